"""Vibration doses."""

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._limits import at_most, root
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.metrics._signals import as_numbers
from jaxdamp.metrics.weighted import as_weighted


def vibration_dose_value(acceleration: SignalLike, dt: ScalarLike | int, weighting: str | None) -> Scalar:
    """Vibration dose value, VDV = (int a_w^4 dt)^(1/4) [m/s^1.75], each sample counting for one interval.

    Doses of several records add as fourth powers. Differentiable; the gradient for a record of zeros is zero.

    Arguments:
        acceleration: acceleration [m/s^2], shape [time].
        dt: the sampling interval [s].
        weighting: "Wk" and so on (see `weighting_response`), or None for a record that is weighted already.

    Raises:
        ValueError: as `weighted_signal`.

    Source: ISO 2631-1, fourth power vibration dose method; BS 6841.

    >>> import jax.numpy as jnp
    >>> a = jnp.sin(2.0 * jnp.pi * jnp.arange(1600.0) / 100)
    >>> round(float(vibration_dose_value(a, 0.01, None)), 4)  # (16 s * 3/8)^(1/4)
    1.5651
    """
    signal = as_weighted(acceleration, dt, weighting)
    square = signal * signal
    return root(jnp.sum(square * square) * jnp.asarray(dt, signal.dtype), 4)


def estimated_vibration_dose_value(weighted_rms: ScalarLike, duration: ScalarLike | int) -> Scalar:
    """Estimated vibration dose value, eVDV = 1.4 a_w T^(1/4) [m/s^1.75].

    For motion with a crest factor below about 6, without shocks; of a Gaussian record the true factor is
    3^(1/4) = 1.316, of a sine 1.107. Differentiable for a positive duration.

    Arguments:
        weighted_rms: weighted RMS acceleration [m/s^2], not negative.
        duration: duration of exposure [s].

    Raises:
        ValueError: if `weighted_rms` is negative, if `duration` is not positive, or if either is not finite.

    Source: BS 6841. The range of crest factors is quoted from memory and not verified.

    >>> round(float(estimated_vibration_dose_value(0.5, 3600.0)), 3)  # an hour at 0.5 m/s^2
    5.422
    """
    _checks.nonnegative("weighted_rms", weighted_rms, "It is the result of `weighted_rms` in m/s^2.")
    _checks.positive("duration", duration, "It is the duration of exposure in s.")
    value, time = as_numbers(weighted_rms, duration)
    return 1.4 * value * root(time, 4)


def motion_sickness_dose(acceleration: SignalLike, dt: ScalarLike | int, weighting: str | None = "Wf") -> Scalar:
    """Motion sickness dose value, MSDV_z = (int a_wf^2 dt)^(1/2) [m/s^1.5], each sample counting for one interval.

    It needs records of many minutes with content down to 0.1 Hz; take the vertical acceleration. Squares of the doses
    of several records add. Differentiable; the gradient for a record of zeros is zero.

    Arguments:
        acceleration: vertical acceleration [m/s^2], shape [time].
        dt: the sampling interval [s].
        weighting: "Wf", or None for a record that is weighted already.

    Raises:
        ValueError: as `weighted_signal`.

    Source: ISO 2631-1, motion sickness.

    >>> import jax.numpy as jnp
    >>> a = 0.5 * jnp.sin(2.0 * jnp.pi * 0.2 * jnp.arange(12000.0) * 0.1)  # 20 minutes at 0.2 Hz
    >>> dose = motion_sickness_dose(a, 0.1)
    >>> round(float(dose), 1), round(float(motion_sickness_percentage(dose)), 1)
    (12.1, 4.0)
    """
    signal = as_weighted(acceleration, dt, weighting)
    return root(jnp.sum(signal * signal) * jnp.asarray(dt, signal.dtype))


def motion_sickness_percentage(dose: ScalarLike, factor: ScalarLike = 1.0 / 3.0) -> Scalar:
    """Percentage of people who may vomit [%], K_m MSDV_z, at most 100.

    For adults not used to the motion, exposed for about 20 minutes to 6 hours, and up to about 70 % (this range is
    quoted from memory and not verified). Differentiable below 100 %.

    Arguments:
        dose: `motion_sickness_dose` [m/s^1.5], not negative.
        factor: K_m [% s^1.5/m]: 1/3 for a mixed population of men and women.

    Raises:
        ValueError: if either is negative or not finite.

    Source: ISO 2631-1, motion sickness, informative annex.

    >>> round(float(motion_sickness_percentage(30.0)), 6)
    10.0
    """
    _checks.nonnegative("dose", dose, "It is the result of `motion_sickness_dose` in m/s^1.5.")
    _checks.nonnegative("factor", factor)
    value, share = as_numbers(dose, factor)
    return at_most(share * value, 100.0)
