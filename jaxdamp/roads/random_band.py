"""A random road with a flat spectrum between two frequencies."""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import largest
from jaxdamp._random import uniform
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.roads._sampled import SampledRoad


@jax.jit(static_argnames=("first", "size"))
def flat_band(phase: Float[Array, " lines"], first: int, size: int) -> Float[Array, " samples"]:
    """One period of sum_k cos(2 pi k j/size + phase_k), k = first, first + 1, ..., at j < size: RMS sqrt(lines/2)."""
    lines = 0.5 * size * jax.lax.complex(jnp.cos(phase), jnp.sin(phase))
    spectrum = jnp.zeros(size // 2 + 1, lines.dtype).at[first : first + phase.size].set(lines)
    return jnp.fft.irfft(spectrum, size)


def band_limited(
    low: float | int = 0.1,
    high: float | int = 50.0,
    *,
    rms: ScalarLike | int | None = None,
    peak_to_peak: ScalarLike | int | None = None,
    duration: float | int,
    dt: float | int,
    seed: int | Array,
    ramp: float | int = 0.5,
) -> SampledRoad:
    """A random road whose displacement spectrum is flat from `low` to `high` and zero elsewhere.

    The road is a sum of cosines at the multiples of 1/duration within the band, all of one amplitude and with random
    phases, so that every realisation has the same spectrum exactly: rms^2/(high - low) [m^2/Hz]. With the usual
    hundreds of lines its heights are close to a Gaussian distribution. It repeats after `duration` without a jump,
    and is linear between its samples.

    `rms` or `peak_to_peak` holds for one full period as sampled, before the fade-in. Differentiable in both.

    Arguments:
        low: the lowest frequency [Hz].
        high: the highest frequency [Hz], below half the sampling frequency 1/dt.
        rms: the root mean square of the height [m].
        peak_to_peak: the difference between the highest and the lowest sample [m], instead of `rms`.
        duration: the length of one period [s], a multiple of `dt` and at least 1/low.
        dt: the spacing of the samples [s].
        seed: a whole number, or a JAX random key.
        ramp: the time [s] over which the road fades in as a raised cosine at the start, so that a vehicle at rest on
            level ground meets no jump; 0 turns it off. Later periods are not faded.

    Raises:
        ValueError: if not exactly one of `rms` and `peak_to_peak` is given, if `low` is not below `high`, if `high`
            is not below the Nyquist frequency 1/(2 dt), if `duration` is not a multiple of `dt` or too short, or if a
            size is not positive.

    Source: Cui, Kurfess and Messman, quarter-car simulation with a random road from 0.1 to 50 Hz, 0.01 m peak to
    peak. They do not say what the phases and amplitudes are.

    >>> road = band_limited(peak_to_peak=0.01, duration=20.0, dt=0.002, seed=0, ramp=0.0)
    >>> import jax.numpy as jnp
    >>> z = road.height(jnp.arange(10_000.0) * 0.002)[:, 0]
    >>> round(float(z.max() - z.min()), 6)
    0.01
    """
    plain = {"low": low, "high": high, "duration": duration, "dt": dt}
    size, first, last = _lines(*(_checks.plain_number(name, value) for name, value in plain.items()))
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    if (rms is None) == (peak_to_peak is None):
        both = "neither was given" if rms is None else f"{rms} m, and peak_to_peak {peak_to_peak} m was given as well"
        _checks.refuse("rms", "be given, or `peak_to_peak`, but not both", both, "Give exactly one of them.")
    phase = uniform(seed, (last - first + 1,), 2.0 * math.pi)
    shape = flat_band(phase, first, size)
    if rms is not None:
        _checks.positive("rms", rms)
        scale: Scalar = jnp.asarray(rms, float) / math.sqrt(0.5 * phase.size)
    else:
        _checks.positive("peak_to_peak", peak_to_peak)
        scale = jnp.asarray(peak_to_peak, float) / (largest(shape) + largest(-shape))
    return SampledRoad(
        samples=(scale * shape)[:, None], driven_at=None, spacing=float(dt), periodic=True, ramp=float(ramp)
    )


def _lines(low: float, high: float, duration: float, dt: float) -> tuple[int, int, int]:
    """The number of samples, and the first and last multiple of 1/duration within the band."""
    _checks.nonnegative("low", low)
    _checks.positive("high", high)
    _checks.positive("dt", dt)
    _checks.positive("duration", duration)
    if low >= high:
        _checks.refuse("low", f"be below `high` ({high} Hz)", f"{low} Hz", "Exchange them, or widen the band.")
    if high >= 0.5 / dt:
        _checks.refuse(
            "high",
            f"be below the Nyquist frequency 1/(2 dt) = {0.5 / dt:.6g} Hz",
            f"{high} Hz",
            "Choose a smaller `dt`.",
        )
    size = round(duration / dt)
    if abs(size * dt - duration) > 1e-6 * dt * size:
        _checks.refuse("duration", f"be a multiple of `dt` ({dt} s)", f"{duration} s", f"Use {size * dt:.9g} s.")
    first, last = max(1, math.ceil(low * duration - 1e-9)), math.floor(high * duration + 1e-9)
    if 0.0 < low * duration < 1.0 - 1e-9 or last < first:
        _checks.refuse(
            "duration",
            "hold at least one period of the lowest frequency and one multiple of 1/duration within the band",
            f"{duration} s for a band from {low} to {high} Hz",
            "Make the road longer, or the band higher or wider.",
        )
    return size, first, last
