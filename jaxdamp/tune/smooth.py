"""Smooth metrics in place of peaks and settling times, whose derivatives jump."""

import dataclasses
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp.metrics import STATISTICS, Metric, Reduction, Statistic, Term, settling_time, smooth_settling_time


DOUBLINGS = 5  # of the exponent: the smooth peak has the power 32


def _powers(y: Array, first: Any) -> Array:
    """An even power, by squaring."""
    del first
    for _ in range(DOUBLINGS):
        y = y * y
    return y


SMOOTH_PEAK = Statistic(
    "smooth_peak",
    (Term(Reduction.SUM, _powers), Term(Reduction.SUM, lambda y, first: _powers(y, first) * jnp.abs(y))),
    lambda sums, count, dt: jnp.where(sums[0] > 0.0, sums[1] / jnp.where(sums[0] > 0.0, sums[0], 1.0), 0.0),
)
EXACT = {  # the true statistic of each smooth one
    SMOOTH_PEAK: STATISTICS["peak"],
    Statistic(
        "smooth_settling_time", of_record=lambda record, dt: smooth_settling_time(record, dt), unit=lambda _: "s"
    ): Statistic("settling_time", of_record=lambda record, dt: settling_time(record, dt), unit=lambda _: "s"),
}
SMOOTH_SETTLING = next(smooth for smooth in EXACT if smooth is not SMOOTH_PEAK)


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
    options = {field.name: getattr(metric, field.name) for field in dataclasses.fields(metric)}
    name = metric.name.replace(metric.statistic.name, exact.name)
    name = name if name != metric.name else f"exact_{name}"
    return Metric(**options | {"statistic": exact, "name": name})
