"""The force as a smooth surface over velocity and acceleration, fitted to data."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Matrix, Number, Scalar, ScalarLike, State, Vector
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._steps import follow
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.force_surface import (
    CONSENT,
    Axis,
    around_zero_range,
    check_surface,
    surface_force,
    surface_least_squares,
)
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

    The loops of shock absorbers widen with frequency, because oil and hoses are compressible: at the same velocity the
    force differs between acceleration and deceleration. Duym and Schoukens (1996) therefore use a surface over velocity
    and acceleration. A law gets the velocity only; a washout filter computes the acceleration from it, delayed by τ.
    One state, the filtered velocity s [m/s]; its step is exact for a velocity linear over the step.

    A force with a lag τ_F has a slope ∂F/∂a ≈ −τ_F ∂F/∂v. Unless τ ≥ τ_F, such a surface adds energy to the motion
    above 1/(2π √(τ (τ_F − τ))), 82 Hz for 4 ms and 1.5 ms, and the mass it is connected to must exceed −∂F/∂a. A
    surface is not necessarily passive: check the dissipated energy before you use it in a vehicle. Outside its data it
    behaves as `ForceSurface`. The law starts at rest: a motion that does not start at rest begins with a very large
    acceleration.

    Arguments:
        coefficients: Cᵢⱼ [N], shape (velocity degree + 1, acceleration degree + 1).
        velocity_range: lowest and highest velocity [m/s] covered, around zero.
        acceleration_range: lowest and highest washed-out acceleration [m/s²] covered, around zero.
        outside_rate: slope over the velocity [N s/m] outside its range, for `outside="hold"`.
        washout_time: τ [s], one or two milliseconds: longer delays the acceleration, shorter passes noise.
        outside: `"nan"` or `"hold"`.

    Raises:
        ValueError: coefficients that are not a matrix, ranges without a width, an unknown `outside`; a known velocity
            or acceleration outside the ranges.

    >>> law = AccelerationSurface([[0.0, -10.0], [1000.0, 0.0]], (-0.5, 0.5), (-40.0, 40.0), washout_time=0.002)
    >>> round(float(law.force(0.0, 0.25, jnp.array([0.21]))), 6)  # 1000 · 0.5 − 10 · 20/40
    495.0
    """

    coefficients: Matrix = parameter(
        "N", "Cᵢⱼ, weights of Tᵢ(velocity) Tⱼ(acceleration)", linear=True, adjustable=False
    )
    velocity_range: Vector = setting("m/s", "velocities covered by data", around_zero)
    acceleration_range: Vector = setting("m/s²", "accelerations covered by data", around_zero)
    outside_rate: Number = setting("N s/m", "slope over the velocity outside its range", nonnegative, default=0.0)
    washout_time: Number = setting("s", "τ, time constant of the washout", positive, default=WASHOUT_TIME)
    outside: str = eqx.field(static=True, default="nan")

    def traits(self) -> Traits:
        """Linear in the coefficients, as the state does not depend on them."""
        return Traits(linear_in_parameters=True, stroke_dependent_at_rest=False, contains_offset=True)

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
        return f"AccelerationSurface is valid for {velocity.words()}, {acceleration.words()}. {CONSENT}"

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
        """Least squares fit to samples in the order of time, as `ForceSurface.guess`.

        Arguments:
            velocity: velocities [m/s], shape (samples,).
            force: forces [N], shape (samples,).
            time: times [s], shape (samples,); one record after the other, each with its own start time.
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
