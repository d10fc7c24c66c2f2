"""What each channel of a vehicle is, in words, with its positive direction and the parts that it is of."""

from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Body, Element, Link, Wheel, prefixed


def descriptions_of(frame: Frame) -> dict[str, str]:
    """A description of each channel, by name, in the order of the units."""
    found: dict[str, str] = {}
    for body in frame.bodies:
        found |= _of_body(body)
    for place in frame.places:
        found[f"z_{place.name}"] = f"height of {place.name} on {place.body}, up"
        found[f"{place.name}_acceleration"] = f"acceleration of {place.name} on {place.body}, up"
    parts: list[Link | Wheel] = [*frame.links, *frame.wheels]
    for part in parts:
        where = f" of {part.name}" if part.name else ""
        if part.elements:
            found[prefixed(part.name, "stroke")] = f"deflection{where}, extension positive"
            found[prefixed(part.name, "damper_velocity")] = f"rate of the deflection{where}, extension positive"
        for element in part.elements:
            name = prefixed(part.name, element.name)
            found[f"{name}_force"] = f"force of {name}{_share(element, part)}, positive where it resists extension"
    for wheel in frame.wheels:
        where, of = (f" under {wheel.name}" if wheel.name else ""), _together(wheel)
        found[f"z_{prefixed(wheel.name, 'road')}"] = f"height of the road{where}, up"
        found[prefixed(wheel.name, "dynamic_tyre_load")] = f"load{where} less the static load{of}, more load positive"
        found[prefixed(wheel.name, "relative_tyre_load")] = f"load{where} less the static load, over the static load"
    return found


def _of_body(body: Body) -> dict[str, str]:
    found = {
        f"z_{body.name}": f"height of {body.name}, up, from where the linear springs carry the weight on level ground",
        f"{body.name}_acceleration": f"acceleration of {body.name}, up",
    }
    for turn in body.turns:
        angle, sense = body.angle(turn.axis), {"pitch": "nose up", "roll": "left side up"}[turn.axis]
        found[angle] = f"{turn.axis} angle of {body.name}, {sense}"
        found[f"{angle}_acceleration"] = f"{turn.axis} acceleration of {body.name}, {sense}"
    return found


def _share(element: Element, part: Link | Wheel) -> str:
    """Of how many laws a force is."""
    return f", one of {element.count} alike that act together" if element.count > 1 else _together(part)


def _together(part: Link | Wheel) -> str:
    return f", {'both' if part.sides == 2 else part.sides} sides together" if part.sides > 1 else ""
