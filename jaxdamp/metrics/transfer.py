"""What a vehicle passes on: transmissibility between two signals, and how far to trust it."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from jaxdamp import _checks
from jaxdamp._types import ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_signal, same_length
from jaxdamp.metrics.spectrum import segment_spectra, welch_plan


def transmissibility(
    input_signal: SignalLike,
    output_signal: SignalLike,
    dt: ScalarLike | int,
    segment_length: int | None = None,
    *,
    overlap: float | int = 0.5,
    window: str = "hann",
    remove_mean: bool = True,
) -> tuple[Float[Array, " frequencies"], Complex[Array, " frequencies"]]:
    """Frequency response by Welch's method, H1 = S_xy/S_xx: (frequency [Hz], complex response [output/input]).

    H1 is right where noise disturbs the output only; noise in the input makes it too small by 1 + noise/signal power
    there. A delay of the output turns the phase by -2 pi f times the delay and must be short against a segment. Trust
    it where `coherence` is near one. Where the input has no content the result is meaningless (at 0 Hz always, once
    the mean is removed) and NaN if its density is zero. Differentiable elsewhere.

    Arguments:
        input_signal: what excites, for example road or wheel, shape [time], any unit.
        output_signal: what follows, for example the body, shape [time], any unit; say in words which ratio it is.
        dt: the sampling interval [s].
        segment_length: the number of samples in a segment; by default an eighth of the record.
        overlap: the part of a segment shared with the next one, from 0 up to but not including 1.
        window: "hann", "hamming", "blackman" or "rectangular".
        remove_mean: whether to subtract the mean of every segment first.

    Returns:
        The frequencies from 0 to 1/(2 dt) and the response at each, shape [segment_length // 2 + 1]; its magnitude is
        `jnp.abs`, its phase `jnp.angle`.

    Raises:
        ValueError: if the lengths differ, or as `power_spectral_density`.

    Source: Bendat and Piersol, Random Data; equals the ratio of `scipy.signal.csd` and `scipy.signal.welch`.

    >>> import jax
    >>> x = jax.random.normal(jax.random.key(0), (4000,))
    >>> frequency, h = transmissibility(x, -2.5 * x, 0.01, 400)
    >>> round(float(h[40].real), 6), round(float(frequency[40]), 6)
    (-2.5, 10.0)
    """
    x, y = as_signal("input_signal", input_signal, least=2), as_signal("output_signal", output_signal, least=2)
    same_length("input_signal", x, "output_signal", y)
    weights, step = welch_plan(x, dt, segment_length, overlap, window)
    power, cross, _ = _moments(x, y, weights, step=step, remove_mean=remove_mean)
    return _frequencies(weights, dt), jax.lax.complex(cross.real / power, cross.imag / power)


def coherence(
    input_signal: SignalLike,
    output_signal: SignalLike,
    dt: ScalarLike | int,
    segment_length: int | None = None,
    *,
    overlap: float | int = 0.5,
    window: str = "hann",
    remove_mean: bool = True,
) -> tuple[Float[Array, " frequencies"], Float[Array, " frequencies"]]:
    """Ordinary coherence by Welch's method, |S_xy|^2/(S_xx S_yy): (frequency [Hz], coherence from 0 to 1 [-]).

    The part of the output's power that follows the input linearly; below one with noise, nonlinear laws, other
    inputs, or resonances narrower than a segment resolves. Unrelated signals give about 1/(number of independent
    segments), and a single segment would give one: it is refused. Differentiable; NaN where a density is zero.

    Arguments:
        input_signal: what excites, shape [time], any unit.
        output_signal: what follows, shape [time], any unit.
        dt: the sampling interval [s].
        segment_length: the number of samples in a segment; by default an eighth of the record.
        overlap: the part of a segment shared with the next one, from 0 up to but not including 1.
        window: "hann", "hamming", "blackman" or "rectangular".
        remove_mean: whether to subtract the mean of every segment first.

    Raises:
        ValueError: if the lengths differ, if the record holds a single segment, or as `power_spectral_density`.

    Source: Bendat and Piersol, Random Data; equals `scipy.signal.coherence` with the same settings.

    >>> import jax
    >>> x, noise = jax.random.normal(jax.random.key(0), (2, 20000))
    >>> frequency, gamma2 = coherence(x, x + noise, 0.01, 400)
    >>> round(float(jnp.mean(gamma2)), 1)  # half of the output's power is noise
    0.5
    """
    x, y = as_signal("input_signal", input_signal, least=2), as_signal("output_signal", output_signal, least=2)
    same_length("input_signal", x, "output_signal", y)
    weights, step = welch_plan(x, dt, segment_length, overlap, window)
    if weights.size + step > x.size:
        must = f"leave two segments in {x.size} samples: the coherence of one is always 1"
        _checks.refuse("segment_length", must, weights.size, "Shorten the segments.")
    power, cross, other = _moments(x, y, weights, step=step, remove_mean=remove_mean)
    return _frequencies(weights, dt), (cross.real**2 + cross.imag**2) / (power * other)


def _frequencies(weights: Float[Array, " size"], dt: ScalarLike | int) -> Float[Array, " frequencies"]:
    size = weights.size
    return jnp.arange(size // 2 + 1, dtype=weights.dtype) / (size * jnp.asarray(dt, weights.dtype))


@jax.jit(static_argnames=("step", "remove_mean"))
def _moments(
    x: Signal, y: Signal, weights: Float[Array, " size"], *, step: int, remove_mean: bool
) -> tuple[Float[Array, " frequencies"], Complex[Array, " frequencies"], Float[Array, " frequencies"]]:
    """S_xx, S_xy and S_yy, up to one factor."""
    first = segment_spectra(x, weights, step=step, remove_mean=remove_mean)
    second = segment_spectra(y, weights, step=step, remove_mean=remove_mean)
    cross = jnp.mean(first.conj() * second, axis=0)
    power, other = (jnp.mean(z.real**2 + z.imag**2, axis=0) for z in (first, second))
    return power, cross, other
