"""The errors of several laws."""

from typing import TYPE_CHECKING

import numpy as np

from jaxdamp.identify import Comparison
from jaxdamp.plots import _style


if TYPE_CHECKING:
    import matplotlib.figure


def ladder(comparison: Comparison) -> "matplotlib.figure.Figure":
    """Bars of the RMSE of each law, on the fitted records and on motion that was held out.

    Arguments:
        comparison: of `identify.compare`.
    """
    rungs = comparison.rungs
    held = any(rung.held_out_rmse is not None for rung in rungs)
    rows = np.arange(len(rungs), dtype=float)
    thickness = 0.38 if held else 0.6
    figure = _style.new_figure(8.5, 1.4 + (0.55 if held else 0.4) * len(rungs))
    axes = figure.subplots()
    groups = [("fitted records", [r.rmse for r in rungs], -0.5 * thickness * held, _style.COLOURS[0])]
    if held:
        scores = [np.nan if r.held_out_rmse is None else r.held_out_rmse for r in rungs]
        groups.append(
            (
                "held-out records" if comparison.held_out else "motion held out",
                scores,
                0.5 * thickness,
                _style.COLOURS[1],
            )
        )
    handles = []
    for label, values, shift, colour in groups:
        bars = axes.barh(rows + shift, values, thickness, color=colour, label=label)
        axes.bar_label(bars, fmt=_style.short, padding=3, fontsize="small")
        handles.append(bars)
    words = "Errors of the laws (free parameters in brackets, the recommended law in bold)"
    _style.dress(axes, "root of the mean squared force error [N]", "", words)
    axes.grid(False, axis="y")
    axes.set_yticks(rows, [f"{r.name} ({r.parameters})" for r in rungs])
    axes.get_yticklabels()[[r.name for r in rungs].index(comparison.best.name)].set_fontweight("bold")
    axes.invert_yaxis()
    axes.margins(x=0.1)
    _style.legend_beside(figure, handles)
    return figure
