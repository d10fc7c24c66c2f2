"""Statistics of a record, computed from all samples at once or sample by sample during a simulation.

A statistic is defined once, as a function of sums, maxima and minima over the samples. Both ways give the same number
up to rounding; sample by sample, it needs no memory for the record.
"""

import dataclasses
import enum
import functools
from collections.abc import Callable
from typing import NamedTuple, SupportsIndex, TypeAlias, final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most, largest, root
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.metrics.dose import max_transient_value


Gathered: TypeAlias = tuple[Scalar, ...]  # the terms of a statistic so far
Samples: TypeAlias = Float[Array, "..."]  # one sample, or all of a record at once


class Reduction(enum.Enum):
    """How a term combines its values over the samples."""

    SUM = "sum"
    LOG_SUM = "logarithm of the sum of exponentials"
    LARGEST = "largest"
    SMALLEST = "smallest"
    FIRST = "first"
    LAST = "last"

    def join(self, before: Scalar, value: Scalar) -> Scalar:
        """The combination with one more value."""
        match self:
            case Reduction.SUM:
                return before + value
            case Reduction.LOG_SUM:
                return jnp.logaddexp(before, value)
            case Reduction.LARGEST:
                return at_least(before, value)
            case Reduction.SMALLEST:
                return at_most(before, value)
            case Reduction.FIRST:
                return before
            case Reduction.LAST:
                return value

    def of(self, values: Signal) -> Scalar:
        """The combination of all values."""
        match self:
            case Reduction.SUM:
                return jnp.sum(values)
            case Reduction.LOG_SUM:
                return jax.nn.logsumexp(values)
            case Reduction.LARGEST:
                return largest(values)
            case Reduction.SMALLEST:
                return -largest(-values)
            case Reduction.FIRST:
                return values[0]
            case Reduction.LAST:
                return values[-1]


def _sample(y: Samples, first: object) -> Samples:
    del first
    return y


def _same_unit(unit: str) -> str:
    return unit


class Term(NamedTuple):
    """A function of a sample y and of the first sample, and the reduction of its values.

    The first sample is available if the first term of the statistic is `Term(Reduction.FIRST)`; otherwise it is None,
    because a run does not save it.

    Attributes:
        reduction: how the values are combined over time.
        value: function of the sample and of the first sample.
    """

    reduction: Reduction
    value: Callable[[Samples, PyTree], Samples] = _sample


@final
@dataclasses.dataclass(frozen=True, repr=False)
class Statistic:
    """One number of a record.

    It is given either by terms, which a run gathers, or by a function of the whole record, for which a run has to save
    its channel.

    Arguments:
        name: in names of metrics.
        terms: sums and extremes over the samples. Where one is a function of the first sample, the first term is
            `Term(Reduction.FIRST)`, which saves it.
        of_terms: the statistic, from the terms, the number of samples and their interval [s].
        of_record: the statistic, from the whole record and its interval [s], in place of terms.
        unit: its unit, from that of the record.
        of_rms: it, from the RMS of a stationary Gaussian record without mean; None where that does not say.
        differentiable: whether its slope says anything; a count has none.
        signed: whether it may be negative, so that a change of it in percent says nothing.

    Raises:
        ValueError: neither terms with a function of them nor a function of the record, or both.

    >>> mean_cube = Statistic("mean_cube", (Term(Reduction.SUM, lambda y, first: y**3),), lambda k, n, dt: k[0] / n)
    >>> float(mean_cube.of(jnp.array([1.0, 2.0]), 0.1))
    4.5
    """

    name: str
    terms: tuple[Term, ...] = ()
    of_terms: Callable[[Gathered, int, ScalarLike], Scalar] | None = None
    of_record: Callable[[Signal, ScalarLike], Scalar] | None = None
    unit: Callable[[str], str] = _same_unit
    of_rms: Callable[[Scalar], Scalar] | None = None
    differentiable: bool = True
    signed: bool = False

    def __post_init__(self) -> None:
        gathered = bool(self.terms) and self.of_terms is not None
        if gathered == (self.of_record is not None) or bool(self.terms) != (self.of_terms is not None):
            _checks.refuse("Statistic", "have terms and a function of them, or one of the record", repr(self.name))

    def __repr__(self) -> str:
        return self.name

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[object, ...]:
        """Those of this module are pickled by name: the copy is the same statistic, and compiles nothing anew."""
        return (_named, (self.name,)) if STATISTICS.get(self.name) is self else super().__reduce_ex__(protocol)

    @property
    def needs_record(self) -> bool:
        """Whether a run has to save the channel."""
        return self.of_record is not None

    def begin(self, y: Scalar) -> Gathered:
        """The terms of the first sample."""
        return self._values(y, y)

    def add(self, gathered: Gathered, y: Scalar) -> Gathered:
        """The terms with one sample more."""
        triples = zip(self.terms, gathered, self._values(y, *gathered[:1]), strict=True)
        return tuple(term.reduction.join(before, value) for term, before, value in triples)

    def end(self, gathered: Gathered, count: int, dt: ScalarLike) -> Scalar:
        """The statistic of so many samples, dt [s] apart, from their terms."""
        assert self.of_terms is not None
        return self.of_terms(gathered, count, dt)

    def of(self, record: Signal, dt: ScalarLike) -> Scalar:
        """The statistic of a whole record, samples dt [s] apart."""
        if self.of_record is not None:
            return self.of_record(record, dt)
        pairs = zip(self.terms, self._values(record, record[0]), strict=True)
        return self.end(tuple(term.reduction.of(values) for term, values in pairs), record.shape[0], dt)

    def _values(self, y: Samples, first: Scalar | None = None) -> tuple[Samples, ...]:
        """The functions of the terms; only a statistic that saves the first sample may take it."""
        saved = first if self.terms[:1] == (Term(Reduction.FIRST),) else None
        try:
            return tuple(term.value(y, saved) for term in self.terms)
        except TypeError:
            if saved is None:
                remedy = "A term of it is a function of the first sample, which no other term saves."
                _checks.refuse("terms", "begin with `Term(Reduction.FIRST)`", repr(self.name), remedy)
            raise


_ROUNDING = 16.0  # of the relative tyre load, in the precision of its numbers: so near to -1 the wheel is lifted


def _mean_square(gathered: Gathered, count: int, _: ScalarLike) -> Scalar:
    return root(gathered[0] / count)


def _deviation(gathered: Gathered, count: int, _: ScalarLike) -> Scalar:
    _, total, squares = gathered
    return root(squares / count - (total / count) ** 2)


def _stress(deviation: Scalar) -> Scalar:
    return 1.0 + 6.0 * deviation**2 + 3.0 * deviation**4


@dataclasses.dataclass(frozen=True)
class _Lifted:
    """1 where the load is at most this share of the static load, 0 elsewhere; equal for an equal share."""

    share: float

    def __call__(self, y: Samples, _: Scalar | None) -> Samples:
        lifted = y <= -1.0 + max(self.share, 1e-9, _ROUNDING * float(jnp.finfo(y.dtype).eps))
        return jnp.where(jnp.isnan(y), y, lifted.astype(y.dtype))


def _mean(gathered: Gathered, count: int, _: ScalarLike) -> Scalar:
    return gathered[0] / count


def lift_off_below(share: float) -> Statistic:
    """The part of the time in which the load of a tyre is at most a share of its static load [-], from 0 to 1.

    Arguments:
        share: 0 for a linear tyre; what a tyre that can lift off still carries where its contact ends.
    """
    terms = (Term(Reduction.SUM, _Lifted(share)),)
    return Statistic("lift_off_fraction", terms, _mean, unit=_dimensionless, differentiable=False)


def _power(gathered: Gathered, count: int, _: ScalarLike) -> Scalar:
    total, first, last = gathered
    return (total - 0.5 * (first + last)) / (count - 1)


def _itself(value: Scalar) -> Scalar:
    return value


def _dimensionless(_: str) -> str:
    return ""


def _of_power(unit: str) -> str:
    return "W" if unit in ("N m/s", "m/s N", "N m rad/s", "rad/s N m") else unit


def _of_dose(unit: str) -> str:
    """The unit times s^0.25."""
    for per_time, of_dose in (("/s^2", "/s^1.75"), ("/s", "/s^0.75")):
        if unit.endswith(per_time):
            return unit.removesuffix(per_time) + of_dose
    return f"{unit} s^0.25".strip()


# Sums about the first sample avoid loss of digits if the mean is large.
_SPREAD = (
    Term(Reduction.FIRST),
    Term(Reduction.SUM, lambda y, first: y - first),
    Term(Reduction.SUM, lambda y, first: (y - first) ** 2),
)
_ALL = (
    Statistic("rms", (Term(Reduction.SUM, lambda y, _: y * y),), _mean_square, of_rms=_itself),
    Statistic("peak", (Term(Reduction.LARGEST, lambda y, _: jnp.abs(y)),), lambda gathered, *_: gathered[0]),
    Statistic("maximum", (Term(Reduction.LARGEST),), lambda gathered, *_: gathered[0], signed=True),
    Statistic("minimum", (Term(Reduction.SMALLEST),), lambda gathered, *_: gathered[0], signed=True),
    Statistic(
        "peak_to_peak",
        (Term(Reduction.SMALLEST), Term(Reduction.LARGEST)),
        lambda gathered, *_: gathered[1] - gathered[0],
    ),
    Statistic("standard_deviation", _SPREAD, _deviation, of_rms=_itself),
    Statistic("mean", (Term(Reduction.SUM),), _mean, signed=True),
    Statistic(
        "road_stress_factor",
        _SPREAD,
        lambda gathered, count, dt: _stress(_deviation(gathered, count, dt)),
        unit=_dimensionless,
        of_rms=_stress,
    ),
    lift_off_below(0.0),
    Statistic(
        "dissipated_power",
        (Term(Reduction.SUM), Term(Reduction.FIRST), Term(Reduction.LAST)),
        _power,
        unit=_of_power,
    ),
    Statistic(
        "vibration_dose_value",
        (Term(Reduction.SUM, lambda y, _: (y * y) ** 2),),
        lambda gathered, _, dt: root(gathered[0] * jnp.asarray(dt, gathered[0].dtype), 4),
        unit=_of_dose,
    ),
    Statistic("max_transient_value", of_record=lambda record, dt: max_transient_value(record, dt, None)),
)
# By name. `lift_off_fraction` and `road_stress_factor` are of a tyre's load beyond its static load over its static
# load, the former of a linear tyre; `dissipated_power` is of the product of a force and its velocity, of another
# channel its mean.
STATISTICS: dict[str, Statistic] = {statistic.name: statistic for statistic in _ALL}


def _named(name: str) -> Statistic:
    """The statistic of this module with this name."""
    return STATISTICS[name]


@dataclasses.dataclass(frozen=True)
class _Percentile:
    """Of a record; equal for an equal share."""

    share: float | int

    def __call__(self, record: Signal, dt: ScalarLike) -> Scalar:
        del dt
        return jnp.percentile(record, self.share)


@of_known_numbers
@functools.cache
def percentile(share: float | int) -> Statistic:
    """The value that a share of the samples of a record stays below.

    Arguments:
        share: in percent, 0 to 100; 50 is the median.

    Raises:
        ValueError: a share outside 0 to 100.

    >>> float(percentile(50).of(jnp.array([3.0, 1.0, 2.0]), 0.1))
    2.0
    """
    if not 0 <= share <= 100:
        _checks.refuse("share", "be 0 to 100 percent", share)
    return Statistic(f"percentile_{share:g}", of_record=_Percentile(share), signed=True)
