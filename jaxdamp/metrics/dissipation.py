"""Energy dissipated by a damper, and how it spreads over the velocities."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike, VectorLike
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


def velocity_histogram(
    velocity: SignalLike, edges: VectorLike, *, width: ScalarLike | int = 0.0
) -> Float[Array, " bins"]:
    """The share of time that the damper spends in each range of velocity, edges[i] <= v < edges[i + 1] [-].

    Shares add up to one if the outer edges hold everything; they may be infinite. Counting samples has no gradient:
    with a `width` each edge becomes a logistic step 1/(1 + exp(-(v - edge)/width)), and the shares are smooth and
    still add up.

    Arguments:
        velocity: damper velocity [m/s], shape [time]; positive in extension.
        edges: edges of the ranges [m/s], increasing, shape [bins + 1].
        width: the width of an edge [m/s]; 0 counts samples.

    Returns:
        The share of each range, shape [bins].

    Raises:
        ValueError: if the record is empty, if `edges` are fewer than two, NaN or not increasing, or `width` is
            negative.

    >>> v = 0.3 * jnp.sin(2.0 * jnp.pi * jnp.arange(1000.0) / 1000)
    >>> velocity_histogram(v, [-jnp.inf, -0.15, 0.0, 0.15, jnp.inf]).round(3)
    Array([0.333, 0.166, 0.168, 0.333], dtype=float64)
    """
    v = as_signal("velocity", velocity)
    limits = _edges(edges, v, width)
    return _shares(v, jnp.ones_like(v), limits, jnp.asarray(width, v.dtype))


def dissipation_histogram(
    force: SignalLike, velocity: SignalLike, edges: VectorLike, *, width: ScalarLike | int = 0.0
) -> Float[Array, " bins"]:
    """The share of the dissipated energy that falls into each range of velocity, int_bin F v dt / int F v dt [-].

    A share can be negative where elastic forces prevail; over whole cycles they cancel in the sum but not in each
    range. Differentiable in the force, and with a `width` in the velocity too (see `velocity_histogram`). NaN if
    nothing is dissipated.

    Arguments:
        force: damper force [N], shape [time]; positive resists extension.
        velocity: damper velocity [m/s], shape [time]; positive in extension.
        edges: edges of the ranges [m/s], increasing, shape [bins + 1].
        width: the width of an edge [m/s]; 0 counts samples.

    Returns:
        The share of each range, shape [bins].

    Raises:
        ValueError: if the lengths differ, or as `velocity_histogram`.

    >>> v = 0.3 * jnp.sin(2.0 * jnp.pi * jnp.arange(1000.0) / 1000)
    >>> dissipation_histogram(1500.0 * v, v, [-jnp.inf, -0.15, 0.15, jnp.inf]).round(3)
    Array([0.471, 0.058, 0.471], dtype=float64)
    """
    f, v = as_signal("force", force), as_signal("velocity", velocity)
    same_length("force", f, "velocity", v)
    limits = _edges(edges, v, width)
    return _shares(v, f * v, limits, jnp.asarray(width, v.dtype))


def _edges(edges: VectorLike, velocity: Signal, width: ScalarLike | int) -> Float[Array, " edges"]:
    _checks.nonnegative("width", width, "It is the width of an edge in m/s.")
    limits = jnp.asarray(edges, velocity.dtype)
    known = _checks.concrete(limits)
    if limits.ndim != 1 or limits.size < 2:
        _checks.refuse("edges", "hold two or more velocities", f"of shape {limits.shape}")
    if known is not None and not np.all(known[1:] > known[:-1]):
        _checks.refuse("edges", "increase", known, "Sort them; the outer ones may be infinite.")
    return limits


@jax.jit
def _shares(v: Signal, weight: Signal, edges: Float[Array, " edges"], width: Scalar) -> Float[Array, " bins"]:
    smooth = width > 0.0
    safe = jnp.where(smooth, width, jnp.ones_like(width))

    def above(edge: Scalar) -> Scalar:
        """The weight of all samples at or above an edge."""
        finite = jnp.isfinite(edge)
        rounded = jax.nn.sigmoid((v - jnp.where(finite, edge, jnp.zeros_like(edge))) / safe)
        hard = jnp.where(jnp.isnan(v), v, (v >= edge).astype(v.dtype))
        return jnp.sum(weight * jnp.where(smooth & finite, rounded, hard))

    return -jnp.diff(jax.lax.map(above, edges)) / jnp.sum(weight)
