"""Smooth hysteresis that saturates: the law of Bouc and Wen."""

from collections.abc import Callable, Sequence
from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._elementary import algebraic_sigmoid, power
from jaxdamp._limits import at_least, within
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._guesses import sliding_fit
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import direction
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.dahl import Dahl
from jaxdamp.dampers.linear import Linear
from jaxdamp.parameters import interval, nonnegative, parameter, positive, real


def hysteresis_rate(travel_rate: ScalarLike, z: ScalarLike, shape: ScalarLike, exponent: ScalarLike) -> Scalar:
    """ż [1/s] = u̇ − γ̂ |u̇| z|z|ⁿ⁻¹ − (1 − γ̂) u̇ |z|ⁿ, with the travel u counted in yield displacements."""
    size = jnp.abs(z)
    flat = power(size, exponent - 1.0)
    return travel_rate * (1.0 - (1.0 - shape) * size * flat) - shape * jnp.abs(travel_rate) * z * flat


def _rate_factor(size: ScalarLike, to_the_n: ScalarLike, exponent: ScalarLike) -> Scalar:
    """(1 − wⁿ)/(1 − w²), and its series near w = 1, where the slope of the quotient would be inaccurate."""
    left = 1.0 - size
    near = left < jnp.finfo(jnp.result_type(size)).eps ** 0.25
    series = 0.5 * exponent * (1.0 - (exponent - 2.0) * left * (0.5 - (2.0 * exponent - 5.0) / 12.0 * left))
    inside = jnp.where(near, 0.0, size)
    return jnp.where(near, series, (1.0 - to_the_n) / ((1.0 - inside) * (1.0 + inside)))


def hysteresis_step(travel: ScalarLike, z: ScalarLike, shape: ScalarLike, exponent: ScalarLike) -> Scalar:
    """The state after a travel in one direction, in yield displacements: second order, bounded for any travel.

    With w = z sgn(u̇) the law reads dw/du = 1 + (2γ̂ − 1)|w|ⁿ for w < 0, unloading, and 1 − wⁿ for w > 0, loading. The
    first is never stiff and is integrated by a midpoint step. The second is integrated by w ← (w + t)/(1 + w t),
    t = tanh(r u), r = (1 − wⁿ)/(1 − w²) at the midpoint: exact for n = 2, and w approaches 1 without exceeding it for
    any travel. Up to the midpoint, tanh s is replaced by s/√(1 + s²), which costs less and is equal to second order.

    Powers are the largest cost: for complete unloading the midpoint |w|/2 needs no further power, so there are only
    two.
    """
    sign = direction(travel)
    u, w, curve = sign * travel, sign * z, 2.0 * shape - 1.0
    begin = power(jnp.abs(z), exponent)
    held, loaded = at_least(-w, 0.0), at_least(w, 0.0)

    unloading = held - 0.5 * u * (1.0 + curve * begin)
    stays = unloading > 0.5 * held  # still unloading at the end; otherwise it loads in the other direction
    steep = 1.0 + curve * jnp.where(w < 0, begin * power(0.5, exponent), 0.0)
    left = at_least(u - held / steep, 0.0)
    half = 0.5 * left * _rate_factor(loaded, jnp.where(w > 0, begin, 0.0), exponent)
    t = algebraic_sigmoid(half)
    loading = (loaded + t) / (1.0 + loaded * t)

    midway = power(jnp.where(stays, unloading, loading), exponent)
    steep = jnp.where(stays, 1.0 + curve * midway, steep)
    left = at_least(u - held / steep, 0.0)
    t = jnp.tanh(left * jnp.where(stays, 1.0, _rate_factor(loading, midway, exponent)))
    return sign * ((loaded + t) / (1.0 + loaded * t) - at_least(held - u * steep, 0.0))


def hysteresis_estimate(travel: ScalarLike, z: ScalarLike, shape: ScalarLike, exponent: ScalarLike) -> Scalar:
    """The state after a travel by Heun's method, limited to −1 … 1, for predictions of the force: half the cost.

    Second order, but first order at kinks.
    """

    def moved(z: ScalarLike) -> Scalar:
        to_the_n = power(jnp.abs(z), exponent)
        return travel * jnp.where(travel * z > 0, 1.0 - to_the_n, 1.0 + (2.0 * shape - 1.0) * to_the_n)

    first = moved(z)
    second = moved(within(z + first, -1.0, 1.0))
    return within(z + 0.5 * (first + second), -1.0, 1.0)


@final
class BoucWen(AbstractDamper):
    """F = c₀ v + k₀ x + f₀ + F_y z (Wen 1976), −1 ≤ z ≤ 1: rate-independent hysteresis with a yield force.

    x_y ż = v − γ̂ |v| z|z|ⁿ⁻¹ − (1 − γ̂) v |z|ⁿ. From rest the hysteretic force grows with slope F_y/x_y and saturates
    at ±F_y; a larger n makes the knee sharper; γ̂ shapes the unloading (½: with slope F_y/x_y until z = 0; 1: steeper
    at first). The usual parameters A, β, γ, α are redundant, since they do not fix the scale of z; here z is
    dimensionless, so A = 1/x_y, γ = γ̂/x_y, β = (1 − γ̂)/x_y, α = F_y (`classical`, `from_classical`), and γ ≥ |β|
    holds by construction: the law always dissipates energy. For a spring that is relaxed at x₀, f₀ = −k₀ x₀.

    State: z. The step is second order, bounded and stable for any x_y and any step. In a `SeriesSpring` it needs c₀
    above zero.

    >>> law = BoucWen(viscous_rate=800.0, stiffness=0.0, yield_force=300.0, yield_displacement=1e-3)
    >>> state = law.advance(0.0, 0.1, 0.01, 0.1, law.initial_state(), 0.1)
    >>> round(float(law.force(0.01, 0.1, state)), 3)
    380.0
    """

    viscous_rate: Number = parameter("N s/m", "c₀, viscous damping coefficient", nonnegative)
    stiffness: Number = parameter("N/m", "k₀, parallel stiffness", nonnegative, adjustable=False)
    yield_force: Number = parameter("N", "F_y, hysteretic force when saturated", positive)
    yield_displacement: Number = parameter(
        "m", "x_y, travel from rest to F_y at the first slope", positive, adjustable=False
    )
    shape: Number = parameter(
        "", "γ̂ = γ/(β + γ), shape of the unloading", interval(0.5, 1.0), default=0.75, adjustable=False
    )
    exponent: Number = parameter("", "n, sharpness of the knee", interval(1.0, 20.0), default=2.0, adjustable=False)
    static_force: Number = parameter("N", "f₀, force at rest at stroke zero", real, default=0.0)

    def constant_forces(self) -> tuple[str, ...]:
        """The static force."""
        return ("static_force",)

    def initial_state(self) -> State:
        """No hysteretic force."""
        return jnp.zeros(1)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        (z,) = own_states(self, state, 1)
        return self.viscous_rate * v + self.stiffness * x + self.static_force + self.yield_force * z

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """ż [1/s]."""
        del x
        (z,) = own_states(self, state, 1)
        return hysteresis_rate(v / self.yield_displacement, z, self.shape, self.exponent)[None]

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """One step along the net travel, see `hysteresis_step`; the velocity is taken as linear over the step."""
        del x0, x1
        return self._moved(hysteresis_step, v0, v1, state, dt)

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """An approximation of `advance`, by `hysteresis_estimate`."""
        del x0, x1
        return self._moved(hysteresis_estimate, v0, v1, state, dt)

    def _moved(
        self, step: Callable[..., Scalar], v0: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        (z,) = own_states(self, state, 1)
        travel = 0.5 * dt * (v0 + v1) / self.yield_displacement
        return step(travel, z, self.shape, self.exponent)[None]

    def classical(self) -> dict[str, float]:
        """A, β, γ [1/m], n and α [N] of ż = A v − γ|v|z|z|ⁿ⁻¹ − β v|z|ⁿ, F = … + α z, for the dimensionless z."""
        first = 1.0 / float(self.yield_displacement)
        shape = float(self.shape)
        parts = {"A": first, "beta": (1.0 - shape) * first, "gamma": shape * first}
        return parts | {"n": float(self.exponent), "alpha": float(self.yield_force)}

    @classmethod
    def from_classical(
        cls,
        c0: float,
        k0: float,
        alpha: float,
        A: float,  # the letter of the literature
        beta: float,
        gamma: float,
        n: float,
        x0: float = 0.0,
    ) -> "BoucWen":
        """The law for a parameter set of F = c₀ v + k₀ (x − x₀) + α z with any scale of z (in SI units).

        Only for sets with γ ≥ β ≥ 0.
        """
        largest = (A / (beta + gamma)) ** (1.0 / n)
        return cls(c0, k0, alpha * largest, largest / A, gamma / (beta + gamma), n, -k0 * x0)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray) -> "BoucWen":
        """Start values from measured data: F ≈ c₀ v + F_y sgn v + f₀ at the higher velocities; x_y starts at 1 mm."""
        rate, level, offset = sliding_fit(velocity, force)
        return cls(rate, 0.0, level, 1e-3, static_force=offset)

    def plainer(self, undetermined: Sequence[str], fastest: float) -> AbstractDamper:
        """Friction that gives before it slides, beside a viscous force."""
        del undetermined, fastest
        friction = Dahl(self.yield_force / self.yield_displacement, self.yield_force)
        return Linear(max(float(self.viscous_rate), 1.0)) + friction
