"""A fit and its records: loops of force over velocity and over stroke, channels of a vehicle, and the residual."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._types import Figure
from jaxdamp.bench import BenchRun, as_runs, last_steady_cycle
from jaxdamp.identify import Comparison, FitResult, VehicleFit
from jaxdamp.plots import _axes, _style
from jaxdamp.plots.curves import force_velocity
from jaxdamp.plots.rides import unit_and_sign


_MOST_POINTS, _PHASES = 300, 40  # of a residual over the velocity, and over the cycle


def fit_loops(
    result: FitResult, runs: BenchRun | Sequence[BenchRun] | None = None, *, most: int = 6, name: str = ""
) -> Figure:
    """Loops of force over velocity and over stroke, measured and fitted, with the residual.

    Points of a force-velocity table have no loops: they and the law are drawn by `plots.force_velocity`.

    For each record the last full cycle is drawn. Of many records only some are drawn, spread evenly over the peak
    velocities, and the title says so. The residual is fitted minus measured. Over the velocity it is reduced to about
    300 samples of each record, so that slow records with many samples do not cover the others; over the cycle it is
    drawn as means over a fortieth of the period, in which noise averages out.

    Arguments:
        result: a fit.
        runs: records to show, for example held-out ones; those of the fit if left out.
        most: the largest number of records to draw.
        name: of the law in the title; that of its class if left out.

    Raises:
        ValueError: no record.
    """
    from matplotlib.lines import Line2D

    remedy = "The call is `fit_loops(result, runs)` with the result of `identify.fit`."
    _checks.instance("result", result, FitResult, "be the result of a fit", remedy)
    runs = result.runs if runs is None else as_runs(runs)
    if not runs:
        _checks.refuse("runs", "hold at least one record", "empty")
    if all(run.of_points for run in runs):
        return _over_points({name or type(result.law).__name__: result}, runs)
    shown = spread(runs, most)
    # All records at once: their shapes are those of the fit's scores, for which all is compiled.
    predicted = dict(zip(map(id, runs), result.respond(tuple(runs)), strict=True))
    forces = [predicted[id(run)] for run in shown]
    figure = _style.new_figure(12.0, 8.0)
    (loops, football), (over_velocity, over_time) = figure.subplots(2, 2, height_ratios=(1.6, 1.0))
    handles = []
    for index, (run, force) in enumerate(zip(shown, forces, strict=True)):
        colour = _style.graded(index, len(shown))
        part = closed_cycle(run)
        velocity, stroke, measured, fitted = run.velocity[part], 1e3 * run.stroke[part], run.force[part], force[part]
        for axes, x in ((loops, velocity), (football, stroke)):
            axes.plot(x, measured, color=colour, linewidth=4.0, alpha=0.3, solid_capstyle="round")
            axes.plot(x, fitted, color=colour, linewidth=1.3)
        residual = fitted - measured
        every = max(len(residual) // _MOST_POINTS, 1)
        over_velocity.plot(velocity[::every], residual[::every], ".", color=colour, markersize=2.5, alpha=0.6)
        size = max((len(part) - 1) // _PHASES, 1)
        phase = _block_means((run.time[part[:-1]] - run.time[part[0]]) * run.frequency, size)
        over_time.plot(phase, _block_means(residual[:-1], size), color=colour, linewidth=1.3)
        handles.append(Line2D([], [], color=colour, linewidth=2.0, label=with_speed(run)))
    label = "fitted − measured [N]"
    _style.dress(loops, _style.VELOCITY, _style.FORCE, "Force over velocity")
    _style.dress(football, _style.STROKE, _style.FORCE, "Force over stroke")
    _style.dress(over_velocity, _style.VELOCITY, label, "Residual over velocity", turns="y")
    over_cycle = "Residual over the cycle, means of 1/40"
    _style.dress(over_time, "time in the cycle, over its period [–]", label, over_cycle, turns="y")
    for axes in (loops, football, over_velocity):
        _style.cross(axes)
        _axes.few_ticks(axes, 7)
    _style.cross(over_time, vertical=False)
    styles = [
        Line2D([], [], color=_style.GREY, linewidth=4.0, alpha=0.4, label="measured"),
        Line2D([], [], color=_style.GREY, linewidth=1.3, label="fitted"),
    ]
    several = len(shown) > 1  # one has its name in the title
    _style.legend_beside(figure, styles + handles * several, "record (peak velocity)" * several)
    figure.suptitle(_title(result, runs, shown, name), x=0.01, ha="left", fontsize="medium")
    return figure


_MOST_LAWS = 12  # of small multiples


def loops_by_law(comparison: Comparison, record: str | None = None) -> Figure:
    """The same record in a small panel for each law, the best first: measured force and that of the law over velocity.

    Of points of a force-velocity table the curves of all laws over them, each with the static force of its fit.

    Arguments:
        comparison: of `identify.compare`; of more than twelve laws the best are drawn, and the title says so.
        record: name of a fitted record; the fastest if left out.

    Raises:
        ValueError: an unknown record.
    """
    remedy = "The call is `loops_by_law(comparison)` with the result of `identify.compare`."
    _checks.instance("comparison", comparison, Comparison, "be a comparison of laws", remedy)
    runs = comparison.best.result.runs
    name = max(runs, key=lambda run: run.peak_velocity).name if record is None else record
    _checks.one_of("record", name, [run.name for run in runs])
    rungs = sorted(comparison.rungs, key=lambda rung: rung.error)
    shown = rungs[:_MOST_LAWS]
    if all(run.of_points for run in runs):
        return _over_points({rung.name: rung.result for rung in shown}, runs)
    columns = min(len(shown), 4)
    figure = _style.new_figure(3.0 * columns, 0.8 + 2.5 * -(-len(shown) // columns))
    panels = figure.subplots(-(-len(shown) // columns), columns, sharex=True, sharey=True, squeeze=False)
    for axes, rung in zip(panels.flat, shown, strict=False):
        number, run = next(pair for pair in enumerate(rung.result.runs) if pair[1].name == name)
        force = rung.result.respond(tuple(rung.result.runs))[number]  # all at once, as they were compiled for the fit
        part = closed_cycle(run)
        axes.plot(run.velocity[part], run.force[part], label="measured", **(_style.REFERENCE | {"linewidth": 3.0}))
        axes.plot(run.velocity[part], force[part], label="law", **_style.AFTER)
        best = ", recommended" * (rung is comparison.best)
        error = _style.quantity(rung.error, "N").replace(" ", "\N{NO-BREAK SPACE}")
        words = f"{_style.in_words(rung.name)}: {error}{best}"
        _style.dress(axes, _style.VELOCITY, "force [N]", words, turns="y", zero="xy")
        _axes.few_ticks(axes, 4)
        axes.label_outer()
    for axes in panels.flat[len(shown) :]:
        axes.set_axis_off()
    for axes in panels.flat[max(len(shown) - columns, 0) : len(shown)]:
        _axes.wrap(axes.set_xlabel(display().text(_style.VELOCITY)), axes)
        axes.tick_params(labelbottom=True)
    judged = "on motion held out" if comparison.best.judged_on else "on the fitted records"
    few = f", the best {len(shown)} of {len(rungs)} laws" * (len(shown) < len(rungs))
    words = f"{name}: measured (grey) and each law (blue), with its error {judged}{few}"
    figure.suptitle(words, x=0.01, ha="left", fontsize="medium", wrap=True)
    return figure


def _over_points(results: Mapping[str, FitResult], runs: Sequence[BenchRun]) -> Figure:
    """The curves of laws over the points of a table, with the static force of the first one's machine left out."""
    laws = {name: result.law for name, result in results.items()}
    static = {name: result.static_force for name, result in results.items()}
    return force_velocity(laws, runs=runs, static_force=static)


def _title(result: FitResult, runs: Sequence[BenchRun], shown: Sequence[BenchRun], name: str) -> str:
    own = runs is result.runs
    percent, rmse = (result.fit_percent, result.rmse) if own else result.score(runs)[:2]
    new = not any(run is fitted for run in runs for fitted in result.runs)
    records = f"{_style.brief(runs[0].name) if len(runs) == 1 else f'{len(runs)} records'}{' not fitted' * new}"
    name = name or _style.law_name(result.law)
    score = f"{name}: fit {percent:.1f} %, RMSE {_style.quantity(rmse, 'N')} on {records}"
    return display().words(score) + (
        f"\n{len(shown)} of them shown, last full cycle of each" if len(shown) < len(runs) else ""
    )


def _block_means(values: Float[np.ndarray, " samples"], size: int) -> Float[np.ndarray, " blocks"]:
    """Means of successive samples, the remainder left out."""
    return values[: len(values) // size * size].reshape(-1, size).mean(axis=1)


def with_speed(run: BenchRun) -> str:
    """The name of a record with its peak velocity, for a legend."""
    return f"{_style.brief(run.name)} ({_style.quantity(run.peak_velocity, 'm/s')})"


def closed_cycle(run: BenchRun) -> np.ndarray:
    """The samples of the last full cycle, and the first of them again."""
    cycle = np.arange(len(run))[last_steady_cycle(run)]
    return np.append(cycle, cycle[0])


def spread(runs: Sequence[BenchRun], most: int) -> list[BenchRun]:
    """At most so many records, spread evenly over the peak velocities, slowest first."""
    remaining = sorted(runs, key=lambda run: run.peak_velocity)
    if len(remaining) <= most:
        return remaining
    chosen = []
    for target in np.linspace(remaining[-1].peak_velocity, remaining[0].peak_velocity, most):
        nearest = min(remaining, key=lambda run: abs(run.peak_velocity - target))
        remaining.remove(nearest)
        chosen.append(nearest)
    return sorted(chosen, key=lambda run: run.peak_velocity)


def vehicle_fit(result: VehicleFit, record: str | None = None) -> Figure:
    """Each channel of a record, measured and fitted, with the residual beside it.

    Arguments:
        result: a fit of a vehicle.
        record: name of the record; the first if left out.

    Raises:
        ValueError: an unknown record.
    """
    remedy = "The call is `vehicle_fit(result)` with the result of `identify.fit_vehicle`."
    _checks.instance("result", result, VehicleFit, "be the result of a fit of a vehicle", remedy)
    names = [one.name for one in result.records]
    name = names[0] if record is None else record
    _checks.one_of("record", name, names)
    shown = result.records[names.index(name)]
    fitted = result.respond(shown)
    scores = [score for score in result.scores if score.record == name]
    figure = _style.new_figure(12.0, 1.0 + 2.2 * len(scores))
    rows = figure.subplots(len(scores), 2, sharex=True, squeeze=False, width_ratios=(2.0, 1.0))
    for (over, residual), score in zip(rows, scores, strict=True):
        factor, label = 1e3 if score.unit == "m" else 1.0, unit_and_sign(result.vehicle.layout, score.channel)
        measured, computed = (factor * np.asarray(one[score.channel]) for one in (shown, fitted))
        over.plot(shown.time, measured, color=_style.GREY, linewidth=2.5, alpha=0.5, label="measured")
        over.plot(shown.time, computed, color=_style.COLOURS[0], linewidth=0.9, label="fitted")
        residual.plot(shown.time, computed - measured, color=_style.COLOURS[1], linewidth=0.6)
        words = _style.first_upper(_style.metric_words(score.channel))
        _style.dress(over, "", label, f"{words}, fit {_style.short(score.fit_percent)} %")
        error = f"fitted − measured, RMS {_style.quantity(score.rmse, score.unit)}"
        _style.dress(residual, "", label.split("  ")[0], error, turns="y" if display().signed(label) else "")
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    _style.legend_above(figure, rows[0, 0].get_lines())
    return figure
