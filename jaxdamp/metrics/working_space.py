"""How much suspension travel is used."""

import jax.numpy as jnp

from jaxdamp._types import Scalar, SignalLike
from jaxdamp.metrics._signals import as_signal
from jaxdamp.metrics.amplitude import rms


def working_space_rms(deflection: SignalLike) -> Scalar:
    """Root mean square of the suspension deflection about its own mean [m], sqrt(mean((d - mean(d))^2)).

    Without the mean, a sensor offset or a ride height changes nothing. An asymmetric damper shifts the mean ("jacking
    down"): that part of the travel is not in this number; look at the mean as well. The gradient for a constant
    deflection is zero.

    >>> import jax.numpy as jnp
    >>> d = 0.2 + 0.03 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100)
    >>> round(float(working_space_rms(d)), 6)
    0.021213

    Args:
        deflection: Suspension deflection z_sprung - z_unsprung [m], shape [time].

    Raises:
        ValueError: If the signal is empty or has more than one axis.
    """
    deflection = as_signal("deflection", deflection)
    return rms(deflection - jnp.mean(deflection))


def working_space_peak(deflection: SignalLike) -> Scalar:
    """Peak-to-peak suspension deflection [m], max(d) - min(d): the travel that the wheel has used. Not half of it.

    Independent of offsets. Only the two extreme samples have a gradient.

    >>> import jax.numpy as jnp
    >>> round(float(working_space_peak(jnp.array([0.0, 0.04, -0.02, 0.01]))), 6)
    0.06

    Args:
        deflection: Suspension deflection z_sprung - z_unsprung [m], shape [time].

    Raises:
        ValueError: If the signal is empty or has more than one axis.
    """
    deflection = as_signal("deflection", deflection)
    return jnp.max(deflection) - jnp.min(deflection)
