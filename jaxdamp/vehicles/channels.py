"""The channels of a vehicle and the predefined ride metrics of them."""

import enum
from collections.abc import Sequence
from typing import NamedTuple

from jaxdamp.metrics import STATISTICS, Metric, lift_off_below
from jaxdamp.vehicles.frame import LOAD_AT_LIFT_OFF, Frame
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
    VELOCITY = "vertical velocity of a body or a place", "m/s"
    ANGULAR_VELOCITY = "pitch or roll velocity of a body", "rad/s"
    ACCELERATION = "vertical acceleration of a body or a place", "m/s^2", "Wk"
    ANGULAR_ACCELERATION = "pitch or roll acceleration of a body", "rad/s^2", "We"
    STROKE = "deflection between two points, extension positive", "m"
    DAMPER_VELOCITY = "rate of a deflection", "m/s"
    FORCE = "force of one law", "N"
    TWIST = "angle across a link", "rad"
    TWIST_VELOCITY = "rate of an angle across a link", "rad/s"
    MOMENT = "moment of one law across an angle", "N m"
    COMMAND = "command of a damper", ""
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
OF_LINK = (ChannelKind.STROKE, ChannelKind.DAMPER_VELOCITY, ChannelKind.FORCE)
OF_ANGULAR_LINK = (ChannelKind.TWIST, ChannelKind.TWIST_VELOCITY, ChannelKind.MOMENT)
# Of a linear wheel, and of one that can lift off.
LIFT_OFF_FRACTIONS = (STATISTICS["lift_off_fraction"], lift_off_below(LOAD_AT_LIFT_OFF))


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
    return [*channels, *_velocities(frame)]  # last, so that numbers of outputs in exported programs stay


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


def _velocities(frame: Frame) -> list[Measured]:
    """Of bodies, their angles and places, and of turning bodies above each link and wheel with laws."""

    def rate(name: str, place: str, of: str, point: Point, kind: ChannelKind = ChannelKind.VELOCITY) -> Measured:
        return Channel(f"{name}_velocity", kind, place, f"velocity of {of}"), _signal("rate", point)

    channels = []
    for body in frame.bodies:
        channels.append(rate(body.name, body.name, f"{body.name}, up", body.at()))
        for turn in body.turns:
            angle, of = body.angle(turn.axis), f"{turn.axis} of {body.name}, {turn.sense}"
            channels.append(rate(angle, body.name, of, Point({angle: 1.0}), ChannelKind.ANGULAR_VELOCITY))
    for place in frame.places:
        channels.append(rate(place.name, place.name, f"{place.name} on {place.body}, up", frame.place(place)))
    above = [(link.name, link.extension) for link in frame.links if link.elements]
    for name, point in [*above, *((wheel.name, wheel.point) for wheel in frame.wheels if wheel.elements)]:
        for body in frame.bodies:
            terms = {q: point.terms[q] for q in body.masses if q in point.terms}
            if len(terms) > 1 and terms.get(f"z_{body.name}") == 1.0:
                of = f"{body.name} above {name}, up"
                channels.append(rate(prefixed(name, "body"), name, of, Point(terms)))
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
    angular = isinstance(part, Link) and part.angular
    of_stroke, of_velocity, of_force = OF_ANGULAR_LINK if angular else OF_LINK
    stroke, velocity = prefixed(part.name, "stroke"), prefixed(part.name, "damper_velocity")
    what = f"{'angle' if angular else 'deflection'}{f' of {part.name}' if part.name else ''}, extension positive"
    channels = [
        (Channel(stroke, of_stroke, part.name, what), _deflection(part, "position")),
        (Channel(velocity, of_velocity, part.name, f"rate of the {what}"), _deflection(part, "rate")),
    ]
    for element in part.elements:
        name = prefixed(part.name, element.name)
        effect = "moment" if angular else "force"
        words = f"{effect} of {name}{_share(element, part)}, positive where it resists extension"
        force = Point({f"force:{name}": 1.0 / element.count})  # the force of one of several equal laws
        channels.append((Channel(f"{name}_force", of_force, name, words), force))
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


def ride_metrics_of(frame: Frame, channels: Sequence[Channel]) -> tuple[Metric, ...]:
    """The ride metrics, in groups: bodies and places, suspensions, tyres."""
    return (*_of_bodies(frame, channels), *_metrics_of_elements(frame), *_of_tyres(frame))


def _of_bodies(frame: Frame, channels: Sequence[Channel]) -> list[Metric]:
    """Accelerations of the bodies that are not wheels and of the places, unweighted and weighted by ISO 2631-1.

    Displacements and angles of these bodies, from the static equilibrium.
    """
    on_wheels = {name for wheel in frame.wheels for name in wheel.point.terms}
    main = frame.main_body.name
    bodies = {body.name for body in frame.bodies if body.name == main or on_wheels.isdisjoint(body.masses)}
    places = bodies | {place.name for place in frame.places}
    metrics: list[Metric] = []
    for c in channels:
        if c.kind.weighting is not None and c.place in places:
            metrics += [
                Metric(c.name, "rms"),
                Metric(c.name, "peak"),
                Metric(c.name, "rms", c.kind.weighting, name=f"weighted_rms_{c.name}"),
                Metric(c.name, "vibration_dose_value", c.kind.weighting, name=f"vibration_dose_value_{c.name}"),
            ]
    for c in channels:
        if c.place in bodies and c.kind in (ChannelKind.HEIGHT, ChannelKind.ANGLE):
            word = f"{c.place}_displacement" if c.kind is ChannelKind.HEIGHT else f"{c.name}_angle"
            metrics += [Metric(c.name, s, from_rest=True, name=f"{s}_{word}") for s in ("rms", "peak")]
    return metrics


def _metrics_of_elements(frame: Frame) -> list[Metric]:
    """Working space and velocity of every link with laws, and the power that each law dissipates."""
    metrics: list[Metric] = []
    parts: list[Link | Wheel] = [*frame.links, *frame.wheels]
    for part in parts:
        stroke, velocity = prefixed(part.name, "stroke"), prefixed(part.name, "damper_velocity")
        if part.elements:
            space = prefixed(part.name, "working_space")
            metrics += [
                Metric(stroke, "standard_deviation", name=f"{space}_rms"),
                Metric(stroke, "mean", from_rest=True, name=f"{space}_mean"),
                Metric(stroke, "peak_to_peak", name=f"{space}_peak_to_peak"),
                Metric(velocity, "peak"),
            ]
        for element in part.elements:
            name = prefixed(part.name, element.name)
            power = f"{name}_dissipated_power"
            metrics.append(Metric(f"{name}_force", "dissipated_power", by=velocity, name=power))
    return metrics


def _of_tyres(frame: Frame) -> list[Metric]:
    """Variation of the tyre loads, and the fraction of time in which a wheel is lifted off."""
    metrics: list[Metric] = []
    for wheel in frame.wheels:
        load, relative = prefixed(wheel.name, "dynamic_tyre_load"), prefixed(wheel.name, "relative_tyre_load")
        coefficient = prefixed(wheel.name, "dynamic_load_coefficient")
        metrics += [Metric(load, "rms"), Metric(relative, "standard_deviation", name=coefficient)]
        of_load = (STATISTICS["road_stress_factor"], LIFT_OFF_FRACTIONS[wheel.lifts])
        metrics += [Metric(relative, statistic, name=prefixed(wheel.name, statistic.name)) for statistic in of_load]
    return metrics
