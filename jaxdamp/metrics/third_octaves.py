"""Third-octave bands of a spectrum, weighted as people feel them."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._limits import root
from jaxdamp.metrics.weighted import check_weighting, weighting_factor


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
    known = _checks.concrete(lines)
    if known is not None and not (known[1:] > known[:-1]).all():
        _checks.refuse("frequency", "increase", f"{known[0]:g} to {known[-1]:g} Hz in another order")
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
