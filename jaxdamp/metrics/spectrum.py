"""Power spectral density."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_signal, check_interval


# Coefficients a_k of the periodic windows w_j = sum_k (-1)^k a_k cos(2 pi k j/n).
_COSINE_WINDOWS = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman": (0.42, 0.5, 0.08),
}


def cosine_window(name: str, size: int) -> Float[np.ndarray, " size"]:
    """A periodic window of `size` samples: "rectangular", "hann", "hamming" or "blackman"."""
    _checks.one_of("window", name, _COSINE_WINDOWS)
    angle = 2.0 * np.pi * np.arange(size) / size
    return sum(((-1) ** k * a * np.cos(k * angle) for k, a in enumerate(_COSINE_WINDOWS[name])), np.zeros(size))


def power_spectral_density(
    signal: SignalLike,
    dt: ScalarLike | int,
    segment_length: int | None = None,
    *,
    overlap: float | int = 0.5,
    window: str = "hann",
    remove_mean: bool = True,
) -> tuple[Float[Array, " frequencies"], Float[Array, " frequencies"]]:
    """One-sided power spectral density by Welch's method: (frequency [Hz], density [unit^2/Hz]).

    The signal is cut into overlapping segments; of each, the mean is removed, and |X|^2 of the windowed segment,
    times 2 dt/sum(w^2) (1 instead of 2 at zero and at the Nyquist frequency), is averaged over the segments. The sum
    of the density times the frequency step 1/(segment_length dt) is the variance of the signal, up to the scatter of
    the estimate; exactly so for one rectangular segment. Samples at the end that do not fill a segment are not used.

    The relative standard deviation of each value is about 1/sqrt(number of independent segments). The result equals
    `scipy.signal.welch` with the same settings. Differentiable in `signal` and `dt`.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.
        dt: the sampling interval [s].
        segment_length: the number of samples in a segment. By default an eighth of the signal (at least 2), which
            with half overlap gives 15 segments. The frequency resolution is 1/(segment_length dt).
        overlap: the part of a segment shared with the next one, from 0 up to but not including 1; half is right for
            "hann".
        window: "hann", "hamming", "blackman" or "rectangular".
        remove_mean: whether to subtract the mean of every segment first.

    Returns:
        The frequencies from 0 to 1/(2 dt) and the density at each, shape [segment_length // 2 + 1].

    Raises:
        ValueError: if `dt` is not positive, `segment_length` is not between 2 and the length of the signal, `overlap`
            is not in [0, 1), or `window` is unknown.

    Source: Welch, IEEE Trans. Audio Electroacoustics 15 (1967) 70-73.

    >>> import jax.numpy as jnp
    >>> x = jnp.sin(2.0 * jnp.pi * 5.0 * jnp.arange(4000.0) * 0.001)
    >>> frequency, psd = power_spectral_density(x, 0.001, segment_length=1000)
    >>> round(float(frequency[jnp.argmax(psd)]), 6)
    5.0
    >>> round(float(jnp.sum(psd) * frequency[1]), 6)  # the variance of a sine, 1/2
    0.5
    """
    signal = as_signal("signal", signal, least=2)
    weights, step = welch_plan(signal, dt, segment_length, overlap, window)
    return _density(signal, jnp.asarray(dt, signal.dtype), weights, step=step, remove_mean=remove_mean)


def welch_plan(
    signal: Signal, dt: ScalarLike | int, segment_length: int | None, overlap: float | int, window: str
) -> tuple[Float[Array, " size"], int]:
    """The window of a segment and the step from one to the next, checked."""
    check_interval(dt)
    _checks.untraced("segment_length", segment_length, "It is part of a compiled program: give a plain number.")
    size = max(2, signal.size // 8) if segment_length is None else segment_length
    if not 2 <= size <= signal.size:
        remedy = "Shorten the segments."
        _checks.refuse("segment_length", f"lie between 2 and the length of the signal ({signal.size})", size, remedy)
    overlap = _checks.plain_number("overlap", overlap)
    if not 0.0 <= overlap < 1.0:
        remedy = "It is a part of a segment: write 0.5 for 50 %."
        _checks.refuse("overlap", "be at least 0 and below 1", overlap, remedy)
    return jnp.asarray(cosine_window(window, size), signal.dtype), size - min(int(overlap * size), size - 1)


def segment_spectra(
    signal: Signal, weights: Float[Array, " size"], *, step: int, remove_mean: bool
) -> Complex[Array, "segments frequencies"]:
    """The discrete Fourier transform of every windowed segment."""
    starts = np.arange(0, signal.size - weights.size + 1, step)
    segments = signal[starts[:, None] + np.arange(weights.size)[None, :]]
    if remove_mean:
        segments = segments - jnp.mean(segments, axis=1, keepdims=True)
    return jnp.fft.rfft(segments * weights[None, :])


@jax.jit(static_argnames=("step", "remove_mean"))
def _density(
    signal: Signal, dt: Scalar, weights: Float[Array, " size"], *, step: int, remove_mean: bool
) -> tuple[Float[Array, " frequencies"], Float[Array, " frequencies"]]:
    size = weights.size
    spectra = segment_spectra(signal, weights, step=step, remove_mean=remove_mean)
    sided = np.full(size // 2 + 1, 2.0)
    sided[0] = 1.0
    if size % 2 == 0:
        sided[-1] = 1.0
    scale = jnp.asarray(sided, signal.dtype) * (dt / jnp.sum(weights**2))
    density = scale * jnp.mean(spectra.real**2 + spectra.imag**2, axis=0)
    return jnp.arange(size // 2 + 1, dtype=signal.dtype) / (size * dt), density
