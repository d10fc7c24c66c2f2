"""Random roads of the ISO 8608 roughness classes."""

import math
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._random import rayleigh, uniform
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.roads.assessment import (
    HIGHEST_SPATIAL_FREQUENCY,
    LOWEST_SPATIAL_FREQUENCY,
    displacement_psd,
    roughness,
)
from jaxdamp.roads.base import AbstractRoad, check_speed, fade_in


Lines = Float[Array, " lines"]

# Up to so many samples are summed as they stand: a Fourier transform costs more.
_FEW = 64
# Points of the grid that each sample is interpolated from: an error of 1e-12 of the RMS of a road.
_POINTS = 14
# The shape of the window for a grid that is at least twice as fine as the shortest wave needs.
_SHAPE = 0.75 * math.pi * _POINTS
# Samples handled at a time: bounds the memory whatever the length of the record.
_BLOCK = 8192


def cosine_sum(cycles: Signal, amplitude: Lines, phase: Lines, *, first: int) -> Signal:
    """Sum_j a_j cos(2 pi (first + j) u + phase_j), j = 0, 1, ..., at each u in `cycles`.

    A few samples are summed directly. For more the sum is computed on a fine regular grid over one cycle by one fast
    Fourier transform, and from there interpolated to the samples, wherever they are: n log n operations instead of n^2,
    equal to the sum to 1e-11 of its RMS. Differentiable in everything.
    """
    real, imaginary = amplitude * jnp.cos(phase), amplitude * jnp.sin(phase)
    if cycles.size <= _FEW:
        return _summed(cycles - jnp.floor(cycles), real, imaginary, first)
    return _interpolated(cycles, real, imaginary, first)


def _summed(cycles: Signal, real: Lines, imaginary: Lines, first: int) -> Signal:
    """Re sum_j (real + i imaginary)_j exp(2 pi i (first + j) u).

    With j = m p + q this is the real part of sum_p exp(2 pi i (first + m p) u) sum_q c_pq exp(2 pi i q u). The inner
    sum is a matrix product and only about 2 sqrt(lines) complex exponentials per sample remain.
    """
    columns = math.ceil(math.sqrt(real.size))
    rows = math.ceil(real.size / columns)
    padding = (0, rows * columns - real.size)
    a, b = (jnp.pad(part, padding).reshape(rows, columns).T for part in (real, imaginary))
    matrix = jnp.block([[a, b], [-b, a]])
    fine = 2.0 * jnp.pi * cycles[:, None] * jnp.arange(columns, dtype=cycles.dtype)[None, :]
    coarse = 2.0 * jnp.pi * cycles[:, None] * (first + columns * jnp.arange(rows, dtype=cycles.dtype))[None, :]
    sums = jnp.concatenate([jnp.cos(fine), jnp.sin(fine)], axis=1) @ matrix
    return jnp.sum(jnp.concatenate([jnp.cos(coarse), -jnp.sin(coarse)], axis=1) * sums, axis=1)


def _from_grid(cycles: Signal, real: Lines, imaginary: Lines, first: int) -> Signal:
    """The same sum by a Fourier transform and interpolation; linear in the lines.

    The Fourier transform of the window sinh(b sqrt(1 - x^2))/sqrt(1 - x^2) is pi I_0(sqrt(b^2 - w^2)), by which the
    lines are divided beforehand, so that the interpolation is exact but for what the window has beyond its points.

    Source: Dutt and Rokhlin (1993) for the method; Potts, Steidl and Tasche (2001) for this window (Kaiser-Bessel).
    """
    size = 2 ** math.ceil(math.log2(4 * (first + real.size)))
    turning = math.pi * _POINTS / size * np.arange(first, first + real.size)
    response = 0.5 * _POINTS * math.pi * np.i0(np.sqrt(_SHAPE**2 - turning**2)) * math.exp(-_SHAPE)
    scale = jnp.asarray(0.5 * size / response, real.dtype)
    lines = jax.lax.complex(scale * real, scale * imaginary)
    spectrum = jnp.zeros(size // 2 + 1, lines.dtype).at[first : first + real.size].set(lines)
    grid = jnp.fft.irfft(spectrum, size)
    around = jnp.concatenate([grid[-_POINTS:], grid, grid[:_POINTS]])
    points = jnp.arange(_POINTS, dtype=cycles.dtype)

    @jax.checkpoint
    def at(u: Signal) -> Signal:
        place = (u - jnp.floor(u)) * size
        left = jnp.ceil(place - 0.5 * _POINTS)
        x = ((place - left)[:, None] - points[None, :]) * (2.0 / _POINTS)
        root = jnp.sqrt(jnp.maximum(1.0 - x * x, 1e-30))
        window = jnp.exp(_SHAPE * (root - 1.0)) * -jnp.expm1(-2.0 * _SHAPE * root) / (2.0 * root)
        begin = left.astype(int) + _POINTS
        near = jax.vmap(lambda index: jax.lax.dynamic_slice(around, (index,), (_POINTS,)))(begin)
        return jnp.sum(window * near, axis=1)

    blocks = math.ceil(cycles.size / _BLOCK)
    block = math.ceil(cycles.size / blocks)
    in_blocks = jnp.pad(cycles, (0, blocks * block - cycles.size)).reshape(blocks, block)
    return jax.lax.map(at, in_blocks).reshape(-1)[: cycles.size]


_interpolated = jax.custom_jvp(_from_grid, nondiff_argnums=(3,))
Inputs = tuple[Signal, Lines, Lines]


@_interpolated.defjvp
def _derivative(first: int, primals: Inputs, tangents: Inputs) -> tuple[Signal, Signal]:
    """The slope is the sum of the lines times 2 pi i n, as exact as the value; that of the window is not."""
    (cycles, real, imaginary), (faster, more_real, more_imaginary) = primals, tangents
    turning = 2.0 * jnp.pi * jnp.arange(first, first + real.size, dtype=real.dtype)
    slope = _interpolated(cycles, -turning * imaginary, turning * real, first)
    more = _from_grid(cycles, more_real, more_imaginary, first)
    return _interpolated(cycles, real, imaginary, first), slope * faster + more


@final
class Iso8608(AbstractRoad):
    """A sum of cosines with the spectrum of ISO 8608; created by `iso8608`.

    Attributes:
        roughness_psd: G_d(n0) [m^3].
        waviness: w.
        driven_at: V [m/s].
        phase: phi_i of each cosine [rad].
        relative_amplitude: r_i of each cosine, of mean square 1 over all roads; 1 for fixed amplitudes.
        length: the distance after which the road repeats [m].
        band: the least and the greatest spatial frequency [cycle/m].
        ramp: the time of the fade-in [s].
        amplitudes: "random" or "fixed".
    """

    roughness_psd: Scalar
    waviness: Scalar
    driven_at: Scalar
    phase: Float[Array, " lines"]
    relative_amplitude: Float[Array, " lines"]
    length: float = eqx.field(static=True)
    band: tuple[float, float] = eqx.field(static=True)
    ramp: float = eqx.field(static=True)
    amplitudes: str = eqx.field(static=True)

    @compiled_for_loops
    def heights_at(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see `iso8608`."""
        time = jnp.asarray(time, self.phase.dtype)
        cycles = self.speed * time / self.length
        wave = cosine_sum(cycles, self.amplitude, self.phase, first=_first_and_last(self.band, self.length)[0])
        return (fade_in(time, self.ramp) * wave)[:, None]

    @property
    def speed(self) -> Scalar:
        """The speed [m/s] that the road was made for."""
        return self.driven_at

    @property
    def spatial_frequency(self) -> Float[Array, " lines"]:
        """The spatial frequencies of the cosines [cycle/m]: all multiples of 1/length within the band."""
        first, last = _first_and_last(self.band, self.length)
        return jnp.arange(first, last + 1, dtype=self.phase.dtype) / self.length

    @property
    def amplitude(self) -> Float[Array, " lines"]:
        """The amplitudes of the cosines [m], r sqrt(2 int G_d dn) over the band nearest to each (by Simpson's rule)."""
        centre, half = self.spatial_frequency, 0.5 / self.length
        lower, upper = jnp.clip(centre - half, *self.band), jnp.clip(centre + half, *self.band)
        ends = [displacement_psd(n, self.roughness_psd, self.waviness) for n in (lower, 0.5 * (lower + upper), upper)]
        return self.relative_amplitude * jnp.sqrt((upper - lower) / 3.0 * (ends[0] + 4.0 * ends[1] + ends[2]))

    @property
    def duration(self) -> float | None:
        """The time [s] after which the road repeats."""
        speed = _checks.concrete(self.speed)
        return None if speed is None else self.length / float(speed)

    @property
    def longest_run(self) -> float | None:
        """The time [s] after which the road repeats, at the highest of several speeds."""
        speed = behind(self.speed)
        return None if speed is None else self.length / float(np.max(speed))

    def reseeded(self, seed: int) -> "Iso8608":
        """Another realisation: the probabilities of phases and amplitudes are shifted, alike for equal roads.

        Equal tracks stay equal, independent ones independent.
        """
        phase, size = shifted(self.phase, self.relative_amplitude, uniform(seed, (2, self.phase.size)))
        if self.amplitudes == "fixed":
            return eqx.tree_at(lambda road: road.phase, self, phase)
        return eqx.tree_at(lambda road: (road.phase, road.relative_amplitude), self, (phase, size))


@jax.jit
def shifted(
    phase: Float[Array, " waves"], size: Float[Array, " waves"], drawn: Float[Array, "2 waves"]
) -> tuple[Float[Array, " waves"], Float[Array, " waves"]]:
    """Phases [rad] and relative amplitudes whose probabilities are shifted by numbers between 0 and 1."""
    turn, shift = drawn
    return (phase + 2.0 * math.pi * turn) % (2.0 * math.pi), rayleigh((jnp.exp(-(size**2)) + shift) % 1.0)


def iso8608(
    road_class: str | ScalarLike,
    speed: ScalarLike | int,
    duration: float | int | None = None,
    *,
    seed: int | Array,
    waviness: ScalarLike | int = 2.0,
    minimum_spatial_frequency: float = LOWEST_SPATIAL_FREQUENCY,
    maximum_spatial_frequency: float = HIGHEST_SPATIAL_FREQUENCY,
    length: float | int | None = None,
    ramp: float | int = 0.5,
    amplitudes: str = "random",
) -> Iso8608:
    """A random road of an ISO 8608 roughness class, driven at constant speed.

    Its displacement PSD over spatial frequency is G_d(n) = G_d(n0) (n/n0)^-w; over frequency it is
    G_d(f/speed)/speed. The road is z(t) = sum_i r_i a_i cos(2 pi n_i V t + phi_i) with n_i = i/length and random phases
    phi_i; a_i^2/2 is the integral of G_d over the band 1/length wide around n_i. It has as many cosines as there are
    multiples of 1/length in the band (2820 for 1 km), and repeats after `length`: simulations refuse to run longer.

    By default the factors r_i are random as well, with the Rayleigh distribution of mean square 1: the road is a
    Gaussian process. The spectrum is that of the class on average, and the RMS of a run scatters from seed to seed as
    on real roads of one class: over the whole length by sqrt(sum p_i^2)/2, where p_i is the share of a cosine in the
    mean square of the signal (2 to 8 % for the body acceleration of a car in 50 s). With `amplitudes="fixed"` all r_i
    are 1: every road has exactly the spectrum and the variance of the class, and a run as long as the road hardly
    scatters. Take this to reproduce a spectrum, not to judge how sure a difference between two dampers is. Heights are
    then only close to Gaussian, with a kurtosis of 3 - 1.5 sum p_i^2 (2.96 for the defaults). A seed gives the same
    phases with either.

    One road holds few long waves: judge body motion on several seeds.

    Differentiable in `speed`, `waviness` and a numeric `road_class`; the same ground is then driven faster or is
    rougher. `two_track` adds the right-hand track, `delayed` the rear axle; `iso8608_filtered` is the road made by a
    shaping filter instead.

    Arguments:
        road_class: a letter from "A" (very good) to "H" (very poor), standing for the geometric mean of the class, or
            the roughness G_d(n0) itself [m^3] at n0 = 0.1 cycle/m ("A" is 16e-6, each class four times the one
            before).
        speed: V, the speed of the vehicle [m/s].
        duration: the time [s] the road must last before it repeats; lengthens the road where 1 km is not enough. The
            same seed with another length is another road.
        seed: a whole number, or a JAX random key.
        waviness: w; 2 in the standard.
        minimum_spatial_frequency: the lower end of the spectrum [cycle/m]; 0.011 in the standard.
        maximum_spatial_frequency: the upper end of the spectrum [cycle/m]; 2.83 in the standard. It reaches the
            frequency 2.83 V: sample the road at more than twice that.
        length: the distance [m] after which the road repeats; by default the longest of 1000 m, ten of the longest
            waves, and `speed` times `duration`.
        ramp: the time [s] over which the road fades in as a raised cosine at the start, so that a vehicle at rest on
            level ground meets no jump; 0 turns it off.
        amplitudes: "random" for a Gaussian road, "fixed" for the exact spectrum in every road.

    Raises:
        ValueError: if the class or `amplitudes` is unknown, if `speed`, the roughness or a spatial frequency is not
            positive, if `waviness` or `ramp` is negative, if the band is empty, if `length` is shorter than the
            longest wave or than `speed` times `duration`, or if `duration` is given while `speed` is traced (give
            `length` instead).

    Source: ISO 8608; Rice (1944) for the Gaussian sum of cosines. Not to be confused with the table over rad/m, whose
    reference is 1 rad/m (1e-6 m^3 for class A).

    >>> import jax.numpy as jnp
    >>> road = iso8608("C", speed=20.0, seed=1, ramp=0.0, amplitudes="fixed")
    >>> z = road.height(jnp.linspace(0.0, 50.0, 10_000, endpoint=False))[:, 0]
    >>> round(float(jnp.sqrt(jnp.mean(z**2))), 6)  # sqrt(256e-6 * 0.1**2 * (1/0.011 - 1/2.83))
    0.015226
    >>> road.duration
    50.0
    """
    band = (float(minimum_spatial_frequency), float(maximum_spatial_frequency))
    _checks.positive("minimum_spatial_frequency", band[0])
    _checks.finite("maximum_spatial_frequency", band[1])
    if band[0] >= band[1]:
        _checks.refuse(
            "minimum_spatial_frequency",
            f"be below `maximum_spatial_frequency` ({band[1]} cycle/m)",
            f"{band[0]} cycle/m",
            "Exchange them, or widen the band.",
        )
    check_speed(speed, "Roads are driven forwards; it is in m/s.")
    _checks.nonnegative("waviness", waviness, "The standard uses 2.")
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    _checks.one_of("amplitudes", amplitudes, ["random", "fixed"])
    density = roughness(road_class)
    length = _repeat_length(band, speed, duration, length)
    first, last = _first_and_last(band, length)
    phase, size = _phases_and_sizes(uniform(seed, (2, last - first + 1)))
    return Iso8608(
        roughness_psd=jnp.asarray(density, float),
        waviness=jnp.asarray(waviness, float),
        driven_at=jnp.asarray(speed, float),
        phase=phase,
        relative_amplitude=jnp.ones_like(phase) if amplitudes == "fixed" else size,
        length=length,
        band=band,
        ramp=float(ramp),
        amplitudes=amplitudes,
    )


@jax.jit
def _phases_and_sizes(drawn: Float[Array, "2 waves"]) -> tuple[Float[Array, " waves"], Float[Array, " waves"]]:
    """Phases [rad] and Rayleigh-distributed relative amplitudes from two rows of numbers between 0 and 1."""
    turn, above = drawn
    return 2.0 * math.pi * turn, rayleigh(above)


def _first_and_last(band: tuple[float, float], length: float) -> tuple[int, int]:
    """The multiples of 1/length whose own bands of that width cover the whole band."""
    return math.floor(band[0] * length + 0.5 + 1e-9), math.ceil(band[1] * length - 0.5 - 1e-9)


def _repeat_length(
    band: tuple[float, float], speed: ScalarLike | int, duration: float | int | None, length: float | int | None
) -> float:
    needed = 0.0
    if duration is not None:
        duration = _checks.plain_number("duration", duration)
        _checks.positive("duration", duration)
        velocity = _checks.concrete(speed)
        if velocity is None:
            remedy = (
                "The number of cosines must be known: give `length`, the distance in m after which the road may repeat."
            )
            _checks.refuse("duration", "be left out where `speed` is traced by JAX", f"{duration} s", remedy)
        needed = float(velocity) * float(duration)
    if length is None:
        return max(1000.0, needed, 10.0 / band[0])
    _checks.positive("length", length)
    shortest = max(needed, 1.0 / band[0])
    if length < shortest * (1.0 - 1e-9):
        _checks.refuse(
            "length",
            f"be at least {shortest:.6g} m, the longest wave or the distance driven",
            f"{length} m",
            "Make it longer, or leave it out.",
        )
    return float(length)
