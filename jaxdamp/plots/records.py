"""Bench records as they are: force over velocity and over stroke, and the channels over time."""

from collections.abc import Iterable

from jaxdamp import _checks
from jaxdamp._types import Figure
from jaxdamp.bench import BenchRun, as_runs, last_steady_cycle
from jaxdamp.plots import _style
from jaxdamp.plots.loops import spread


def records(runs: BenchRun | Iterable[BenchRun], *, most: int = 12) -> Figure:
    """The last full cycle over velocity and over stroke, and stroke and force of the whole records over time.

    Arguments:
        runs: a record, or several; a colour for each, from slow to fast.
        most: the largest number of records to draw, spread evenly over the peak velocities.

    Raises:
        ValueError: no record.
    """
    runs = as_runs(runs)
    if not runs:
        _checks.refuse("runs", "hold at least one record", "empty")
    shown = spread(runs, most)
    figure = _style.new_figure(12.0, 7.5)
    panels = figure.subplot_mosaic([["v", "x"], ["stroke", "stroke"], ["force", "force"]], height_ratios=(2, 1, 1))
    handles = []
    for number, run in enumerate(shown):
        look = {"color": _style.graded(number, len(shown)), "linewidth": 1.1}
        part = last_steady_cycle(run)
        panels["v"].plot(run.velocity[part], run.force[part], **look)
        panels["x"].plot(1e3 * run.stroke[part], run.force[part], **look)
        panels["stroke"].plot(run.time - run.time[0], 1e3 * run.stroke, **look)
        label = f"{run.name} ({run.peak_velocity:.2g} m/s)"
        handles += panels["force"].plot(run.time - run.time[0], run.force, label=label, **look)
    _style.dress(panels["v"], _style.VELOCITY, _style.FORCE, "Last full cycle: force over velocity")
    _style.dress(panels["x"], _style.STROKE, _style.FORCE, "Force over stroke")
    _style.dress(panels["stroke"], "", "stroke [mm]\n(+ rebound)", "Whole records")
    _style.dress(panels["force"], "time [s]", "force [N]\n(+ resists extension)")
    for name, axes in panels.items():
        _style.cross(axes, vertical=name in "vx")
    _style.legend_beside(figure, handles, f"{len(shown)} of {len(runs)} records" if len(shown) < len(runs) else "")
    return figure
