"""Frequency response of the linearised vehicle, from the road to every channel."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from jaxdamp import _checks
from jaxdamp._limits import root
from jaxdamp._matrices import solve
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.linear import LinearVehicle, as_linear


def frequency_response(
    vehicle: AbstractVehicle | LinearVehicle,
    frequency: ArrayLike | Sequence[float],
    *,
    speed: ScalarLike | int | None = None,
    in_phase: bool = False,
    by_wheel: bool = False,
) -> dict[str, Complex[Array, "..."]]:
    """Complex gain from road height to every channel, H(ω) = C (iω − A)⁻¹ (B + iω E) + D + iω F.

    All wheels run on the same road: with a `speed` one axle after the other, Σ_w H_w exp(−iω τ_w) with the delay τ_w of
    wheel w behind the front axle, or `in_phase`. Differentiable in every parameter and in the speed.

    Arguments:
        vehicle: a vehicle, linearised about rest, or what `linearise` made of it.
        frequency: frequencies [Hz], shape (frequencies,).
        speed: of the vehicle [m/s]; not needed for a single axle.
        in_phase: the road is under all axles at once, instead of a speed.
        by_wheel: return the gain from the height under each wheel instead of their sum.

    Returns:
        For each channel, in its unit per metre: shape (frequencies,), or (frequencies, wheels) by wheel.

    Raises:
        ValueError: frequencies that are not a vector of numbers ≥ 0, a speed that is not positive or comes with
            `by_wheel` or `in_phase`, several axles with none of the three.

    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> gain = frequency_response(quarter_car_000(), [0.0, 1.0])["z_sprung"]
    >>> [round(float(abs(g)), 3) for g in gain]
    [1.0, 5.174]
    """
    _checks.nonnegative("frequency", frequency)
    points = jnp.asarray(frequency, dtype=float)
    if points.ndim != 1:
        _checks.refuse("frequency", "have one axis", f"of shape {points.shape}", "Pass `np.linspace(0.1, 20.0, 400)`.")
    if by_wheel and speed is not None:
        _checks.refuse("speed", "be left out with `by_wheel`", speed, "Multiply by exp(−2πi f τ) as the roads need.")
    linear = as_linear(vehicle)
    gains = _of_channels(linear, points, None if by_wheel else linear.delays(speed, in_phase))
    return dict(zip(linear.channels, gains, strict=True))


@compiled_for_loops
def _of_channels(
    linear: LinearVehicle, frequency: Float[Array, " frequencies"], delays: Float[Array, " wheels"] | None
) -> list[Complex[Array, "..."]]:
    """Gain of every channel, of all wheels together if their delays are given."""
    gains = _gains_by_wheel(linear, frequency)
    if delays is not None:
        gains = jnp.sum(gains * _phase_factors(frequency, delays)[:, None], axis=2)
    return list(jnp.moveaxis(gains, 1, 0))


def _gains_by_wheel(
    linear: LinearVehicle, frequency: Float[Array, " frequencies"]
) -> Complex[Array, "frequencies channels wheels"]:
    """Gain of every channel from the height under each wheel."""
    s = _imaginary(2.0 * jnp.pi * frequency)[:, None, None]
    a, b, e, c, d, f = (
        matrix.astype(s.dtype)[None]
        for matrix in (
            linear.state_matrix,
            linear.road_input,
            linear.road_rate_input,
            linear.output,
            linear.road_feed,
            linear.feed_through,
        )
    )
    states = jax.vmap(solve)(s * jnp.eye(a.shape[1], dtype=s.dtype)[None] - a, b + s * e)
    return c @ states + d + s * f


def _phase_factors(
    frequency: Float[Array, " frequencies"], delays: Float[Array, " wheels"]
) -> Complex[Array, "frequencies wheels"]:
    """exp(−2πi f τ)."""
    return jnp.exp(_imaginary(-2.0 * jnp.pi * frequency[:, None] * delays[None, :]))


def _imaginary(values: Float[Array, "..."]) -> Complex[Array, "..."]:
    return jax.lax.complex(jnp.zeros_like(values), values)


def spectral_rms(
    vehicle: AbstractVehicle | LinearVehicle,
    frequency: ArrayLike | Sequence[float],
    density: ArrayLike | Sequence[float],
    *,
    speed: ScalarLike | int | None = None,
    in_phase: bool = False,
    coherence: ArrayLike | Sequence[float] | None = None,
) -> dict[str, Scalar]:
    """RMS of every channel of the linearised vehicle on a random road of any spectrum, √∫ |H(f)|² S(f) df.

    By the trapezoidal rule over the given frequencies: they must resolve the resonances and, with a speed, the ripples
    of width 1/τ due to the delay between the axles. Only the given frequency range is included. For a road whose rate
    is white noise, `stationary_rms` is exact.

    Arguments:
        vehicle: a vehicle, linearised about rest, or what `linearise` made of it.
        frequency: increasing frequencies [Hz], shape (frequencies,).
        density: one-sided power spectral density of the height of each track there [m²/Hz]; of an ISO 8608 road
            G_d(f/V)/V.
        speed: of the vehicle [m/s]; not needed for a single axle.
        in_phase: the road is under all axles at once, instead of a speed.
        coherence: γ(f) in −1 … 1, cross spectrum of left and right track divided by S; if left out, both tracks are
            equal. Needs wheels on both sides.

    Raises:
        ValueError: frequencies that do not increase, a density or coherence of another shape, a negative density, a
            coherence beyond −1 … 1 or for a vehicle whose wheels stand for both sides, several axles with neither
            `speed` nor `in_phase`.

    >>> import numpy as np
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> frequency = np.linspace(0.1, 50.0, 5000)  # white height, as in paper 000: 65.8 1/s²
    >>> rms = spectral_rms(quarter_car_000(), frequency, np.full(5000, 1.0 / 49.9))
    >>> round(float(rms["sprung_acceleration"]), 1)
    65.8
    """
    _checks.nonnegative("density", density)
    points, levels = jnp.asarray(frequency, dtype=float), jnp.asarray(density, dtype=float)
    values = _checks.concrete(frequency)
    if values is not None and (values.ndim != 1 or values.size < 2):
        _checks.refuse("frequency", "have one axis and two values or more", f"of shape {values.shape}")
    if values is not None and not (values[1:] > values[:-1]).all():
        i = int((values[1:] <= values[:-1]).argmax())
        _checks.refuse("frequency", "increase", f"{values[i]} at number {i} and then {values[i + 1]}")
    if levels.shape != points.shape:
        _checks.refuse("density", f"have the shape {points.shape} of `frequency`", f"of shape {levels.shape}")
    linear = as_linear(vehicle)
    shared = None
    if coherence is not None:
        shared = jnp.asarray(coherence, dtype=float)
        if shared.shape != points.shape:
            _checks.refuse("coherence", f"have the shape {points.shape} of `frequency`", f"of shape {shared.shape}")
        concrete = behind(shared)
        if concrete is not None and (wrong := ~(np.abs(concrete) <= 1.0 + 1e-6)).any():
            _checks.refuse("coherence", "be between -1 and 1", _checks.summary(concrete, wrong))
        offsets = _checks.concrete(linear.left)
        if offsets is not None and (offsets == 0).any():
            remedy = "Take a `RollCar` or a `FullCar`, or leave it out."
            _checks.refuse("coherence", "be left out where a wheel stands for both sides", "given", remedy)
    rms = _rms_of_channels(linear, points, levels, linear.delays(speed, in_phase), shared)
    return dict(zip(linear.channels, rms, strict=True))


@compiled_for_loops
def _rms_of_channels(
    linear: LinearVehicle,
    frequency: Float[Array, " frequencies"],
    density: Float[Array, " frequencies"],
    delays: Float[Array, " wheels"],
    coherence: Float[Array, " frequencies"] | None,
) -> list[Scalar]:
    delayed = _gains_by_wheel(linear, frequency) * _phase_factors(frequency, delays)[:, None]
    if coherence is None:
        squares = jnp.abs(jnp.sum(delayed, axis=2)) ** 2
    else:
        sides = (linear.left > 0)[None, None, :]
        left, right = (jnp.sum(jnp.where(side, delayed, 0.0), axis=2) for side in (sides, ~sides))
        both = coherence[:, None] * jnp.real(left * jnp.conj(right))
        squares = jnp.abs(left) ** 2 + jnp.abs(right) ** 2 + 2.0 * both
    spectra = squares * density[:, None]
    return list(root(jnp.sum(0.5 * (spectra[1:] + spectra[:-1]) * jnp.diff(frequency)[:, None], axis=0)))
