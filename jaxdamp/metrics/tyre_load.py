"""Variation of the tyre load, and wear of the road by the forces of all axles together."""

import jax.numpy as jnp
from jax.scipy.special import ndtri
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._limits import at_least, root
from jaxdamp._types import Scalar, ScalarLike, SignalLike, VectorLike
from jaxdamp.metrics._signals import as_numbers, as_signal, check_interval
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
        threshold: the load [N] that counts as lifted off: 0 for a linear tyre. A tyre with `tyre_lifts=True`, whose
            load is rounded there, still carries 0.007 (exactly 0.01 ln 2) of its static load where its contact ends:
            give that, as the ride metrics do.

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


def aggregate_force(
    tyre_loads: Float[ArrayLike, "axles time"],
    delays: VectorLike,
    dt: ScalarLike | int,
    exponent: ScalarLike | int = 4,
) -> Float[Array, " places"]:
    """Sum over the axles of the tyre load to a power, at every place of the road, A_k = sum_j F_jk^n [N^n].

    Place k is what the first axle passes in sample k; axle j passes it `delays[j]` later, between two samples by
    linear interpolation. n = 4 stands for wear of flexible roads, n = 1 for the total load. Loads below zero count as
    zero: a tyre does not pull. Only places that all axles pass within the record are returned. Differentiable in the
    loads (for n > 1 also at zero).

    Arguments:
        tyre_loads: total tyre load, static part included [N], shape [axles, time].
        delays: when each axle passes a place, after the first one [s], shape [axles]: distance/speed. Not negative,
            not traced, because the number of places depends on them.
        dt: the sampling interval [s].
        exponent: n [-], at least 1.

    Returns:
        A_k, shape [places].

    Raises:
        ValueError: if shapes do not match, `dt` is not positive, a delay is negative or traced, the record is shorter
            than the largest delay, or `exponent` is below 1.

    Source: Cole and Cebon's aggregate force; see Cebon, Vehicle System Dynamics 18 (1989) 107 (title verified only).

    >>> loads = jnp.array([[1.0, 2.0, 3.0, 4.0], [10.0, 20.0, 30.0, 40.0]])
    >>> aggregate_force(loads, [0.0, 0.02], 0.01, exponent=1)  # the second axle comes two samples later
    Array([31., 42.], dtype=float64)
    """
    (loads,) = as_numbers(tyre_loads)
    if loads.ndim != 2:
        remedy = "Stack one row per axle."
        _checks.refuse("tyre_loads", "have the axes axle and time", f"of shape {loads.shape}", remedy)
    check_interval(dt)
    times, step = _checks.concrete(delays), _checks.concrete(dt)
    if times is None or step is None:
        remedy = "Close over plain numbers."
        _checks.refuse("delays", "be known, with `dt`, when the code is compiled", "traced", remedy)
    _checks.nonnegative("delays", times, "Count them from the axle that comes first.")
    if times.shape != loads.shape[:1]:
        _checks.refuse("delays", f"hold one value per axle ({loads.shape[0]})", f"of shape {times.shape}")
    power = _checks.concrete(exponent)
    if power is not None and not power >= 1:
        _checks.refuse("exponent", "be at least 1", power, "4 is usual for wear of the road.")
    # a delay within rounding of a whole number of samples is that number
    shifts = [round(float(t / step), 9) for t in times]
    places = loads.shape[1] - max(int(-(-shift // 1)) for shift in shifts)
    if places < 1:
        must = f"end before the record does ({loads.shape[1] * step:g} s)"
        _checks.refuse("delays", must, times, "Take a longer record; delays are in s.")
    rows = []
    for row, shift in zip(loads, shifts, strict=True):
        whole = int(shift)
        load = row[whole : whole + places]
        if shift > whole:
            load = load + (shift - whole) * (row[whole + 1 : whole + 1 + places] - load)
        rows.append(at_least(load, 0.0) ** jnp.asarray(exponent, loads.dtype))
    return jnp.sum(jnp.stack(rows), axis=0)


def aggregate_force_percentile(
    aggregate: SignalLike, percentile: ScalarLike | int = 95.0, *, gaussian: bool = False
) -> Scalar:
    """The value that the aggregate force stays below at `percentile` per cent of the places, in its unit [N^n].

    Counted from the places, with linear interpolation between neighbours: only two of them have a gradient. With
    `gaussian` it is mean + z standard deviation (z = 1.645 for 95 %), smooth in all places but right only as far as
    the places are normally distributed: fourth powers are skewed, and it comes out somewhat low for them.

    Arguments:
        aggregate: A_k from `aggregate_force` [N^n], shape [places].
        percentile: between 0 and 100 [%].
        gaussian: whether to take the smooth estimate.

    Raises:
        ValueError: if `aggregate` is empty or has more than one axis, or `percentile` is not between 0 and 100.

    Source: Cole and Cebon take the 95th percentile (from memory, not verified).

    >>> places = jnp.arange(101.0)
    >>> round(float(aggregate_force_percentile(places)), 6)
    95.0
    """
    places = as_signal("aggregate", aggregate)
    level = _checks.concrete(percentile)
    if level is not None and not 0.0 < level < 100.0:
        _checks.refuse("percentile", "lie between 0 and 100", level, "It is in per cent.")
    if not gaussian:
        return jnp.percentile(places, jnp.asarray(percentile, places.dtype))
    mean = jnp.mean(places)
    return mean + ndtri(jnp.asarray(percentile, places.dtype) / 100.0) * root(jnp.mean((places - mean) ** 2))
