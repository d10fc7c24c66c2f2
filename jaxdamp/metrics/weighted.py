"""The frequency weightings of ISO 2631-1, and records of acceleration weighted by them."""

import functools
import math
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.metrics._signals import StateSpace, as_numbers, as_signal, check_interval, respond_exactly
from jaxdamp.metrics.amplitude import rms


class _Parameters(NamedTuple):
    """Frequencies in Hz and quality factors; a filter at infinity is left out."""

    high_pass: float  # f1
    low_pass: float  # f2
    transition: tuple[float, float, float] | None  # f3 (may be infinite), f4, Q4
    step: tuple[float, float, float, float] | None  # f5, Q5, f6, Q6
    gain: float = 1.0


_WEIGHTINGS = {
    "Wb": _Parameters(0.4, 100.0, (16.0, 16.0, 0.55), (2.5, 0.9, 4.0, 0.95), 1.024),
    "Wc": _Parameters(0.4, 100.0, (8.0, 8.0, 0.63), None),
    "Wd": _Parameters(0.4, 100.0, (2.0, 2.0, 0.63), None),
    "We": _Parameters(0.4, 100.0, (1.0, 1.0, 0.63), None),
    "Wf": _Parameters(0.08, 0.63, (math.inf, 0.25, 0.86), (0.0625, 0.80, 0.10, 0.80)),
    "Wj": _Parameters(0.4, 100.0, None, (3.75, 0.91, 5.32, 0.91)),
    "Wk": _Parameters(0.4, 100.0, (12.5, 12.5, 0.63), (2.37, 0.91, 3.35, 0.91)),
}


# ω, Q and n of (n₀ + n₁ σ + n₂ σ²)/(1 + σ/Q + σ²) with σ = s/ω.
Section: TypeAlias = tuple[float, float, tuple[float, float, float]]


@functools.cache
def sections(weighting: str) -> tuple[Section, ...]:
    """The chain of a weighting: high-pass, low-pass, then the transition and the upward step where there is one."""
    p, butterworth, turn = _WEIGHTINGS[weighting], math.sqrt(0.5), 2.0 * math.pi
    chain = [
        (turn * p.high_pass, butterworth, (0.0, 0.0, p.gain)),
        (turn * p.low_pass, butterworth, (1.0, 0.0, 0.0)),
    ]
    if p.transition:
        f3, f4, quality = p.transition
        chain.append((turn * f4, quality, (1.0, f4 / f3, 0.0)))
    if p.step:
        f5, q5, f6, q6 = p.step
        chain.append((turn * f6, q6, ((f5 / f6) ** 2, f5 / f6 / q5, 1.0)))
    return tuple(chain)


def check_weighting(weighting: str) -> None:
    """Refuse an unknown weighting and name the nearest."""
    if weighting not in _WEIGHTINGS:
        letter = weighting.strip()[-1:] if isinstance(weighting, str) else ""  # it tells: "wk", "W_k", "ISO Wk"
        near = f"W{letter.lower()}"
        hint = f"Did you mean {near!r}?" if near in _WEIGHTINGS else ""
        _checks.refuse("weighting", f"be one of {', '.join(map(repr, _WEIGHTINGS))}", repr(weighting), hint)


def weighting_response(frequency: Float[ArrayLike, "*shape"], weighting: str) -> Complex[Array, "*shape"]:
    """Complex frequency response H(j 2 pi f) [-] of an ISO weighting: gain and phase.

    H = K s²/(s² + s w1/Q + w1²) · w2²/(s² + s w2/Q + w2²) · (1 + s/w3)/(1 + s/(Q4 w4) + (s/w4)²)
    · (w5/w6)² (1 + s/(Q5 w5) + (s/w5)²)/(1 + s/(Q6 w6) + (s/w6)²), Q = 1/sqrt(2). The phase is that of the same
    analogue filter; only crest factor, MTVV and VDV depend on it. Differentiable.

    Arguments:
        frequency: frequency [Hz], any shape, not negative.
        weighting: "Wk" (vertical, seated or standing), "Wd" (horizontal), "Wc" (backrest, fore and aft), "We"
            (rotations), "Wj" (head of a lying person), "Wb" (vertical, BS 6841 and ISO 2631-4), "Wf" (motion
            sickness).

    Raises:
        ValueError: if a frequency is negative or not finite, or if the weighting is unknown.

    Source: parameters of ISO 8041 as printed in the Larson Davis HVM200 manual, Table 3.1; for Wk, Wd and Wf the same
    values stand in Chrono's ChFilters.cpp. The standard itself was not at hand.

    >>> h = weighting_response(2.0, "Wk")
    >>> round(float(jnp.abs(h)), 3), round(float(jnp.angle(h, deg=True)), 1)
    (0.531, 36.5)
    """
    check_weighting(weighting)
    _checks.nonnegative("frequency", frequency, "Weightings are defined for frequencies in Hz.")
    (f,) = as_numbers(frequency)
    return _response(f, weighting)


@jax.jit(static_argnames="weighting")
def _response(f: Float[Array, "*shape"], weighting: str) -> Complex[Array, "*shape"]:
    response = jax.lax.complex(jnp.ones_like(f), jnp.zeros_like(f))
    for w, quality, (n0, n1, n2) in sections(weighting):
        sigma = f * (2.0 * math.pi / w)
        above = jax.lax.complex(n0 - n2 * sigma * sigma, n1 * sigma)
        below = jax.lax.complex(1.0 - sigma * sigma, sigma / quality)
        response = response * (above / below)
    return response


def weighting_factor(frequency: Float[ArrayLike, "*shape"], weighting: str) -> Float[Array, "*shape"]:
    """Magnitude |H(j 2 pi f)| [-] of an ISO weighting: what a sine of frequency f is multiplied by.

    Within 1 % of Table 3 of ISO 2631-1:1997 at the nominal centre frequencies (Wk, Wd and Wf), save Wd at 10 Hz, which
    is 0.202 and printed as 0.212. Use nominal frequencies (0.125, 0.16, ... Hz) for that table; ISO 8041 tabulates at
    the exact ones, 10^(n/10), which differ by up to 2.5 %. Differentiable; at 0 Hz value and slope are zero.

    Arguments:
        frequency: frequency [Hz], any shape, not negative.
        weighting: "Wb", "Wc", "Wd", "We", "Wf", "Wj" or "Wk"; see `weighting_response`.

    Raises:
        ValueError: if a frequency is negative or not finite, or if the weighting is unknown.

    Source: see `weighting_response`.

    >>> weighting_factor(jnp.array([0.5, 1.0, 5.0, 20.0]), "Wk").round(3)
    Array([0.418, 0.482, 1.039, 0.636], dtype=float64)
    """
    return jnp.abs(weighting_response(frequency, weighting))


@functools.cache
def cascade(weighting: str) -> StateSpace:
    """The chain as one system in NumPy arrays: each section feeds the next, two states each."""
    chain = sections(weighting)
    n = 2 * len(chain)
    a, b, c, d = np.zeros((n, n)), np.zeros(n), np.zeros(n), 1.0  # y = c x + d u is the output of the chain so far
    for low, (w, quality, (n0, n1, n2)) in zip(range(0, n, 2), chain, strict=True):
        high = low + 1
        a[low, high], a[high, low], a[high, high] = w, -w, -w / quality
        a[high] += w * c
        b[high] = w * d
        c, d = n2 * c, n2 * d
        c[low] += n0 - n2
        c[high] += n1 - n2 / quality
    return StateSpace(a, b, c, d)


@functools.cache
def settling(weighting: str) -> float:
    """The time [s] in which the slowest motion of the filter falls to 1e-12."""
    slowest = -np.max(np.linalg.eigvals(cascade(weighting).state_matrix).real)
    return float(12.0 * math.log(10.0) / slowest)


def weighting_state_space(weighting: str) -> StateSpace:
    """An ISO weighting as a linear system x' = A x + B u, y = C x + D u, to be joined to the state of an engine.

    u is the acceleration, y the weighted acceleration, and all states have the unit of u: each section holds its
    low-passed input and that one's rate over ω, so that nothing but the section's own ω [rad/s] stands in A. Sections
    follow one another (A is block lower triangular): 2 states each for high-pass, low-pass, transition and step, so
    8 for Wk, Wb and Wf, 6 for the others. D is zero, because the low-pass stands in every chain.

    Arguments:
        weighting: "Wb", "Wc", "Wd", "We", "Wf", "Wj" or "Wk".

    Returns:
        `state_matrix` [1/s], shape [n, n], `input_vector` [1/s], `output_vector` and `feed_through` [-], in the
        default floating-point type.

    Raises:
        ValueError: if the weighting is unknown.

    Source: see `weighting_response`.

    >>> system = weighting_state_space("Wk")
    >>> system.state_matrix.shape, float(system.feed_through)
    ((8, 8), 0.0)
    >>> a, b, c = (part.astype(complex) for part in system[:3])
    >>> x = jnp.linalg.solve(4j * jnp.pi * jnp.eye(8, dtype=complex) - a, b)  # the same filter, at s = 2 pi j 2 Hz
    >>> round(float(jnp.abs(c @ x)), 3), round(float(weighting_factor(2.0, "Wk")), 3)
    (0.531, 0.531)
    """
    check_weighting(weighting)
    return StateSpace(*(jnp.asarray(part, float) for part in cascade(weighting)))


@of_known_numbers
@functools.cache
def discrete_weighting(weighting: str, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Φ, H₀, H₁ and C of w₁ = Φ w₀ + H₀ u₀ + H₁ (u₁ − u₀), y = C w: a weighting, exact for u straight over a step.

    In the real basis of its modes, each a pair of states that turns and decays by itself: Φ holds blocks of 2 × 2, so
    that a step takes half the products. The constants are NumPy arrays in double precision.

    Arguments:
        weighting: of ISO 2631-1, such as "Wk".
        dt: step [s].
    """
    system = cascade(weighting)
    values, vectors = map(np.asarray, np.linalg.eig(np.asarray(system.state_matrix)))
    upper = np.flatnonzero(np.imag(values) > 0)  # all modes of all weightings oscillate
    n = values.size
    basis = np.empty((n, n))
    basis[:, ::2], basis[:, 1::2] = np.real(vectors[:, upper]), -np.imag(vectors[:, upper])
    inward, output = np.linalg.solve(basis, np.asarray(system.input_vector)), np.asarray(system.output_vector) @ basis
    phi, held, ramp = np.zeros((n, n)), np.empty(n), np.empty(n)
    for i, mode in enumerate(upper):
        pair, z = slice(2 * i, 2 * i + 2), values[mode] * dt
        first = np.expm1(z) / z
        second = (first - 1.0) / z
        for target, factor in ((held, first), (ramp, second)):
            target[pair] = _turn(factor * dt) @ inward[pair]
        phi[pair, pair] = _turn(np.exp(z))
    return phi, held, ramp, output


def _turn(factor: complex) -> np.ndarray:
    """A complex factor as a matrix of real and imaginary part."""
    return np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])


def weighted_signal(
    acceleration: SignalLike,
    dt: ScalarLike | int,
    weighting: str,
    *,
    method: str = "spectrum",
    remove_mean: bool = True,
) -> Signal:
    """The frequency-weighted record a_w(t), as long as the record and without delay of its own.

    The filter is the analogue one of the standard, phase included; it starts at rest, and what rings on after the
    record is cut off. Two methods:

    - "spectrum" multiplies the spectrum of the record by H(f), exactly for a record without content above the Nyquist
      frequency: right for measured records behind an anti-alias filter. The record is followed by as many zeros as it
      takes the filter to settle to 1e-12 (16 s, or 78 s for Wf), so that its end does not run into its beginning.
    - "step" solves x' = A x + B u exactly for an input straight from sample to sample: right for simulated records,
      with any dt, known or traced, and the same as the filter's states in an engine. Straight lines between samples
      lose (pi f dt)^2/3 of a sine's amplitude against "spectrum": 0.13 % at 20 Hz and 3 % at 100 Hz with dt = 1 ms.

    The mean is removed first, because an offset or gravity would otherwise act as a step at the start of the record;
    all weightings suppress a constant. Keep it where the record starts from rest and its jumps are real.
    Differentiable and linear in `acceleration`.

    Arguments:
        acceleration: acceleration [m/s^2] or angular acceleration [rad/s^2], shape [time].
        dt: the sampling interval [s]; sample at 1 kHz or so for content up to 100 Hz.
        weighting: "Wb", "Wc", "Wd", "We", "Wf", "Wj" or "Wk"; see `weighting_response`.
        method: "spectrum" or "step".
        remove_mean: whether to subtract the mean of the record first.

    Raises:
        ValueError: if there are fewer than two samples, `dt` is not positive, `weighting` or `method` is unknown, or
            `dt` is traced with "spectrum", where it sets the size of an array.

    Source: ISO 2631-1; parameters see `weighting_response`.

    >>> time = jnp.arange(8000.0) * 0.001
    >>> a = weighted_signal(jnp.sin(2.0 * jnp.pi * 8.0 * time), 0.001, "Wk")
    >>> round(float(jnp.max(a[6000:])), 3)  # |Wk| at 8 Hz is 1.036
    1.036
    """
    signal = as_signal("acceleration", acceleration, least=2)
    check_interval(dt)
    check_weighting(weighting)
    _checks.one_of("method", method, ["spectrum", "step"])
    if remove_mean:
        signal = signal - jnp.mean(signal)
    if method == "step":
        return respond_exactly(cascade(weighting), signal, dt)
    concrete = _checks.concrete(dt)
    if concrete is None:
        remedy = 'Close over dt as a plain number, mark it static in jax.jit, or take method="step".'
        _checks.refuse("dt", 'be known when the code is compiled for the method "spectrum"', "traced", remedy)
    size = _fast_length(signal.size + math.ceil(settling(weighting) / float(concrete)))
    frequency = jnp.arange(size // 2 + 1, dtype=signal.dtype) / (size * float(concrete))
    return _filtered(signal, weighting_response(frequency, weighting))


def _fast_length(least: int) -> int:
    """The smallest length 2^a, 3·2^a, 5·2^a, 9·2^a or 15·2^a (a > 0) that is not below `least`."""
    return min(odd * 2 ** max(1, math.ceil(math.log2(least / odd))) for odd in (1, 3, 5, 9, 15))


@jax.jit
def _filtered(signal: Signal, response: jax.Array) -> Signal:
    size = 2 * (response.size - 1)
    return jnp.fft.irfft(jnp.fft.rfft(signal, size) * response, size)[: signal.size]


def as_weighted(
    acceleration: SignalLike,
    dt: ScalarLike | int,
    weighting: str | None,
    *,
    method: str = "spectrum",
    remove_mean: bool = True,
) -> Signal:
    """The weighted record; as it is for the weighting `None`."""
    check_interval(dt)
    if weighting is None:
        return as_signal("acceleration", acceleration, least=2)
    return weighted_signal(acceleration, dt, weighting, method=method, remove_mean=remove_mean)


def weighted_rms(
    acceleration: SignalLike,
    dt: ScalarLike | int,
    weighting: str | None,
    *,
    method: str = "spectrum",
    remove_mean: bool = True,
) -> Scalar:
    """Root mean square of the frequency-weighted acceleration, a_w = sqrt(mean(a_w(t)^2)) [m/s^2].

    The basic evaluation of ISO 2631-1. Differentiable; the gradient for a record of zeros is zero. Records should be
    much longer than the filter settles (a few seconds; a minute or more with Wf), whose start is counted.

    Arguments:
        acceleration: acceleration [m/s^2] or angular acceleration [rad/s^2], shape [time].
        dt: the sampling interval [s].
        weighting: "Wk" and so on (see `weighting_response`), or None for a record that is weighted already, which is
            taken as it is.
        method: "spectrum" or "step"; see `weighted_signal`.
        remove_mean: whether to subtract the mean of the record first.

    Raises:
        ValueError: as `weighted_signal`.

    Source: ISO 2631-1, weighted root-mean-square acceleration.

    >>> time = jnp.arange(20000.0) * 0.001
    >>> round(float(weighted_rms(jnp.sin(2.0 * jnp.pi * 8.0 * time), 0.001, "Wk")), 3)  # 1.036/sqrt(2)
    0.732
    """
    return rms(as_weighted(acceleration, dt, weighting, method=method, remove_mean=remove_mean))
