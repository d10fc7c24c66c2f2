"""A sensor of a machine or vehicle, and a channel that answers late: a delay of any part of a sample, a lag."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._types import Number, Scalar, ScalarLike, Signal
from jaxdamp.parameters import AbstractDeclared, nonnegative, parameter, positive, readable
from jaxdamp.rig.marching import hermite, slopes


@jax.jit
def delayed(values: Signal, samples: Scalar) -> Signal:
    """A signal later by a number of samples, not necessarily whole; its first and last values stand beyond its ends."""
    last = values.size - 1
    places = within(jnp.arange(values.size, dtype=values.dtype) - samples, 0.0, float(last))
    before = jnp.clip(jax.lax.stop_gradient(places).astype(int), 0, last - 1)
    rises = slopes(values, jnp.ones((), values.dtype))
    ends = (values[before], rises[before], values[before + 1], rises[before + 1])
    return hermite(ends, places - before.astype(places.dtype))


@jax.jit
def delayed_straight(values: Signal, samples: Scalar) -> Signal:
    """As `delayed`, for a signal with steps, which runs straight between samples."""
    places = jnp.arange(values.size, dtype=values.dtype)
    return jnp.interp(places - samples, places, values)


@jax.jit
def lagged(values: Signal, samples: Scalar) -> Signal:
    """Y of τ y' + y = signal, from a settled start, exact for straight lines between samples.

    Arguments:
        values: the signal.
        samples: τ in samples; zero gives the signal itself.
    """
    there = samples > 1e-3  # below, exp(−1/samples) is no number beside 1
    safe = jnp.where(there, samples, 1.0)
    decay = jnp.where(there, jnp.exp(-1.0 / safe), 0.0)
    mean = samples * (1.0 - decay)
    weights = (mean - decay, 1.0 - mean)

    def step(y: Array, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        return decay * y + weights[0] * ends[0] + weights[1] * ends[1], y  # the one before, as in `march`

    last, before = jax.lax.scan(step, values[0], (values[:-1], values[1:]))
    return jnp.append(before, last)


@final
class Sensor(AbstractDeclared):
    """A sensor with gain, zero error, lag, delay and high-pass: which of them are given is what it has.

        shown(t) = gain · h(t − delay) + offset,  h = high-pass of the channel behind a first-order lag

    The high-pass, of an accelerometer coupled by a capacitor for instance, is of first order. Both filters are settled
    at the first sample.

    In a fit (`identify.fit_vehicle`) the numbers given are free, with these values as start: `Sensor(offset=0.0,
    lag=1e-3)` estimates a zero error and a lag. `freeze` holds known ones.

    Arguments:
        gain: factor on the channel.
        offset: zero error, in the unit of the channel.
        lag: time constant of a first-order lag [s].
        delay: of the channel behind the road channel [s].
        high_pass: corner frequency of a first-order high-pass [Hz].

    Raises:
        ValueError: a gain or a corner frequency that is not positive, a negative lag.

    >>> signal = jnp.ones(5)
    >>> Sensor(gain=2.0, offset=0.5)(signal, 1e-3).tolist()
    [2.5, 2.5, 2.5, 2.5, 2.5]
    >>> Sensor(high_pass=0.5)(signal, 1e-3).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0]
    """

    gain: Number = parameter("", "gain of the sensor", positive)
    offset: Number = parameter("", "zero error of the sensor, in the unit of its channel")
    lag: Number = parameter("s", "time constant of the sensor's first-order lag", nonnegative)
    delay: Number = parameter("s", "delay of the channel behind the road channel")
    high_pass: Number = parameter("Hz", "corner frequency of the sensor's high-pass", nonnegative)
    given: tuple[str, ...] = eqx.field(static=True)

    def __init__(
        self,
        *,
        gain: ScalarLike | int | None = None,
        offset: ScalarLike | int | None = None,
        lag: ScalarLike | int | None = None,
        delay: ScalarLike | int | None = None,
        high_pass: ScalarLike | int | None = None,
    ) -> None:
        if high_pass is not None:
            _checks.positive("high_pass", high_pass, "Leave it out for a sensor that shows slow motions too.")
        numbers = {"gain": gain, "offset": offset, "lag": lag, "delay": delay, "high_pass": high_pass}
        for name, value in numbers.items():
            setattr(self, name, (1.0 if name == "gain" else 0.0) if value is None else value)
        self.given = tuple(name for name, value in numbers.items() if value is not None)

    def __repr__(self) -> str:
        return readable(self) if not self.given else f"Sensor({', '.join(self._words())})"

    def _words(self) -> list[str]:
        numbers = {name: _checks.concrete(getattr(self, name)) for name in self.given}
        return [f"{name}={'traced' if value is None else value.tolist()}" for name, value in numbers.items()]

    def __call__(self, values: Signal, dt: ScalarLike) -> Signal:
        """What the sensor shows of a channel sampled every dt [s], in the unit of the channel, shape (time,)."""
        if "lag" in self.given:
            values = lagged(values, self.lag / dt)
        if "high_pass" in self.given:
            corner = 2.0 * np.pi * self.high_pass * dt  # in radians a sample
            safe = jnp.where(corner > 0.0, corner, 1.0)
            values = jnp.where(corner > 0.0, values - lagged(values, 1.0 / safe), values)
        if "delay" in self.given:
            values = delayed(values, self.delay / dt)
        return self.gain * values + self.offset
