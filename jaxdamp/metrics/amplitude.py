"""The size of a signal."""

import jax.numpy as jnp

from jaxdamp._types import Scalar, SignalLike
from jaxdamp.metrics._signals import as_signal


def rms(signal: SignalLike) -> Scalar:
    """Root mean square, sqrt(mean(x^2)), in the unit of the signal. The mean is not removed.

    The gradient is x/(n rms); for a signal that is zero throughout, where the root has none, it is taken as zero.

    >>> import jax.numpy as jnp
    >>> round(float(rms(3.0 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100))), 6)  # 3/sqrt(2)
    2.12132

    Args:
        signal: Uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: If the signal is empty or has more than one axis.
    """
    square = jnp.mean(as_signal("signal", signal) ** 2)
    zero = square == 0.0
    return jnp.where(zero, square, jnp.sqrt(jnp.where(zero, jnp.ones_like(square), square)))


def peak(signal: SignalLike) -> Scalar:
    """Largest magnitude, max |x|, in the unit of the signal.

    Only the sample that holds the peak has a gradient; it jumps where two samples compete, and ties share it equally.

    >>> import jax.numpy as jnp
    >>> round(float(peak(jnp.array([0.2, -1.5, 1.0]))), 6)
    1.5

    Args:
        signal: Uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: If the signal is empty or has more than one axis.
    """
    return jnp.max(jnp.abs(as_signal("signal", signal)))


def crest_factor(signal: SignalLike) -> Scalar:
    """Peak over root mean square, max |x| / sqrt(mean(x^2)) [-]: sqrt(2) for a sine, about 4 for a Gaussian record.

    ISO 2631-1 asks for more than the weighted RMS when that of the weighted acceleration exceeds 9. The gradient is
    that of `peak` and `rms`. A signal that is zero throughout has no crest factor: the result is NaN.

    >>> import jax.numpy as jnp
    >>> round(float(crest_factor(jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100))), 6)
    1.414214

    Args:
        signal: Uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: If the signal is empty or has more than one axis.
    """
    return peak(signal) / rms(signal)
