"""What a controller is told: sensors with their faults, and signals that it computes from others."""

import dataclasses
from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, NamedTuple, TypeAlias, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._random import normal_at
from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.control.actuator import decay
from jaxdamp.control.policies import Signals
from jaxdamp.parameters import AbstractDeclared, Module, nonnegative, parameter, positive, real


Kind = TypeVar("Kind")
Noise: TypeAlias = Float[Array, "... columns"]


@final
class SignalSensor(AbstractDeclared):
    """A sensor of one signal, read at every sample: the signal behind a lag, with bias and noise, rounded.

        y' = (signal − y)/lag,   reading = resolution · round((y + bias + noise w)/resolution)

    with w of the standard normal distribution, independent from sample to sample and from sensor to sensor. The lag
    runs on the instants of the run. Numbers are in the unit of the signal. Derivatives pass the rounding as if it were
    not there, which is their mean over a range of signals; the exact ones are zero.

    >>> from jaxdamp.control import SignalSensor
    >>> float(SignalSensor(bias=0.1, resolution=0.25).read(1.0, 0.0))
    1.0
    """

    lag: Number = parameter("s", "time constant of its bandwidth", nonnegative, default=0.0, adjustable=False)
    noise: Number = parameter("", "standard deviation of readings", nonnegative, default=0.0, adjustable=False)
    bias: Number = parameter("", "constant error", real, default=0.0, adjustable=False)
    resolution: Number = parameter("", "step between readings; 0: none", nonnegative, default=0.0, adjustable=False)

    def read(self, value: ScalarLike, noise: ScalarLike) -> Scalar:
        """The reading of a signal that has passed the lag.

        Arguments:
            value: of the signal.
            noise: a number of the standard normal distribution.
        """
        measured = value + self.bias + self.noise * noise
        there = self.resolution > 0.0
        step = jnp.where(there, self.resolution, 1.0)
        rounded = jnp.where(there, step * jnp.round(measured / step), measured)
        return measured + jax.lax.stop_gradient(rounded - measured)


class Filter(NamedTuple):
    """s⁺ = Φ s + γ p, output s₀: a filter over a period in which the slope of its input is p.

    Attributes:
        transition: Φ, rows of numbers.
        gain: γ.
    """

    transition: Sequence[Sequence[Scalar]]
    gain: Sequence[Scalar]

    def __call__(self, state: Sequence[Scalar], slope: Scalar) -> tuple[Scalar, ...]:
        """The state a period later."""
        rows = zip(self.transition, self.gain, strict=True)
        return tuple(sum((a * s for a, s in zip(row, state, strict=True)), g * slope) for row, g in rows)


class AbstractFilter(AbstractDeclared):
    """A signal that the controller computes from the readings of another, taken as straight between samples.

    A run begins as if the vehicle had always stood still, so a constant error of the other signal has no effect.
    """

    source: ClassVar[str]  # name of the other signal

    @abstractmethod
    def over(self, period: ScalarLike) -> Filter:
        """The filter over a period [s], exact."""


@final
class Integrated(AbstractFilter):
    """A velocity from readings of the acceleration, by a band-pass: s/(s² + √2 ω s + ω²), ω = 2π low.

    It is 1/s behind a Butterworth high-pass of second order, which keeps bias and drift out. Near the corner the
    velocity comes early, at 1 Hz by 25° with a corner of 0.3 Hz.
    """

    source = "body_acceleration"
    low: Number = parameter("Hz", "corner below which it does not integrate", positive, default=0.3, adjustable=False)

    def over(self, period: ScalarLike) -> Filter:
        """The filter over a period: states are velocity and its rate."""
        corner = np.sqrt(2.0) * np.pi * self.low  # of both, the damping and the frequency of its poles [rad/s]
        decay, angle = jnp.exp(-corner * period), corner * period
        sine, cosine = decay * jnp.sin(angle), decay * jnp.cos(angle)
        gain = (1.0 - cosine - sine) / (2.0 * corner * corner), sine / corner
        transition = (cosine + sine, gain[1]), (-2.0 * corner * sine, cosine - sine)
        return Filter(transition, gain)


@final
class Differentiated(AbstractFilter):
    """The rate of the stroke from readings of the stroke, such as of a height sensor: s/(1 + s lag).

    Without a lag it is the difference of two readings over the period, and half a period late.
    """

    source = "stroke"
    lag: Number = parameter("s", "time constant of its filter", nonnegative, default=0.01, adjustable=False)

    def over(self, period: ScalarLike) -> Filter:
        """The filter over a period."""
        left = decay(period, self.lag)
        return Filter(((left,),), (1.0 - left,))


@final
class Subtracted(Module):
    """The velocity of the wheel as that of the body minus the rate of the stroke, as the controller has them."""


@final
class Sensors(AbstractDeclared):
    """The sensors of a damper: what is left out is exact, behind the `sensor_lag` of the controller.

    Noise is the same whatever the step of the run, as it belongs to the number of the sample; every damper has its own.
    Another seed is another noise, also in a sweep: `sweep(ride, {"sensors.seed": range(20)})`.

    Arguments:
        body_velocity: `Integrated(low)` from the acceleration of the body, or a sensor [m/s].
        wheel_velocity: `Subtracted()` from those of body and damper, or a sensor [m/s].
        body_acceleration: a sensor [m/s²].
        stroke: a sensor [m].
        velocity: `Differentiated(lag)` from the stroke, or a sensor [m/s].

    >>> from jaxdamp.control import Integrated, SignalSensor, Sensors
    >>> sensors = Sensors(Integrated(low=0.3), body_acceleration=SignalSensor(noise=0.05, bias=0.2, resolution=0.01))
    """

    body_velocity: SignalSensor | Integrated | None = None
    wheel_velocity: SignalSensor | Subtracted | None = None
    body_acceleration: SignalSensor | None = None
    stroke: SignalSensor | None = None
    velocity: SignalSensor | Differentiated | None = None
    seed: Number = parameter("", "whole number that the noise follows from", nonnegative, default=0.0, adjustable=False)

    def __check_init__(self) -> None:
        seed = _checks.concrete(self.seed)
        if seed is not None and np.any(seed != np.round(seed)):
            _checks.refuse("seed", "be a whole number", f"{seed}")

    def without_noise(self) -> "Sensors":
        """The same without a random part."""
        return self._with(lambda sensor: dataclasses.replace(sensor, noise=0.0))

    def outside(self) -> "Sensors":
        """Signals read exactly where there are sensors: what a control unit computes of readings that it is given."""
        return self._with(lambda _: SignalSensor())

    def _with(self, change: Callable[[SignalSensor], SignalSensor]) -> "Sensors":
        changed = {name: change(sensor) for name, sensor in self.of_kind(SignalSensor).items()}
        return dataclasses.replace(self, **changed, seed=0.0)

    def of_kind(self, kind: type[Kind]) -> dict[str, Kind]:
        """The sensors, or filters, of this kind by the name of their signal, in the order of the signals."""
        sensors = {name: getattr(self, name, None) for name in Signals._fields}
        return {name: one for name, one in sensors.items() if isinstance(one, kind)}


def noise_of(sensors: Sequence[Sensors | None], samples: Float[Array, " time"]) -> Noise | None:
    """Numbers of the standard normal distribution for the sensors of all dampers; None if none has one.

    Arguments:
        sensors: of each damper.
        samples: number of the last sample at each instant, from 0 at the beginning of the run.
    """
    places, count, columns = samples.astype(jnp.uint32), len(Signals._fields), []
    for damper, kinds in enumerate(sensors):
        if kinds is None:
            continue
        for name in kinds.of_kind(SignalSensor):
            stream = count * damper + Signals._fields.index(name)
            columns.append(normal_at(kinds.seed.astype(jnp.uint32), stream, places))
    return jnp.stack(columns, axis=-1) if columns else None


class Reader(eqx.Module):
    """The readings of one damper's sensors, with what is the same at all samples computed once.

    Arguments:
        sensors: of the damper; without any, it reads what is there.
        lag: of signals without a sensor of their own [s].
        dt: spacing of the instants [s].
        period: between two samples [s].
        column: of its first sensor in the noise.
    """

    shares: Signals
    sensors: dict[str, SignalSensor]
    filters: dict[str, tuple[str, Filter]]  # with the name of the signal that is filtered
    subtracted: bool = eqx.field(static=True)
    period: float = eqx.field(static=True)
    column: int = eqx.field(static=True)

    def __init__(self, sensors: Sensors | None, lag: Scalar, dt: Scalar, period: float, column: int) -> None:
        chosen = Sensors() if sensors is None else sensors
        self.sensors, self.period, self.column = chosen.of_kind(SignalSensor), period, column
        self.filters = {name: (one.source, one.over(period)) for name, one in chosen.of_kind(AbstractFilter).items()}
        self.subtracted = isinstance(chosen.wheel_velocity, Subtracted)
        shares = Signals(*(1.0 - decay(dt, lag),) * len(Signals._fields))
        self.shares = shares._replace(**{name: 1.0 - decay(dt, one.lag) for name, one in self.sensors.items()})

    def filtered(self, seen: Signals, signals: Signals) -> Signals:
        """What the sensors have an instant later, behind their lags."""
        return jax.tree.map(lambda old, new, share: old + share * (new - old), seen, signals, self.shares)

    def begin(self, seen: Signals) -> dict[str, tuple[Scalar, ...]]:
        """Of each filter its input and its states, at rest."""
        read, zero = self._direct(seen, None), jnp.zeros_like(seen.stroke)
        return {
            name: (getattr(read, source), *(zero,) * len(sensors.gain))
            for name, (source, sensors) in self.filters.items()
        }

    def __call__(
        self, seen: Signals, memory: dict[str, tuple[Scalar, ...]], noise: Noise | None
    ) -> tuple[Signals, dict[str, tuple[Scalar, ...]]]:
        """What the controller has at a sample, and what its filters then remember."""
        read, after = self._direct(seen, noise), {}
        for name, (source, sensors) in self.filters.items():
            (before, *state), value = memory[name], getattr(read, source)
            after[name] = (value, *sensors(state, (value - before) / self.period))
        read = read._replace(**{name: state[1] for name, state in after.items()})
        if self.subtracted:
            read = read._replace(wheel_velocity=read.body_velocity - read.velocity)
        return read, after

    def _direct(self, seen: Signals, noise: Noise | None) -> Signals:
        """The readings of the sensors."""
        columns = range(self.column, self.column + len(self.sensors))
        values = {
            name: sensor.read(getattr(seen, name), 0.0 if noise is None else noise[column])
            for column, (name, sensor) in zip(columns, self.sensors.items(), strict=True)
        }
        return seen._replace(**values)


def readers(sensors: Sequence[Sensors | None], lag: Scalar, dt: Scalar, period: float) -> tuple[Reader, ...]:
    """Of each damper; arguments as those of `Reader`."""
    made, column = [], 0
    for each in sensors:
        made.append(Reader(each, lag, dt, period, column))
        column += len(made[-1].sensors)
    return tuple(made)
