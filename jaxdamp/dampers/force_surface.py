"""The force as a smooth surface over stroke and velocity, fitted to data."""

from typing import final

import equinox as eqx
import numpy as np

from jaxdamp._types import Matrix, Number, Scalar, ScalarLike, Vector
from jaxdamp.dampers._surface import (
    CONSENT,
    Axis,
    around_zero_range,
    check_surface,
    data_range,
    surface_force,
    surface_least_squares,
)
from jaxdamp.dampers.base import AbstractStateless
from jaxdamp.dampers.traits import Traits
from jaxdamp.parameters import around_zero, ends, nonnegative, parameter, setting


@final
class ForceSurface(AbstractStateless):
    """F(x, v) = Σ Cᵢⱼ Tᵢ(x̄) Tⱼ(v̄), x̄ and v̄ the stroke and velocity scaled to −1 … 1, Tₖ Chebyshev polynomials.

    The restoring-force surface of Masri and Caughey (1979), for shock absorbers by Surace, Worden and Tomlinson (1992).
    It describes forces that depend on the present stroke and velocity: gas, springs, stroke-dependent valves. It cannot
    describe hysteresis loops that widen with frequency; use `AccelerationSurface` for these. A surface is not
    necessarily passive: check the dissipated energy before you use it in a vehicle.

    Polynomials are not valid outside their data. Outside the ranges the force is therefore NaN, which `respond`,
    `simulate` and `fit` refuse with a message; called with plain numbers, the law raises an error. With
    `outside="hold"` the law uses the values of the nearest edge there, plus `outside_rate` times the velocity beyond
    it.

    Arguments:
        coefficients: Cᵢⱼ [N], shape (stroke degree + 1, velocity degree + 1).
        stroke_range: lowest and highest stroke [m] covered.
        velocity_range: lowest and highest velocity [m/s] covered, around zero.
        outside_rate: slope over the velocity [N s/m] outside its range, for `outside="hold"`.
        outside: `"nan"` or `"hold"`.

    Raises:
        ValueError: coefficients that are not a matrix, ranges without a width, an unknown `outside`; a known stroke or
            velocity outside the ranges.

    >>> law = ForceSurface([[0.0, 1000.0], [0.0, 200.0]], stroke_range=(-0.05, 0.05), velocity_range=(-0.5, 0.5))
    >>> round(float(law.force_stroke_velocity(0.025, 0.25)), 6)  # 1000 · 0.5 + 200 · 0.5 · 0.5
    550.0
    """

    coefficients: Matrix = parameter("N", "Cᵢⱼ, weights of Tᵢ(stroke) Tⱼ(velocity)", linear=True, adjustable=False)
    stroke_range: Vector = setting("m", "strokes covered by data", ends)
    velocity_range: Vector = setting("m/s", "velocities covered by data", around_zero)
    outside_rate: Number = setting("N s/m", "slope over the velocity outside its range", nonnegative, default=0.0)
    outside: str = eqx.field(static=True, default="nan")

    def __check_init__(self) -> None:
        check_surface(self.coefficients, self.outside)

    def traits(self) -> Traits:
        """The first coefficient is an offset."""
        return super().traits()._replace(contains_offset=True)

    def force_stroke_velocity(self, x: ScalarLike, v: ScalarLike) -> Scalar:
        """Force [N] at stroke x [m] and velocity v [m/s]."""
        stroke, velocity = self._axes(x, v)
        return surface_force(self.coefficients, stroke, velocity, self.outside) + self.outside_rate * velocity.beyond()

    def validity(self) -> str:
        """The ranges in words."""
        stroke, velocity = self._axes(0.0, 0.0)
        return f"ForceSurface is valid for {stroke.words()}, {velocity.words()}. {CONSENT}"

    def _axes(self, x: ScalarLike, v: ScalarLike) -> tuple[Axis, Axis]:
        return Axis("x", "m", x, self.stroke_range), Axis("v", "m/s", v, self.velocity_range)

    @classmethod
    def guess(
        cls,
        velocity: np.ndarray,
        force: np.ndarray,
        stroke: np.ndarray,
        degrees: tuple[int, int] = (3, 7),
        ridge: float | int | None = None,
        outside: str = "nan",
    ) -> "ForceSurface":
        """Least squares fit to samples, over the ranges of the data extended by 1 %.

        A `RankWarning` states how many combinations of coefficients the samples do not determine: the samples of a
        single sine are on one ellipse, which determines 2 (m + n) of the (m + 1)(n + 1) combinations (m, n ≥ 1).

        Arguments:
            velocity: velocities [m/s], shape (samples,).
            force: forces [N], shape (samples,).
            stroke: strokes [m], shape (samples,).
            degrees: highest degree over stroke and over velocity.
            ridge: λ of the ridge term λ ‖C‖², relative to the largest singular value squared; by default that of
                smallest generalised cross-validation. `fit` has no ridge term.
            outside: as for the law; `outside_rate` is Σ F v / Σ v² of the data.
        """
        velocity, force, stroke = (np.asarray(a, dtype=float) for a in (velocity, force, stroke))
        reaches = data_range("stroke", stroke), around_zero_range("velocity", velocity)
        coefficients = surface_least_squares(stroke, velocity, force, reaches, degrees, ridge)
        viscous = max(float(force @ velocity / (velocity @ velocity)), 0.0)
        return cls(coefficients, *reaches, viscous, outside)
