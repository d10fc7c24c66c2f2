"""The ISO 8608 road as white noise through a first-order filter."""

import math
from typing import final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._random import normal
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.roads._sampled import AbstractProcess, SampledRoad
from jaxdamp.roads.iso_classes import LOWEST_SPATIAL_FREQUENCY, REFERENCE_SPATIAL_FREQUENCY, roughness


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

    _, rest = jax.lax.scan(advance, noise[0], noise[1:])
    return jnp.concatenate([noise[:1], rest])


@final
class FilteredNoise(AbstractProcess):
    """The shaping filter at equally spaced samples.

    Arguments:
        deviation: standard deviation of the heights [m].
        correlation: of neighbouring samples.
    """

    deviation: Scalar
    correlation: Scalar

    def draw(self, seed: int | Array, count: int) -> Float[Array, " samples"]:
        """So many heights [m]."""
        return self.deviation * autoregressive(normal(seed, (count,)), self.correlation)


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
    _checks.positive("speed", speed, "Roads are driven forwards; it is in m/s.")
    _checks.positive("cutoff", cutoff, "Without a cut-off the variance of the road grows without end.")
    _checks.positive("spacing", spacing)
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    samples = math.ceil(_length(speed, duration, length) / spacing - 1e-9) + 1
    correlation = jnp.asarray(jnp.exp(-2.0 * math.pi * spacing * jnp.asarray(cutoff, float)))
    process = FilteredNoise(jnp.sqrt(filtered_noise_variance(density, cutoff)), correlation)
    return SampledRoad(
        samples=process.draw(seed, samples)[:, None],
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
