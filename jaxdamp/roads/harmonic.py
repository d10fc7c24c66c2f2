"""Sinusoidal roads."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads._crossing import given_in_time
from jaxdamp.roads._fade import fade_in
from jaxdamp.roads.base import AbstractRoad


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

    @eqx.filter_jit
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
