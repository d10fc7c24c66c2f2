"""One polynomial over the whole range of velocities."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike, Vector, VectorLike
from jaxdamp.dampers.base import AbstractMemoryless
from jaxdamp.parameters import around_zero, as_float, parameter, setting


@final
class Polynomial(AbstractMemoryless):
    """F = Σⱼ aⱼ vʲ, j = 1 … n, inside a given range of velocities; outside along the tangents at its ends.

    A polynomial is not valid outside the data it was fitted to; the tangents prevent extreme values there. Whether it
    is passive depends on its coefficients.

    Arguments:
        coefficients: a₁ … aₙ, contributions to the force [N] at 1 m/s, shape (n,).
        velocity_range: lowest and highest velocity [m/s] where the polynomial is valid.

    >>> law = Polynomial(coefficients=[1500.0, 200.0, -300.0], velocity_range=(-1.0, 1.0))
    >>> round(float(law.force_velocity(0.5)), 6), round(float(law.force_velocity(2.0)), 6)
    (762.5, 2400.0)
    """

    coefficients: Vector = parameter("N", "contributions to the force at 1 m/s, by power", linear=True)
    velocity_range: Vector = setting("m/s", "range where the polynomial is valid", around_zero)

    def __init__(
        self,
        coefficients: VectorLike,
        velocity_range: VectorLike = (-2.0, 2.0),
    ) -> None:
        self.coefficients = as_float(coefficients)
        self.velocity_range = as_float(velocity_range)

    def __check_init__(self) -> None:
        if self.coefficients.ndim != 1 or self.coefficients.size == 0:
            _checks.refuse("coefficients", "be a₁ … aₙ in one dimension", f"of shape {self.coefficients.shape}")

    def force_velocity(self, v: ScalarLike) -> Scalar:
        """Force [N] at velocity v [m/s]."""
        inside = within(v, self.velocity_range[0], self.velocity_range[1])
        ascending = jnp.concatenate([jnp.zeros(1, self.coefficients.dtype), self.coefficients])
        value = jnp.polyval(ascending[::-1], inside)
        slope = jnp.polyval((ascending[1:] * jnp.arange(1.0, ascending.size))[::-1], inside)
        return value + slope * (v - inside)

    @classmethod
    def guess(cls, velocity: np.ndarray, force: np.ndarray, degree: int = 5) -> "Polynomial":
        """Coefficients from measured data by least squares; the range is that of the data."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        scale = np.abs(velocity).max()
        powers = np.stack([(velocity / scale) ** j for j in range(1, degree + 1)], axis=1)
        scaled = np.linalg.lstsq(powers, force, rcond=None)[0]
        reach = (min(float(velocity.min()), 0.0), max(float(velocity.max()), 0.0))
        return cls(scaled / scale ** np.arange(1, degree + 1), reach)
