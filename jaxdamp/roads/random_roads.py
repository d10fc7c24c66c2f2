"""Random roads without a class of their own: a band of frequencies, white noise through a filter, white alone."""

import math
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import largest
from jaxdamp._random import normal, uniform
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.roads._sampled import AbstractProcess, SampledRoad
from jaxdamp.roads.assessment import LOWEST_SPATIAL_FREQUENCY, REFERENCE_SPATIAL_FREQUENCY, roughness
from jaxdamp.roads.base import check_speed


@jax.jit(static_argnames=("first", "size"))
def flat_band(phase: Float[Array, " lines"], first: int, size: int) -> Float[Array, " samples"]:
    """One period of sum_k cos(2 pi k j/size + phase_k), k = first, first + 1, ..., at j < size: RMS sqrt(lines/2)."""
    lines = 0.5 * size * jax.lax.complex(jnp.cos(phase), jnp.sin(phase))
    spectrum = jnp.zeros(size // 2 + 1, lines.dtype).at[first : first + phase.size].set(lines)
    return jnp.fft.irfft(spectrum, size)


@final
class FlatBand(AbstractProcess):
    """Cosines of one amplitude at neighbouring multiples of the inverse of the period."""

    first: int = eqx.field(static=True)  # multiple
    lines: int = eqx.field(static=True)  # number of multiples
    holds_peak_to_peak: bool = eqx.field(static=True)  # instead of the RMS

    def redraw(self, samples: Float[Array, " samples"], seed: int) -> Float[Array, " samples"]:
        """Other heights [m] of the same spectrum, scaled to the same peak to peak if that was given."""
        phase = jnp.angle(jnp.fft.rfft(samples)[self.first : self.first + self.lines])
        other = flat_band(phase + uniform(seed, phase.shape, 2.0 * math.pi), self.first, samples.size)
        extent = _peak_to_peak if self.holds_peak_to_peak else jnp.std
        return extent(samples) / extent(other) * other


def _peak_to_peak(samples: Float[Array, " samples"]) -> Scalar:
    return largest(samples) + largest(-samples)


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
        scale = jnp.asarray(peak_to_peak, float) / _peak_to_peak(shape)
    return SampledRoad(
        samples=(scale * shape)[:, None],
        driven_at=None,
        spacing=float(dt),
        periodic=True,
        ramp=float(ramp),
        process=FlatBand(first, phase.size, rms is None),
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


def filtered_noise_variance(roughness_psd: ScalarLike, cutoff: ScalarLike) -> Scalar:
    """sigma^2 = pi n0^2 G_d(n0)/(2 n1) [m^2], the integral of G_d(n0) n0^2/(n^2 + n1^2) over all n > 0."""
    return jnp.asarray(0.5 * math.pi * REFERENCE_SPATIAL_FREQUENCY**2 * roughness_psd / cutoff, float)


@jax.jit
def autoregressive(noise: Float[Array, " samples"], correlation: Scalar) -> Float[Array, " samples"]:
    """u_k = rho u_(k-1) + sqrt(1 - rho^2) e_k, u_0 = e_0: stationary, of variance 1 if the noise e is."""
    innovation = jnp.sqrt((1.0 - correlation) * (1.0 + correlation))

    def advance(u: Scalar, e: Scalar) -> tuple[Scalar, Scalar]:
        u = correlation * u + innovation * e
        return u, u

    _, following = jax.lax.scan(advance, noise[0], noise[1:])
    return jnp.concatenate([noise[:1], following])


@final
class FilteredNoise(AbstractProcess):
    """The shaping filter at equally spaced samples."""

    deviation: Scalar  # standard deviation of the heights [m]
    correlation: Scalar  # of neighbouring samples

    def redraw(self, samples: Float[Array, " samples"], seed: int) -> Float[Array, " samples"]:
        """Other heights [m]: the probabilities of the noise are shifted."""
        return _redrawn(self.deviation, self.correlation, samples, uniform(seed, samples.shape))


@jax.jit
def _filtered(deviation: Scalar, correlation: Scalar, noise: Float[Array, " samples"]) -> Float[Array, " samples"]:
    return deviation * autoregressive(noise, correlation)


@jax.jit
def _redrawn(
    deviation: Scalar, correlation: Scalar, samples: Float[Array, " samples"], shift: Float[Array, " samples"]
) -> Float[Array, " samples"]:
    """Filtered noise whose probabilities are those of the noise behind `samples`, shifted by numbers from 0 to 1."""
    u = samples / deviation
    innovation = jnp.sqrt((1.0 - correlation) * (1.0 + correlation))
    noise = jnp.concatenate([u[:1], (u[1:] - correlation * u[:-1]) / innovation])
    least = float(jnp.finfo(u.dtype).eps)  # at 0 and 1 the noise is infinite
    probability = jnp.clip((jax.scipy.special.ndtr(noise) + shift) % 1.0, least, 1.0 - least)
    return _filtered(deviation, correlation, jax.scipy.special.ndtri(probability))


def iso8608_filtered(
    road_class: str | ScalarLike,
    speed: ScalarLike | int,
    duration: float | int | None = None,
    *,
    seed: int | Array,
    cutoff: ScalarLike | int = LOWEST_SPATIAL_FREQUENCY,
    spacing: float | int = 0.05,
    length: float | int | None = None,
    ramp: float | int = 0.5,
) -> SampledRoad:
    """A random road of an ISO 8608 class made by a shaping filter, dz/dx + 2 pi n1 z = 2 pi n0 sqrt(G_d(n0)) w(x).

    With w of one-sided spectral density 1 the spectrum is G_d(n0) n0^2/(n^2 + n1^2): that of the class well above the
    cut-off n1, level below it. The variance of the heights is pi n0^2 G_d(n0)/(2 n1). The filter runs along the road,
    so that the ground does not depend on the speed, and is exact at the samples, which are linked by straight lines:
    the density seen by the vehicle is that of the samples times sinc(n spacing)^4, 12 % too low at 2.83 cycle/m with
    the default spacing.

    In contrast to `iso8608` the heights are Gaussian, the variance of one road scatters (by about 1/sqrt(pi n1 L) over
    a length L), the road never repeats, and the waviness is 2. Differentiable in `speed`, `cutoff` and a numeric
    `road_class`; the gradient in speed is that of the straight lines.

    Arguments:
        road_class: a letter from "A" to "H", or the roughness G_d(n0) itself [m^3], as for `iso8608`.
        speed: V, the speed of the vehicle [m/s].
        duration: the time [s] the road lasts; not where `speed` is traced by JAX.
        seed: a whole number, or a JAX random key.
        cutoff: n1 [cycle/m].
        spacing: the distance between samples [m]. A simulation may not take steps longer than spacing/speed.
        length: the length of the road [m], instead of `duration`.
        ramp: the time [s] over which the road fades in as a raised cosine at the start; 0 turns it off.

    Raises:
        ValueError: if the class is unknown, if `speed`, the roughness, `cutoff`, `spacing`, `duration` or `length` is
            not positive, if `ramp` is negative, if not exactly one of `duration` and `length` is given, if the road
            is shorter than one spacing, or if `duration` is given while `speed` is traced.

    Source: ISO 8608 for the spectrum. The noise of density 1 becomes randn/sqrt(2 dx) on a grid, not randn/sqrt(dx):
    the latter, seen in published code, doubles the spectrum.

    >>> road = iso8608_filtered("C", speed=20.0, duration=50.0, seed=1)
    >>> round(float(road.samples.std()), 4), round(float(filtered_noise_variance(256e-6, 0.011)) ** 0.5, 4)
    (0.0175, 0.0191)
    """
    density = roughness(road_class)
    check_speed(speed, "Roads are driven forwards; it is in m/s.")
    _checks.positive("cutoff", cutoff, "Without a cut-off the variance of the road grows without end.")
    _checks.positive("spacing", spacing)
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    samples = math.ceil(_length(speed, duration, length) / spacing - 1e-9) + 1
    correlation = jnp.asarray(jnp.exp(-2.0 * math.pi * spacing * jnp.asarray(cutoff, float)))
    process = FilteredNoise(jnp.sqrt(filtered_noise_variance(density, cutoff)), correlation)
    return SampledRoad(
        samples=_filtered(process.deviation, process.correlation, normal(seed, (samples,)))[:, None],
        driven_at=jnp.asarray(speed, float),
        spacing=float(spacing),
        periodic=False,
        ramp=float(ramp),
        process=process,
    )


def _length(speed: ScalarLike | int, duration: float | int | None, length: float | int | None) -> float:
    if (duration is None) == (length is None):
        both = "neither was given" if duration is None else f"{duration} s, and length {length} m as well"
        _checks.refuse("duration", "be given, or `length`, but not both", both, "Give exactly one of them.")
    if duration is None:
        _checks.positive("length", length)
        return float(length or 0.0)
    duration = _checks.plain_number("duration", duration)
    _checks.positive("duration", duration)
    velocity = _checks.concrete(speed)
    if velocity is None:
        remedy = "The number of samples must be known: give `length` in m."
        _checks.refuse("duration", "be left out where `speed` is traced by JAX", f"{duration} s", remedy)
    return float(velocity) * float(duration)


@final
class WhiteRoad(eqx.Module):
    """A road given only by its spectrum, for the stationary response of vehicles; created by `white`.

    Attributes:
        velocity_psd: two-sided power spectral density S of the rate of height [(m/s)²/Hz], as `stationary_rms` takes
            it: half of `one_sided_velocity_psd`.
        speed: speed of the vehicle, for the delays between axles [m/s].
    """

    velocity_psd: Scalar
    speed: Scalar

    @property
    def one_sided_velocity_psd(self) -> Scalar:
        """Power spectral density over positive frequencies [(m/s)²/Hz], 2 S: that of all other spectra here."""
        return 2.0 * self.velocity_psd


def white(road_class: str | ScalarLike, speed: ScalarLike) -> WhiteRoad:
    """The road of an ISO 8608 class at a speed as white noise in the rate of height, S = 2π² G_d(n₀) n₀² V.

    S is two-sided. The one-sided density, with which spectra of simulated and measured signals are compared, is 2 S =
    (2π n₀)² G_d(n₀) V (`one_sided_velocity_psd`).

    It cannot be used in simulations over time, only for stationary responses, in which heights are relative. There,
    each law of a vehicle is replaced by the linear one that is equivalent in the Gaussian motion that results
    (statistical linearisation, `vehicles.linearise`). In `benchmarks/white_road.py`, RMS values of a car with one of
    twelve laws, on classes A to D, are within 5 % of simulations, with hysteresis within 12 %, save the stroke where
    friction mostly sticks.

    Arguments:
        road_class: a letter A to H, or G_d(n₀) [m³].
        speed: vehicle speed V [m/s].

    Raises:
        ValueError: an unknown class, a speed or roughness that is not positive.

    >>> round(float(white("C", speed=20.0).velocity_psd), 9)
    0.001010647
    """
    check_speed(speed)
    density = 2.0 * np.pi**2 * roughness(road_class) * REFERENCE_SPATIAL_FREQUENCY**2 * speed
    return WhiteRoad(jnp.asarray(density, float), jnp.asarray(speed, float))
