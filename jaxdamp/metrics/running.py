"""The running root mean square and its maximum."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, PyTree

from jaxdamp import _checks
from jaxdamp._limits import largest, root
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._linear_system import quotient, respond_as_lag
from jaxdamp.metrics._signals import as_signal, check_interval
from jaxdamp.metrics.weighted import as_weighted


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
