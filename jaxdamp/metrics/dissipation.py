"""Energy dissipated by a damper: in all, over its velocities, and the temperature that it gives."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike, VectorLike
from jaxdamp.metrics._signals import as_numbers, as_signal, check_interval, quotient, respond_as_lag, same_length


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
    concrete = _checks.concrete(limits)
    if limits.ndim != 1 or limits.size < 2:
        _checks.refuse("edges", "hold two or more velocities", f"of shape {limits.shape}")
    if concrete is not None and not np.all(concrete[1:] > concrete[:-1]):
        _checks.refuse("edges", "increase", concrete, "Sort them; the outer ones may be infinite.")
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


def temperature_rise(
    power: ScalarLike | int,
    time: Float[ArrayLike, "*shape"],
    heat_capacity: ScalarLike | int,
    cooling: ScalarLike | int,
    start: ScalarLike | int = 0.0,
) -> Float[Array, "*shape"]:
    """Temperature above ambient under constant power [K]: start e^(-t/tau) + (P/hA)(1 - e^(-t/tau)), tau = C/hA.

    The solution of C T' = P - hA (T - T_ambient). It tends to P/hA; without cooling it is start + P t/C. One mass at
    one temperature: the oil is hotter than the tube at first. Differentiable in everything, also at cooling 0.

    Arguments:
        power: mean dissipated power P [W]; see `dissipated_power`.
        time: time since the start [s], any shape, not negative.
        heat_capacity: C, that of oil and metal together [J/K].
        cooling: hA, heat transfer coefficient times surface [W/K].
        start: temperature above ambient at time 0 [K].

    Raises:
        ValueError: if `heat_capacity` is not positive, if `time` or `cooling` is negative, or anything is not finite.

    >>> [round(float(temperature_rise(90.0, t, 1200.0, 1.5)), 2) for t in (60.0, 800.0, 1e5)]  # tau = 800 s
    [4.34, 37.93, 60.0]
    """
    _checks.finite("power", power)
    _checks.nonnegative("time", time)
    _checks.positive("heat_capacity", heat_capacity, "It is in J/K: mass times specific heat.")
    _checks.nonnegative("cooling", cooling, "It is in W/K: heat transfer coefficient times surface.")
    _checks.finite("start", start)
    t, p, capacity, conductance, above = as_numbers(time, power, heat_capacity, cooling, start)
    x = t * (conductance / capacity)
    # (1 - e^-x)/x; by its series where the quotient has no derivative
    small = x < 1e-3
    series = 1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0))))
    safe = jnp.where(small, jnp.ones_like(x), x)
    part = jnp.where(small, series, -jnp.expm1(-safe) / safe)
    return above * jnp.exp(-x) + (p / capacity) * t * part


def damper_temperature(
    power: SignalLike,
    dt: ScalarLike | int,
    heat_capacity: ScalarLike | int,
    cooling: ScalarLike | int,
    ambient: ScalarLike | int,
    start: ScalarLike | int | None = None,
) -> Signal:
    """Temperature of a damper over a record of its power, the solution of C T' = P - hA (T - T_ambient).

    Exact for a power that runs straight from sample to sample, for any interval: a mean power per second or minute
    serves as well as F v at 1 kHz. Differentiable in everything; the temperature scale is that of `ambient`.

    Arguments:
        power: dissipated power F v, or means of it [W], shape [time].
        dt: the sampling interval [s].
        heat_capacity: C, that of oil and metal together [J/K].
        cooling: hA, heat transfer coefficient times surface [W/K], positive.
        ambient: temperature of the air [K or degC].
        start: temperature at the first sample [K or degC]; ambient if not given.

    Returns:
        The temperature at each sample, in the scale of `ambient`, shape [time].

    Raises:
        ValueError: if there are fewer than two samples, if `dt`, `heat_capacity` or `cooling` is not positive, or if a
            temperature is not finite.

    >>> import jax.numpy as jnp
    >>> minutes = damper_temperature(jnp.full(31, 90.0), 60.0, heat_capacity=1200.0, cooling=1.5, ambient=20.0)
    >>> round(float(minutes[0]), 2), round(float(minutes[-1]), 2)
    (20.0, 73.68)
    """
    p = as_signal("power", power, least=2)
    check_interval(dt)
    _checks.positive("heat_capacity", heat_capacity, "It is in J/K: mass times specific heat.")
    _checks.positive("cooling", cooling, "It is in W/K; without cooling use `temperature_rise`.")
    _checks.finite("ambient", ambient)
    air = jnp.asarray(ambient, p.dtype)
    if start is not None:
        _checks.finite("start", start)
    above = jnp.zeros((), p.dtype) if start is None else jnp.asarray(start, p.dtype) - air
    time_constant = quotient(heat_capacity, cooling, p.dtype)
    return air + respond_as_lag(p / jnp.asarray(cooling, p.dtype), dt, time_constant, above)
