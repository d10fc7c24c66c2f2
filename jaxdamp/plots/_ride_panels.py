"""The panels of a ride sheet, and what they show: vehicles before and after on a road."""

import textwrap
from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np

from jaxdamp._display import display
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Axes
from jaxdamp.plots import _axes, _rides, _sheet, _style, fitted_range
from jaxdamp.plots.damping import ratios, wheel_axis
from jaxdamp.rig import quasi_static
from jaxdamp.roads import WhiteRoad, assess_roughness, class_limits, road_class
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


_MM, _BINS, _MOST_BARS = 1e3, 31, 6
_NOTE: _style.Look = {"fontsize": 6.5, "va": "center", "bbox": {"facecolor": "white", "linewidth": 0.0, "pad": 0.4}}


def vehicle(axes: Axes, shown: _rides.Rides) -> None:
    """The sketch of the vehicle under its natural frequencies."""
    sketch(axes, shown.cars[1])
    frequencies = [_style.short(float(f)) for f in shown.frequencies]
    axes.set_title(f"Natural frequencies {', '.join(frequencies[:6])} Hz", loc="left")


def road(axes: Axes, shown: _rides.Rides) -> None:
    """The spectrum of a random road among the classes of ISO 8608, or the heights of a bump."""
    if shown.road is None:
        _sheet.remarks(axes, "Road", ["Several roads or conditions; see the page."], width=40)
        return
    speed, n = shown.speed, np.geomspace(0.02, 2.0, 60)
    heights = None if shown.responses is None else np.asarray(shown.responses[0].road)[:, 0]
    if shown.responses is not None and heights is not None and (shown.is_event or speed is None):
        axes.plot(shown.responses[0].time, _MM * heights, color=_style.BLACK, linewidth=1.3)
        height = _style.short(_MM * float(np.ptp(heights)))
        _style.dress(axes, "time [s]", "height [mm]", f"Road: {height} mm from the lowest to the highest point")
        return
    speed = 1.0 if speed is None else speed
    if shown.responses is None or heights is None:
        assert isinstance(shown.road, WhiteRoad)
        driven, roughness = "", float(shown.road.velocity_psd) / (2.0 * np.pi) ** 2 / speed / 0.1**2
        axes.loglog(n, roughness * (n / 0.1) ** -2.0, **_style.AFTER)
        name = road_class(roughness)
    else:
        spacing, length = speed * shown.responses[0].dt, speed * float(shown.responses[0].time[-1])
        driven = f" as driven, over {display().words(f'{_style.short(length)} m')}"
        measured = assess_roughness(heights, spacing, bands_per_octave=3)
        axes.loglog(measured.spatial_frequency, measured.displacement_psd, **_style.AFTER)
        name = measured.road_class
    line = (n / 0.1) ** -2.0
    for letter in "ABCDEFGH":
        axes.loglog(n, class_limits(letter)[1] * line, color="0.8", linewidth=0.6, zorder=0.5)
    low, high = class_limits(name)
    low, high = max(low, high / 4.0 if np.isfinite(high) else 0.0), min(high, 4.0 * low if low else np.inf)
    axes.fill_between(n, low * line, high * line, color="0.55", alpha=0.3, linewidth=0.0)
    axes.set_ylim(0.2 * low * line[-1], 4.0 * high * line[0])
    axes.set_xlim(n[0], n[-1])
    _style.plain_log_axis(axes.xaxis)
    title = f"Road{driven}: ISO 8608 class {name}, {display().speed(speed)}"
    _style.dress(axes, "spatial frequency [cycle/m]", "height PSD [m³]", title)


def plane(axes: Axes, shown: _rides.Rides) -> None:
    """Comfort over grip: present and new, the curve of constant damping, limits."""
    comfort, grip = shown.goal("comfort"), shown.goal("grip")
    if not comfort or not grip or shown.road is None:
        _sheet.remarks(axes, "Comfort and grip", ["No metrics of comfort and grip for this road."], width=50)
        return
    curve = _rides.constant_damping(shown, comfort, grip)
    if isinstance(curve, str):
        why = textwrap.fill(f"No curve of constant damping: {curve}", 60)
        axes.text(0.02, 0.02, why, transform=axes.transAxes, fontsize=6.0, color=_style.GREY)
    else:
        axes.plot(*curve, color=_style.GREY, linewidth=1.2, marker=".", markersize=4, label="constant damping")
        for at, word in ((0, "soft"), (-1, "firm")):
            place, left = (curve[0][at], curve[1][at]), curve[0][at] < np.mean(curve[0])
            look = {"color": _style.GREY, "fontsize": _sheet.SMALL, "ha": "right" if left else "left"}
            axes.annotate(word, place, (-5 if left else 5, 3), textcoords="offset points", **look)
    places = [(_mean(side, comfort), _mean(side, grip)) for side in shown.values]
    if not shown.single:
        arrow = {"arrowstyle": "-|>", "color": _style.AFTER["color"], "linewidth": 1.4, "shrinkA": 5, "shrinkB": 6}
        axes.annotate("", places[1], places[0], arrowprops=arrow)
        axes.plot(*places[0], **_style.PRESENT, label=_style.in_words(shown.names[0]), linestyle="")
    label = _style.in_words(shown.names[1])
    axes.plot(*places[1], **_style.BEST, label=label, linestyle="")
    _limits(axes, shown, comfort, grip)
    units = [typeset_unit(shown.units[names[0]]) for names in (comfort, grip)]
    x, y = f"{_style.metric_words(comfort[0])} [{units[0]}]", f"tyre load variation, RMS [{units[1]}]"
    _style.dress(axes, x, y, "Comfort and grip: better to the left and down")
    axes.margins(0.12)
    axes.legend(frameon=False, loc="best")


def _mean(values: Mapping[str, float], names: Sequence[str]) -> float:
    return float(np.mean([values[name] for name in names]))


def _limits(axes: Axes, shown: _rides.Rides, comfort: Sequence[str], grip: Sequence[str]) -> None:
    """The limits of the plane: of metrics that are alone on their axis."""
    bottom, top = axes.get_ylim()
    for names, line in ((comfort, axes.axvline), (grip, axes.axhline)):
        upper = shown.limits.get(names[0], (0.0, np.inf))[1]
        if len(names) == 1 and np.isfinite(upper):
            line(upper, **_style.LIMIT, label="limit")
            axes.set_ylim(bottom, max(top, 1.02 * upper) if names is grip else top)


def _main_metrics(shown: _rides.Rides) -> list[str]:
    """The names of the metrics of a sheet: what was minimised, comfort, pitch, travel, grip, what is limited."""
    minimised = [shown.tuning.metric] if shown.tuning else []
    pitch = [n for n in shown.values[0] if n.startswith(("rms_pitch_acc", "weighted_rms_pitch_acc"))][-1:]
    names = [*minimised, *shown.goal("comfort"), *pitch, *shown.goal("travel"), *shown.goal("grip"), *shown.limits]
    return list(dict.fromkeys(names))[:_MOST_BARS]


def bars(axes: Axes, shown: _rides.Rides) -> None:
    """The main metrics: change with whiskers over unseen roads and marks at limits, or their values for one ride."""
    names = _main_metrics(shown)
    if shown.single:
        rows = [(_style.metric_words(n), _style.quantity(shown.values[1][n], shown.units[n], n)) for n in names]
        _sheet.table(axes, "The main numbers", ["", ""], rows, [1.0], step=0.1)
        return
    for row, name in enumerate(names):
        _bar(axes, shown, row, name)
    axes.set_ylim(len(names) - 0.5, -0.6)
    axes.set_yticks([])
    whiskers = ", whiskers: unseen roads" * (shown.fresh is not None)
    title = f"{_style.in_words(shown.names[0])} → {_style.in_words(shown.names[1])}{whiskers}"
    _style.dress(axes, "change [%]", "", title + ", red: limit" * bool(shown.limits))
    axes.grid(False, axis="y")
    _style.cross(axes, horizontal=False)
    axes.margins(x=0.08)


def _bar(axes: Axes, shown: _rides.Rides, row: int, name: str) -> None:
    """The change of one metric; of one without a change in percent only the values."""
    values = " → ".join(_style.quantity(side[name], shown.units[name], name) for side in shown.values)
    change = shown.change(name, shown.values[1][name])
    percent = "" if change is None else f", {_style.percent(change)}"
    text = f"{_style.metric_words(name)}:  {values}{percent}"
    axes.text(0.01, row - 0.3, text, transform=axes.get_yaxis_transform(), zorder=5, **_NOTE)
    if change is None:
        return
    axes.barh(row + 0.1, change, 0.4, color=_style.GOOD if change < 0.0 else _style.COLOURS[1], zorder=2)
    if shown.fresh is not None and np.all(np.isfinite(shown.fresh.change(name))):
        spread = 100.0 * shown.fresh.change(name)
        axes.plot([spread.min(), spread.max()], [row + 0.1] * 2, "|-", color=_style.BLACK, linewidth=1.2, zorder=3)
        axes.plot(spread.mean(), row + 0.1, "D", color=_style.BLACK, markersize=3.5, zorder=3)
    ends = [shown.change(name, end) for end in shown.limits.get(name, ()) if np.isfinite(end)]
    for end in (end for end in ends if end is not None):
        axes.plot([end, end], [row - 0.15, row + 0.35], color=_style.BAD, linewidth=2.0, zorder=4)


def damper(panels: Sequence[Axes], shown: _rides.Rides, path: str) -> None:
    """A damper before and after over mm/s: its force, its damping ratio, and the share of time at each velocity."""
    curves, *damping, shares = panels
    velocities = [_rides.damper_velocity(shown, path, number) for number in (0, 1)]
    peaks = [np.abs(v).max() for v in velocities if v is not None]
    reach = 1.05 * float(max(peaks)) if peaks else 1.0
    several = _draw_law(curves, damping, shown, path, np.linspace(-reach, reach, 401))
    for _, style, number in shown.styles():
        velocity = velocities[number]
        if velocity is not None:
            edges = np.linspace(-reach, reach, _BINS + 1)
            share = 100.0 * np.histogram(velocity, edges)[0] / len(velocity)
            shares.step(0.5 * (edges[1:] + edges[:-1]), share, where="mid", **style)
    title = _style.first_upper(_style.in_words(path).removesuffix(" law"))
    _style.dress(curves, "", "force [N]", title + ", at all levels of its command" * several, turns="y")
    _style.cross(curves)
    _style.dress(shares, "", "time [%]", _rides.quadrants(velocities[1]))
    for axes in panels:
        _axes.label_axis(axes, "x", "velocity [mm/s]   (+ rebound)", times=_MM)
    curves.set_xlim(-reach, reach)
    if len(shown.styles()) > 1:
        drawn = [line for line in curves.get_lines() if not str(line.get_label()).startswith("_")]
        curves.legend(handles=drawn, frameon=False, loc="upper left")
    for above in (curves, *damping):
        above.tick_params(labelbottom=False)
        above.set_xlabel("")


def _draw_law(curves: Axes, damping: Sequence[Axes], shown: _rides.Rides, path: str, points: np.ndarray) -> bool:
    """Force and damping ratio of a law before and after; whether it is drawn at several commands."""
    laws = [shown.laws(path, number) for number in (0, 1)]
    critical = [_rides.critical(shown, path, number) for number in (0, 1)]
    heights = []
    for label, style, number in shown.styles():
        for law in laws[number]:
            force, one = np.asarray(quasi_static(law, points).force), critical[number]
            fitted_range.curve(curves, law, points, force, label=label or "law", **style)
            label = "_"  # the others of a damper at several commands
            heights += [ratios(axes, law, one, points, force, **style) for axes in damping if one is not None]
    fitted_range.shade(curves, [law for of_one in laws for law in of_one], points)
    for axes in damping:
        _style.dress(axes, "", "body [–]", "Damping ratio")
        axes.set_ylim(0.0, max(heights))
        wheel_axis(axes, [one for one in critical if one is not None])
    return len(laws[1]) > 1
