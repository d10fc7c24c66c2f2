"""Energy dissipated by a damper."""

import jax.numpy as jnp
import numpy as np

from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_signal, check_interval, same_length


def _trapezoid(signal: Signal) -> Scalar:
    """Integral over time, in units of the sampling interval, ends counted half."""
    return signal.sum() - 0.5 * (signal[0] + signal[-1])


def dissipated_energy(force: SignalLike, velocity: SignalLike, dt: ScalarLike | int) -> Scalar:
    """The work done on the damper over the record, E = int F v dt [J], by the trapezoidal rule.

    Positive when the damper takes energy out of the motion, with the signs of this library: force resisting extension
    and velocity in extension are positive. For one or more whole cycles of a steady motion it is the area of the
    force-stroke loops; elastic parts of the force then cancel. Differentiable.

    Arguments:
        force: damper force [N], shape [time].
        velocity: damper velocity [m/s], shape [time].
        dt: the sampling interval [s].

    Raises:
        ValueError: if the lengths differ, if there are fewer than two samples, or if `dt` is not positive.

    >>> import jax.numpy as jnp
    >>> time = jnp.linspace(0.0, 1.0, 1001)
    >>> v = 0.5 * jnp.cos(2.0 * jnp.pi * time)
    >>> round(float(dissipated_energy(2000.0 * v, v, 0.001)), 6)  # c V^2 T/2
    250.0
    """
    force, velocity = as_signal("force", force, least=2), as_signal("velocity", velocity, least=2)
    same_length("force", force, "velocity", velocity)
    check_interval(dt)
    return _trapezoid(force * velocity) * jnp.asarray(dt, force.dtype)


def dissipated_power(force: SignalLike, velocity: SignalLike) -> Scalar:
    """Mean power that the damper turns into heat, P = (1/T) int F v dt [W], by the trapezoidal rule.

    As in `dissipated_energy`, elastic parts cancel over whole cycles or a long record. Differentiable.

    Arguments:
        force: damper force [N], shape [time]; positive resists extension.
        velocity: damper velocity [m/s], shape [time]; positive in extension.

    Raises:
        ValueError: if the lengths differ, or if there are fewer than two samples.

    >>> import jax.numpy as jnp
    >>> v = 0.5 * jnp.cos(2.0 * jnp.pi * jnp.linspace(0.0, 1.0, 1001))
    >>> round(float(dissipated_power(2000.0 * v, v)), 6)  # c V^2/2
    250.0
    """
    energy = dissipated_energy(force, velocity, 1.0)
    return energy / (np.size(force) - 1)


def equivalent_damping(force: SignalLike, velocity: SignalLike) -> Scalar:
    """The rate of the linear damper that dissipates as much in the same motion, c = int F v dt / int v^2 dt [N s/m].

    For whole cycles of a sine with amplitude X and angular frequency w it is the usual E/(pi w X^2), with E the
    energy of one cycle; it holds for any other motion as well. The record should span whole cycles, or be long, so
    that elastic and gas forces cancel. Differentiable; NaN if the damper does not move.

    Arguments:
        force: damper force [N], shape [time]; positive resists extension.
        velocity: damper velocity [m/s], shape [time]; positive in extension.

    Raises:
        ValueError: if the lengths differ, or if there are fewer than two samples.

    >>> import jax.numpy as jnp
    >>> time = jnp.linspace(0.0, 1.0, 1001)
    >>> v = 0.5 * jnp.cos(2.0 * jnp.pi * time)
    >>> round(float(equivalent_damping(1000.0 * v**3, v)), 4)  # 3/4 of 1000 V^2
    187.5
    """
    force, velocity = as_signal("force", force, least=2), as_signal("velocity", velocity, least=2)
    same_length("force", force, "velocity", velocity)
    return _trapezoid(force * velocity) / _trapezoid(velocity * velocity)
