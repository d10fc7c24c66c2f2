"""An axle: a corner on the left, its mirror image on the right, an anti-roll bar between them."""

from typing import Any, final

from jaxdamp._types import Number
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.corner import Corner
from jaxdamp.vehicles.parts import AbstractPart, Body, Link, Parts, prefixed


@final
class Axle(AbstractPart):
    """Two equal corners, half a track width left and right of the middle, with an anti-roll bar.

    The energy of the bar is ½ k_R (φ − (z_ul − z_ur)/w)²: its twist is the roll angle of the body relative to the line
    through the wheels.

    Arguments:
        corner: wheel, suspension and tyre of each side.
        track_width: w [m].
        anti_roll_rate: k_R [N m/rad], moment on the body per roll angle.
    """

    corner: Corner
    track_width: Number = parameter("m", "distance between the left and the right wheel", positive, adjustable=False)
    anti_roll_rate: Number = parameter("N m/rad", "stiffness of the anti-roll bar", nonnegative, default=0.0)

    def parts(self, name: str, body: Body, *, ahead: Any = None, behind: Any = 0.0) -> Parts:
        """Left corner, right corner and anti-roll bar under a body that rolls.

        Arguments:
            name: prefix of the names of the parts, may be empty.
            body: the body above the axle.
            ahead: distance ahead of the centre of gravity [m], for a body that pitches.
            behind: distance behind the front axle [m].
        """
        half = 0.5 * self.track_width
        left, right = (
            self.corner.parts(prefixed(name, side), body.at(ahead, y), behind=behind, left=y, beside=side == "right")
            for side, y in (("left", half), ("right", -half))
        )
        line = (left[0].at() - right[0].at()) * (1.0 / self.track_width)
        bar = Link(prefixed(name, "anti_roll_bar"), body.roll - line, self.anti_roll_rate)
        return (left[0], right[0]), (left[1], right[1], bar), (left[2], right[2])
