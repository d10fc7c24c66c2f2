"""Running values, doses and third octaves of a vibration, weighted as people feel it."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, PyTree

from jaxdamp import _checks
from jaxdamp._limits import at_most, largest, root
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_numbers, as_signal, check_increasing, check_interval, quotient, respond_as_lag
from jaxdamp.metrics.weighted import as_weighted, check_weighting, weighting_factor


def running_rms(
    signal: SignalLike, dt: ScalarLike | int, time_constant: ScalarLike | int = 1.0, *, averaging: str = "linear"
) -> Signal:
    """Root mean square over the last `time_constant` seconds, at the end of every sampling interval.

    - "linear": sqrt((1/tau) int_{t-tau}^t x^2 dt), each sample counting for the interval that it starts. A window that
      is not a whole number of intervals takes the right part of its oldest sample.
    - "exponential": sqrt((1/tau) int x^2 exp(-(t - s)/tau) ds), the exact response of the lag tau y' = x^2 - y to a
      square that runs straight from sample to sample.

    Before the record the signal counts as zero, so the first `time_constant` seconds rise from zero. Differentiable;
    where the window holds only zeros the gradient is zero.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit; weight it first (`weighted_signal`) where the
            standard says so.
        dt: the sampling interval [s].
        time_constant: the integration time tau [s], at least dt; 1 s in ISO 2631-1.
        averaging: "linear" or "exponential".

    Returns:
        The running value in the unit of the signal, shape [time].

    Raises:
        ValueError: if the record is shorter than `time_constant`, `time_constant` is shorter than `dt`, either is not
            positive, or `averaging` is unknown.

    Source: ISO 2631-1, running r.m.s. method.

    >>> import jax.numpy as jnp
    >>> burst = jnp.where(jnp.arange(400) < 100, 2.0, 0.0)  # 1 s of 2 m/s^2, then rest
    >>> running_rms(burst, 0.01)[jnp.array([49, 99, 149, 249])].round(6)  # sqrt(2), 2, sqrt(2), 0
    Array([1.414214, 2.      , 1.414214, 0.      ], dtype=float64)
    """
    signal = as_signal("signal", signal, least=2)
    check_interval(dt)
    _checks.positive("time_constant", time_constant, "It is the integration time in s.")
    _checks.one_of("averaging", averaging, ["linear", "exponential"])
    step, window = _checks.concrete(dt), _checks.concrete(time_constant)
    if step is not None and window is not None:
        span = signal.size * step
        if not step <= window <= span * (1.0 + 1e-9):
            must = f"lie between dt ({step:g} s) and the length of the record ({span:g} s)"
            _checks.refuse("time_constant", must, window, "Take a longer record or a shorter window.")
    if averaging == "exponential":
        return root(respond_as_lag(signal * signal, dt, time_constant))
    return _moving(signal, jnp.asarray(quotient(time_constant, dt, signal.dtype), signal.dtype))


@jax.jit
def _moving(signal: Signal, intervals: Scalar) -> Signal:
    """Root mean square over the last so many intervals, at the end of each."""
    square, whole = signal * signal, jnp.floor(intervals)
    count = whole.astype(int)
    oldest = _delayed(square, count)
    return root((_moving_sum(square, count) + (intervals - whole) * oldest) / intervals)


def _moving_sum(values: Signal, count: Int[Array, ""]) -> Signal:
    """Sum of the last so many values at each, zeros before the first.

    From sums over 1, 2, 4, ... values, those that the binary digits of the count name. No sum is the difference of two
    larger ones, as those of a cumulative sum are, which after a loud stretch leave nothing of a quiet one in single
    precision.
    """

    def double(_: object, sums: tuple[Signal, Int[Array, ""], Signal, Int[Array, ""]]) -> PyTree:
        total, taken, block, length = sums
        has = (count & length) != 0
        total = jnp.where(has, total + _delayed(block, taken), total)
        return total, taken + jnp.where(has, length, 0), block + _delayed(block, length), 2 * length

    # a loop: written out, the compiler would compute every sum again for each of its two uses, 2^digits times
    start = jnp.zeros_like(values), jnp.zeros_like(count), values, jnp.ones_like(count)
    return jax.lax.fori_loop(0, values.size.bit_length(), double, start)[0]


def _delayed(values: Signal, count: Int[Array, ""]) -> Signal:
    """The values so many places later, with zeros before."""
    padded = jnp.concatenate([jnp.zeros_like(values), values])
    return jax.lax.dynamic_slice(padded, (values.size - count,), (values.size,))


def max_transient_value(
    acceleration: SignalLike,
    dt: ScalarLike | int,
    weighting: str | None,
    *,
    time_constant: ScalarLike | int = 1.0,
    averaging: str = "linear",
) -> Scalar:
    """Maximum transient vibration value, MTVV = max_t `running_rms` of the weighted acceleration [m/s^2].

    Only the window that holds the maximum has a gradient; it jumps where two windows compete. Tune on
    `smooth_peak(running_rms(...))` instead.

    Arguments:
        acceleration: acceleration [m/s^2], shape [time].
        dt: the sampling interval [s].
        weighting: "Wk" and so on (see `weighting_response`), or None for a record that is weighted already.
        time_constant: the integration time tau [s].
        averaging: "linear" or "exponential"; the two differ, for a short shock by up to a few per cent.

    Raises:
        ValueError: as `weighted_signal` and `running_rms`.

    Source: ISO 2631-1, running r.m.s. method, tau = 1 s.

    >>> import jax.numpy as jnp
    >>> time = jnp.arange(10000.0) * 0.001
    >>> kick = jnp.where((time > 4.0) & (time < 4.5), 3.0, 0.0) * jnp.sin(2.0 * jnp.pi * 8.0 * time)
    >>> round(float(max_transient_value(kick, 0.001, None)), 4)  # 3/sqrt(2) for half of the second: 1.5
    1.5
    """
    signal = as_weighted(acceleration, dt, weighting)
    return largest(running_rms(signal, dt, time_constant, averaging=averaging))


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


_NUMBERS = np.arange(-3, 20)  # of the bands from 0.5 to 80 Hz


def third_octave_rms(
    frequency: Float[ArrayLike, " lines"], density: Float[ArrayLike, " lines"], weighting: str | None = None
) -> tuple[Float[Array, " bands"], Float[Array, " bands"]]:
    """RMS in the third octaves of ISO 2631-1, from 0.5 to 80 Hz: (centre frequencies [Hz], RMS of each band).

    a_i = sqrt(∫ |W(f)|² S(f) df) over 10^((n ± 1/2)/10) Hz, n = -3 ... 19, by the trapezoidal rule. The sum of the
    squares is the square of the (weighted) RMS between 0.45 and 89 Hz. NaN in bands that the spectrum does not reach.
    Differentiable in `density`; a band without power has the derivative zero.

    Arguments:
        frequency: increasing frequencies [Hz], such as those of `power_spectral_density`. A band narrower than their
            step shares the power of its neighbours: below 1 Hz take segments of 10 s or longer.
        density: one-sided power spectral density there [unit²/Hz], shape (lines,).
        weighting: of ISO 2631-1, such as "Wk"; none if left out.

    Returns:
        Centre frequencies 10^(n/10) Hz, which the standard calls 0.5, 0.63, 0.8, 1 ... 80 Hz, and the RMS in each band
        in the unit of the signal, shape (23,) both.

    Raises:
        ValueError: other shapes, fewer than two lines, frequencies that do not increase, an unknown weighting.

    Source: ISO 2631-1; exact centre frequencies of IEC 61260-1, base ten.

    >>> from jaxdamp.metrics import power_spectral_density
    >>> a = jnp.sqrt(2.0) * jnp.sin(2.0 * jnp.pi * 8.0 * jnp.arange(8000.0) * 0.00125)
    >>> centre, rms = third_octave_rms(*power_spectral_density(a, 0.00125, 8000), "Wk")
    >>> at = int(jnp.argmax(rms))
    >>> round(float(centre[at]), 2), round(float(rms[at]), 3)  # |Wk| at 8 Hz is 1.036
    (7.94, 1.036)
    """
    lines, levels = jnp.asarray(frequency, dtype=float), jnp.asarray(density, dtype=float)
    if lines.ndim != 1 or lines.shape != levels.shape or lines.size < 2:
        shapes = f"of shapes {lines.shape} and {levels.shape}"
        _checks.refuse("density", "have one axis of two lines or more, as `frequency`", shapes)
    check_increasing(lines)
    if weighting is not None:
        check_weighting(weighting)
    return jnp.asarray(10.0 ** (_NUMBERS / 10.0), lines.dtype), _in_bands(lines, levels, weighting)


@jax.jit(static_argnames="weighting")
def _in_bands(
    frequency: Float[Array, " lines"], density: Float[Array, " lines"], weighting: str | None
) -> Float[Array, " bands"]:
    """The root of the integral between the ends of the bands."""
    if weighting is not None:
        density = weighting_factor(frequency, weighting) ** 2 * density
    ends = jnp.asarray(10.0 ** ((np.append(_NUMBERS, 20) - 0.5) / 10.0), frequency.dtype)
    cells = 0.5 * (density[1:] + density[:-1]) * jnp.diff(frequency)
    below = jnp.interp(ends, frequency, jnp.concatenate([jnp.zeros(1, cells.dtype), jnp.cumsum(cells)]))
    reached = (ends[:-1] >= frequency[0]) & (ends[1:] <= frequency[-1])
    return jnp.where(reached, root(jnp.diff(below)), jnp.nan)
