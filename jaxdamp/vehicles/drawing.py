"""How a vehicle is drawn in motion: points with their heights, bodies, springs, dampers, wheels; by `drawing.js`."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxdamp._tables import Contents
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Link, Point, Wheel, prefixed


UNKNOWN_SPEED = 20.0  # m/s, at which a road without a speed is drawn
OVERHANG = 0.4  # m, of a body beyond its outermost points


def drawing_script() -> str:
    """The script by which a page of the browser draws vehicles, and plays their motion."""
    return Path(__file__).with_name("drawing.js").read_text(encoding="utf-8")


class _End(NamedTuple):
    """Where a point is: on a body, ahead of its centre of gravity and to the left of it [m]."""

    body: str
    ahead: float
    left: float
    share: float = 1.0  # of the height of the body; its sign tells the ends of a link apart


class Drawing:
    """The points of a vehicle that are drawn, and what is drawn between them.

    Arguments:
        frame: of the vehicle.
        channels: names of its channels, of which the dampers are those with a force.

    Attributes:
        heights: of each point, as coefficients of the coordinates.
        bodies: those drawn as such, in their order in `parts`.
        springs: the links drawn as springs, in their order in `parts`.
        forces: the channel of the force of each damper.
        parts: what the script draws. A negative end of a damper, -1 - k, is the wheel k.
    """

    def __init__(self, frame: Frame, channels: Sequence[str]) -> None:
        self.frame, self._known, self._drawn = frame, set(channels), list[_End]()
        self.forces: list[str] = []
        self._links = [self._ends(link.extension) for link in frame.links]
        wheels = [self._ends(wheel.point)[0] for wheel in frame.wheels]
        self._on_road = {end.body for end in wheels}
        links = zip(frame.links, self._links, strict=True)
        pairs = [(link, ends[0], ends[1]) for link, ends in links if len(ends) == 2]
        upright = [(link, upper, lower) for link, upper, lower in pairs if self._above(upper, lower)]
        self.springs = [link for link, *_ in upright]
        self.bodies = [body for body in frame.bodies if self._levels[body.name] > 0]
        self.parts: Contents = {
            "dampers": self._dampers(pairs, wheels),
            "springs": [[self._point(upper), self._point(lower)] for _, upper, lower in upright],
            "wheels": [{"point": self._point(end)} for end in wheels],
            **self._drawn_bodies(),
        }
        self.parts["points"] = [self._place(end) for end in self._drawn]
        self.heights = [Point(self._terms(end)) for end in self._drawn]

    def _drawn_bodies(self) -> Contents:
        """The bodies by their corners, and beams that carry wheels by their points."""
        beams = [body.name for body in self.frame.bodies if self._levels[body.name] == 0]
        return {
            "bodies": [{"corners": self._corners(b.name), "level": self._levels[b.name]} for b in self.bodies],
            "beams": [self._of_body(beam) for beam in beams],
        }

    def body_of(self, point: int) -> str:
        """The body on which a point is."""
        return self._drawn[point].body

    def _ends(self, point: Point) -> list[_End]:
        """The ends of a link, or the bodies behind a point, those with a positive share first."""
        ends = []
        for body in self.frame.bodies:
            share = float(point.terms.get(f"z_{body.name}", 0.0))
            if share:
                turns = {turn.axis: float(point.terms.get(body.angle(turn.axis), 0.0)) / share for turn in body.turns}
                ends.append(_End(body.name, turns.get("pitch", 0.0), turns.get("roll", 0.0), share))
        return sorted(ends, key=lambda end: -end.share)

    @cached_property
    def _offsets(self) -> Mapping[str, tuple[float, float]]:
        """Where the centre of gravity of each body is, ahead and to the left of that of the main body [m]."""
        offsets = {self.frame.main_body.name: (0.0, 0.0)}
        for _ in self.frame.bodies:
            for ends in self._links:
                attached = next((end for end in ends if end.body in offsets), None)
                if attached is None:
                    continue
                ahead, left = offsets[attached.body]
                for end in ends:
                    offsets.setdefault(end.body, (ahead + attached.ahead - end.ahead, left + attached.left - end.left))
        return {body.name: offsets.get(body.name, (0.0, 0.0)) for body in self.frame.bodies}

    @cached_property
    def _levels(self) -> Mapping[str, int]:
        """How high a body is drawn: 0 a wheel, 1 the main body, 2 what stands on it, and so on."""
        main = self.frame.main_body.name
        levels = {body.name: 0 if body.name in self._on_road - {main} else 1 for body in self.frame.bodies}
        for _ in self.frame.bodies:
            for upper, lower in (ends for ends in self._links if len(ends) == 2):
                if upper.body not in self._on_road | {main} and lower.body != upper.body:
                    levels[upper.body] = max(levels[upper.body], 1 + levels[lower.body])
        return levels

    def _point(self, end: _End) -> int:
        """The number of a point."""
        end = end._replace(share=1.0)
        self._drawn += [] if end in self._drawn else [end]
        return self._drawn.index(end)

    def _place(self, end: _End) -> Contents:
        ahead, left = self._offsets[end.body]
        return {"ahead": ahead + end.ahead, "left": left + end.left, "level": self._levels[end.body]}

    def _terms(self, end: _End) -> dict[str, float]:
        arms = {"pitch": end.ahead, "roll": end.left}
        body = self.frame.body(end.body)
        return {f"z_{end.body}": 1.0} | {body.angle(turn.axis): arms[turn.axis] for turn in body.turns}

    def _dampers(self, pairs: Sequence[tuple[Link, _End, _End]], wheels: Sequence[_End]) -> list[Contents]:
        """The dampers of links, and of hulls whose wheels have no mass those beside the tyre."""
        dampers = [self._damper(link, self._point(upper), self._point(lower)) for link, upper, lower in pairs]
        for number, (wheel, end) in enumerate(zip(self.frame.wheels, wheels, strict=True)):
            dampers.append(self._damper(wheel, self._point(end), -1 - number))
        return [damper for of_one in dampers for damper in of_one]

    def _damper(self, part: Link | Wheel, upper: int, lower: int) -> list[Contents]:
        """The elements of a part with a force, between two points."""
        dampers = []
        for element in part.elements:
            name = prefixed(part.name, element.name)
            if f"{name}_force" in self._known:
                self.forces.append(f"{name}_force")
                dampers.append({"name": name.replace("_", " "), "ends": [upper, lower]})
        return dampers

    def _above(self, upper: _End, lower: _End) -> bool:
        """Whether one end is above the other; those of an anti-roll bar are beside each other."""
        places = [np.add(self._offsets[end.body], (end.ahead, end.left)) for end in (upper, lower)]
        return bool(np.allclose(*places, atol=1e-9))

    def _of_body(self, body: str) -> list[int]:
        """The points of a body from rear to front; of a wheel one, of a walking beam several."""
        numbers = [number for number, end in enumerate(self._drawn) if end.body == body]
        return sorted(numbers, key=lambda number: self._drawn[number].ahead)

    def _corners(self, body: str) -> list[int]:
        """Points round a body, beyond those where something is attached: two of a body seen as a bar, else four."""
        ends = [end for end in self._drawn if end.body == body] or [_End(body, 0.0, 0.0)]
        ahead, left = [end.ahead for end in ends], [end.left for end in ends]
        fore, aft = max(ahead) + OVERHANG, min(ahead) - OVERHANG
        sides = sorted({max(left), min(left)})
        round_it = [(fore, sides[0]), (aft, sides[0])]
        round_it += [(aft, sides[1]), (fore, sides[1])] if len(sides) == 2 else []
        return [self._point(_End(body, *place)) for place in round_it]
