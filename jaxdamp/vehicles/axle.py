"""An axle: a corner on the left, its mirror image on the right, an anti-roll bar between them."""

from typing import Any, final

from jaxdamp._types import Number
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.corner import Corner, suspend
from jaxdamp.vehicles.parts import AbstractPart, Body, Link, Wheel, prefixed


@final
class Axle(AbstractPart):
    """Two corners alike, half a track width left and right of the middle, with an anti-roll bar.

    The bar holds the energy ½ k_R (φ − (z_ul − z_ur)/w)²: it twists by the roll of the body against the line through
    the wheels, and by nothing else.

    Arguments:
        corner: on each side.
        track_width: w [m].
        anti_roll_rate: k_R [N m/rad], moment on the body by angle of roll.
    """

    corner: Corner
    track_width: Number = parameter("m", "distance between the left and the right wheel", positive)
    anti_roll_rate: Number = parameter("N m/rad", "stiffness of the anti-roll bar", nonnegative, default=0.0)


def carry(
    axle: Axle, name: str, body: Body, *, ahead: Any = None, behind: Any = 0.0
) -> tuple[tuple[Body, ...], tuple[Link, ...], tuple[Wheel, ...]]:
    """The parts of an axle under a body that rolls: left corner, right corner, anti-roll bar.

    Arguments:
        axle: the axle.
        name: of its parts, may be empty.
        body: on it.
        ahead: of the centre of gravity [m], on a body that pitches.
        behind: distance behind the front axle [m].
    """
    half = 0.5 * axle.track_width
    sides = [
        suspend(
            axle.corner, prefixed(name, side), body.at(ahead, left), behind=behind, left=left, beside=side == "right"
        )
        for side, left in (("left", half), ("right", -half))
    ]
    (left_wheel, _, _), (right_wheel, _, _) = sides
    line = (left_wheel.at() - right_wheel.at()) * (1.0 / axle.track_width)
    bar = Link(prefixed(name, "anti_roll_bar"), body.roll - line, axle.anti_roll_rate)
    bodies, links, tyres = zip(*sides, strict=True)
    return bodies, (*links, bar), tyres
