"""Amplitude measures of a signal."""

import jax
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._limits import largest, root
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.metrics._signals import as_signal


def rms(signal: SignalLike) -> Scalar:
    """Root mean square, sqrt(mean(x^2)), in the unit of the signal. The mean is not removed.

    The gradient is x/(n rms); for a signal that is zero throughout, where the root has none, it is taken as zero.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(rms(3.0 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100))), 6)  # 3/sqrt(2)
    2.12132
    """
    return root(jnp.mean(as_signal("signal", signal) ** 2))


def peak(signal: SignalLike) -> Scalar:
    """Largest magnitude, max |x|, in the unit of the signal.

    Only the sample that holds the peak has a gradient, of equal ones the first; it jumps where two samples compete.
    Tune on `smooth_peak` instead.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(peak(jnp.array([0.2, -1.5, 1.0]))), 6)
    1.5
    """
    return largest(jnp.abs(as_signal("signal", signal)))


def smooth_peak(signal: SignalLike, order: ScalarLike | int = 16) -> Scalar:
    """A smooth approximation of `peak`: the power mean (mean |x|^p)^(1/p), in the unit of the signal.

    It is between max |x| / n^(1/p) and max |x| and approaches max |x| with the order p; as a mean over time it does not
    depend on the sampling rate. All large samples have a gradient. A sine gives 0.90 of its peak with p = 16; a
    Gaussian record gives 2.48 standard deviations, its peak some 4. It is computed relative to the largest sample, so
    nothing overflows. The gradient for a signal that is zero throughout is zero.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.
        order: the power p, at least 2; 8 to 16 for tuning.

    Raises:
        ValueError: if the signal is empty or has more than one axis, or `order` is not finite or below 2.

    >>> import jax.numpy as jnp
    >>> x = jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100)
    >>> [round(float(smooth_peak(x, p)), 4) for p in (2, 8, 16, 64)]
    [0.7071, 0.8504, 0.9033, 0.9646]
    """
    x = as_signal("signal", signal)
    _checks.finite("order", order)
    known = _checks.concrete(order)
    if known is not None and known < 2.0:
        _checks.refuse("order", "be at least 2", known, "Use `rms` for 2 and larger orders to come closer to the peak.")
    p = jnp.asarray(order, x.dtype)
    largest = jax.lax.stop_gradient(jnp.max(jnp.abs(x)))
    zero = largest == 0.0
    scale = jnp.where(zero, jnp.ones_like(largest), largest)
    mean = jnp.mean(jnp.abs(x / scale) ** p)
    safe = jnp.where(zero, jnp.ones_like(mean), mean)
    return jnp.where(zero, jnp.zeros_like(mean), scale * safe ** (1.0 / p))


def crest_factor(signal: SignalLike) -> Scalar:
    """Peak over root mean square, max |x| / sqrt(mean(x^2)) [-]: sqrt(2) for a sine, about 4 for a Gaussian record.

    ISO 2631-1 requires more than the weighted RMS if the crest factor of the weighted acceleration exceeds 9. The
    gradient is that of `peak` and `rms`. A signal that is zero throughout has no crest factor: the result is NaN.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(crest_factor(jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100))), 6)
    1.414214
    """
    return peak(signal) / rms(signal)
