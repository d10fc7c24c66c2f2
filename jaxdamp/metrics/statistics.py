"""Statistics: numbers made of a record at once, or gathered sample by sample while a simulation runs.

A ride metric is a statistic of a channel of a vehicle. Both ways give the same number up to rounding; gathered, it
needs no memory for the record.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax.numpy as jnp

from jaxdamp._limits import at_least, at_most
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.metrics._signals import root
from jaxdamp.metrics.amplitude import peak, rms
from jaxdamp.metrics.dissipation import dissipated_power
from jaxdamp.metrics.dose import vibration_dose_value
from jaxdamp.metrics.tyre_load import lift_off_fraction, road_stress_factor
from jaxdamp.metrics.working_space import working_space_mean, working_space_peak_to_peak, working_space_rms


Kept: TypeAlias = tuple[Scalar, ...]


class Statistic(NamedTuple):
    """One number of a record.

    Arguments:
        of: it, from the whole record and its sampling interval [s].
        begin: what is kept of the first sample.
        add: what is kept with one sample more.
        end: it, from what is kept, the number of samples and their interval [s].
        unit: its unit, from that of the record.
        weighted: whether the record is weighted by ISO 2631-1 first.
        of_rms: it, from the RMS of a stationary Gaussian record without mean; None where that does not say.
        differentiable: whether its slope says anything; a count has none.
        signed: whether it may be negative, so that a change of it in percent says nothing.
    """

    of: Callable[[Signal, ScalarLike], Scalar]
    begin: Callable[[Scalar], Kept]
    add: Callable[[Kept, Scalar], Kept]
    end: Callable[[Kept, int, ScalarLike], Scalar]
    unit: Callable[[str], str] = lambda unit: unit
    weighted: bool = False
    of_rms: Callable[[Scalar], Scalar] | None = None
    differentiable: bool = True
    signed: bool = False


_ON_THE_ROAD = -1.0 + 1e-9  # relative tyre load; rounding counts as lifted


def _mean_square(kept: Kept, count: int, _: ScalarLike) -> Scalar:
    return root(kept[0] / count)


def _squares(kept: Kept, y: Scalar) -> Kept:
    return (kept[0] + y * y,)


def _spread(kept: Kept, y: Scalar) -> Kept:
    """Sums about the first sample, which keeps their digits where the mean is large."""
    first, total, squares = kept
    return first, total + (y - first), squares + (y - first) ** 2


def _deviation(kept: Kept, count: int, _: ScalarLike) -> Scalar:
    _, total, squares = kept
    return root(squares / count - (total / count) ** 2)


def _stress(deviation: Scalar) -> Scalar:
    return 1.0 + 6.0 * deviation**2 + 3.0 * deviation**4


def _lifted(y: Scalar) -> Scalar:
    return jnp.where(jnp.isnan(y), y, (y <= _ON_THE_ROAD).astype(y.dtype))


def _from_zero(y: Scalar) -> Kept:
    return y, jnp.zeros_like(y), jnp.zeros_like(y)


def _power(kept: Kept, count: int, _: ScalarLike) -> Scalar:
    total, first, last = kept
    return (total - 0.5 * (first + last)) / (count - 1)


def _of_relative_load(metric: Callable[..., Scalar]) -> Callable[[Signal, ScalarLike], Scalar]:
    return lambda record, _: metric(record, 1.0)


# By name. `lift_off_fraction` and `road_stress_factor` are of a tyre's load beyond its static load over its static
# load; `dissipated_power` is of the product of a force and its velocity.
STATISTICS: dict[str, Statistic] = {
    "rms": Statistic(
        lambda record, _: rms(record), lambda y: (y * y,), _squares, _mean_square, of_rms=lambda value: value
    ),
    "peak": Statistic(
        lambda record, _: peak(record),
        lambda y: (jnp.abs(y),),
        lambda kept, y: (at_least(kept[0], jnp.abs(y)),),
        lambda kept, *_: kept[0],
    ),
    "peak_to_peak": Statistic(
        lambda record, _: working_space_peak_to_peak(record),
        lambda y: (y, y),
        lambda kept, y: (at_most(kept[0], y), at_least(kept[1], y)),
        lambda kept, *_: kept[1] - kept[0],
    ),
    "standard_deviation": Statistic(
        lambda record, _: working_space_rms(record), _from_zero, _spread, _deviation, of_rms=lambda value: value
    ),
    "mean": Statistic(
        lambda record, _: working_space_mean(record),
        lambda y: (y,),
        lambda kept, y: (kept[0] + y,),
        lambda kept, count, _: kept[0] / count,
        signed=True,
    ),
    "road_stress_factor": Statistic(
        _of_relative_load(road_stress_factor),
        _from_zero,
        _spread,
        lambda kept, count, dt: _stress(_deviation(kept, count, dt)),
        unit=lambda _: "",
        of_rms=_stress,
    ),
    "lift_off_fraction": Statistic(
        lambda record, _: lift_off_fraction(record, _ON_THE_ROAD),
        lambda y: (_lifted(y),),
        lambda kept, y: (kept[0] + _lifted(y),),
        lambda kept, count, _: kept[0] / count,
        unit=lambda _: "",
        differentiable=False,
    ),
    "dissipated_power": Statistic(
        lambda record, _: dissipated_power(record, jnp.ones_like(record)),
        lambda y: (y, y, y),
        lambda kept, y: (kept[0] + y, kept[1], y),
        _power,
        unit=lambda _: "W",
    ),
    "weighted_rms": Statistic(
        lambda record, _: rms(record),
        lambda y: (y * y,),
        _squares,
        _mean_square,
        weighted=True,
        of_rms=lambda value: value,
    ),
    "vibration_dose_value": Statistic(
        lambda record, dt: vibration_dose_value(record, dt, None),
        lambda y: ((y * y) ** 2,),
        lambda kept, y: (kept[0] + (y * y) ** 2,),
        lambda kept, _, dt: root(kept[0] * jnp.asarray(dt, kept[0].dtype), 4),
        unit=lambda unit: unit.replace("^2", "^1.75"),
        weighted=True,
    ),
}
