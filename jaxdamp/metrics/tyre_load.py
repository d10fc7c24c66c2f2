"""Variation of the tyre load."""

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.metrics._signals import as_signal
from jaxdamp.metrics.amplitude import rms


def dynamic_load_coefficient(tyre_load_variation: SignalLike, static_tyre_load: ScalarLike | int) -> Scalar:
    """Standard deviation of the tyre load over the static load, DLC = std(dF)/F_static [-]: some 0.05 to 0.3 in use.

    The mean is removed first, so the total tyre load may be given as well as its variation. Differentiable; the
    gradient for a constant load is zero.

    Arguments:
        tyre_load_variation: tyre load about its static value [N], shape [time].
        static_tyre_load: the static load of the same tyre [N].

    Raises:
        ValueError: if the signal is empty or has more than one axis, or `static_tyre_load` is not positive.

    >>> import jax.numpy as jnp
    >>> load = 600.0 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100)
    >>> round(float(dynamic_load_coefficient(load, 3000.0)), 6)
    0.141421
    """
    variation = as_signal("tyre_load_variation", tyre_load_variation)
    _checks.positive("static_tyre_load", static_tyre_load, "It is the weight carried by the tyre in N, positive.")
    return rms(variation - jnp.mean(variation)) / jnp.asarray(static_tyre_load, variation.dtype)


def road_stress_factor(tyre_load_variation: SignalLike, static_tyre_load: ScalarLike | int) -> Scalar:
    """Eisenmann's road stress factor, 1 + 6 DLC^2 + 3 DLC^4 [-], with DLC the `dynamic_load_coefficient`.

    It is the mean of (F/F_static)^4, to which road wear is taken to be proportional, for a Gaussian tyre load with
    the static load as its mean. For other loads, such as those with lift-off, take that mean instead. Differentiable.

    Arguments:
        tyre_load_variation: tyre load about its static value [N], shape [time].
        static_tyre_load: the static load of the same tyre [N].

    Raises:
        ValueError: if the signal is empty or has more than one axis, or `static_tyre_load` is not positive.

    >>> import jax.numpy as jnp
    >>> load = 600.0 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100)
    >>> round(float(road_stress_factor(load, 3000.0)), 6)  # 1 + 6 * 0.02 + 3 * 0.0004
    1.1212
    """
    square = dynamic_load_coefficient(tyre_load_variation, static_tyre_load) ** 2
    return 1.0 + 6.0 * square + 3.0 * square**2


def lift_off_fraction(tyre_load: SignalLike, threshold: ScalarLike | int = 0.0) -> Scalar:
    """The part of the time, from 0 to 1, during which the tyre load is at or below `threshold` [-].

    It counts samples, so its gradient is zero everywhere: do not tune on it, tune on `dynamic_load_coefficient`.

    Arguments:
        tyre_load: total tyre load, static part included [N], shape [time]; positive presses on the road.
        threshold: the load [N] that counts as lifted off; give a small positive one for a tyre model with a smooth
            lift-off.

    Raises:
        ValueError: if the signal is empty or has more than one axis, or `threshold` is not finite.

    >>> import jax.numpy as jnp
    >>> round(float(lift_off_fraction(jnp.array([1500.0, 0.0, 0.0, 2500.0]))), 6)
    0.5
    """
    load = as_signal("tyre_load", tyre_load)
    _checks.finite("threshold", threshold)
    lifted = jnp.where(jnp.isnan(load), load, (load <= jnp.asarray(threshold, load.dtype)).astype(load.dtype))
    return jnp.mean(lifted)
