"""Yielding elements in parallel with a concave viscous force: magnetorheological and other friction dampers."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import final

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._elementary import power
from jaxdamp._limits import within
from jaxdamp._types import Number, Scalar, ScalarLike, State, Vector
from jaxdamp.dampers._guesses import sliding_fit
from jaxdamp.dampers._plainer import sliding
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import travels
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.dahl import Dahl
from jaxdamp.dampers.play import dead_zone
from jaxdamp.parameters import interval, nonnegative, parameter, positive


def element_force(
    deflection: ScalarLike, sliding_force: ScalarLike, travel: ScalarLike, clearance: ScalarLike
) -> Scalar:
    """Y dz(d, δ)/e [N], a spring behind a clearance; ±Y at the largest deflection δ + e."""
    return sliding_force * dead_zone(deflection, clearance) / travel


def element_step(deflection: ScalarLike, travel: ScalarLike, periods: ScalarLike, limit: ScalarLike) -> Scalar:
    """Deflection [m] after a travel [m] in one direction that took so many relaxation times, within ± the limit [m]."""
    grown = jnp.where(periods > 1e-6, -jnp.expm1(-periods) / jnp.where(periods > 1e-6, periods, 1.0), 1.0)
    return within(deflection * jnp.exp(-periods) + travel * grown, -limit, limit)


class AbstractViscoPlastic(AbstractDamper):
    """A yield curve of Herschel and Bulkley beside yielding elements, whose relaxation derived classes define.

    F = F_y tanh(v/v_f) + K |v|ⁿ sgn v + Σ Yᵢ dz(dᵢ, δᵢ)/eᵢ, with the deflections dᵢ [m] within ±(δᵢ + eᵢ) as states.
    """

    yield_force: Number = parameter("N", "F_y, yield force that follows the velocity at once", nonnegative, linear=True)
    viscous_force: Number = parameter("N", "K, viscous force at 1 m/s", nonnegative, linear=True)
    exponent: Number = parameter("", "n, exponent of the viscous force", interval(0.1, 2.0), adjustable=False)
    flow_velocity: Number = parameter("m/s", "v_f, velocity over which the flow begins", positive, adjustable=False)
    sliding_forces: Vector = parameter(
        "N", "Yᵢ, sliding force of each element", positive, linear=True, adjustable=False
    )
    elastic_travels: Vector = parameter("m", "eᵢ, travel that loads each element", positive, adjustable=False)
    clearances: Vector = parameter("m", "δᵢ, half the free travel of each element", nonnegative, adjustable=False)
    relaxation_times: Vector = parameter(
        "s", "τᵢ, time in which the force of each element decays at rest", positive, adjustable=False
    )
    asymmetry: Number = parameter("", "a, force in compression relative to rebound", positive, default=1.0)

    def __check_init__(self) -> None:
        shapes = [jnp.shape(a) for a in (self.sliding_forces, self.elastic_travels, self.clearances)]
        shapes.append(jnp.shape(self.relaxation_times))
        if len(set(shapes)) > 1 or not shapes[0][0]:
            must = "be as long as `elastic_travels`, `clearances` and `relaxation_times`, one number for each element"
            _checks.refuse("sliding_forces", must, f"of shapes {shapes}")

    def traits(self) -> Traits:
        """No force at rest; the deflections have a kink where an element begins to slide."""
        return Traits(stroke_dependent_at_rest=False)

    def initial_state(self) -> State:
        """No deflections."""
        return jnp.zeros(jnp.shape(self.sliding_forces))

    def _sided(self, side: ScalarLike, force: Scalar) -> Scalar:
        return jnp.where(side >= 0, force, self.asymmetry * force)

    def _deflections(self, state: State) -> State:
        return jnp.stack(own_states(self, state, self.sliding_forces.size))

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x
        deflections = self._deflections(state)
        width = self.flow_velocity  # over which |v| is rounded: K v (v² + v_f²)^((n−1)/2)
        flow = self.yield_force * jnp.tanh(v / width)
        flow = flow + self.viscous_force * v * power(v * v + width * width, 0.5 * (self.exponent - 1.0))
        elements = jax.vmap(element_force)(deflections, self.sliding_forces, self.elastic_travels, self.clearances)
        return self._sided(v, flow) + jnp.sum(jax.vmap(self._sided)(deflections, elements))

    @abstractmethod
    def relaxation_rates(self, deflections: State) -> State:
        """Rates [m/s] at which the deflections [m] decrease at rest."""

    @abstractmethod
    def steps(self, deflections: State, travel: ScalarLike, duration: ScalarLike) -> State:
        """The deflections [m] after a travel [m] in one direction over a time [s]."""

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the deflections [m/s], zero while an element slides."""
        del x
        deflections = self._deflections(state)
        rate = v - self.relaxation_rates(deflections)
        slides = (jnp.abs(deflections) >= self.clearances + self.elastic_travels) & (deflections * rate > 0)
        return jnp.where(slides, 0.0, rate)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Exact for a constant velocity before and after a reversal."""
        del x0, x1
        state = self._deflections(state)
        before, after = travels(v0, v1, dt)
        reversed_at = jnp.where(v0 * v1 < 0, v0 / jnp.where(v0 * v1 < 0, v0 - v1, 1.0), 0.0)
        for travel, share in ((before, reversed_at), (after, 1.0 - reversed_at)):
            state = self.steps(state, travel, share * dt)
        return state

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "AbstractViscoPlastic":
        """Start values from measured data: sliding force at once, after 0.1 mm, and after a clearance.

        The viscous force is that at the highest velocities, for n = 0.5.
        """
        rate, level, _ = sliding_fit(velocity, force)
        fastest = float(np.max(np.abs(velocity)))
        viscous = rate * fastest**0.5
        return cls(
            0.3 * level, viscous, 0.5, 0.1 * fastest, [0.3 * level, 0.5 * level], [1e-4] * 2, [0.0, 1.5e-4], [1.0] * 2
        )


@final
class ViscoPlastic(AbstractViscoPlastic):
    """F = F_y tanh(v/v_f) + K |v|ⁿ sgn v + Σ Yᵢ dz(dᵢ, δᵢ)/eᵢ, ḋᵢ = v − dᵢ/τᵢ within ±(δᵢ + eᵢ).

    The first two terms are the yield curve of Herschel and Bulkley (1926), concave for n < 1, rounded over the flow
    velocity v_f; they follow the velocity at once. Each element beside them is a spring that yields: after a reversal
    it is unloaded, is free over its clearance 2 δᵢ, is loaded over eᵢ, and then slides with Yᵢ (the element of Prandtl
    and Iwan, with a clearance). At rest its force decays with the relaxation time τᵢ. In compression, all forces are
    multiplied by an asymmetry a. Passive for any parameters.

    In records of a magnetorheological damper the force falls at every reversal to a shelf over 0.2 to 0.3 mm and then
    jumps to its plateau: one element without and one with clearance (`notebooks/magnetorheological.ipynb`). A gas
    force or an offset of the load cell stands beside it: `ViscoPlastic(...) + Spring(...)`.

    States: the deflections dᵢ [m]. The step is exact for steady motion, reversals included, second order in general,
    and stable for any stiffness Yᵢ/eᵢ.

    Arguments:
        yield_force: F_y [N].
        viscous_force: K [N] at 1 m/s.
        exponent: n.
        flow_velocity: v_f [m/s].
        sliding_forces: Yᵢ [N], shape (elements,).
        elastic_travels: eᵢ [m], shape (elements,).
        clearances: δᵢ [m], shape (elements,).
        relaxation_times: τᵢ [s], shape (elements,).
        asymmetry: a, force in compression relative to rebound.

    Raises:
        ValueError: elements whose four vectors are not of equal length.

    >>> import jax.numpy as jnp
    >>> law = ViscoPlastic(200.0, 500.0, 0.5, 0.005, [300.0], [1e-4], [1e-4], [1.0])
    >>> [round(float(law.force(0.0, 0.0, jnp.array([deflection]))), 6) for deflection in (5e-5, 1.5e-4, -2e-4)]
    [0.0, 150.0, -300.0]
    """

    def relaxation_rates(self, deflections: State) -> State:
        """dᵢ/τᵢ [m/s]."""
        return deflections / self.relaxation_times

    def steps(self, deflections: State, travel: ScalarLike, duration: ScalarLike) -> State:
        """Exact for a constant velocity."""
        periods, limit = duration / self.relaxation_times, self.clearances + self.elastic_travels
        return jax.vmap(element_step, (0, None, 0, 0))(deflections, travel, periods, limit)

    def plainer(self, undetermined: Sequence[str], fastest: float) -> AbstractDamper:
        """One element in place of all, which gives from the start, beside a viscous force."""
        del undetermined
        forces, travels = np.asarray(self.sliding_forces), np.asarray(self.elastic_travels)
        elastic = Dahl((forces / travels).sum(), forces.sum())
        rate = float(self.viscous_force) * fastest ** (float(self.exponent) - 1.0)
        return sliding(rate, self.yield_force, self.flow_velocity, elastic, fastest)
