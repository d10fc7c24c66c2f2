"""The sketch of a vehicle on its sheet, from the side: bodies on springs and dampers on wheels, with its numbers."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from jaxdamp._types import Axes
from jaxdamp.plots import _sheet, _style
from jaxdamp.vehicles import AbstractVehicle, Drawing


_LEVEL, _WHEEL, _THICK = 0.75, 0.32, 0.3  # m: from body to body, centre of a wheel above the road, height of a body
_ENDS, _BESIDE = (0.06, 0.8), 0.03  # of the width: ends of the vehicle, before its text; from spring to middle
_POINTS, _WIDE = 85.0, 228.0  # height and width of the sketch [pt]
_SMALL: _style.Look = {"fontsize": 6.5, "va": "center", "linespacing": 1.1}


def sketch(axes: Axes, vehicle: AbstractVehicle) -> None:
    """Bodies on springs and dampers on wheels, front to the right, with masses and rates; of two sides the left one."""
    drawing = Drawing(vehicle.frame(), list(vehicle.units))
    points, parts = drawing.parts["points"], drawing.parts
    ahead = np.array([point["ahead"] for point in points])
    x = list(map(float, np.interp(ahead, (ahead.min(), ahead.max()), _ENDS)))
    y = [0.1 + _LEVEL * point["level"] if point["level"] else _WHEEL for point in points]
    near = [point["left"] >= 0.0 for point in points]
    foot = [high + _THICK * (point["level"] > 0) for high, point in zip(y, points, strict=True)]  # on bodies
    _sheet.blank(axes)
    axes.set_ylim(0.0, max(y) + _THICK)
    _bodies(axes, drawing, x, y)
    springs = [
        (y[upper], _style.quantity(float(link.stiffness), "N/m"), x[upper], foot[lower])
        for link, (upper, lower) in zip(drawing.springs, parts["springs"], strict=True)
        if near[upper] and float(link.stiffness)
    ]
    for (high, rate), same in groupby(sorted(springs), key=lambda one: one[:2]):
        *others, (_, _, foremost, low) = same
        for _, _, place, of_it in others:
            _spring(axes, place, of_it, high, "")
        _spring(axes, foremost, low, high, "each " * bool(others) + rate)
    _wheels(axes, drawing, x, y, near)
    for damper in parts["dampers"]:
        upper, lower = damper["ends"]
        if near[upper] and damper["name"].endswith("damper"):
            _damper(axes, x[upper], _WHEEL if lower < 0 else foot[lower], y[upper])


def _bodies(axes: Axes, drawing: Drawing, x: Sequence[float], y: Sequence[float]) -> None:
    """Bodies with their masses, and beams between wheels."""
    from matplotlib.patches import Rectangle

    for body, drawn in zip(drawing.bodies, drawing.parts["bodies"], strict=True):
        right, left, bottom = x[drawn["corners"][0]], x[drawn["corners"][1]], y[drawn["corners"][0]]
        axes.add_patch(Rectangle((left, bottom), right - left, _THICK, facecolor="0.92", edgecolor=_style.BLACK))
        name = f"{_style.in_words(body.name).replace('sprung', 'body')}, {_style.quantity(float(body.mass), 'kg')}"
        axes.text(0.5 * (left + right), bottom + 0.5 * _THICK, name, ha="center", **_SMALL)
    for beam in drawing.parts["beams"]:
        axes.plot([x[k] for k in beam], [y[k] for k in beam], color=_style.BLACK, linewidth=2.5)


def _spring(axes: Axes, x: float, low: float, high: float, rate: str) -> None:
    turns = x - _BESIDE + 0.012 * np.array([0, 0, 1, -1, 1, -1, 1, 0, 0])
    axes.plot(turns, np.linspace(low, high, 9), color=_style.BLACK, linewidth=1.0, zorder=1.5)
    axes.text(x + _BESIDE + 0.02, low + 0.62 * (high - low), rate, ha="left", **_SMALL)


def _damper(axes: Axes, x: float, low: float, high: float) -> None:
    blue, third = _style.AFTER["color"], (high - low) / 3.0
    axes.plot([x + _BESIDE] * 2, [low, high], color=blue, linewidth=1.5, zorder=3)
    axes.plot([x + _BESIDE] * 2, [low + third, high - third], color=blue, linewidth=6.0, solid_capstyle="butt")


def _wheels(axes: Axes, drawing: Drawing, x: Sequence[float], y: Sequence[float], near: Sequence[bool]) -> None:
    """Wheels on the road; what is equal in neighbours is written once, with the foremost one."""
    masses = {body.name: float(body.mass) for body in drawing.frame.bodies if body not in drawing.bodies}
    rates = [float(wheel.stiffness) for wheel in drawing.frame.wheels]
    places = [wheel["point"] for wheel in drawing.parts["wheels"]]
    shown = sorted((x[point], point, rate) for point, rate in zip(places, rates, strict=True) if near[point])
    size = min(26.0, 190.0 * min(np.diff([place for place, *_ in shown]), default=1.0))
    axes.axhline(max(_WHEEL - 0.5 * size * axes.get_ylim()[1] / _POINTS, 0.0), color=_style.BLACK, linewidth=1.0)
    labels = []
    for place, point, rate in shown:
        axes.plot(place, _WHEEL, "o", markersize=size, markerfacecolor="white", color=_style.BLACK)
        body = drawing.body_of(point)
        if body not in masses:  # of a hull, whose wheels are on the springs of the body
            _spring(axes, place, _WHEEL, y[point], "")
        mass = f"{_style.quantity(masses[body], 'kg')}, tyre\n" if body in masses else ""
        labels.append((f"{mass}{_style.quantity(rate, 'N/m')}", place, body if mass else point))
    for label, same in groupby(labels, key=lambda one: one[0]):
        *others, (_, place, owner) = same
        words = "each " * any(other[2] != owner for other in others) + label
        axes.text(place + 0.5 * size / _WIDE + 0.015, _WHEEL, words, ha="left", **_SMALL)
