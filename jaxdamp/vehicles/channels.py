"""Channels of a vehicle: each is a linear combination of signals of the motion, the forces and the road."""

import enum
from typing import NamedTuple

from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Element, Link, Point, Wheel, prefixed


class ChannelKind(enum.Enum):
    """The physical quantity of a channel, which determines its unit and its frequency weighting.

    Attributes:
        meaning: description in words.
        unit: SI unit.
        weighting: frequency weighting of ISO 2631-1, for accelerations.
    """

    HEIGHT = "height of a body or a place", "m"
    ANGLE = "pitch or roll angle of a body", "rad"
    ACCELERATION = "vertical acceleration of a body or a place", "m/s^2", "Wk"
    ANGULAR_ACCELERATION = "pitch or roll acceleration of a body", "rad/s^2", "We"
    STROKE = "deflection between two points, extension positive", "m"
    DAMPER_VELOCITY = "rate of a deflection", "m/s"
    FORCE = "force of one law", "N"
    ROAD_HEIGHT = "height of the road under a wheel", "m"
    TYRE_LOAD = "load of a wheel minus the static load", "N"
    RELATIVE_TYRE_LOAD = "load of a wheel minus the static load, divided by the static load", ""

    def __init__(self, meaning: str, unit: str, weighting: str | None = None) -> None:
        self.meaning, self.unit, self.weighting = meaning, unit, weighting


class Channel(NamedTuple):
    """A channel of a vehicle.

    Arguments:
        name: name of the channel.
        kind: its physical quantity.
        place: name of the body, place, link, wheel or element that it belongs to.
        description: its meaning, its positive direction, and the number of dampers or wheels it stands for.
    """

    name: str
    kind: ChannelKind
    place: str
    description: str

    @property
    def unit(self) -> str:
        """Its SI unit."""
        return self.kind.unit


Measured = tuple[Channel, Point]  # a channel, and its linear combination of `signals`
ANGULAR = (ChannelKind.ANGLE, ChannelKind.ANGULAR_ACCELERATION)


def signals(frame: Frame) -> list[str]:
    """Names of the signals that channels are combined from.

    Positions, rates and accelerations of the coordinates, forces of the elements, heights and rates of the road.
    """
    motion = [f"{what}:{name}" for what in ("position", "rate", "acceleration") for name in frame.coordinates]
    road = [f"{what}:{wheel.name}" for what in ("road", "road rate") for wheel in frame.wheels]
    return [*motion, *[f"force:{name}" for name in frame.element_names], *road]


def channels_of(frame: Frame) -> list[Measured]:
    """All channels of a vehicle; the relative tyre load must still be divided by the static load of its wheel."""
    parts: list[Link | Wheel] = [*frame.links, *frame.wheels]
    channels = [channel for body in frame.bodies for channel in _of_body(body)]
    for place in frame.places:
        where, names = f"{place.name} on {place.body}, up", (f"z_{place.name}", place.name)
        words = f"height of {where}", f"acceleration of {where}"
        channels += _of_point(place.name, frame.place(place), names, words)
    for part in parts:
        channels += _of_elements(part)
    for wheel in frame.wheels:
        channels += _of_wheel(wheel)
    return channels


def _signal(what: str, point: Point) -> Point:
    """A point of the coordinates, of their positions, rates or accelerations."""
    return Point({f"{what}:{name}": coefficient for name, coefficient in point.terms.items()})


def _of_point(
    place: str,
    point: Point,
    names: tuple[str, str],
    words: tuple[str, str],
    kinds: tuple[ChannelKind, ChannelKind] = (ChannelKind.HEIGHT, ChannelKind.ACCELERATION),
) -> list[Measured]:
    """A height or an angle, and its acceleration."""
    return [
        (Channel(names[0], kinds[0], place, words[0]), _signal("position", point)),
        (Channel(f"{names[1]}_acceleration", kinds[1], place, words[1]), _signal("acceleration", point)),
    ]


def _of_body(body: Body) -> list[Measured]:
    height = f"height of {body.name}, up, from the equilibrium of the linear springs on level ground"
    words = height, f"acceleration of {body.name}, up"
    channels = _of_point(body.name, body.at(), (f"z_{body.name}", body.name), words)
    for turn in body.turns:
        angle, of = body.angle(turn.axis), f"of {body.name}, {turn.sense}"
        words, kinds = (f"{turn.axis} angle {of}", f"{turn.axis} acceleration {of}"), ANGULAR
        channels += _of_point(body.name, Point({angle: 1.0}), (angle, angle), words, kinds)
    return channels


def _deflection(part: Link | Wheel, what: str) -> Point:
    """The deflection of a link or a wheel, or its rate."""
    if isinstance(part, Link):
        return _signal(what, part.extension)
    road = "road" if what == "position" else "road rate"
    return _signal(what, part.point) - Point({f"{road}:{part.name}": 1.0})


def _of_elements(part: Link | Wheel) -> list[Measured]:
    """Deflection, its rate and the forces of a part with laws."""
    if not part.elements:
        return []
    stroke, velocity = prefixed(part.name, "stroke"), prefixed(part.name, "damper_velocity")
    what = f"deflection{f' of {part.name}' if part.name else ''}, extension positive"
    channels = [
        (Channel(stroke, ChannelKind.STROKE, part.name, what), _deflection(part, "position")),
        (Channel(velocity, ChannelKind.DAMPER_VELOCITY, part.name, f"rate of the {what}"), _deflection(part, "rate")),
    ]
    for element in part.elements:
        name = prefixed(part.name, element.name)
        words = f"force of {name}{_share(element, part)}, positive where it resists extension"
        force = Point({f"force:{name}": 1.0 / element.count})  # the force of one of several equal laws
        channels.append((Channel(f"{name}_force", ChannelKind.FORCE, name, words), force))
    return channels


def _of_wheel(wheel: Wheel) -> list[Measured]:
    """Height of the road under a wheel, and its load minus the static load, positive for more load."""
    where, of = (f" under {wheel.name}" if wheel.name else ""), _together(wheel)
    pull = _deflection(wheel, "position") * wheel.stiffness + _deflection(wheel, "rate") * wheel.damping
    for name in wheel.element_names:
        pull = pull + Point({f"force:{name}": 1.0})
    dynamic, relative = (prefixed(wheel.name, f"{word}_tyre_load") for word in ("dynamic", "relative"))
    kinds, load = ChannelKind, f"load{where} minus the static load"
    height = Channel(
        f"z_{prefixed(wheel.name, 'road')}", kinds.ROAD_HEIGHT, wheel.name, f"height of the road{where}, up"
    )
    return [
        (height, Point({f"road:{wheel.name}": 1.0})),
        (Channel(dynamic, kinds.TYRE_LOAD, wheel.name, f"{load}{of}, more load positive"), -pull),
        (Channel(relative, kinds.RELATIVE_TYRE_LOAD, wheel.name, f"{load}, divided by the static load"), -pull),
    ]


def _share(element: Element, part: Link | Wheel) -> str:
    """The number of laws that a force stands for, in words."""
    return f", of one of {element.count} equal ones" if element.count > 1 else _together(part)


def _together(part: Link | Wheel) -> str:
    return f", {'both' if part.sides == 2 else part.sides} sides together" if part.sides > 1 else ""
