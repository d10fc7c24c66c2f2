"""A front of ride metrics, with the damper laws along it."""

from collections.abc import Mapping

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Artist, Axes, Figure, VectorLike
from jaxdamp.dampers import AbstractDamper
from jaxdamp.plots import _style
from jaxdamp.plots.changes import own_laws
from jaxdamp.rig import quasi_static
from jaxdamp.tune import ParetoFront, limit_spans
from jaxdamp.vehicles import AbstractVehicle


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
    _style.dress(axes, _label(front, x), _label(front, y), f"Front of {len(front)} designs")
    return handles


def _limits(axes: Axes, front: ParetoFront, x: str, y: str) -> list[Artist]:
    """Dashed lines at the limits of the two objectives, and marks at points where another metric is at its limit."""
    colour, handles = _style.BAD, []
    for name, (lower, upper) in limit_spans(front.limits, list(front.values)).items():
        for end in (lower, upper):
            if not np.isfinite(end):
                continue
            words = (
                f"limit of {_style.metric_words(name)}, {_style.short(end)} {typeset_unit(front.units[name])}".rstrip()
            )
            if name in (x, y):
                line = axes.axvline if name == x else axes.axhline
                handles.append(line(end, color=colour, linestyle="--", linewidth=1.2, label=words))
            elif (at_limit := np.abs(front.values[name] - end) <= AT_LIMIT * abs(end)).any():
                marks = front.values[x][at_limit], front.values[y][at_limit]
                handles.append(axes.scatter(*marks, 60.0, colour, marker="|", linewidths=1.8, label=f"at the {words}"))
    return handles


def _label(front: ParetoFront, name: str) -> str:
    words, unit = _style.metric_words(name), typeset_unit(front.units[name])
    return f"{words} [{unit}]" if unit else words


def _laws_along(front: ParetoFront) -> dict[str, list[AbstractDamper]]:
    """The laws that differ along the front, by a title: each at every point."""
    along = list(zip(*(own_laws(front.point(i)) for i in range(len(front))), strict=True))
    places = [i for i, group in enumerate(along) if not _all_equal(group)]
    return {f"Damper {i + 1}" if len(along) > 1 else "Damper": list(along[i]) for i in places}


def _all_equal(laws: tuple[AbstractDamper, ...]) -> bool:
    import equinox as eqx

    return all(bool(eqx.tree_equal(laws[0], law)) for law in laws[1:])


def _curves(
    axes: Axes,
    front: ParetoFront,
    laws: list[AbstractDamper],
    title: str,
    velocities: VectorLike | None,
) -> None:
    """Force over velocity of the laws at some points of the front, the knee among them."""
    if velocities is None:
        peaks = front.values.get("peak_damper_velocity", np.zeros(1))
        reach = 1.1 * float(np.max(peaks)) or 1.0
        velocities = np.linspace(-reach, reach, 401)
    points = np.asarray(velocities, dtype=float)
    shown = {*np.linspace(0, len(laws) - 1, min(MOST_CURVES, len(laws))).astype(int).tolist(), front.knee}
    shades = front.shares[:, 0]
    for i in sorted(shown):
        force = np.asarray(quasi_static(laws[i], points).force)
        knee = i == front.knee
        colour = _style.COLOURS[1] if knee else _style.graded(float(shades[i]))
        axes.plot(points, force, color=colour, linewidth=2.2 if knee else 1.1, zorder=3 if knee else 2)
    _style.dress(axes, _style.VELOCITY, _style.FORCE, f"{title}, in the colours of the front")
    _style.cross(axes)
