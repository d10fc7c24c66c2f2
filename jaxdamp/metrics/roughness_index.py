"""The international roughness index of a road profile, for the whole profile and by segment."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._results import drawn_by
from jaxdamp._tables import Column, Contents, Table
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_signal


# The golden car, per unit of sprung mass: damper [1/s], spring and tyre [1/s^2], unsprung mass [-].
_DAMPER, _SPRING, _TYRE, _UNSPRUNG = 6.0, 63.3, 653.0, 0.15
_SPEED = 80.0 / 3.6  # m/s
_RUN_UP = 11.0  # m, half a second


def golden_car_step(spacing: float) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, " 4"]]:
    """The matrix and the vector that take the golden car over one sample of constant slope.

    The states are the slope z_s' [-] of the body's path and its rate [1/s], then those of the wheel.
    """
    from scipy.linalg import expm

    growth = np.zeros((5, 5))
    growth[:4, :4] = [
        [0.0, 1.0, 0.0, 0.0],
        [-_SPRING, -_DAMPER, _SPRING, _DAMPER],
        [0.0, 0.0, 0.0, 1.0],
        [_SPRING / _UNSPRUNG, _DAMPER / _UNSPRUNG, -(_SPRING + _TYRE) / _UNSPRUNG, -_DAMPER / _UNSPRUNG],
    ]
    growth[3, 4] = _TYRE / _UNSPRUNG
    step = expm(growth * (spacing / _SPEED))
    return step[:4, :4], step[:4, 4]


def international_roughness_index(
    profile: SignalLike, spacing: ScalarLike | int, *, moving_average: float | int = 0.25
) -> Scalar:
    """International roughness index, IRI = (1/L) int |z_s' - z_u'| dx [m/m]; times 1000 in the usual m/km.

    The procedure of the standard: the slopes of the profile over k = max(1, nint(0.25 m/spacing)) samples, which is a
    moving average over about 250 mm and none at spacings above 0.167 m, drive the golden car (damper 6 1/s, spring
    63.3 1/s^2, tyre 653 1/s^2, unsprung mass 0.15, all per sprung mass) at 80 km/h, each for one sample, exactly; at
    the start body and wheel ride at the mean slope of the first 11 m. The index is the mean of |z_s' - z_u'| after each
    sample. A sine of wavelength 1, 2.4, 5, 16 or 50 m gives 2/pi times 0.2731, 1.6640, 1.1697, 1.5367 or 0.1366 times
    its slope amplitude, times sinc(k spacing/w) sinc(spacing/w).

    Because k is a whole number, the same line sampled differently gives values that differ by a few per cent: the
    average is over 0.25 m at a spacing of 0.125 m, but over 0.3 m at 0.15 m. Compare roads at one spacing.

    Differentiable in the profile wherever the car moves, and independent of the profile's offset and mean slope. The
    last k samples serve the slope only. `international_roughness_by_segment` gives it for every 100 m.

    Arguments:
        profile: height of one wheel track [m], shape [samples], longer than 11.25 m.
        spacing: the distance between samples [m], at most 0.3 m and known when compiled.
        moving_average: the length of the moving average [m]; 0 for a profile that is averaged already, by a
            profilometer that reports means over 250 mm. It is rounded to a whole number of samples, at least one.

    Raises:
        ValueError: if the profile is too short, `spacing` is not positive, above 0.3 m or traced, or `moving_average`
            is negative.

    Source: Sayers, Gillespie and Paterson, World Bank Technical Paper 46 (1986), whose coefficients for 250 mm are
    found to six digits; Sayers, Transportation Research Record 1501 (1995); ASTM E1926. The largest spacing is quoted
    from memory and not verified.

    >>> x = jnp.arange(0.0, 200.0, 0.1)
    >>> profile = 0.001 * 2.4 / (2.0 * jnp.pi) * jnp.sin(2.0 * jnp.pi * x / 2.4)  # slope 1 mm/m
    >>> round(1000.0 * float(international_roughness_index(profile, 0.1)), 2)  # m/km
    1.02
    """
    return jnp.mean(_rates(profile, spacing, moving_average)[0])


class RoughnessBySegment(NamedTuple):
    """The international roughness index of a profile and of its segments; from `international_roughness_by_segment`.

    Attributes:
        whole: index of the whole profile [m/m].
        segments: index of each segment [m/m].
        starts: distance of the start of each segment from the first sample [m].
        lengths: length of each segment [m]; the last one may be shorter than the others.
    """

    whole: Scalar
    segments: Float[Array, " segments"]
    starts: Float[np.ndarray, " segments"]
    lengths: Float[np.ndarray, " segments"]

    @property
    def is_partial(self) -> bool:
        """Whether the last segment is shorter than the others."""
        return bool(self.lengths[-1] < self.lengths[0] - 1e-6)

    def table(self) -> Table:
        """A row for each segment and one for the whole profile."""
        ends, notes = self.starts + self.lengths, [""] * len(self.lengths)
        if self.is_partial:
            notes[-1] = f"the last {self.lengths[-1]:.6g} m only"
        cells = [
            *zip(self.starts, ends, self.segments, notes, strict=True),
            (0.0, ends[-1], self.whole, "whole profile"),
        ]
        columns = Column("from", "m", ".6g"), Column("to", "m", ".6g"), Column("IRI", "m/km", ".3f"), Column("note")
        rows = tuple((float(start), float(end), 1e3 * float(value), note) for start, end, value, note in cells)
        return Table("International roughness index", columns, rows)

    def to_dict(self) -> Contents:
        """The rows of the table with units, ready for JSON."""
        return self.table().to_dict()

    def __str__(self) -> str:
        return self.table().to_text()

    plot = drawn_by("roughness_by_segment", "The index over the distance.")


def international_roughness_by_segment(
    profile: SignalLike,
    spacing: ScalarLike | int,
    *,
    segment: float | int = 100.0,
    moving_average: float | int = 0.25,
) -> RoughnessBySegment:
    """The international roughness index of each segment of a profile, such as every 100 m, and of the whole profile.

    The golden car drives over the whole profile once, so its initial state only affects the first segment: see
    `international_roughness_index`. The index of the whole profile is the mean of the segments, weighted by length.

    >>> x = jnp.arange(0.0, 250.0, 0.1)
    >>> rough = jnp.where(x < 100.0, 0.001, 0.004) * jnp.sin(2.0 * jnp.pi * x / 5.0)
    >>> print(international_roughness_by_segment(rough, 0.1))
    International roughness index
    from [m]  to [m]  IRI [m/km]  note
           0     100       0.928
         100     200       3.716
         200   249.7       3.706  the last 49.7 m only
           0   249.7       2.597  whole profile

    Arguments:
        profile: height of one wheel track [m], shape [samples], longer than 11.25 m.
        spacing: the distance between samples [m], at most 0.3 m and known when compiled.
        segment: the length of a segment [m], at least one sample.
        moving_average: as for `international_roughness_index`.

    Raises:
        ValueError: what `international_roughness_index` refuses, a segment that is not longer than a sample.
    """
    _checks.positive("segment", segment, "It is a length in m.")
    rates, distance = _rates(profile, spacing, moving_average)
    if segment < distance:
        _checks.refuse("segment", f"be at least one sample ({distance:g} m) long", f"{segment} m", "Pass 100.0.")
    number = np.floor(np.arange(rates.size) * distance / segment + 1e-9).astype(int)
    counts = np.bincount(number)
    sums = jax.ops.segment_sum(rates, jnp.asarray(number), num_segments=counts.size)
    starts = distance * (np.cumsum(counts) - counts)
    return RoughnessBySegment(jnp.mean(rates), sums / jnp.asarray(counts, rates.dtype), starts, distance * counts)


def _rates(
    profile: SignalLike, spacing: ScalarLike | int, moving_average: float | int
) -> tuple[Float[Array, " shorter"], float]:
    """|z_s' - z_u'| after each sample, and the distance between samples [m]."""
    heights = as_signal("profile", profile, least=2)
    concrete = _checks.concrete(spacing)
    if concrete is None:
        _checks.refuse("spacing", "be known when the code is compiled", "traced", "Close over a plain number.")
    _checks.positive("spacing", spacing, "It is the distance between samples in m.")
    _checks.nonnegative("moving_average", moving_average, "Use 0 for no moving average.")
    distance = float(concrete)
    if distance > 0.3:
        _checks.refuse("spacing", "not exceed 0.3 m", distance, "Sample the road more closely; it is in m.")
    length = (heights.size - 1) * distance
    if length <= _RUN_UP + moving_average:
        must = f"be longer than {_RUN_UP + moving_average:g} m"
        _checks.refuse("profile", must, f"{length:g} m long", "Measure further, or check `spacing`.")
    base = max(1, math.floor(moving_average / distance + 0.5 + 1e-9))
    run_up = math.floor(_RUN_UP / distance + 0.5 + 1e-9)
    matrix, push = (jnp.asarray(part, heights.dtype) for part in golden_car_step(distance))
    return _driven(heights, matrix, push, base, run_up, distance), distance


@jax.jit(static_argnames=("base", "run_up", "distance"))
def _driven(
    heights: Signal, matrix: Float[Array, "4 4"], push: Float[Array, " 4"], base: int, run_up: int, distance: float
) -> Float[Array, " shorter"]:
    """The golden car over the slopes of the profile, relative to the mean slope at the start, at which it rides."""
    slope = (heights[base:] - heights[:-base]) / (base * distance)
    start = (heights[run_up] - heights[0]) / (run_up * distance)

    def step(state: Array, slope: Scalar) -> tuple[Array, Scalar]:
        state = matrix @ state + push * slope
        return state, state[0] - state[2]

    _, rate = jax.lax.scan(step, jnp.zeros(4, heights.dtype), slope - start)
    return jnp.abs(rate)
