"""Decay of a free motion."""

import math

import jax
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._limits import root
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_numbers, as_signal, check_interval


def _check_band(band: ScalarLike | float) -> None:
    concrete = _checks.concrete(band)
    if concrete is not None and not 0.0 < concrete < 1.0:
        _checks.refuse("band", "lie between 0 and 1", concrete, "It is a part of the peak: write 0.05 for 5 %.")


def settling_time(
    signal: SignalLike, dt: ScalarLike | int, band: ScalarLike = 0.05, *, final: ScalarLike | int = 0.0
) -> Scalar:
    """The time after which |x - final| stays within `band` times its largest value [s].

    Counted from the first sample to the last crossing of the band, located by linear interpolation. `inf` if
    the record ends outside the band, 0 if it is at rest throughout. The gradient is that of the last crossing alone;
    the value jumps where a half-wave slips in or out of the band. Tune on `smooth_settling_time` instead.

    Arguments:
        signal: the motion after a kick or step, shape [time], any unit.
        dt: the sampling interval [s].
        band: part of the largest deviation [-]: 0.05 or 0.02 are usual.
        final: where the motion comes to rest, in the unit of the signal.

    Raises:
        ValueError: if there are fewer than two samples, `dt` is not positive, `band` is not between 0 and 1, or
            `final` is not finite.

    >>> time = jnp.arange(5000.0) * 0.001
    >>> decay = jnp.exp(-2.0 * time)
    >>> round(float(settling_time(decay, 0.001)), 4)  # ln(20)/2
    1.4979
    """
    x = as_signal("signal", signal, least=2)
    check_interval(dt)
    _check_band(band)
    _checks.finite("final", final)
    deviation = jnp.abs(x - jnp.asarray(final, x.dtype))
    return _last_crossing(deviation, jnp.asarray(band, x.dtype)) * jnp.asarray(dt, x.dtype)


@jax.jit
def _last_crossing(size: Signal, band: Scalar) -> Scalar:
    """When, in intervals, a magnitude falls below a part of its maximum for good."""
    limit = band * jnp.max(size)
    outside = size > limit
    last = jnp.max(jnp.where(outside, jnp.arange(size.size), -1))
    i = jnp.clip(last, 0, size.size - 2)
    drop = size[i] - size[i + 1]
    part = (size[i] - limit) / jnp.where(drop > 0.0, drop, jnp.ones_like(drop))
    time = i.astype(size.dtype) + part
    time = jnp.where(last < 0, jnp.zeros_like(time), jnp.where(outside[-1], jnp.inf, time))
    return jnp.where(jnp.isnan(limit), limit, time)


def smooth_settling_time(
    signal: SignalLike, dt: ScalarLike | int, band: ScalarLike = 0.05, *, final: ScalarLike | int = 0.0
) -> Scalar:
    """A smooth approximation of `settling_time`: ln(1/band) sqrt(2 int t^2 y^2 dt / int y^2 dt) [s], y = x - final.

    It is the settling time of the exponential envelope that has the same energy-weighted RMS time: exact for a decay
    exp(-s t), and for an oscillation with that envelope up to a term of the order of (damping ratio)^2. The record
    must hold the whole decay, or it comes out short. Differentiable in everything; NaN for a signal at rest.

    Arguments:
        signal: the motion after a kick or step, shape [time], any unit, from the kick on.
        dt: the sampling interval [s].
        band: part of the envelope's start [-]: 0.05 or 0.02 are usual.
        final: where the motion comes to rest, in the unit of the signal.

    Raises:
        ValueError: as `settling_time`.

    >>> time = jnp.arange(10000.0) * 0.001
    >>> swing = jnp.exp(-2.0 * time) * jnp.cos(2.0 * jnp.pi * 5.0 * time)
    >>> round(float(smooth_settling_time(swing, 0.001)), 2)  # ln(20)/2 = 1.50
    1.49
    """
    x = as_signal("signal", signal, least=2)
    check_interval(dt)
    _check_band(band)
    _checks.finite("final", final)
    energy = (x - jnp.asarray(final, x.dtype)) ** 2
    samples = jnp.arange(x.size, dtype=x.dtype)
    share = jnp.sum(samples * samples * energy) / jnp.sum(energy)
    return -jnp.log(jnp.asarray(band, x.dtype)) * root(2.0 * share) * jnp.asarray(dt, x.dtype)


def logarithmic_decrement(signal: SignalLike, *, final: ScalarLike | int = 0.0, threshold: ScalarLike = 0.02) -> Scalar:
    """Logarithmic decrement of a free decay, delta = ln(x_k/x_{k+1}) per full cycle [-].

    Twice the slope of a straight line through ln |x - final| of all successive turning points, highs and lows, that
    exceed `threshold` times the largest; each turning point is refined by a parabola through three samples. Equal
    samples at the top, as in a digitised record, are one turning point. Highs and lows share the line, so an asymmetric
    damper gives the mean of its two directions. NaN with fewer than two turning points. Differentiable, but it jumps
    where a turning point enters or leaves.

    Arguments:
        signal: the free motion, shape [time], any unit; one mode, smooth enough that noise makes no turning points.
        final: where the motion comes to rest, in the unit of the signal.
        threshold: turning points below this part of the largest are left out [-].

    Raises:
        ValueError: if there are fewer than five samples, `final` is not finite, or `threshold` is not in [0, 1).

    >>> time = jnp.arange(4000.0) * 0.001
    >>> decay = jnp.exp(-0.8 * time) * jnp.cos(2.0 * jnp.pi * 2.0 * time)
    >>> round(float(logarithmic_decrement(decay)), 4)  # 0.8 * 0.5
    0.4
    """
    x = as_signal("signal", signal, least=5)
    _checks.finite("final", final)
    concrete = _checks.concrete(threshold)
    if concrete is not None and not 0.0 <= concrete < 1.0:
        _checks.refuse("threshold", "be at least 0 and below 1", concrete, "It is a part of the largest turning point.")
    return _decrement(x - jnp.asarray(final, x.dtype), jnp.asarray(threshold, x.dtype))


@jax.jit
def _decrement(y: Signal, threshold: Scalar) -> Scalar:
    before, here, after = y[:-2], y[1:-1], y[2:]
    rise = jnp.diff(y)
    # of equal samples at the top, as of a digitised record, the first counts, if the next change turns back
    changes = jnp.where(rise == 0.0, rise.size - 1, jnp.arange(rise.size))
    turns = rise[:-1] * rise[jax.lax.cummin(changes, reverse=True)[1:]] < 0.0
    bend = before - 2.0 * here + after
    lift = (after - before) ** 2 / jnp.where(turns, -8.0 * bend, jnp.ones_like(bend))
    height = jnp.where(turns, jnp.abs(here + lift), jnp.zeros_like(here))
    used = turns & (height > threshold * jnp.max(height))
    weight = used.astype(y.dtype)
    number = jnp.cumsum(weight) - 1.0
    level = jnp.where(used, jnp.log(jnp.where(used, height, jnp.ones_like(height))), jnp.zeros_like(height))
    count = jnp.sum(weight)
    centred = weight * (number - jnp.sum(weight * number) / count)
    slope = jnp.sum(centred * level) / jnp.sum(centred * centred)
    return jnp.where(jnp.any(jnp.isnan(y)), jnp.nan, -2.0 * slope)


def damping_ratio(decrement: ScalarLike | int) -> Scalar:
    """Damping ratio of one mode from its logarithmic decrement, zeta = delta/sqrt(4 pi^2 + delta^2) [-].

    The inverse of delta = 2 pi zeta/sqrt(1 - zeta^2). Differentiable.

    Arguments:
        decrement: logarithmic decrement per full cycle [-].

    Raises:
        ValueError: if `decrement` is not finite.

    >>> round(float(damping_ratio(0.4)), 5)
    0.06353
    """
    _checks.finite("decrement", decrement, "A decay without two turning points has no decrement.")
    (delta,) = as_numbers(decrement)
    return delta / jnp.sqrt(4.0 * math.pi**2 + delta * delta)
