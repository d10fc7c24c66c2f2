"""Control charts of a production line."""

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Figure
from jaxdamp.identify import ControlCharts
from jaxdamp.plots import _style


MOST = 8  # quantities that are drawn


def control_charts(result: ControlCharts) -> Figure:
    """Each quantity in each chart: points over the dampers, the limits, and signals in another colour.

    The baseline is shaded. Individuals are in the unit of the quantity, the others in standard deviations.

    Arguments:
        result: of `identify.control_charts`.
    """
    remedy = "The call is `control_charts(charts)` with the result of `identify.control_charts`."
    _checks.instance("result", result, ControlCharts, "be control charts", remedy)
    drawn = list(result.quantities.items())[:MOST]
    figure = _style.new_figure(4.2 * len(result.charts), 0.9 + 2.4 * len(drawn))
    grid, place = figure.add_gridspec(len(drawn), len(result.charts)), np.arange(len(result.names)) + 1
    for row, (name, unit) in enumerate(drawn):
        for column, chart in enumerate(result.charts):
            axes = figure.add_subplot(grid[row, column])
            scale, centre, label = 1.0, 0.0, "[standard deviations]"
            if chart.name == "individuals":
                scale, centre = float(result.deviation[row]), float(result.centre[row])
                label = f"[{typeset_unit(unit, '–')}]"
            signs = result.signals[name][column]
            axes.axvspan(result.baseline[0] + 0.5, result.baseline[-1] + 1.5, color=_style.SHADE, zorder=0)
            for level, style in ((-chart.limit, "--"), (0.0, "-"), (chart.limit, "--")):
                axes.axhline(centre + scale * level, color=_style.BLACK, linewidth=0.9, linestyle=style)
            for values in {id(v): v for v in chart.statistics(result.scores[:, row])}.values():
                axes.plot(place, centre + scale * values, ".-", color=_style.COLOURS[0], linewidth=0.6, markersize=3)
                out = (signs != 0) & (np.abs(values) > chart.limit)
                axes.plot(place[out], centre + scale * values[out], "o", color=_style.COLOURS[1], markersize=4)
            _style.dress(axes, "damper" if row == len(drawn) - 1 else "", label, f"{name}, {chart.name}")
    figure.suptitle(f"{len(result.names)} dampers, limits from {result.baseline.size} of them (shaded)")
    more = len(result.quantities) - len(drawn)
    _style.note_below(figure, [f"{more} further quantities are in the tables."] if more else [])
    return figure
