"""Records of acceleration, frequency weighted."""

import math

import jax
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._linear_system import respond_exactly
from jaxdamp.metrics._signals import as_signal, check_interval
from jaxdamp.metrics.amplitude import rms
from jaxdamp.metrics.weighting import cascade, check_weighting, settling, weighting_response


def weighted_signal(
    acceleration: SignalLike,
    dt: ScalarLike | int,
    weighting: str,
    *,
    method: str = "spectrum",
    remove_mean: bool = True,
) -> Signal:
    """The frequency-weighted record a_w(t), as long as the record and without delay of its own.

    The filter is the analogue one of the standard, phase included; it starts at rest, and what rings on after the
    record is cut off. Two methods:

    - "spectrum" multiplies the spectrum of the record by H(f), exactly for a record without content above the Nyquist
      frequency: right for measured records behind an anti-alias filter. The record is followed by as many zeros as it
      takes the filter to settle to 1e-12 (16 s, or 78 s for Wf), so that its end does not run into its beginning.
    - "step" solves x' = A x + B u exactly for an input straight from sample to sample: right for simulated records,
      with any dt, known or traced, and the same as the filter's states in an engine. Straight lines between samples
      lose (pi f dt)^2/3 of a sine's amplitude against "spectrum": 0.13 % at 20 Hz and 3 % at 100 Hz with dt = 1 ms.

    The mean is removed first, because an offset or gravity would otherwise act as a step at the start of the record;
    all weightings suppress a constant. Keep it where the record starts from rest and its jumps are real.
    Differentiable and linear in `acceleration`.

    Arguments:
        acceleration: acceleration [m/s^2] or angular acceleration [rad/s^2], shape [time].
        dt: the sampling interval [s]; sample at 1 kHz or so for content up to 100 Hz.
        weighting: "Wb", "Wc", "Wd", "We", "Wf", "Wj" or "Wk"; see `weighting_response`.
        method: "spectrum" or "step".
        remove_mean: whether to subtract the mean of the record first.

    Raises:
        ValueError: if there are fewer than two samples, `dt` is not positive, `weighting` or `method` is unknown, or
            `dt` is traced with "spectrum", where it sets the size of an array.

    Source: ISO 2631-1; parameters see `weighting_response`.

    >>> time = jnp.arange(8000.0) * 0.001
    >>> a = weighted_signal(jnp.sin(2.0 * jnp.pi * 8.0 * time), 0.001, "Wk")
    >>> round(float(jnp.max(a[6000:])), 3)  # |Wk| at 8 Hz is 1.036
    1.036
    """
    signal = as_signal("acceleration", acceleration, least=2)
    check_interval(dt)
    check_weighting(weighting)
    _checks.one_of("method", method, ["spectrum", "step"])
    if remove_mean:
        signal = signal - jnp.mean(signal)
    if method == "step":
        return respond_exactly(cascade(weighting), signal, dt)
    known = _checks.concrete(dt)
    if known is None:
        remedy = 'Close over dt as a plain number, mark it static in jax.jit, or take method="step".'
        _checks.refuse("dt", 'be known when the code is compiled for the method "spectrum"', "traced", remedy)
    size = _fast_length(signal.size + math.ceil(settling(weighting) / float(known)))
    frequency = jnp.arange(size // 2 + 1, dtype=signal.dtype) / (size * float(known))
    return _filtered(signal, weighting_response(frequency, weighting))


def _fast_length(least: int) -> int:
    """The smallest length 2^a, 3·2^a, 5·2^a, 9·2^a or 15·2^a (a > 0) that is not below `least`."""
    return min(odd * 2 ** max(1, math.ceil(math.log2(least / odd))) for odd in (1, 3, 5, 9, 15))


@jax.jit
def _filtered(signal: Signal, response: jax.Array) -> Signal:
    size = 2 * (response.size - 1)
    return jnp.fft.irfft(jnp.fft.rfft(signal, size) * response, size)[: signal.size]


def as_weighted(acceleration: SignalLike, dt: ScalarLike | int, weighting: str | None) -> Signal:
    """The weighted record; as it is for the weighting `None`."""
    check_interval(dt)
    if weighting is None:
        return as_signal("acceleration", acceleration, least=2)
    return weighted_signal(acceleration, dt, weighting)


def weighted_rms(
    acceleration: SignalLike,
    dt: ScalarLike | int,
    weighting: str,
    *,
    method: str = "spectrum",
    remove_mean: bool = True,
) -> Scalar:
    """Root mean square of the frequency-weighted acceleration, a_w = sqrt(mean(a_w(t)^2)) [m/s^2].

    The basic evaluation of ISO 2631-1. Differentiable; the gradient for a record of zeros is zero. Records should be
    much longer than the filter settles (a few seconds; a minute or more with Wf), whose start is counted.

    Arguments:
        acceleration: acceleration [m/s^2] or angular acceleration [rad/s^2], shape [time].
        dt: the sampling interval [s].
        weighting: "Wb", "Wc", "Wd", "We", "Wf", "Wj" or "Wk"; see `weighting_response`.
        method: "spectrum" or "step"; see `weighted_signal`.
        remove_mean: whether to subtract the mean of the record first.

    Raises:
        ValueError: as `weighted_signal`.

    Source: ISO 2631-1, weighted root-mean-square acceleration.

    >>> time = jnp.arange(20000.0) * 0.001
    >>> round(float(weighted_rms(jnp.sin(2.0 * jnp.pi * 8.0 * time), 0.001, "Wk")), 3)  # 1.036/sqrt(2)
    0.732
    """
    return rms(weighted_signal(acceleration, dt, weighting, method=method, remove_mean=remove_mean))
