"""Temperature of a damper: one mass that is heated by dissipation and cooled by air."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._types import ScalarLike, Signal, SignalLike
from jaxdamp.metrics._linear_system import quotient, respond_as_lag
from jaxdamp.metrics._signals import as_numbers, as_signal, check_interval


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
