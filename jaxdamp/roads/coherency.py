"""How alike the two tracks of a random road are."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._types import ScalarLike


# K_v(x) = int_0^inf exp(-x cosh t) cosh(v t) dt by the trapezoidal rule. The error at this step is below 1e-13 up to
# x = 150, where K is 1e-66; the range, to t = 16, suffices down to the least x.
_STEP, _NODES, _LEAST = 0.0625, 257, 2e-5


def coherency(
    spatial_frequency: Float[ArrayLike, " lines"], track_width: ScalarLike | int, waviness: ScalarLike | int = 2.0
) -> Float[Array, " lines"]:
    """The coherency of two parallel tracks on an isotropic Gaussian surface whose spectrum is a power law n^-w.

    gamma(n) = 2 (x/2)^(w/2) K_(w/2)(x)/Gamma(w/2) with x = 2 pi B n and the modified Bessel function K. It is real,
    1 for waves much longer than the track B, 0 for much shorter ones; the cross spectrum of the tracks is gamma G_d,
    the coherence (as estimated by `scipy.signal.coherence`) gamma^2. Differentiable in all arguments. Relative accuracy
    1e-12 for 2e-5 < x < 150; waves longer than 3e5 B count as that long.

    Arguments:
        spatial_frequency: n [cycle/m], positive.
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
    return _coherency(
        jnp.asarray(spatial_frequency, float), jnp.asarray(track_width, float), jnp.asarray(waviness, float)
    )


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
