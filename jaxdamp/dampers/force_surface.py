"""The force as a smooth surface over stroke and velocity, fitted to data: Chebyshev polynomials of two axes."""

from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._types import Matrix, Number, Scalar, ScalarLike, Vector
from jaxdamp._warned import warn
from jaxdamp.dampers.base import AbstractStateless
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import around_zero, ends, nonnegative, parameter, setting


CONSENT = 'Fit it to records with a larger range, or accept the values of the nearest edge outside, `outside="hold"`.'
MARGIN = 0.01  # of the width of the data, added to the range: averaging and rounding shift samples
THIN = 1e-3  # singular value, relative to the largest, below which errors of the data are amplified a thousand times
RIDGES = np.logspace(-16, 0, 65)  # relative to the largest singular value squared; cross-validation selects one


class Axis(NamedTuple):
    """A coordinate of a surface: its name and unit for messages, its value and the range of the data."""

    name: str
    unit: str
    value: ScalarLike
    reach: Vector

    def held(self) -> Scalar:
        """The value, or the nearest edge."""
        return within(self.value, self.reach[0], self.reach[1])

    def beyond(self) -> Scalar:
        """Distance of the value from the nearest edge; zero inside."""
        return self.value - self.held()

    def covers(self) -> Bool[Array, ""]:
        """Whether the value is inside the range."""
        return (self.value >= self.reach[0]) & (self.value <= self.reach[1])

    def polynomials(self, count: int) -> Float[Array, " _"]:
        """T₀ … of the value scaled to −1 … 1, by Tₖ₊₁ = 2 u Tₖ − Tₖ₋₁: finite slopes at the ends too."""
        low, high = self.reach[0], self.reach[1]
        u = (2.0 * self.held() - high - low) / (high - low)
        terms = [jnp.ones_like(u), u]
        while len(terms) < count:
            terms.append(2.0 * u * terms[-1] - terms[-2])
        return jnp.stack(terms[:count])

    def words(self) -> str:
        """The range in words."""
        return f"{self.name} from {float(self.reach[0]):.4g} to {float(self.reach[1]):.4g} {self.unit}"


def surface_force(coefficients: Float[Array, "_ _"], first: Axis, second: Axis, outside: str) -> Scalar:
    """Σ Cᵢⱼ Tᵢ Tⱼ; outside the ranges NaN, or an error for known values, unless `outside` is "hold"."""
    rows, columns = coefficients.shape
    weights = first.polynomials(rows)[:, None] * second.polynomials(columns)[None, :]
    force = jnp.sum(coefficients * weights)
    if outside == "hold":
        return force
    for axis in (first, second):
        if _checks.concrete(axis.covers()) is not None and not axis.covers():
            _checks.refuse(axis.name, f"lie inside the data, {axis.words()}", axis.value, CONSENT)
    return jnp.where(first.covers() & second.covers(), force, jnp.nan)


def check_surface(coefficients: Array, outside: str) -> None:
    """Refuse coefficients that are not a matrix, and unknown values of `outside`."""
    if coefficients.ndim != 2 or coefficients.size == 0:
        _checks.refuse("coefficients", "have a row and a column for each degree", f"of shape {coefficients.shape}")
    _checks.one_of("outside", outside, ["nan", "hold"])


def data_range(name: str, values: np.ndarray) -> np.ndarray:
    """Lowest and highest value, extended by 1 % of the width."""
    low, high = float(np.min(values)), float(np.max(values))
    if not low < high:
        _checks.refuse(name, "vary", f"{low:g} throughout")
    return np.array([low, high]) + MARGIN * (high - low) * np.array([-1.0, 1.0])


def around_zero_range(name: str, values: np.ndarray) -> np.ndarray:
    """The same, including zero."""
    low, high = data_range(name, values)
    return np.array([min(low, 0.0), max(high, 0.0)])


def surface_least_squares(
    first: np.ndarray,
    second: np.ndarray,
    force: np.ndarray,
    reaches: tuple[np.ndarray, np.ndarray],
    degrees: tuple[int, int],
    ridge: float | int | None,
) -> Float[np.ndarray, "rows columns"]:
    """Coefficients of min ‖A c − F‖² + λ ‖c‖², λ = ridge · (largest singular value of A)².

    By default the ridge is that of smallest generalised cross-validation ‖F − A c‖²/(N − tr H)², H = A (AᵀA + λ)⁻¹ Aᵀ
    (Golub, Heath and Wahba 1979). A warning states how many combinations of coefficients the data do not determine.
    """
    if len(degrees) != 2 or min(degrees) < 0:
        _checks.refuse("degrees", "be two whole numbers, 0 or more", degrees)
    if ridge is not None:
        _checks.nonnegative("ridge", ridge)
    u, w = ((2 * a - r.sum()) / (r[1] - r[0]) for a, r in zip((first, second), reaches, strict=True))
    basis = np.polynomial.chebyshev.chebvander2d(u, w, degrees)
    if len(basis) < basis.shape[1]:
        _checks.refuse("force", f"have at least {basis.shape[1]} samples for these degrees", f"of {len(basis)}")
    left, sizes, right = np.linalg.svd(basis, full_matrices=False)
    projected = left.T @ force
    unexplained = np.sum((force - left @ projected) ** 2)
    shares = sizes / sizes[0]
    thin = int(np.count_nonzero(shares < THIN))
    if thin:
        warn(
            f"The records do not determine {thin} of {len(shares)} combinations of the coefficients of the surface"
            f" (singular values below {THIN:g} of the largest). The samples of a single sine, for example, are on one"
            " ellipse. Add records of other amplitudes and frequencies, or use lower degrees.",
            np.exceptions.RankWarning,
        )

    rounding = len(basis) * np.finfo(float).eps

    def retained(ridge: float | int) -> np.ndarray:
        return np.where(shares > rounding, shares**2 / (shares**2 + ridge), 0.0)

    def cross_validation(ridge: float | int) -> float:
        missed = unexplained + np.sum(((1 - retained(ridge)) * projected) ** 2)
        return float(missed / (len(force) - np.sum(retained(ridge))) ** 2)

    if ridge is None:
        ridge = float(min(RIDGES, key=cross_validation))
    return (right.T @ (retained(ridge) * projected / sizes)).reshape(degrees[0] + 1, degrees[1] + 1)


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
