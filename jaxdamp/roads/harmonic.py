"""Sinusoidal roads of one frequency, or of one that rises."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.roads.base import AbstractRoad, fade_in, given_in_time


@final
class Sine(AbstractRoad):
    """A sine in time; created by `sine`."""

    amplitude: Scalar
    frequency: Scalar
    driven_at: Scalar | None
    ramp: float = eqx.field(static=True)

    @property
    def speed(self) -> Scalar | None:
        """The speed [m/s] that the road was made for."""
        return self.driven_at

    @compiled_for_loops
    def heights_at(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see `sine`."""
        time = jnp.asarray(time, self.amplitude.dtype)
        wave = self.amplitude * jnp.sin(2.0 * jnp.pi * self.frequency * time)
        return (fade_in(time, self.ramp) * wave)[:, None]


def sine(
    amplitude: ScalarLike | int,
    *,
    frequency: ScalarLike | int | None = None,
    wavelength: ScalarLike | int | None = None,
    speed: ScalarLike | int | None = None,
    ramp: float | int = 0.0,
) -> Sine:
    """A sinusoidal road, z(t) = A sin(2 pi f t), with f given or f = speed/wavelength.

    It starts at height zero but with its full slope; give a `ramp` of a few periods where the transient of that
    matters. Differentiable in every argument but `ramp`.

    Arguments:
        amplitude: A, half the height from trough to crest [m].
        frequency: f [Hz].
        wavelength: the distance between two crests [m], instead of `frequency`.
        speed: the speed of the vehicle [m/s], with `wavelength`.
        ramp: the time [s] over which the road fades in as a raised cosine; 0 turns it off.

    Raises:
        ValueError: if not exactly one of `frequency` and `wavelength` is given, if `speed` is missing with
            `wavelength` or given with `frequency`, if one of the three is not positive, if `amplitude` is not finite,
            or if `ramp` is negative.

    >>> import jax.numpy as jnp
    >>> waves = sine(0.01, wavelength=8.0, speed=16.0)
    >>> waves.height(jnp.array([0.0, 0.125, 0.375]))[:, 0].round(6)
    Array([ 0.  ,  0.01, -0.01], dtype=float64)
    """
    _checks.finite("amplitude", amplitude)
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    in_time = given_in_time("frequency", frequency, "Hz", "wavelength", wavelength, speed)
    driven = None if in_time else jnp.asarray(speed, float)
    frequency = jnp.asarray(frequency, float) if driven is None else driven / jnp.asarray(wavelength, float)
    return Sine(jnp.asarray(amplitude, float), frequency, driven, float(ramp))


def wave_course(
    height: ScalarLike | int, length: ScalarLike | int, speed: ScalarLike | int, *, ramp: float | int = 0.0
) -> Sine:
    """A course of equal waves, as tracked vehicles are tried on: z(t) = h/2 sin(2 pi V t/a), `sine` by other measures.

    The usual measures of a wave are its height from trough to crest and its length from crest to crest; the amplitude
    is half the height (the source takes the whole height by mistake).

    Arguments:
        height: h, from trough to crest [m]; 0.1 to 0.2 m in the source.
        length: a, from crest to crest [m]; 5 to 8 m in the source.
        speed: V, the speed of the vehicle [m/s].
        ramp: the time [s] over which the road fades in as a raised cosine; 0 turns it off.

    Raises:
        ValueError: if `length` or `speed` is not positive, if `height` is not finite, or if `ramp` is negative.

    Source: identification of the shock absorbers of an M113, equation 17: f = V/a, 0.556 Hz for 12 km/h and 6 m.

    >>> import jax.numpy as jnp
    >>> course = wave_course(0.15, length=6.0, speed=12 / 3.6)
    >>> round(float(course.frequency), 3)
    0.556
    >>> z = course.height(jnp.linspace(0.0, 3.6, 201))
    >>> round(float(z.max() - z.min()), 6)
    0.15
    """
    _checks.finite("height", height)
    _checks.positive("length", length)
    return sine(0.5 * height, wavelength=length, speed=speed, ramp=ramp)


def linear_sweep(time: Signal, start: Scalar, stop: Scalar, duration: Scalar) -> tuple[Signal, Signal]:
    """Linear: f = f0 + (f1 - f0) t/T [Hz] and its integral from 0, f0 t + (f1 - f0) t^2/(2 T) [cycles]."""
    rate = (stop - start) / duration
    return start + rate * time, time * (start + 0.5 * rate * time)


def logarithmic_sweep(time: Signal, start: Scalar, stop: Scalar, duration: Scalar) -> tuple[Signal, Signal]:
    """Logarithmic: f = f0 (f1/f0)^(t/T) [Hz] and its integral from 0, f0 T/ln(f1/f0) ((f1/f0)^(t/T) - 1) [cycles]."""
    rate = jnp.log(stop / start) / duration
    return start * jnp.exp(rate * time), start * jnp.expm1(rate * time) / rate


_SWEEPS = {"linear": linear_sweep, "logarithmic": logarithmic_sweep}


@final
class SweepSine(AbstractRoad):
    """A sine of changing frequency; created by `sweep_sine`."""

    size: Scalar  # amplitude of the height [m] or of its rate [m/s]
    start: Scalar
    stop: Scalar
    period: Scalar
    sweep: str = eqx.field(static=True)
    of_velocity: bool = eqx.field(static=True)
    ramp: float = eqx.field(static=True)

    @compiled_for_loops
    def heights_at(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see `sweep_sine`."""
        time = jnp.asarray(time, self.size.dtype)
        inside = within(time, 0.0, self.period)
        frequency, cycles = _SWEEPS[self.sweep](inside, self.start, self.stop, self.period)
        amplitude = self.size / (2.0 * jnp.pi * frequency) if self.of_velocity else self.size
        wave = amplitude * jnp.sin(2.0 * jnp.pi * (cycles + frequency * (time - inside)))
        return (fade_in(time, self.ramp) * wave)[:, None]

    @property
    def duration(self) -> float | None:
        """The time [s] of the sweep."""
        period = _checks.concrete(self.period)
        return None if period is None else float(period)


def sweep_sine(
    start: ScalarLike | int,
    stop: ScalarLike | int,
    *,
    duration: ScalarLike | int,
    amplitude: ScalarLike | int | None = None,
    velocity_amplitude: ScalarLike | int | None = None,
    sweep: str = "linear",
    ramp: float | int = 0.0,
) -> SweepSine:
    """A sine that sweeps from one frequency to another, z(t) = A sin(2 pi int f dt).

    Linear: f = f0 + (f1 - f0) t/T. Logarithmic, the same time for every octave: f = f0 (f1/f0)^(t/T). With
    `amplitude` the height swings by the same A throughout; with `velocity_amplitude` A = V/(2 pi f), as test rigs do
    it: the rate of height then swings by V, except for the part A'(t) sin, of relative size f'/(2 pi f^2). Before the
    start and after the end the frequency stays at f0 and f1. Differentiable in every number but `ramp`.

    Arguments:
        start: f0 [Hz].
        stop: f1 [Hz]; below f0 for a sweep downwards.
        duration: T, the time [s] of the sweep, and of the road.
        amplitude: A, half the height from trough to crest [m].
        velocity_amplitude: V, the amplitude of the rate of height [m/s], instead of `amplitude`.
        sweep: "linear" or "logarithmic".
        ramp: the time [s] over which the road fades in as a raised cosine; 0 turns it off.

    Raises:
        ValueError: if not exactly one of the two amplitudes is given, if it is not finite, if a frequency or
            `duration` is not positive, if the frequencies are equal, if `ramp` is negative, or if `sweep` is unknown.

    >>> import jax.numpy as jnp
    >>> rig = sweep_sine(1.0, 20.0, duration=30.0, velocity_amplitude=0.1, sweep="logarithmic")
    >>> z = rig.height(jnp.arange(0.0, 30.0, 0.001))[:, 0]
    >>> round(float(z[:1000].max()), 4), round(float(z[-1000:].max()), 5)  # 0.1/(2 pi f)
    (0.0155, 0.00088)
    """
    _checks.one_of("sweep", sweep, _SWEEPS)
    _checks.positive("start", start)
    _checks.positive("stop", stop)
    _checks.positive("duration", duration)
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    first, last = _checks.concrete(start), _checks.concrete(stop)
    if first is not None and last is not None and first == last:
        _checks.refuse("stop", f"differ from `start` ({first} Hz)", f"{last} Hz", "Use `sine` for a single frequency.")
    if (amplitude is None) == (velocity_amplitude is None):
        both = "neither was given" if amplitude is None else f"{amplitude} m, and {velocity_amplitude} m/s as well"
        _checks.refuse("amplitude", "be given, or `velocity_amplitude`, but not both", both, "Give exactly one.")
    of_velocity = amplitude is None
    size = velocity_amplitude if of_velocity else amplitude
    _checks.finite("velocity_amplitude" if of_velocity else "amplitude", size)
    return SweepSine(
        size=jnp.asarray(size, float),
        start=jnp.asarray(start, float),
        stop=jnp.asarray(stop, float),
        period=jnp.asarray(duration, float),
        sweep=sweep,
        of_velocity=of_velocity,
        ramp=float(ramp),
    )
