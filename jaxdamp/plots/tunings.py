"""Tunings: laws, spectra and metrics before and after, and a front of metrics with the laws along it."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._tables import typeset_unit
from jaxdamp._traced import equal
from jaxdamp._types import Artist, Axes, Figure, VectorLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.plots import _style, fitted_range
from jaxdamp.plots._rides import without_answer
from jaxdamp.plots.rides import default_channels
from jaxdamp.rig import quasi_static
from jaxdamp.tune import ParetoFront, TuneResult, change_in_percent, limit_spans
from jaxdamp.vehicles import AbstractVehicle


_FASTEST = "peak_damper_velocity"  # the metric, if the vehicle reports it


def tuning(result: TuneResult, velocities: VectorLike | None = None) -> Figure:
    """Force over velocity of each damper and response spectra before and after, and the change of each ride metric.

    Arguments:
        result: a tuning.
        velocities: where to draw the laws [m/s]; a little beyond the fastest damper motion of the ride, if the vehicle
            reports it as `peak_damper_velocity`, or −1 to 1 m/s, if left out.
    """
    remedy = "The call is `tuning(result)` with the result of `tune.minimise`."
    _checks.instance("result", result, TuneResult, "be the result of a tuning", remedy)
    points = _velocities(velocities, [side.get(_FASTEST, 0.0) for side in (result.before, result.after)])
    pairs = _changed(result)
    spectra = result.spectra(default_channels(result.start.layout))
    height = max(6.0, 0.38 * len(result.before))  # a line of text for each metric
    figure = _style.new_figure(12.0, height + 3.0 * bool(spectra))
    rows = figure.add_gridspec(1 + bool(spectra), 1, height_ratios=(height, 3.0)[: 1 + bool(spectra)])
    grid = rows[0].subgridspec(1, 2, width_ratios=(1.0, 1.0))
    bars = figure.add_subplot(grid[1])
    if spectra:
        below = rows[1].subgridspec(1, len(spectra))
        for place, (channel, pair) in enumerate(spectra.items()):
            _spectrum(figure.add_subplot(below[place]), channel, result.start.units[channel], pair)
    columns, gaps = grid[0].subgridspec(len(pairs), 1), []
    for place, (name, pair) in enumerate(pairs.items()):
        gaps += _law(figure.add_subplot(columns[place]), name, pair, points)
    verdict = result.verdict
    colour = _style.GOOD if verdict.better else _style.BAD
    words = f"{verdict.outcome.value}\n{display().words(without_answer(result))}"
    figure.suptitle(words, x=0.01, ha="left", fontsize="medium", color=colour, wrap=True)
    _bars(bars, result)
    _style.note_below(figure, gaps)
    return figure


def _velocities(given: VectorLike | None, peaks: Sequence[float] | np.ndarray) -> np.ndarray:
    """The velocities at which laws are drawn; a little beyond the fastest motion, if it is known, if none are given."""
    reach = 1.1 * float(np.max(peaks)) or 1.0
    return np.linspace(-reach, reach, 401) if given is None else np.asarray(given, dtype=float)


def _law(curves: Axes, name: str, pair: tuple[AbstractDamper, AbstractDamper], points: np.ndarray) -> list[str]:
    """A law before and after over the velocity; a sentence for each that has no settled force somewhere."""
    gaps = []
    for law, when, style in zip(pair, ("before", "after"), (_style.BEFORE, _style.AFTER), strict=True):
        gaps += fitted_range.settled(curves, law, points, f"{name} {when}", label=when, **style)[1]
    fitted_range.shade(curves, pair, points)
    _style.dress(curves, _style.VELOCITY, _style.FORCE, name, zero="xy")
    curves.legend(loc="upper left", frameon=False)
    return gaps


def _changed(result: TuneResult) -> dict[str, tuple[AbstractDamper, AbstractDamper]]:
    """The laws of both vehicles by the names of the dampers: those that differ, or the first."""
    names = [_style.first_upper(_style.in_words(name)) for name in result.start.frame().element_names]
    pairs = list(zip(*(own_laws(vehicle) for vehicle in (result.start, result.vehicle)), strict=True))
    differing = [i for i, (old, new) in enumerate(pairs) if not equal(old, new)] or [0]
    return {names[i]: pairs[i] for i in differing}


def own_laws(vehicle: AbstractVehicle) -> list[AbstractDamper]:
    """The laws of a vehicle, one of several equal ones, without those of tyre lift-off."""
    frame = vehicle.frame()
    return [element.law for part in (*frame.links, *frame.wheels) for element in part.elements]


def _bars(axes: Axes, result: TuneResult) -> None:
    """Relative change of each metric, with its values; of one without a change in percent only the values."""
    names = list(result.before)
    rows = np.arange(len(names), dtype=float)
    change = [change_in_percent(result, n, result.before[n], result.after[n]) for n in names]
    widths = [value or 0.0 for value in change]
    axes.barh(rows, widths, 0.65, color=[_style.COLOURS[1] if width > 0 else _style.COLOURS[2] for width in widths])
    reached = dict.fromkeys(result.limits, " (limited)") | dict.fromkeys(result.active_limits, " (limit reached)")
    reached |= {n: " (tightened limit reached)" for n in result.active_limits if n in result.tightened}
    reached |= dict.fromkeys(result.violated, " (LIMIT VIOLATED)")
    labels = []
    for name, value in zip(names, change, strict=True):
        mark = " (minimised)" if name == result.metric else reached.get(name, "")
        pair = (_style.quantity(side[name], result.units[name], name) for side in (result.before, result.after))
        percent = "" if value is None else f"  ({_style.percent(value, 1)})"
        labels.append(f"{_style.metric_words(name)}{mark}\n{' → '.join(pair)}{percent}")
    axes.set_yticks(rows, labels, fontsize="small")
    axes.invert_yaxis()
    axes.margins(x=0.08)
    _style.dress(axes, "change [%]", "", "Ride metrics", zero="x")
    axes.grid(False, axis="y")


def _spectrum(axes: Axes, channel: str, unit: str, pair: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
    """The power spectral density of a channel before and after."""
    for side, style, label in zip(pair, (_style.BEFORE, _style.AFTER), ("before", "after"), strict=True):
        axes.loglog(*side, label=label, **style)
    title = f"Spectrum of the {_style.metric_words(channel)}"
    squared = f"({typeset_unit(unit)})²" if "/" in unit else f"{unit}²"
    _style.dress(axes, "frequency [Hz]", f"[{squared}/Hz]", title)
    _style.plain_log_axis(axes.xaxis)
    _style.within_six_decades(axes)
    axes.set_xlim(*pair[0][0][[0, -1]])
    axes.legend(frameon=False)


MOST_CURVES = 9
AT_LIMIT = 1e-4  # relative distance to a limit within which a point counts as being there
MARKS = ("s", "D", "^", "v", "P", "X")


def pareto(
    front: ParetoFront, baselines: Mapping[str, AbstractVehicle] | None = None, velocities: VectorLike | None = None
) -> Figure:
    """The front, with its knee, the start and other vehicles; and force over velocity of the dampers along it.

    Points and curves have the colour of their first objective. Of three objectives each pair has axes of its own.

    Arguments:
        front: result of `tune.pareto`.
        baselines: other vehicles by name, simulated on the same road.
        velocities: where to draw the laws [m/s]; as far as the dampers move, if the vehicle reports it as
            `peak_damper_velocity`, or −1 to 1 m/s, if left out.
    """
    remedy = "The call is `pareto(front)` with the result of `tune.pareto`."
    _checks.instance("front", front, ParetoFront, "be a front", remedy)
    marked = {"present (start)": front.before}
    if baselines:
        others = _style.by_name("baselines", baselines, AbstractVehicle, "a vehicle", "Give them as {'name': vehicle}.")
        marked |= {name: front.metrics_of(vehicle) for name, vehicle in others.items()}
    pairs = [(0, 1)] if len(front.names) == 2 else [(0, 1), (0, 2), (1, 2)]
    laws = _laws_along(front)
    count = len(pairs) + len(laws)
    columns = min(count, 2)
    figure = _style.new_figure(6.4 * columns, 4.6 * -(-count // columns))
    plots = figure.subplots(-(-count // columns), columns, squeeze=False).ravel()
    names = [(front.names[a], front.names[b]) for a, b in pairs]
    drawn = [_points(plot, front, x, y, marked) for plot, (x, y) in zip(plots, names, strict=False)]
    for plot, (name, along) in zip(plots[len(pairs) :], laws.items(), strict=False):
        _curves(plot, front, along, name, velocities)
    for plot in plots[count:]:
        plot.set_axis_off()
    by_label = {handle.get_label(): handle for handles in drawn for handle in handles}
    _style.legend_above(figure, list(by_label.values()), 3)
    _style.note_below(figure, [_style.said(front.summary)])
    return figure


def _points(axes: Axes, front: ParetoFront, x: str, y: str, marked: Mapping[str, Mapping[str, float]]) -> list[Artist]:
    """One pair of objectives: the points of the front, its knee, and vehicles to compare with."""
    across, up, shades = front.values[x], front.values[y], front.shares[:, 0]
    if len(front.names) == 2:
        axes.plot(across, up, color="0.6", linewidth=1.0, zorder=1)
    points = axes.scatter(across, up, 26.0, 0.66 * shades, cmap="viridis", vmin=0.0, vmax=1.0, label="front", zorder=3)
    knee = axes.scatter(
        across[front.knee], up[front.knee], 150.0, facecolors="none", edgecolors=_style.COLOURS[1], linewidths=1.8,
        label=f"knee, point {front.knee}", zorder=4,
    )  # fmt: skip
    handles = [points, knee]
    for i, (name, values) in enumerate(marked.items()):
        mark: _style.Look = {"color": _style.COLOURS[(i + 1) % len(_style.COLOURS)], "marker": MARKS[i % len(MARKS)]}
        look = mark | (_style.PRESENT if i == 0 else {})
        handles += axes.plot(values[x], values[y], label=_style.in_words(name), linestyle="", zorder=4, **look)
    handles += _limits(axes, front, x, y)
    across_label, up_label = (_style.labelled(_style.metric_words(name), front.units[name]) for name in (x, y))
    _style.dress(axes, across_label, up_label, f"Front of {len(front)} design{'s' * (len(front) > 1)}")
    return handles


def _limits(axes: Axes, front: ParetoFront, x: str, y: str) -> list[Artist]:
    """Dashed lines at the limits of the two objectives, and marks at points where another metric is at its limit."""
    colour, handles = _style.BAD, []
    for name, (lower, upper) in limit_spans(front.limits, list(front.values)).items():
        for end in (lower, upper):
            if not np.isfinite(end):
                continue
            words = f"limit of {_style.metric_words(name)}, {_style.quantity(end, front.units[name], name)}"
            if name in (x, y):
                line = axes.axvline if name == x else axes.axhline
                handles.append(line(end, color=colour, linestyle="--", linewidth=1.2, label=words))
            elif (at_limit := np.abs(front.values[name] - end) <= AT_LIMIT * abs(end)).any():
                marks = front.values[x][at_limit], front.values[y][at_limit]
                handles.append(axes.scatter(*marks, 60.0, colour, marker="|", linewidths=1.8, label=f"at the {words}"))
    return handles


def _laws_along(front: ParetoFront) -> dict[str, list[AbstractDamper]]:
    """The laws that differ along the front, by a title: each at every point."""
    along = list(zip(*(own_laws(front.point(i)) for i in range(len(front))), strict=True))
    places = [i for i, group in enumerate(along) if not all(equal(group[0], law) for law in group[1:])]
    return {f"Damper {i + 1}" if len(along) > 1 else "Damper": list(along[i]) for i in places}


def _curves(
    axes: Axes, front: ParetoFront, laws: list[AbstractDamper], title: str, velocities: VectorLike | None
) -> None:
    """Force over velocity of the laws at some points of the front, the knee among them."""
    points = _velocities(velocities, front.values.get(_FASTEST, np.zeros(1)))
    shown = {*np.linspace(0, len(laws) - 1, min(MOST_CURVES, len(laws))).astype(int).tolist(), front.knee}
    shades = front.shares[:, 0]
    for i in sorted(shown):
        force = np.asarray(quasi_static(laws[i], points).force)
        knee = i == front.knee
        colour = _style.COLOURS[1] if knee else _style.graded(float(shades[i]))
        axes.plot(points, force, color=colour, linewidth=2.2 if knee else 1.1, zorder=3 if knee else 2)
    _style.dress(axes, _style.VELOCITY, _style.FORCE, f"{title}, in the colours of the front", zero="xy")
