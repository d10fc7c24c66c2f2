"""Records without a law: as they are, mean loops, forces over velocity with limits and a baseline, gas and friction."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._display import display, plus_minus
from jaxdamp._types import Axes, Figure
from jaxdamp.bench import (
    BenchRun,
    Evaluation,
    FoldedCycles,
    GasAndFriction,
    LimitCheck,
    Measurement,
    as_runs,
)
from jaxdamp.plots import _axes, _style
from jaxdamp.plots.loops import closed_cycle, spread, with_speed


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
        part = closed_cycle(run)
        panels["v"].plot(run.velocity[part], run.force[part], **look)
        panels["x"].plot(1e3 * run.stroke[part], run.force[part], **look)
        panels["stroke"].plot(run.time - run.time[0], 1e3 * run.stroke, **look)
        handles += panels["force"].plot(run.time - run.time[0], run.force, label=with_speed(run), **look)
    _style.dress(panels["v"], _style.VELOCITY, _style.FORCE, "Last full cycle: force over velocity", zero="xy")
    _style.dress(panels["x"], _style.STROKE, _style.FORCE, "Force over stroke", zero="xy")
    _style.dress(panels["stroke"], "", "stroke [mm]\n(+ rebound)", "Whole records", zero="y")
    _style.dress(panels["force"], "time [s]", "force [N]\n(+ resists extension)", zero="y")
    _style.legend_beside(figure, handles, f"{len(shown)} of {len(runs)} records" if len(shown) < len(runs) else "")
    return figure


_REMEDY = "Take what `bench.evaluate(runs)` gives."
_MOST_LABELLED = 14  # records in a legend
_DISTINCT = 0.02  # difference of peak velocities, relative to the largest, below which records are repeats


def evaluation(evaluation: Evaluation, baseline: Evaluation | None = None, limits: LimitCheck | None = None) -> Figure:
    """Mean cycles of records over velocity, stroke, acceleration and time, and forces over velocity.

    One setting: a colour for each record, from slow to fast. Several: a colour for each setting. Bands show the
    standard deviation of the force from cycle to cycle.

    Arguments:
        evaluation: what is to be shown.
        baseline: another evaluation, drawn dashed in grey beneath.
        limits: drawn as bars at their velocities.
    """
    from matplotlib.lines import Line2D

    _checks.instance("evaluation", evaluation, Evaluation, "be an evaluation", _REMEDY)
    figure = _style.new_figure(14.0, 8.5)
    panels = figure.subplot_mosaic([["v", "peaks", "peaks"], ["x", "a", "t"]], height_ratios=(1.25, 1.0))
    handles = []
    if baseline is not None:
        _checks.instance("baseline", baseline, Evaluation, "be an evaluation", _REMEDY)
        style: _style.Look = {"color": _style.GREY, "linestyle": "--", "linewidth": 1.0, "zorder": 1.5}
        for run in baseline.runs:
            _draw_cycle(panels, baseline.cycles[run.name], style)
        _draw_forces(panels["peaks"], baseline, dict.fromkeys(baseline.settings, style))
        handles.append(Line2D([], [], label="baseline", **style))
    colours, labels = _colours(evaluation)
    for run in sorted(evaluation.runs, key=lambda run: -run.peak_velocity):
        _draw_cycle(panels, evaluation.cycles[run.name], {"color": colours[run.name], "linewidth": 1.3})
    several = len(evaluation.settings) > 1
    styles = {
        name: {"color": colours[runs[0].name] if several else _style.BLACK, "linewidth": 1.4}
        for name, runs in evaluation.settings.items()
    }
    ends = _draw_forces(panels["peaks"], evaluation, styles)
    handles += [Line2D([], [], color=colour, linewidth=2.0, label=label) for label, colour in labels]
    handles.append(Line2D([], [], color=_style.GREY, linewidth=7.0, alpha=0.3, label="± scatter over cycles"))
    marks: _style.Look = {"marker": "o", "markerfacecolor": "white", "color": _style.BLACK, "linestyle": ""}
    handles.append(Line2D([], [], label="at peak velocity", **marks))
    handles.append(Line2D([], [], label="at stated velocity", **{**marks, "marker": "D", "markerfacecolor": None}))
    handles += _draw_limits(panels["peaks"], limits) if limits is not None else []
    _dress(panels)
    panels["peaks"].set_xlim(*panels["peaks"].get_xlim())
    _style.label_ends(panels["peaks"], ends)
    _style.legend_beside(figure, handles)
    return figure


def gas_and_friction(forces: GasAndFriction) -> Figure:
    """Force over stroke in both directions, with the gas force between them, and both in numbers.

    Arguments:
        forces: of `bench.separate_gas_and_friction`.
    """
    _checks.instance("forces", forces, GasAndFriction, "be separated", "Take `bench.separate_gas_and_friction(run)`.")
    figure = _style.new_figure(9.0, 5.0)
    axes = figure.subplots()
    both_directions(axes, forces)
    _style.dress(axes, _style.STROKE, _style.FORCE, f"{forces.record}: {gas_and_friction_words(forces)}", zero="xy")
    return figure


def both_directions(axes: Axes, forces: GasAndFriction) -> None:
    """Force over stroke [mm] into rebound and into compression without the reversals, and the static force between."""
    cut = max(len(forces.stroke) // 20, 1)  # where the stroke turns, the force is on its way from one side to the other
    stroke, gas = forces.stroke[cut:-cut], forces.static_force(forces.stroke)[cut:-cut]
    curves = (
        ("into rebound", forces.rebound[cut:-cut], _style.REBOUND, "-", "bottom"),
        ("into compression", forces.compression[cut:-cut], _style.COMPRESSION, "-", "top"),
        ("static", gas, _style.BLACK, ":", "bottom"),
    )
    for label, force, colour, dash, side in curves:
        axes.plot(1e3 * stroke, force, dash, color=colour, linewidth=1.6, label=f"_{label}")
        place, above = (1e3 * stroke[len(stroke) // 2], force[len(stroke) // 2]), 4.0 if side == "bottom" else -4.0
        words: _style.Look = {"xytext": (0.0, above), "textcoords": "offset points", "ha": "center", "va": side}
        axes.annotate(label, place, color=colour, fontsize="small", **words)
    axes.margins(y=0.15)


def gas_and_friction_words(forces: GasAndFriction, between: str = ", ") -> str:
    """Static force at mid-stroke in the sign that is shown, its rate and the friction, with their uncertainties."""
    values = {m.quantity: m for m in forces.measurements}
    gas, friction = (_with_uncertainty(values[name]) for name in ("gas force", "friction"))
    return f"Static {gas}, {_style.quantity(forces.gas_rate, 'N/m')}{between}friction {friction}"


def _with_uncertainty(measurement: Measurement) -> str:
    """A measured value, and its uncertainty where it is known, in the unit and the sign that are shown."""
    shown = display().of(measurement.unit, signed=display().signed(measurement.quantity))
    value, error = shown(measurement.value), abs(shown(measurement.uncertainty or 0.0))
    return f"{plus_minus(value, error).replace('-', '−') if error else _style.short(value)} {shown.unit}"


def _colours(evaluation: Evaluation) -> tuple[_style.Look, list[tuple[str, tuple[float, float, float, float]]]]:
    """The colour of each record, and the entries of the legend."""
    if len(evaluation.settings) > 1:
        names = list(evaluation.settings)
        chosen = {name: _style.graded(i, len(names)) for i, name in enumerate(names)}
        colours = {run.name: chosen[name] for name, runs in evaluation.settings.items() for run in runs}
        return colours, [(f"setting {name}" if name else "no setting", chosen[name]) for name in names]
    order = sorted(evaluation.runs, key=lambda run: run.peak_velocity)
    colours = {run.name: _style.graded(i, len(order)) for i, run in enumerate(order)}
    shown = order if len(order) <= _MOST_LABELLED else [order[0], order[-1]]
    return colours, [(with_speed(run), colours[run.name]) for run in shown]


def _draw_cycle(panels: Mapping[str, Axes], cycles: FoldedCycles, style: _style.Look) -> None:
    """The mean cycle of a record, closed, in a band of one standard deviation of the force over its cycles."""
    stroke, velocity, force = (
        _closed(values.mean(axis=0)) for values in (cycles.stroke, cycles.velocity, cycles.force)
    )
    phase = np.linspace(0.0, 1.0, len(force))
    step = float(cycles.periods.mean()) / (len(force) - 1)
    acceleration = _closed((np.roll(velocity[:-1], -1) - np.roll(velocity[:-1], 1)) / (2 * step))
    scatter = _closed(cycles.force.std(axis=0, ddof=1)) if len(cycles.periods) > 1 else None
    for name, values in (("v", velocity), ("x", 1e3 * stroke), ("a", acceleration), ("t", phase)):
        panels[name].plot(values, force, **style)
        if scatter is None:
            continue
        # The band is drawn from the smallest value to the largest and back, so that it does not cover itself.
        first, last = sorted((int(np.argmin(values)), int(np.argmax(values))))
        there, back = np.arange(first, last + 1), np.r_[last : len(values), 0 : first + 1]
        for part in (there, back) if len(there) < len(values) else (there,):  # time does not come back
            low, high = force[part] - scatter[part], force[part] + scatter[part]
            look = {"color": style["color"], "alpha": 0.25, "linewidth": 0.0, "zorder": 1.2}
            panels[name].fill_between(values[part], low, high, **look)


def _closed(values: Float[np.ndarray, " points"]) -> Float[np.ndarray, " more"]:
    return np.append(values, values[0])


def _draw_forces(axes: Axes, evaluation: Evaluation, styles: Mapping[str, _style.Look]) -> list:
    """Forces at peak velocity of each setting, and those at stated velocities.

    Lines join the peaks of a setting whose velocities differ clearly; repeats of one velocity stand beside each other.
    At rest is the gas force with the friction to both sides, where a slow record tells them. Of several settings each
    is named at the end of its line, which is returned.
    """
    ends: list = []
    for setting in evaluation.settings:
        for side in ("rebound", "compression"):
            velocity, force = _branch(evaluation, setting, side)
            joined = bool(np.all(np.diff(velocity) > _DISTINCT * np.abs(velocity).max()))
            look = styles[setting] if joined else {**styles[setting], "linestyle": ""}
            peaks = np.flatnonzero(velocity).tolist()
            marks: _style.Look = {"marker": "o", "markersize": 4.5, "markerfacecolor": "white", "markevery": peaks}
            drawn = axes.plot(velocity, force, **marks, **look)
            if side == "rebound" and len(evaluation.settings) > 1 and setting:
                drawn[0].set_label(setting)
                ends += drawn
        stated = [
            ((1 if m.quantity == "rebound force" else -1) * m.velocity, m.value)
            for m in evaluation.measurements
            if m.setting == setting and m.velocity is not None and m.unit == "N"
        ]
        if stated:
            axes.plot(*np.array(stated).T, "D", markersize=4.5, color=styles[setting]["color"], zorder=3)
    return ends


def _branch(evaluation: Evaluation, setting: str, side: str) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and forces at the peaks of a side, with gas force and friction at rest where they are known."""
    values = {(m.quantity, m.record): m.value for m in evaluation.measurements}
    runs = evaluation.settings[setting]
    pairs = [(values[f"{side} velocity", run.name], values[f"{side} force", run.name]) for run in runs]
    if slow := evaluation.gas_and_friction.get(setting):
        pairs.append((0.0, slow.gas_force + (slow.friction if side == "rebound" else -slow.friction)))
    velocity, force = np.array(sorted(pairs)).T
    return velocity, force


def limit_bars(limits: LimitCheck) -> Iterator[tuple[str, float, list[float], bool]]:
    """Setting, velocity [m/s], least and largest force, and whether they are kept, of limits at stated velocities."""
    for limit, measured in limits.results:
        if limit.velocity is not None and measured is not None and measured.unit == "N":
            ends = [measured.value if end is None else end for end in (limit.minimum, limit.maximum)]
            side = 1.0 if limit.quantity.startswith("rebound") else -1.0
            yield measured.setting, side * limit.velocity, ends, limit.kept_by(measured.value)


def _draw_limits(axes: Axes, limits: LimitCheck) -> list:
    """Bars from the least to the largest force at stated velocities; one-sided limits end at the measured value."""
    from matplotlib.lines import Line2D

    colours = {True: _style.GOOD, False: _style.BAD}
    seen = set()
    for _, at, ends, passed in limit_bars(limits):
        axes.plot([at, at], ends, color=colours[passed], linewidth=7.0, alpha=0.45, solid_capstyle="butt")
        seen.add(passed)
    words = {True: "limits, kept", False: "limits, not kept"}
    return [
        Line2D([], [], color=colours[passed], linewidth=7.0, alpha=0.45, label=words[passed]) for passed in sorted(seen)
    ]


def _dress(panels: Mapping[str, Axes]) -> None:
    _style.dress(panels["v"], _style.VELOCITY, _style.FORCE, "Continuous plot (CVP): mean cycles")
    _style.dress(panels["peaks"], _style.VELOCITY, _style.FORCE, "Peak-velocity plot (PVP)")
    _style.dress(panels["x"], _style.STROKE, _style.FORCE, "Force over stroke")
    _style.dress(panels["a"], "acceleration [m/s²]   (+ rebound)", _style.FORCE, "Force over acceleration")
    _style.dress(panels["t"], "time in the cycle, over its period [–]", _style.FORCE, "Force over time")
    for name, axes in panels.items():
        if name not in "vx":
            axes.set_ylabel("")
        _style.cross(axes, vertical=name != "t")
        _axes.few_ticks(axes, 6)


def limit_check(check: LimitCheck) -> Figure:
    """A row for each limit: its range as a bar, and the measured value, all divided by the largest of the row.

    Arguments:
        check: of `Evaluation.check`.
    """
    _checks.instance("check", check, LimitCheck, "be measurements beside limits", "Take `evaluation.check(limits)`.")
    figure = _style.new_figure(7.0, 1.5 + 0.4 * len(check.results))
    axes, labels = figure.subplots(), []
    for row, (limit, measured) in enumerate(check.results):
        value = float("nan") if measured is None else measured.value
        ends = [np.nan if end is None else end for end in (limit.minimum, limit.maximum)]
        size = np.nanmax(np.abs([*ends, value])) or 1.0
        low, high = (-1.2 if np.isnan(ends[0]) else ends[0] / size), (1.2 if np.isnan(ends[1]) else ends[1] / size)
        axes.barh(row, high - low, left=low, height=0.5, color="0.85")
        colour = _style.GOOD if measured is not None and limit.kept_by(value) else _style.BAD
        axes.plot(value / size, row, "o", color=colour)
        where = limit.setting if measured is None else measured.record or measured.setting
        shown = "not measured" if measured is None else f"{_style.short(value)} {measured.unit}".strip()
        labels.append(f"{limit.quantity}, {where}: {shown}")
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel("value, as a share of the largest of limits and value")
    figure.suptitle(check.summary, wrap=True)
    return figure
