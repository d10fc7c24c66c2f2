"""A sinusoidal road whose frequency rises or falls."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike
from jaxdamp.roads._fade import fade_in
from jaxdamp.roads.base import AbstractRoad


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

    @eqx.filter_jit
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
