"""Smooth approximations of peaks and settling times, for searches that follow slopes."""

import dataclasses
from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp._types import Scalar
from jaxdamp.metrics import STATISTICS, Metric, Reduction, Statistic, Term, settling_time, smooth_settling_time


POWER = 32  # of the smooth peak
LEAST = 1e-30  # added to a size whose logarithm is taken


def _logarithm(power: int) -> Callable[[Array, object], Array]:
    """Of a power of |y|, which as a number would overflow in single precision from 16 on, and vanish below 0.06."""
    return lambda y, _: power * jnp.log(jnp.abs(y) + LEAST)


def _exponential(logarithm: Scalar) -> Scalar:
    """Of a logarithm of a size; zero for `LEAST`."""
    size = jnp.exp(logarithm)
    return jnp.where(size > 2.0 * LEAST, size, 0.0)


SMOOTH_PEAK = Statistic(
    "smooth_peak",
    (Term(Reduction.LOG_SUM, _logarithm(POWER)), Term(Reduction.LOG_SUM, _logarithm(POWER + 1))),
    lambda logarithms, count, dt: _exponential(logarithms[1] - logarithms[0]),
)
SMOOTH_SETTLING = Statistic(
    "smooth_settling_time", of_record=lambda record, dt: smooth_settling_time(record, dt), unit=lambda _: "s"
)
EXACT = {  # the true statistic of each smooth one
    SMOOTH_PEAK: STATISTICS["peak"],
    SMOOTH_SETTLING: Statistic("settling_time", of_record=lambda r, dt: settling_time(r, dt), unit=lambda _: "s"),
}


def smooth_peak(channel: str, **options: object) -> Metric:
    """A smooth approximation of the peak of a channel, Σ|y|^33 / Σ|y|^32 over the samples.

    It is never above the peak: 1.5 % below for a sine, and closer for a single event. Where several peaks are about
    equally high, all of them take part in its derivative, so that a search is not stopped by the kink of `"peak"`. A
    tuning shows the true peak beside it.

    Arguments:
        channel: of the vehicle.
        options: `weighting`, `from_rest`, `window`, `name`, as of `metrics.Metric`.

    >>> smooth_peak("damper_force").name
    'smooth_peak_damper_force'
    """
    return Metric(channel, SMOOTH_PEAK, **options)  # type: ignore[arg-type]


def smooth_settling(channel: str, **options: object) -> Metric:
    """A smooth approximation of the time after which a channel stays within 5 % of its peak [s].

    It is `metrics.smooth_settling_time` of the record; the window should begin at the kick. A tuning shows the true
    settling time beside it.

    Arguments:
        channel: of the vehicle; `from_rest=True` for heights and strokes, which do not come to rest at zero.
        options: `from_rest`, `window`, `name`, as of `metrics.Metric`.

    >>> smooth_settling("pitch_acceleration").name
    'smooth_settling_time_pitch_acceleration'
    """
    return Metric(channel, SMOOTH_SETTLING, **options)  # type: ignore[arg-type]


def exact_counterpart(metric: Metric) -> Metric | None:
    """The metric with the true statistic, for a metric with a smooth one."""
    exact = EXACT.get(metric.statistic)
    if exact is None:
        return None
    name = metric.name.replace(metric.statistic.name, exact.name)
    return dataclasses.replace(metric, statistic=exact, name=name if name != metric.name else f"exact_{name}")
