"""The force as a smooth surface over velocity and acceleration, taken from data."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Matrix, Number, Scalar, ScalarLike, State, Vector
from jaxdamp.dampers._first_order import follow
from jaxdamp.dampers._surface import (
    CONSENT,
    Axis,
    around_zero_range,
    check_surface,
    surface_force,
    surface_least_squares,
)
from jaxdamp.dampers.base import AbstractDamper, own_states
from jaxdamp.dampers.traits import Traits
from jaxdamp.parameters import around_zero, nonnegative, parameter, positive, setting


WASHOUT_TIME = 1.5e-3  # s


def washed_acceleration(time: np.ndarray, velocity: np.ndarray, washout_time: float | int = WASHOUT_TIME) -> np.ndarray:
    """The law's acceleration (v − s)/τ [m/s²] under velocities, zero wherever the time falls back to a new record."""
    steps = np.diff(time)

    def step(slow: jax.Array, ends: tuple[jax.Array, ...]) -> tuple[jax.Array, jax.Array]:
        before, after, dt = ends
        slow = jnp.where(dt > 0, follow(slow, before, after, jnp.where(dt > 0, dt, 1.0), washout_time), after)
        return slow, slow

    v = jnp.asarray(velocity)
    _, slow = jax.lax.scan(step, v[0], (v[:-1], v[1:], jnp.asarray(steps)))
    return (velocity - np.concatenate([velocity[:1], np.asarray(slow)])) / washout_time


@final
class AccelerationSurface(AbstractDamper):
    """F(v, a) = Σ Cᵢⱼ Tᵢ(v̄) Tⱼ(ā), a = (v − s)/τ, τ ṡ + s = v, v̄ and ā scaled to −1 … 1, Tₖ Chebyshev polynomials.

    The loops of shock absorbers open with frequency, because oil and hoses give way: at one velocity the force
    differs between speeding up and slowing down. So Duym and Schoukens (1996) lay the surface over velocity and
    acceleration. A law receives the velocity only; a washout makes the acceleration from it, late by τ. One state, the
    washed-out velocity s [m/s]; its step is exact for a velocity linear over the step.

    A force that lags by τ_F has a slope ∂F/∂a ≈ −τ_F ∂F/∂v. Unless τ ≥ τ_F, such a surface drives the motion above
    1/(2π √(τ (τ_F − τ))), 82 Hz for 4 ms and 1.5 ms, and the mass it is connected to must exceed −∂F/∂a. Nothing makes
    a surface passive: look at its work before it goes into a vehicle. Outside its data it refuses or holds as
    `ForceSurface` does. The law starts at rest: a motion that does not begins with an acceleration outside any data.

    Arguments:
        coefficients: Cᵢⱼ [N], shape (velocity degree + 1, acceleration degree + 1).
        velocity_range: lowest and highest velocity [m/s] covered, around zero.
        acceleration_range: lowest and highest washed-out acceleration [m/s²] covered, around zero.
        outside_rate: slope over the velocity [N s/m] outside its range, for `outside="hold"`.
        washout_time: τ [s], a millisecond or two: longer makes the acceleration late, shorter lets noise through.
        outside: `"nan"` or `"hold"`.

    Raises:
        ValueError: coefficients that are no grid, ranges without a width, an unknown word; a known velocity or
            acceleration outside the ranges.

    >>> law = AccelerationSurface([[0.0, -10.0], [1000.0, 0.0]], (-0.5, 0.5), (-40.0, 40.0), washout_time=0.002)
    >>> round(float(law.force(0.0, 0.25, jnp.array([0.21]))), 6)  # 1000 · 0.5 − 10 · 20/40
    495.0
    """

    coefficients: Matrix = parameter("N", "Cᵢⱼ, weights of Tᵢ(velocity) Tⱼ(acceleration)", linear=True)
    velocity_range: Vector = setting("m/s", "velocities covered by data", around_zero)
    acceleration_range: Vector = setting("m/s²", "accelerations covered by data", around_zero)
    outside_rate: Number = setting("N s/m", "slope over the velocity outside its range", nonnegative, default=0.0)
    washout_time: Number = setting("s", "τ, time constant of the washout", positive, default=WASHOUT_TIME)
    outside: str = eqx.field(static=True, default="nan")

    def traits(self) -> Traits:
        """Linear in the coefficients, as the state does not depend on them."""
        return Traits(linear_in_parameters=True, stroke_dependent_at_rest=False)

    def __check_init__(self) -> None:
        check_surface(self.coefficients, self.outside)

    def initial_state(self) -> State:
        """No velocity."""
        return jnp.zeros(1)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x
        (slow,) = own_states(self, state, 1)
        velocity, acceleration = self._axes(v, (v - slow) / self.washout_time)
        held = surface_force(self.coefficients, velocity, acceleration, self.outside)
        return held + self.outside_rate * velocity.beyond()

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """The washed-out acceleration [m/s²]."""
        del x
        (slow,) = own_states(self, state, 1)
        return jnp.stack([(v - slow) / self.washout_time])

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Exact for a velocity linear over the step."""
        del x0, x1
        (slow,) = own_states(self, state, 1)
        return jnp.stack([follow(slow, v0, v1, dt, self.washout_time)])

    def validity(self) -> str:
        """The ranges in words."""
        velocity, acceleration = self._axes(0.0, 0.0)
        return f"AccelerationSurface holds for {velocity.words()}, {acceleration.words()}. {CONSENT}"

    def _axes(self, v: ScalarLike, a: ScalarLike) -> tuple[Axis, Axis]:
        return Axis("v", "m/s", v, self.velocity_range), Axis("acceleration", "m/s²", a, self.acceleration_range)

    @classmethod
    def guess(
        cls,
        velocity: np.ndarray,
        force: np.ndarray,
        time: np.ndarray,
        degrees: tuple[int, int] = (7, 3),
        ridge: float | int | None = None,
        washout_time: float | int = WASHOUT_TIME,
        outside: str = "nan",
    ) -> "AccelerationSurface":
        """The least squares through samples in the order of time, as `ForceSurface.guess` does it.

        Arguments:
            velocity: [m/s], shape (samples,).
            force: [N], shape (samples,).
            time: [s], shape (samples,); one record after the other, the time of each beginning anew.
            degrees: highest degree over velocity and over acceleration.
            ridge: as in `ForceSurface.guess`.
            washout_time: τ [s].
            outside: as for the law; `outside_rate` is Σ F v / Σ v² of the data.
        """
        velocity, force, time = (np.asarray(a, dtype=float) for a in (velocity, force, time))
        acceleration = washed_acceleration(time, velocity, washout_time)
        reaches = around_zero_range("velocity", velocity), around_zero_range("acceleration", acceleration)
        coefficients = surface_least_squares(velocity, acceleration, force, reaches, degrees, ridge)
        viscous = max(float(force @ velocity / (velocity @ velocity)), 0.0)
        return cls(coefficients, *reaches, viscous, washout_time, outside)
