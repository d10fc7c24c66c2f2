"""Vehicles in motion over their road: a page for the browser."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import Contents, typeset_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp._writing import write_whole
from jaxdamp.plots import _style
from jaxdamp.simulation import Response
from jaxdamp.vehicles import Frame, Link, Point, Wheel, prefixed


RATE = 100.0  # 1/s, of the samples in the page, between which it draws straight lines
LONGEST = 60.0  # s, of a run in the page
SHOWN = 0.25  # m, of the largest motion in the picture
FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
UNKNOWN_SPEED = 20.0  # m/s, at which a road without a speed is drawn
OVERHANG = 0.4  # m, of a body beyond its outermost points
_PAGE = Path(__file__).with_name("animation.html")


class _End(NamedTuple):
    """Where a point is: on a body, ahead of its centre of gravity and to the left of it [m]."""

    body: str
    ahead: float
    left: float
    share: float = 1.0  # of the height of the body; its sign tells the ends of a link apart


@of_known_numbers
def animation(responses: Response | Mapping[str, Response], path: str | os.PathLike[str], *, title: str = "") -> Path:
    """Write a page in which a vehicle, or several side by side, moves over its road: `response.animate(path)`.

    Bodies, wheels and dampers with their forces, in slow motion if wanted, with a slider for the time; below them the
    acceleration of the body and the force of the first damper. Heights are magnified by a factor that the page states;
    of a long run it shows the first minute, and says so. One file without server or network.

    Arguments:
        responses: of `simulate`; several by name, such as `{"before": before, "after": after}`.
        path: the file to write, NAME.html; an existing one is replaced, and never left incomplete.
        title: of the page; made from the vehicle if left out.

    Returns:
        The path of the file.

    Raises:
        ValueError: no HTML file, a folder that does not exist, no response, runs at other instants.
    """
    file = Path(path).expanduser()
    if file.suffix != ".html":
        _checks.refuse("path", "be a file NAME.html", str(file))
    runs = _style.by_name("responses", responses, Response, "the response of a vehicle, or several", _style.SIMULATE)
    first = next(iter(runs.values()))
    for name, run in runs.items():
        if run.time.shape != first.time.shape or not np.allclose(run.time, first.time):
            times = f"{run.time.size} to {float(run.time[-1]):g} s"
            _checks.refuse(f"responses[{name!r}]", "have the instants of the first one", times)
    length, cut = float(first.time[-1] - first.time[0]), ""
    if length > LONGEST:
        begin, cut = float(first.time[0]), f" The first {LONGEST:g} of {length:g} s."
        runs = {name: run.between(begin, begin + LONGEST) for name, run in runs.items()}
    every = max(round(1.0 / (RATE * float(first.time[1] - first.time[0]))), 1)
    designs: list[Contents] = [{"name": name} | _design(run, every) for name, run in runs.items()]
    moved = 1e-4 * max(max(map(abs, point["height"])) for design in designs for point in design["points"])
    data = {
        "title": title or f"{_style.first_upper(_style.class_words(first.vehicle))} on its road",
        "step": every * float(first.time[1] - first.time[0]),
        "factor": max((factor for factor in FACTORS if factor * moved <= SHOWN), default=1),
        "cut": cut,
        "designs": designs,
    }
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return write_whole(file, _PAGE.read_text(encoding="utf-8").replace("{{data}}", text))


def _design(run: Response, every: int) -> Contents:
    """One vehicle: where its points are, their heights over time, forces and signals."""
    frame, count = run.vehicle.frame(), run.motion.shape[1] // 2
    coordinates = dict(zip(frame.coordinates, np.asarray(run.motion).T[:count], strict=True))
    links = [(link, _ends(link.extension, frame)) for link in frame.links]
    wheels = [(wheel, _ends(wheel.point, frame)[0]) for wheel in frame.wheels]
    offsets = _offsets(frame, [ends for _, ends in links])
    drawn = _Drawn(frame, coordinates, offsets, every)
    dampers = _all_dampers(run, drawn, links, wheels, every)
    springs = [[drawn.point(end) for end in ends] for _, ends in links if len(ends) == 2 and drawn.above(*ends)]
    on_road = [_wheel(run, number, wheel, drawn.point(end), every) for number, (wheel, end) in enumerate(wheels)]
    levels = _levels(frame, [ends for _, ends in links], [end for _, end in wheels])
    return {
        **_bodies(frame, drawn, levels),  # first, as it adds points
        "points": drawn.points,
        "levels": [levels[end.body] for end in drawn.ends],
        "springs": springs,
        "dampers": dampers,
        "wheels": on_road,
    } | _signals(run, every)


def _bodies(frame: Frame, drawn: "_Drawn", levels: Mapping[str, int]) -> Contents:
    """The bodies by their corners, and beams that carry wheels by their points."""
    names = [body.name for body in frame.bodies]
    return {
        "bodies": [{"corners": drawn.corners(name), "level": levels[name]} for name in names if levels[name] > 0],
        "beams": [drawn.of_body(name) for name in names if levels[name] == 0],
    }


def _signals(run: Response, every: int) -> Contents:
    """How fast the vehicle is, and the acceleration of its body."""
    channel = next(name for name in run.units if name.endswith("_acceleration"))
    return {
        "speed": _speed(run) or UNKNOWN_SPEED,
        "speedKnown": _speed(run) is not None or run.axle_timing.kind != "one axle",
        "driven": run.axle_timing.kind in ("delayed", "one axle"),
        "signal": np.round(np.asarray(run[channel])[::every], 4).tolist(),
        "channel": f"{_style.metric_words(channel)} [{typeset_unit(run.units[channel])}]",
        "rms": _style.quantity(float(np.std(np.asarray(run[channel]))), run.units[channel]),
    }


def _all_dampers(
    run: Response,
    drawn: "_Drawn",
    links: Sequence[tuple[Link, list[_End]]],
    wheels: Sequence[tuple[Wheel, _End]],
    every: int,
) -> list[Contents]:
    """The dampers of links, and of hulls whose wheels have no mass those beside the tyre."""
    dampers = []
    for link, ends in links:
        if len(ends) == 2:
            dampers += _dampers(run, link, [drawn.point(end) for end in ends], every)
    for number, (wheel, end) in enumerate(wheels):
        dampers += _dampers(run, wheel, [drawn.point(end), -1 - number], every)
    return dampers


def _dampers(run: Response, part: Link | Wheel, ends: list[int], every: int) -> list[Contents]:
    """The elements of a part with a force, between two points; a negative number is that of a wheel on the road."""
    channels = {
        prefixed(part.name, element.name): prefixed(part.name, element.name) + "_force" for element in part.elements
    }
    return [
        {"name": _style.in_words(name), "ends": ends, "force": np.round(np.asarray(run[force])[::every]).tolist()}
        for name, force in channels.items()
        if force in run.units
    ]


def _speed(run: Response) -> float | None:
    """Of the vehicle [m/s], where the response knows it."""
    speed = run.axle_timing.speed
    return None if speed is None or np.ndim(speed) else float(speed)


def _wheel(run: Response, number: int, wheel: Wheel, point: int, every: int) -> Contents:
    heights = np.round(1e4 * np.asarray(run.road)[::every, number]).astype(int).tolist()
    return {"point": point, "road": heights}


def _ends(point: Point, frame: Frame) -> list[_End]:
    """The ends of a link, or the bodies behind a point, those with a positive share first."""
    ends = []
    for body in frame.bodies:
        share = float(point.terms.get(f"z_{body.name}", 0.0))
        if share:
            turns = {turn.axis: float(point.terms.get(body.angle(turn.axis), 0.0)) / share for turn in body.turns}
            ends.append(_End(body.name, turns.get("pitch", 0.0), turns.get("roll", 0.0), share))
    return sorted(ends, key=lambda end: -end.share)


def _offsets(frame: Frame, links: Sequence[Sequence[_End]]) -> dict[str, tuple[float, float]]:
    """Where the centre of gravity of each body is, ahead and to the left of that of the main body [m]."""
    offsets = {frame.main_body.name: (0.0, 0.0)}
    for _ in frame.bodies:
        for ends in links:
            known = next((end for end in ends if end.body in offsets), None)
            if known is None:
                continue
            ahead, left = offsets[known.body]
            for end in ends:
                offsets.setdefault(end.body, (ahead + known.ahead - end.ahead, left + known.left - end.left))
    return {body.name: offsets.get(body.name, (0.0, 0.0)) for body in frame.bodies}


def _levels(frame: Frame, links: Sequence[Sequence[_End]], wheels: Sequence[_End]) -> dict[str, int]:
    """How high a body is drawn: 0 a wheel, 1 the main body, 2 what stands on it."""
    main, on_road = frame.main_body.name, {end.body for end in wheels}
    levels = {body.name: 0 if body.name in on_road and body.name != main else 1 for body in frame.bodies}
    for ends in links:
        if len(ends) == 2 and ends[1].body == main:
            levels[ends[0].body] = 2
    return levels


class _Drawn:
    """The points of a vehicle that are drawn, each with its place and its heights over time."""

    def __init__(
        self,
        frame: Frame,
        coordinates: Mapping[str, np.ndarray],
        offsets: Mapping[str, tuple[float, float]],
        every: int,
    ) -> None:
        self._frame, self._coordinates, self._offsets, self._every = frame, coordinates, offsets, every
        self.ends: list[_End] = []
        self.points: list[Contents] = []

    def point(self, end: _End) -> int:
        """The number of a point."""
        end = end._replace(share=1.0)
        if end not in self.ends:
            body, (ahead, left) = self._frame.body(end.body), self._offsets[end.body]
            arms = {body.angle(turn.axis): {"pitch": end.ahead, "roll": end.left}[turn.axis] for turn in body.turns}
            height = self._coordinates[f"z_{end.body}"]
            height = height + sum(arm * self._coordinates[angle] for angle, arm in arms.items())
            heights = np.round(1e4 * height[:: self._every]).astype(int).tolist()
            self.points.append({"ahead": ahead + end.ahead, "left": left + end.left, "height": heights})
            self.ends.append(end)
        return self.ends.index(end)

    def above(self, upper: _End, lower: _End) -> bool:
        """Whether one end is above the other; those of an anti-roll bar are beside each other."""
        places = [np.add(self._offsets[end.body], (end.ahead, end.left)) for end in (upper, lower)]
        return bool(np.allclose(*places, atol=1e-9))

    def of_body(self, body: str) -> list[int]:
        """The points of a body from rear to front; of a wheel one, of a walking beam several."""
        own = [number for number, end in enumerate(self.ends) if end.body == body]
        return sorted(own, key=lambda number: self.ends[number].ahead)

    def corners(self, body: str) -> list[int]:
        """Points round a body, beyond those where something is attached: two of a body seen as a bar, else four."""
        own = [end for end in self.ends if end.body == body] or [_End(body, 0.0, 0.0)]
        ahead, left = [end.ahead for end in own], [end.left for end in own]
        fore, aft = max(ahead) + OVERHANG, min(ahead) - OVERHANG
        sides = sorted({max(left), min(left)})
        round_it = [(fore, sides[0]), (aft, sides[0])]
        round_it += [(aft, sides[1]), (fore, sides[1])] if len(sides) == 2 else []
        return [self.point(_End(body, *place)) for place in round_it]
