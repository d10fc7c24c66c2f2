"""What was kept of a sweep: histograms, means and ranges, a Pareto set."""

from typing import TYPE_CHECKING

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Axes, Figure
from jaxdamp.plots import _style


if TYPE_CHECKING:
    from jaxdamp.sweeps import SweepSummary


_COLUMNS = 3  # of panels


def sweep_summary(result: "SweepSummary") -> Figure:
    """A histogram of each result that has one, with its mean and standard deviation; else its mean and range.

    The Pareto set is drawn over its first two results. Points outside the bins are counted in the title.

    Arguments:
        result: of `jaxdamp.sweep(..., summary=...)`.
    """
    from jaxdamp.sweeps import SweepSummary  # with xarray and pandas, which other pictures do without

    remedy = "The call is `sweep_summary(found)` with the result of `jaxdamp.sweep(..., summary=sweeps.Summary())`."
    _checks.instance("result", result, SweepSummary, "be the summary of a sweep", remedy)
    names = [str(name) for name in result.statistics.data_vars]
    count = len(names) + (result.pareto is not None)
    figure = _style.new_figure(12.0, 0.9 + 2.8 * -(-count // _COLUMNS))
    grid = figure.add_gridspec(-(-count // _COLUMNS), _COLUMNS)
    panels = [figure.add_subplot(grid[i // _COLUMNS, i % _COLUMNS]) for i in range(count)]
    for axes, name in zip(panels, names, strict=False):
        _spread(axes, result, name)
    if result.pareto is not None:
        x, y = result.pareto.attrs["objectives"][:2]
        first, second = (str(name) for name in (x, y))
        axes, units = panels[-1], [typeset_unit(result.pareto[name].attrs.get("units", ""), "–") for name in (x, y)]
        axes.plot(result.pareto[x], result.pareto[y], ".", color=_style.COLOURS[1])
        title = f"Pareto set of {result.pareto.sizes['point']} points"
        _style.dress(
            axes, f"{_style.metric_words(first)} [{units[0]}]", f"{_style.metric_words(second)} [{units[1]}]", title
        )
    figure.suptitle(result.summary)
    return figure


def _spread(axes: Axes, result: "SweepSummary", name: str) -> None:
    """A histogram with mean and standard deviation, or these alone between the ends."""
    _, mean, deviation, low, high = result.statistics[name].values.tolist()
    title = _style.metric_words(name)
    if name in result.histograms:
        counts = result.histograms[name]
        lower, upper = counts["lower"].values[1:-1], counts["upper"].values[1:-1]
        axes.bar(lower, counts.values[1:-1], upper - lower, align="edge", color=_style.COLOURS[0], alpha=0.6)
        outside = int(counts.values[0] + counts.values[-1])
        title += f", {outside} points outside" if outside else ""
        label = "points"
    else:
        axes.plot([low, high], [0.0, 0.0], "|-", color=_style.COLOURS[0], markersize=14)
        axes.set_yticks([])
        label = ""
    if np.isfinite(mean):
        axes.axvspan(mean - deviation, mean + deviation, color=_style.SHADE, zorder=0)
        axes.axvline(mean, color=_style.BLACK, linewidth=1.2)
    unit = typeset_unit(result.statistics[name].attrs.get("units", ""), "–")
    _style.dress(axes, f"mean, standard deviation{'' if label else ', range'} [{unit}]", label, title)
