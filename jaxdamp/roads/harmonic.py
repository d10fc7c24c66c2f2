"""A sinusoidal road."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.roads._fade import fade_in
from jaxdamp.roads.base import AbstractRoad


@final
class Sine(AbstractRoad):
    """A sine in time; made by `sine`."""

    amplitude: Scalar
    frequency: Scalar
    ramp: float = eqx.field(static=True)

    @eqx.filter_jit
    def height(self, time: SignalLike) -> Float[Array, "time 1"]:
        """The height [m] at each `time` [s]; see `sine`."""
        time = jnp.asarray(time, self.amplitude.dtype)
        wave = self.amplitude * jnp.sin(2.0 * jnp.pi * self.frequency * time)
        return (fade_in(time, self.ramp) * wave)[:, None]

    @property
    def grid(self) -> None:
        """A formula has no samples."""
        return None

    @property
    def duration(self) -> None:
        """A sine does not end."""
        return None


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

    >>> import jax.numpy as jnp
    >>> waves = sine(0.01, wavelength=8.0, speed=16.0)
    >>> waves.height(jnp.array([0.0, 0.125, 0.375]))[:, 0].round(6)
    Array([ 0.  ,  0.01, -0.01], dtype=float64)

    Args:
        amplitude: A, half the height from trough to crest [m].
        frequency: f [Hz].
        wavelength: The distance between two crests [m], instead of `frequency`.
        speed: The speed of the vehicle [m/s], with `wavelength`.
        ramp: The time [s] over which the road fades in as a raised cosine; 0 turns it off.

    Raises:
        ValueError: If not exactly one of `frequency` and `wavelength` is given, if `speed` is missing with
            `wavelength` or given with `frequency`, if one of the three is not positive, if `amplitude` is not finite,
            or if `ramp` is negative.
    """
    _checks.finite("amplitude", amplitude)
    _checks.nonnegative("ramp", ramp, "Use 0 for no fade-in.")
    if (frequency is None) == (wavelength is None):
        both = "neither was given" if frequency is None else f"{frequency} Hz, and wavelength {wavelength} m as well"
        _checks.refuse(
            "frequency", "be given, or `wavelength` with `speed`, but not both", both, "Give exactly one of them."
        )
    if frequency is not None:
        if speed is not None:
            _checks.refuse(
                "speed", "be left out when `frequency` is given", speed, "Give `wavelength` and `speed` instead."
            )
        _checks.positive("frequency", frequency)
        frequency = jnp.asarray(frequency, float)
    else:
        if speed is None:
            _checks.refuse("speed", "be given with `wavelength`", speed, "Give the speed of the vehicle in m/s.")
        _checks.positive("wavelength", wavelength)
        _checks.positive("speed", speed, "Roads are driven forwards.")
        frequency = jnp.asarray(speed, float) / jnp.asarray(wavelength, float)
    return Sine(amplitude=jnp.asarray(amplitude, float), frequency=frequency, ramp=float(ramp))
