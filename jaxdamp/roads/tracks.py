"""Roads with a left and a right track, and their coherency."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._random import rayleigh, sign, uniform
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads._composed import AbstractOnSeveralRoads, same_columns
from jaxdamp.roads.base import AbstractRoad, Columns
from jaxdamp.roads.iso_roughness import Iso8608, shifted


# K_v(x) = int_0^inf exp(-x cosh t) cosh(v t) dt by the trapezoidal rule. The error at this step is below 1e-13 up to
# x = 150, where K is 1e-66; the range, to t = 16, suffices down to the least x.
_STEP, _NODES, _LEAST = 0.0625, 257, 2e-5


def coherency(
    spatial_frequency: Float[ArrayLike, "..."], track_width: ScalarLike | int, waviness: ScalarLike | int = 2.0
) -> Float[Array, "..."]:
    """The coherency of two parallel tracks on an isotropic Gaussian surface whose spectrum is a power law n^-w.

    gamma(n) = 2 (x/2)^(w/2) K_(w/2)(x)/Gamma(w/2) with x = 2 pi B n and the modified Bessel function K. It is real,
    1 for waves much longer than the track B, 0 for much shorter ones; the cross spectrum of the tracks is gamma G_d,
    the coherence (as estimated by `scipy.signal.coherence`) gamma^2. Differentiable in all arguments. Relative accuracy
    1e-12 for 2e-5 < x < 150; waves longer than 3e5 B count as that long.

    Arguments:
        spatial_frequency: n [cycle/m], positive, of any shape.
        track_width: B, the distance between the tracks [m].
        waviness: w, positive.

    Raises:
        ValueError: if an argument is not positive.

    Source: isotropy of road surfaces, Kamash and Robson (1978); formula derived for jaxdamp and checked by quadrature.

    >>> import jax.numpy as jnp
    >>> coherency(jnp.array([0.01, 0.1, 1.0]), 1.5).round(4)
    Array([0.9868, 0.6264, 0.0003], dtype=float64)
    """
    _checks.positive("spatial_frequency", spatial_frequency)
    _checks.positive("track_width", track_width)
    _checks.positive("waviness", waviness, "The standard uses 2.")
    n = jnp.asarray(spatial_frequency, float)
    shared = _coherency(n.ravel(), jnp.asarray(track_width, float), jnp.asarray(waviness, float))
    return shared.reshape(n.shape)


@jax.jit
def _coherency(
    spatial_frequency: Float[Array, " lines"], track_width: ScalarLike, waviness: ScalarLike
) -> Float[Array, " lines"]:
    order, x = 0.5 * waviness, jnp.maximum(2.0 * jnp.pi * track_width * spatial_frequency, _LEAST)
    t = _STEP * jnp.arange(_NODES, dtype=x.dtype)
    # both exponents in one, so that neither factor overflows
    exponents = -x[:, None] * jnp.cosh(t)[None, :]
    values = 0.5 * (jnp.exp(exponents + (order * t)[None, :]) + jnp.exp(exponents - (order * t)[None, :]))
    bessel = _STEP * (jnp.sum(values, axis=1) - 0.5 * values[:, 0])
    return 2.0 * jnp.exp(order * jnp.log(0.5 * x) - jax.lax.lgamma(order)) * bessel


@final
class TwoTrack(AbstractOnSeveralRoads):
    """A left-hand and a right-hand track; created by `two_track`.

    Attributes:
        roads: left, right.
        track_width: B [m], where the right-hand track was made from the left-hand one.
    """

    roads: tuple[AbstractRoad, AbstractRoad]
    track_width: Scalar | None = None

    def heights_at(self, time: SignalLike) -> Float[Array, "time 2"]:
        """The heights [m] at each `time` [s], left then right."""
        return jnp.concatenate([track.height(time) for track in self.roads], axis=1)

    @property
    def wheels(self) -> int:
        """Left and right."""
        return 2

    @property
    def columns(self) -> Columns:
        """Two tracks side by side, in phase if they are."""
        in_phase = self.roads[0].columns.kind == "in phase"
        return Columns("in phase" if in_phase else "road", 2)

    def reseeded(self, seed: int) -> AbstractRoad | None:
        """Other tracks, which are as coherent as these."""
        left, right = self.roads
        if self.track_width is None or not isinstance(left, Iso8608) or not isinstance(right, Iso8608):
            return super().reseeded(seed)
        if left.amplitudes == "fixed":
            return super().reseeded(seed)
        gamma, remainder = _gamma(left, self.track_width), _others(seed, left.phase.size)
        difference = _parts_of(right.phase, right.relative_amplitude) - _parts_of(
            left.phase, gamma * left.relative_amplitude
        )
        turned, scaled = _polar(difference)
        phase, size = shifted(turned, scaled / jnp.sqrt((1.0 - gamma) * (1.0 + gamma)), remainder)
        other = left.reseeded(seed)
        return TwoTrack((other, _coherent(other, gamma, phase, size)), self.track_width)


def two_track(
    left: AbstractRoad,
    right: AbstractRoad | None = None,
    *,
    track_width: ScalarLike | int | None = None,
    seed: int | Array | None = None,
) -> TwoTrack:
    """A road with a left-hand and a right-hand track, in this order; follow it with `delayed` for several axles.

    Either give both tracks: any two roads with one track each, for example a pothole on the right and level ground on
    the left. Or give a random road of `iso8608` and the `track_width` B: the right-hand track is then another random
    road of the same spectrum, coherent at long wavelengths and independent at short ones, as on an isotropic surface
    (see `coherency`).

    Its cosines, as complex numbers, are gamma(n) times those of the left track and sqrt(1 - gamma(n)^2) times other
    ones with the same distribution, so that both tracks together are a Gaussian process. For a road with fixed
    amplitudes each cosine has the same amplitude and a phase shifted by arccos(gamma(n)), with a random sign: every
    road, not only their average, then has exactly the spectrum G_d of the class in both tracks, G_d (1 + gamma)/2 in
    their mean (heave) and 2 G_d (1 - gamma) in their difference (roll). The coherence over bands of many cosines is
    gamma^2 in either. Differentiable in `track_width` and in what the road is differentiable in.

    Arguments:
        left: the road under the left wheels, with a single track.
        right: the road under the right wheels, with a single track; the same object for a symmetric road.
        track_width: B [m], the distance between the tracks, for a right-hand track made from `left`.
        seed: a whole number, or a JAX random key, for the right-hand track: with `track_width` only.

    Raises:
        ValueError: if not exactly one of `right` and `track_width` is given, if a road has several tracks, if
            `track_width` is not positive or comes without `seed`, or if it is given for a road that is not made by
            `iso8608`.

    >>> import jax.numpy as jnp
    >>> from jaxdamp.roads import delayed, iso8608
    >>> road = two_track(iso8608("C", speed=20.0, seed=1), track_width=1.5, seed=2)
    >>> road.height(jnp.linspace(0.0, 10.0, 1001)).shape
    (1001, 2)
    >>> delayed(road, positions=[0.0, 2.7], speed=20.0).wheels  # front-left, front-right, rear-left, rear-right
    4
    """
    for name, road in (("left", left), ("right", right)):
        if road is not None and road.wheels != 1:
            remedy = (
                "First put the tracks beside each other, then the axles behind each other: delayed(two_track(...))."
            )
            _checks.refuse(name, "be a road with a single track", f"one with {road.wheels}", remedy)
    if (right is None) == (track_width is None):
        both = "neither was given" if right is None else f"a road, and track_width {track_width} m as well"
        _checks.refuse("right", "be given, or `track_width` with `seed`, but not both", both, "Give exactly one.")
    if right is not None:
        if seed is not None:
            _checks.refuse(
                "seed", "be left out when `right` is given", seed, "It is for a track made by `track_width`."
            )
        same_columns("right", (left, right))
        return TwoTrack((left, right))
    if not isinstance(left, Iso8608):
        remedy = "Give the second track as `right`."
        _checks.refuse("left", "be a road made by `iso8608` with `track_width`", f"a {type(left).__name__}", remedy)
    assert track_width is not None  # since `right` is None
    _checks.positive("track_width", track_width, "It is in m.")
    if seed is None:
        _checks.refuse("seed", "be given with `track_width`", seed, "Any whole number: another one, another road.")
    return TwoTrack((left, _beside(left, track_width, seed)), jnp.asarray(track_width, float))


def _beside(left: Iso8608, track_width: ScalarLike, seed: int | Array) -> Iso8608:
    """The right-hand track of a random road."""
    gamma = _gamma(left, track_width)
    if left.amplitudes == "fixed":
        return eqx.tree_at(lambda road: road.phase, left, left.phase + sign(seed, gamma.shape) * jnp.arccos(gamma))
    turn, above = _others(seed, gamma.size)
    return _coherent(left, gamma, 2.0 * jnp.pi * turn, rayleigh(above))


def _gamma(left: Iso8608, track_width: ScalarLike) -> Float[Array, " lines"]:
    """The coherency of the tracks at the cosines of a road."""
    # at 1, which gamma reaches only for a vanishing track, arccos and the square root have no slope
    gamma = coherency(left.spatial_frequency, track_width, left.waviness)
    return jnp.minimum(gamma, 1.0 - 4.0 * float(jnp.finfo(gamma.dtype).eps))


def _others(seed: int | Array, lines: int) -> Float[Array, "2 lines"]:
    """Numbers from 0 to 1 that `iso8608` and its roads do not use, so that the same seed may be given to both."""
    return uniform(seed, (4, lines))[2:]


def _parts_of(phase: Float[Array, " lines"], size: Float[Array, " lines"]) -> Float[Array, "2 lines"]:
    """The real and the imaginary part of cosines."""
    return jnp.stack([size * jnp.cos(phase), size * jnp.sin(phase)])


def _polar(parts: Float[Array, "2 lines"]) -> tuple[Float[Array, " lines"], Float[Array, " lines"]]:
    """Phases [rad] and sizes of cosines."""
    real, imaginary = parts
    return jnp.arctan2(imaginary, real), jnp.sqrt(real**2 + imaginary**2)


def _coherent(
    left: Iso8608, gamma: Float[Array, " lines"], phase: Float[Array, " lines"], size: Float[Array, " lines"]
) -> Iso8608:
    """A track whose cosines are gamma times those of `left` and sqrt(1 - gamma^2) times others."""
    shared, independent = gamma * left.relative_amplitude, jnp.sqrt((1.0 - gamma) * (1.0 + gamma)) * size
    drawn = _polar(_parts_of(left.phase, shared) + _parts_of(phase, independent))
    return eqx.tree_at(lambda road: (road.phase, road.relative_amplitude), left, drawn)
