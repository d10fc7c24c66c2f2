"""The differences between dampers in ride metrics, with their uncertainty."""

import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Figure
from jaxdamp.plots import _style
from jaxdamp.tune import DamperComparison


def damper_comparison(comparison: DamperComparison) -> Figure:
    """The change of each metric from the first damper, with its 95 % interval; hollow where it may be none.

    Thick lines are the standard error from the fitted parameters alone.

    Arguments:
        comparison: result of `tune.compare_dampers`.
    """
    remedy = "The call is `damper_comparison(comparison)` with the result of `tune.compare_dampers`."
    _checks.instance("comparison", comparison, DamperComparison, "be a comparison of dampers", remedy)
    first, *others = comparison.values
    metrics = list(comparison.units)
    figure = _style.new_figure(8.5, 1.6 + 0.3 * len(metrics) * max(len(others), 1))
    axes = figure.add_subplot()
    handles = []
    for number, name in enumerate(others):
        rows = np.arange(len(metrics)) + 0.7 * ((number + 0.5) / len(others) - 0.5)
        differences = [comparison.difference(metric, name) for metric in metrics]
        change, margin, from_parameters = (
            np.array([getattr(d, key) for d in differences]) for key in ("change", "margin", "from_parameters")
        )
        colour = _style.COLOURS[number % len(_style.COLOURS)]
        faces = [colour if d.significant else "white" for d in differences]
        thick = {"ecolor": colour, "linewidth": 3.5, "alpha": 0.6}
        axes.errorbar(change, rows, xerr=_finite(margin), fmt="none", ecolor=colour, capsize=3.0, linewidth=1.0)
        axes.errorbar(change, rows, xerr=_finite(from_parameters), fmt="none", **thick)
        axes.scatter(change, rows, 40.0, faces, edgecolors=colour, zorder=3)
        handles.append(axes.scatter([], [], 40.0, colour, label=f"{name} relative to {first}"))
    axes.set_yticks(range(len(metrics)), [_style.metric_words(metric) for metric in metrics])
    axes.invert_yaxis()
    roads = len(next(iter(comparison.values[first].values())))
    where = f"on the same {roads} roads" if roads > 1 else "on a white road"
    _style.dress(axes, "change [%]", "", f"Ride metrics beside those of {first}, {where}")
    axes.grid(False, axis="y")
    _style.cross(axes, horizontal=False)
    _style.legend_above(figure, handles)
    legend = "With 95 % intervals; hollow where there may be no difference; thick: standard error from the parameters."
    _style.note_below(figure, [legend, *map(_style.typeset, comparison.warnings)])
    return figure


def _finite(errors: np.ndarray) -> np.ndarray:
    """Errors to draw: none where they are unknown, which the notes below say."""
    return np.where(np.isfinite(errors), errors, 0.0)
