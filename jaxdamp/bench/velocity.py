"""Velocity from a measured stroke without drowning in its noise.

A difference of neighbouring samples multiplies noise of σ metres by √2 times the sampling rate: 10 µm at 2 kHz become
28 mm/s. Two better ways, the first where it applies:

* harmonic regression: a steady sine of a test bench is a few harmonics of one frequency. Frequency and harmonics are
  fitted to the whole record and differentiated exactly; noise, mains ripple and quantisation average out.
* Savitzky-Golay: the slope of a cubic or quintic fitted around every sample. The window is the one with the least
  expected error, judged by what in the spectrum of the record is motion (see `jaxdamp.bench.spectrum`). Of strokes at
  constant velocity, as in a triangle, the slope of a parabola: a mean of the velocity, which overshoots at no corner.
"""

import numpy as np
from jaxtyping import ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import clock
from jaxdamp.bench.motion import Samples, cycle_instants, dominant_frequency, savitzky_golay, savitzky_golay_factors
from jaxdamp.bench.spectrum import Spectrum, spectrum_of


METHODS = ("harmonic", "savitzky-golay")
_HARMONICS = 8
_STEADY = 0.004  # amplitude by which a cycle may differ from the mean cycle
_UNSTEADY = 0.5  # the same, beyond which a look at some of the samples is enough
_ENOUGH, _A_CYCLE = 20_000, 20  # samples, in all and in a cycle, of such a look
_LAST_SHARE = 0.005  # of the highest harmonics in the velocity, relative to the fundamental
_AT_REST = 0.02  # of the largest speed, which no stroke of a machine at rest exceeds
_SHORTEST = 10  # samples of a stroke
_CONSTANT = 0.85  # of the largest speed of a stroke but for a tenth of its samples, which half of it exceeds
_QUIET = 0.03  # residual, relative to the amplitude, that is taken for ripple and noise of any colour


@of_known_numbers
@one_thread()
def estimate_velocity(time: ArrayLike, stroke: ArrayLike, *, method: str | None = None) -> tuple[Samples, str]:
    """Velocity of a uniformly sampled stroke, and a sentence that says how it was found.

    Arguments:
        time: instants [s], uniform, shape (time,).
        stroke: stroke [m], shape (time,). It stays as it is.
        method: "harmonic" or "savitzky-golay"; None takes the harmonic regression where the whole record is a steady
            periodic motion of at least two cycles, and Savitzky-Golay elsewhere.

    Returns:
        Velocity [m/s], of the stroke's sign, and the sentence.

    Raises:
        ValueError: too few samples, NaN, a constant stroke, time not uniform, or "harmonic" asked for a record that
            is not steady and periodic.

    >>> time = np.arange(2000) / 1000
    >>> stroke = 0.010 * np.sin(2 * np.pi * 3 * time) + 1e-5 * np.random.default_rng(0).standard_normal(2000)
    >>> velocity, how = estimate_velocity(time, stroke)
    >>> how
    'velocity from the stroke by harmonic regression, 3 Hz, 1 harmonic'
    >>> error = velocity - 2 * np.pi * 3 * 0.010 * np.cos(2 * np.pi * 3 * time)
    >>> bool(np.max(np.abs(error)) < 5e-4)
    True
    """
    if method is not None:
        _checks.one_of("method", method, METHODS)
    time, stroke = np.asarray(time, dtype=np.float64), np.asarray(stroke, dtype=np.float64)
    if time.ndim != 1 or time.shape != stroke.shape:
        _checks.refuse("stroke", f"have the shape of the time, {time.shape}", f"of shape {stroke.shape}")
    clock.check_count(len(time), "the record")
    clock.check_numbers(time, "time", "the record")
    clock.check_numbers(stroke, "stroke", "the record")
    clock.check_stroke(stroke, "the record")
    time, _ = clock.check_time(time, "the record")
    frequency = dominant_frequency(time, stroke)
    spectrum = spectrum_of(time, stroke, frequency)
    if method != "savitzky-golay":
        fit = None if spectrum.has_fast_motion else _fit_harmonics(time, stroke, frequency)
        if fit is not None:
            velocity, omega, count = fit
            wave = f"{omega / (2 * np.pi):.5g} Hz, {count} harmonic{'s' * (count > 1)}"
            left = spectrum.left_out(spectrum.omega < 1.5 * count * omega / spectrum.rate)
            return velocity, f"velocity from the stroke by harmonic regression, {wave}{left}"
        if method == "harmonic":
            _checks.refuse(
                "method",
                "fit the record",
                "'harmonic' for a stroke that is no steady periodic motion of two cycles or more",
                "Cut rest and run-up away, or use 'savitzky-golay'.",
            )
    window, order, gain = _window(spectrum, frequency, (3, 5))
    velocity = spectrum.rate * savitzky_golay(stroke, window, order, derivative=1)
    if _is_mostly_constant(velocity):
        window, order, gain = _window(spectrum, frequency, (2,))
        velocity = spectrum.rate * savitzky_golay(stroke, window, order, derivative=1)
    width = f"{window} samples ({1e3 * (window - 1) / spectrum.rate:.3g} ms)"
    how = f"velocity from the stroke by a Savitzky-Golay filter of {width}, order {order}"
    return velocity, how + spectrum.left_out(gain / np.maximum(spectrum.omega, np.finfo(float).tiny))


def _basis(phase: Samples, harmonics: int) -> Float[np.ndarray, "time columns"]:
    """Columns 1, cos kφ, sin kφ for k = 1 … harmonics."""
    basis = np.ones((len(phase), 1 + 2 * harmonics))
    cosines, sines = basis[:, 1 : harmonics + 1], basis[:, harmonics + 1 :]
    np.multiply(phase[:, None], np.arange(1, harmonics + 1), out=cosines)  # in place: records may be long
    np.sin(cosines, out=sines)
    np.cos(cosines, out=cosines)
    return basis


def _least_squares(basis: Float[np.ndarray, "time columns"], values: Samples) -> Float[np.ndarray, " columns"]:
    """Least squares by the normal equations, good enough because waves over whole cycles are nearly orthogonal."""
    scale = np.sqrt(np.einsum("ij,ij->j", basis, basis))
    gram = (basis.T @ basis) / np.outer(scale, scale)
    return np.linalg.solve(gram, (basis.T @ values) / scale) / scale


def _derivative(
    basis: Float[np.ndarray, "time columns"], omega: float, coefficients: Float[np.ndarray, " columns"]
) -> Samples:
    count = (len(coefficients) - 1) // 2
    order = omega * np.arange(1, count + 1)
    return basis[:, count + 1 :] @ (-order * coefficients[1 : count + 1]) + basis[:, 1 : count + 1] @ (
        order * coefficients[count + 1 :]
    )


def _fit_frequency(t: Samples, stroke: Samples, omega: float, harmonics: int) -> tuple[float, np.ndarray]:
    """Gauss-Newton on the frequency with the harmonics projected out (they are linear); t has mean zero."""
    coefficients = np.zeros(1 + 2 * harmonics)
    for _ in range(12):
        basis = _basis(omega * t, harmonics)
        coefficients = _least_squares(basis, stroke)
        slope = _derivative(basis, omega, coefficients) * t / omega  # derivative of the wave by the frequency
        both = _least_squares(np.concatenate([basis, slope[:, None]], axis=1), stroke)
        omega += float(both[-1])
        if abs(both[-1]) < 1e-13 * abs(omega) or omega <= 0:
            break
    return omega, coefficients


def _fit_harmonics(time: Samples, stroke: Samples, frequency: float) -> tuple[Samples, float, int] | None:
    """Velocity, angular frequency and number of harmonics of a steady periodic record, or None if it is not one."""
    rate = (len(time) - 1) / (time[-1] - time[0])
    most = min(_HARMONICS, int(0.4 * rate / frequency))
    if len(time) * frequency / rate < 1.9 or most < 1:
        return None
    t = time - time.mean()
    guess = 2 * np.pi * frequency
    thin = slice(None, None, max(min(len(t) // _ENOUGH, int(rate / frequency / _A_CYCLE)), 1))
    omega, wave = _fit_frequency(t[thin], stroke[thin], guess, 1)
    if abs(omega / guess - 1) > 0.1:
        return None
    left = stroke[thin] - _basis(omega * t[thin], 1) @ wave
    if np.any(_in_cycles(t[thin], left, omega)[0] > _UNSTEADY * np.hypot(*wave[1:])):
        return None
    omega, _ = _fit_frequency(t, stroke, omega, 1)
    used = _significant(stroke, _basis(omega * t, most))
    if used is None:
        return None
    omega, coefficients = _fit_frequency(t, stroke, omega, used)
    basis = _basis(omega * t, used)
    residual = stroke - basis @ coefficients
    if not _steady(t, residual, omega, float(np.hypot(coefficients[1], coefficients[1 + used]))):
        return None
    return _derivative(basis, omega, coefficients), omega, used


def _significant(stroke: Samples, basis: Float[np.ndarray, "time columns"]) -> int | None:
    """How many harmonics the wave has: up to the last one before two in a row drown in the noise.

    None if the velocity of the highest ones is still not small: corners, as in a triangle, have no end of harmonics.
    """
    most = (basis.shape[1] - 1) // 2
    coefficients = _least_squares(basis, stroke)
    sizes = np.hypot(coefficients[1 : most + 1], coefficients[most + 1 :])
    noise = float(np.std(stroke - basis @ coefficients)) * np.sqrt(2 / len(stroke))
    seen = sizes > max(5 * noise, 1e-4 * sizes[0])
    used = 1
    for k in range(1, most):
        if seen[k]:
            used = k + 1
        elif k + 1 >= most or not seen[k + 1]:
            break
    share = np.arange(1, most + 1) * sizes / sizes[0]  # of the velocity
    return None if most > 2 and np.any((share > _LAST_SHARE)[-2:] & seen[-2:]) else used


def _steady(t: Samples, residual: Samples, omega: float, amplitude: float) -> bool:
    """Whether what the wave leaves is noise: no cycle differs from the mean one, and little or no colour is left."""
    spread = float(np.sqrt(np.mean(residual**2)))
    if spread < 1e-7 * amplitude:
        return True
    local, most = _in_cycles(t, residual, omega)
    white = float(np.std(np.diff(residual)) / np.sqrt(2))
    allowed = _STEADY * amplitude + 4 * white * np.sqrt(2 / most)
    return bool(np.all(local < allowed) and (spread < _QUIET * amplitude or spread < 1.3 * white))


def _in_cycles(t: Samples, residual: Samples, omega: float) -> tuple[Float[np.ndarray, " cycles"], int]:
    """The fundamental of what a wave leaves in each whole cycle, and the number of samples of the longest one."""
    cycle = np.floor(omega * (t - t[0]) / (2 * np.pi) + 1e-9).astype(int)
    count = np.bincount(cycle)
    full = count >= 0.9 * count.max()
    cosine, sine = (np.bincount(cycle, wave(omega * t) * residual) for wave in (np.cos, np.sin))
    return (2 * np.hypot(cosine, sine) / np.maximum(count, 1))[full], int(count.max())


def _is_mostly_constant(velocity: Samples) -> bool:
    """Whether most strokes of a motion have nearly one speed each: half of a sine is slower than 0.7 of its largest."""
    turns = np.flatnonzero(np.diff(velocity > 0)) + 1
    strokes = [np.abs(part) for part in np.split(velocity, turns) if len(part) >= _SHORTEST]
    moving = [speed for speed in strokes if speed.max() > _AT_REST * np.abs(velocity).max()]
    constant = [len(speed) for speed in moving if np.median(speed) > _CONSTANT * np.quantile(speed, 0.9)]
    return sum(constant) > 0.5 * sum(map(len, moving))


def _window(
    spectrum: Spectrum, frequency: float, orders: tuple[int, ...]
) -> tuple[int, int, Float[np.ndarray, " lines"]]:
    """Length and order of the Savitzky-Golay filter with the least expected error of the velocity, and its gain."""
    power, omega = spectrum.power, spectrum.omega
    motion = np.where(spectrum.motion, power - spectrum.floor, 0.0)
    longest = min(max(spectrum.rate / frequency, 5), 2 * (len(power) - 1) - 1)
    best = (np.inf, 5, orders[0])
    for order in orders:
        half = least = (order + 1) // 2
        while 2 * half + 1 <= longest or half == least:
            response = _response(half, order, omega)
            error = float(np.sum(motion * (response - omega) ** 2 + (power - motion) * response**2))
            best = min(best, (error, 2 * half + 1, order))
            half = max(half + 1, round(1.2 * half))
    return best[1], best[2], _response(best[1] // 2, best[2], omega)


def _response(half: int, order: int, omega: Float[np.ndarray, " lines"]) -> Float[np.ndarray, " lines"]:
    """Gain of the differentiating filter at angular frequencies per sample; the ideal gain is ω itself."""
    coefficients = np.zeros(2 * half)
    at, fitted = savitzky_golay_factors(half, order, 1)
    coefficients[1 : half + 1] = at[half] @ fitted[:, half + 1 :]
    size = 32 * half
    return np.interp(omega, 2 * np.pi * np.arange(size // 2 + 1) / size, -2 * np.fft.rfft(coefficients, size).imag)


def integrate_velocity(time: Samples, velocity: Samples, where: str) -> tuple[Samples, Samples, str]:
    """Stroke [m] and velocity [m/s] without drift, and a sentence that says what was done.

    A constant error of the velocity makes the stroke drift. It is the slope of the straight line through the means of
    the stroke over the full cycles, and is taken off the velocity. Zero stroke is the middle of the motion.
    """
    from scipy.interpolate import CubicSpline  # takes a second to import, and few records need it

    instants = cycle_instants(time, velocity) if np.ptp(velocity) > 0 else time[:1]
    if len(instants) < 2:
        raise ValueError(
            f"{where}: the velocity has no full cycle, so that drift cannot be told from motion when it is integrated. "
            "Record a cycle or more, or a stroke channel."
        )
    curve = CubicSpline(time, velocity)
    lengths, wander = np.diff(instants), ""
    if len(lengths) > 1:
        means, middles = np.diff(curve.antiderivative(2)(instants)) / lengths, instants[:-1] + 0.5 * lengths
        offset, start = np.polyfit(middles - time[0], means, 1)
        off = means - start - offset * (middles - time[0])
        wander = f", and wanders by {1e3 * np.std(off):.2g} mm from cycle to cycle" if len(off) > 2 else ""
    else:
        offset = np.diff(curve.antiderivative()(instants))[0] / lengths[0]
    stroke = curve.antiderivative()(time) - offset * (time - time[0])
    steady = stroke[(time >= instants[0]) & (time <= instants[-1])]
    note = (
        f"stroke integrated from the velocity, less a constant {offset:.3g} m/s against drift; its zero is the middle "
        f"of the motion, not a place in the damper{wander}"
    )
    return stroke - 0.5 * (steady.max() + steady.min()), velocity - offset, note
