"""Any law in series with a clearance: a worn ball joint, a loose rod end, a void in the oil."""

from abc import abstractmethod
from collections.abc import Callable
from typing import final

import jax.numpy as jnp

from jaxdamp._field_types import check_field_types
from jaxdamp._limits import within
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.dampers._series import AbstractSeries, Deflections, require_feed_through
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import nonnegative, parameter, positive


TRACE = 1e-12  # of the stiffness, in the clearance at rest


def dead_zone(deflection: ScalarLike, clearance: ScalarLike) -> Scalar:
    """max(x_s − δ, 0) − max(−x_s − δ, 0) [m], the part of a deflection beyond a clearance of ±δ."""
    return deflection - within(deflection, -clearance, clearance)


class AbstractClearance(AbstractSeries):
    """A law in series with a spring that has a clearance, F = k dz(x_s, δ)."""

    @abstractmethod
    def contact(self) -> tuple[ScalarLike, ScalarLike]:
        """Stiffness k [N/m] and clearance δ [m]."""

    def traits(self) -> Traits:
        """The states have a kink where the clearance ends, and so the stroke since a reversal matters."""
        return super().traits()._replace(extrapolable_states=False, stroke_dependent=True)

    def spring_force(self, deflections: Deflections) -> Scalar:
        """Force [N] of the spring behind its clearance."""
        stiffness, clearance = self.contact()
        return stiffness * dead_zone(deflections[0], clearance)

    def force_at_rest(self, total: Scalar) -> Scalar:
        """Force [N] of the spring, and a trace of it in the clearance, so that the middle is where nothing pulls."""
        stiffness, _ = self.contact()
        return self.spring_force((total,)) + TRACE * stiffness * total

    def spring_in_stage(
        self, law_force: Callable[[Scalar], Scalar], free: Scalar, duration: ScalarLike
    ) -> Callable[[Deflections], Scalar]:
        """Force [N] on the side of the clearance, or inside it, on which the stage ends.

        At the kinks a stiff contact looks like a root to Newton's method; the law's force there tells the side.
        """
        stiffness, clearance = self.contact()
        extended = law_force((free - clearance) / duration) > 0
        compressed = law_force((free + clearance) / duration) < 0
        gap = jnp.where(extended, clearance, -clearance)
        return lambda deflections: jnp.where(extended | compressed, stiffness * (deflections[0] - gap), 0.0)

    def largest_deflection(self, force: Scalar, begun: Deflections) -> Scalar:
        """Clearance and deflection [m] of the spring."""
        del begun
        stiffness, clearance = self.contact()
        return clearance + force / stiffness


@final
class Play(AbstractClearance):
    """F = k dz(x_s, δ) = F_law(v_d), x = x_d + x_s: any law behind a spring with a clearance of ±δ.

    After a reversal the force falls to zero, stays there over a travel of 2 δ, in which the law does not move, and
    rises with the stiffness k of the contact. Causes are worn or loose joints, rod ends and top mounts, and voids in
    the oil of a damper. A law that acts across the clearance stands beside it: `Play(law, ...) + Linear(...)`.

    State: the deflection x_s [m] of clearance and spring together, then the states of the law. The step is that of
    `SeriesSpring`, stable for any k and step, and passive if the law is. The force has a kink at ±δ; everywhere else it
    is differentiable, also by δ. A law whose force is a state only (`Lag`, `MonoTube`) needs one beside it that resists
    velocity: `Play(law + Linear(...), ...)`.

    Raises:
        ValueError: a law whose force does not depend directly on the velocity.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.dampers import Linear
    >>> law = Play(Linear(2000.0), stiffness=1e6, clearance=2e-4)
    >>> [round(float(law.force(0.0, 0.0, jnp.array([deflection]))), 6) for deflection in (1.5e-4, 7e-4, -7e-4)]
    [0.0, 500.0, -500.0]
    """

    law: AbstractDamper
    stiffness: Number = parameter("N/m", "k, stiffness of the contact", positive, adjustable=False)
    clearance: Number = parameter("m", "δ, half the free travel", nonnegative, adjustable=False)

    def __check_init__(self) -> None:
        check_field_types(self)
        require_feed_through("law", self.law, "Play")

    def contact(self) -> tuple[ScalarLike, ScalarLike]:
        """Stiffness k [N/m] and clearance δ [m]."""
        return self.stiffness, self.clearance
