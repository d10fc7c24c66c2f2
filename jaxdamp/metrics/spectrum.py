"""Power spectral densities of one signal and of two: transmissibility and coherence."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import as_signal, check_interval, same_length


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
    if not isinstance(size, int | np.integer):
        _checks.refuse("segment_length", "be a whole number of samples", repr(size), "Write 256, not 256.0.")
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
