"""What a test machine adds to the force of a law before it stands in a record."""

import dataclasses
from typing import NamedTuple, TypeVar, cast, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Number, Scalar, Signal, SignalLike, State
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import AbstractDeclared, Domain, as_float, nonnegative, parameter, positive, setting
from jaxdamp.rig.marching import NOTHING, Followed, finer, march, slopes, state_at_rest, step_and_rate
from jaxdamp.rig.response import respond
from jaxdamp.rig.sensor import delayed, delayed_straight, lagged


A = TypeVar("A", Array, np.ndarray)


def _not_positive() -> Domain:
    return not_positive


not_positive = dataclasses.replace(
    nonnegative,
    name="zero or negative, since gas pushes the rod out while force counts positive when it resists extension",
    contains=lambda a: bool((a <= 0).all()),
    from_raw=lambda raw, scale: -nonnegative.from_raw(raw, scale),
    to_raw=lambda value, scale: nonnegative.to_raw(-value, scale),
    lower=-jnp.inf,
    upper=0.0,
    remade=(_not_positive, ()),
)


class Readings(NamedTuple):
    """What the sensors of a machine would show without noise.

    Attributes:
        force: of the load cell [N], positive when it resists extension, shape (time,).
        temperature: of the damper [K], shape (time,).
    """

    force: Signal
    temperature: Signal

    def every(self, parts: int) -> "Readings":
        """Only the first of so many instants each."""
        return self if parts == 1 else Readings(self.force[::parts], self.temperature[::parts])


@final
class Rig(AbstractDeclared):
    """A test machine as the force channel of its records sees it: gas, friction, mass, heat, delay, lag and offsets.

    With ϑ, the temperature above that of the law's own numbers, and x = x_measured − x₀:

        F(t) = F_law(x, v) (1 − κ ϑ) + (G + k x)(1 + γ ϑ) + F_f tanh(v / v_f) + m v'
        ϑ' = h (F_law (1 − κ ϑ) + F_f tanh(v / v_f)) v − c ϑ
        F_measured(t) = F₀ + (F behind a first-order lag)(t − delay)
        u' = (u_measured − u) / command_lag

    u is the command that a law has which takes one, such as a `Scheduled`: the coil current or the valve follows what
    was measured with a lag. It stands here, beside the other lags of a bench, and not in the law, whose force is that
    at a command it has: in a vehicle the controller has an actuator of its own, `Controlled(actuator_lag=...)`, and
    with a lag in the law too it would count twice. Between samples the measured command runs straight, and the lag is
    exact for that.

    Everything is zero by default, so that `Rig()` shows the force of the law. The gas does no lasting work and gives no
    heat. It differentiates by all parameters of law and rig, and works under `jit` and `vmap`. For a delay of
    any part of a sample stroke and velocity are interpolated by cubics, whose error falls with the fourth power of the
    sampling step (1e-4 at 14 samples a period, 1e-6 at 45), however suddenly the force turns.

    In a fit a record is led in by a copy of its first cycle, and ϑ begins with that.

    The friction of seals that hold more at rest than in motion is a law: `law + StribeckFriction(...)`, or `LuGre`.

    >>> import numpy as np
    >>> from jaxdamp.dampers import Linear
    >>> time = np.linspace(0.0, 1.0, 1001)
    >>> rig = Rig(gas_force=-120.0, force_offset=15.0)
    >>> force = rig.force(Linear(2000.0), time, 0.01 * np.sin(6 * time), 0.06 * np.cos(6 * time))
    >>> round(float(force[0]), 6)
    15.0
    """

    gas_force: Number = parameter("N", "G, force of the gas at mid-stroke", not_positive, linear=True, default=0.0)
    gas_stiffness: Number = parameter("N/m", "k, stiffness of the gas", nonnegative, linear=True, default=0.0)
    friction: Number = parameter("N", "F_f, Coulomb friction of the seals", nonnegative, linear=True, default=0.0)
    friction_velocity: Number = parameter(
        "m/s", "v_f, velocity over which the friction changes sign", positive, default=0.005
    )
    moving_mass: Number = parameter(
        "kg", "m, mass that moves between damper and load cell", nonnegative, linear=True, default=0.0
    )
    force_delay: Number = parameter("s", "delay of the force channel behind the stroke channel", default=0.0)
    force_lag: Number = parameter("s", "time constant of the force channel's first-order lag", nonnegative, default=0.0)
    force_offset: Number = parameter("N", "F₀, zero error of the load cell", linear=True, default=0.0)
    stroke_offset: Number = parameter("m", "x₀, zero error of the stroke sensor", default=0.0)
    temperature_slope: Number = parameter("1/K", "κ, loss of damping force for each kelvin", default=0.0)
    gas_temperature_slope: Number = parameter("1/K", "γ, rise of gas force for each kelvin", default=0.0)
    heating: Number = parameter("K/J", "h, one over the heat capacity", nonnegative, default=0.0)
    cooling: Number = parameter("1/s", "c, one over the time constant of cooling", nonnegative, default=0.0)
    command_lag: Number = parameter("s", "time constant of the actuator behind the command", nonnegative, default=0.0)
    initial_rise: Number = parameter("K", "ϑ at the start, above the reference temperature", default=0.0)
    reference_temperature: Number = setting("K", "temperature of the law's own numbers", positive, default=293.15)

    def __check_init__(self) -> None:
        _checks.kelvin("Rig.reference_temperature", self.reference_temperature)

    def force(
        self,
        law: AbstractDamper,
        time: SignalLike,
        stroke: SignalLike,
        velocity: SignalLike | None = None,
        *,
        temperature: SignalLike | None = None,
        command: SignalLike | None = None,
        substeps: int = 1,
    ) -> Signal:
        """Force [N] that the load cell would show while the machine moves a damper; the arguments are `readings`'s."""
        conditions = {"temperature": temperature, "command": command}
        return self.readings(law, time, stroke, velocity, **conditions, substeps=substeps).force

    def readings(
        self,
        law: AbstractDamper,
        time: SignalLike,
        stroke: SignalLike,
        velocity: SignalLike | None = None,
        *,
        temperature: SignalLike | None = None,
        command: SignalLike | None = None,
        substeps: int = 1,
    ) -> Readings:
        """What the sensors would show without noise while the machine moves a damper.

        Arguments:
            law: the damper law, which starts at rest.
            time: uniformly spaced instants [s], shape (time,).
            stroke: as the stroke sensor shows it [m], positive in extension, shape (time,).
            velocity: [m/s], shape (time,); by central differences of the stroke if it is left out.
            temperature: measured temperature of the damper [K], shape (time,), in place of that which the dissipated
                energy gives.
            command: measured command of a law that takes one, shape (time,), which acts behind the actuator's lag.
            substeps: steps from one instant to the next, of a law with states and of a lag of the force, between which
                stroke and velocity are interpolated by cubics.

        Returns:
            Force and temperature.

        Raises:
            ValueError: what `jaxdamp.respond` refuses; a temperature or a command that is not finite or of another
                length.
        """
        time, stroke = as_float(time, "time"), as_float(stroke, "stroke")
        dt, rate = step_and_rate(time, stroke, None if velocity is None else as_float(velocity, "velocity"))
        temperature, command = (
            None if values is None else _channel(name, values, time)
            for name, values in (("temperature", temperature), ("command", command))
        )
        motion = self.delayed_motion(self.effects(), dt, stroke, rate)
        acting = self.acting(self.effects(), dt, Followed(temperature, command))
        parts = substeps if "lag" in self.effects() else 1
        if parts > 1:
            dt, motion, acting = finer(dt, *motion, acting, parts)
            time, substeps = time[0] + dt * jnp.arange(motion[0].size, dtype=time.dtype), 1
        warm, acting = acting.temperature, acting.of(law)  # for the machine and for the law
        inside = motion[0] - self.stroke_offset
        start = state_at_rest(acting.first(law), inside[0])
        law_force = respond(law, time, inside, motion[1], state=start, **acting._asdict(), substeps=substeps)
        shown = _readings(self, self.effects(), law_force, dt, *motion, warm).every(parts)
        return shown if temperature is None else shown._replace(temperature=temperature)

    def march(
        self,
        law: AbstractDamper,
        effects: tuple[str, ...],
        dt: Scalar,
        stroke: Signal,
        velocity: Signal,
        followed: Followed = NOTHING,
        substeps: int = 1,
        state: State | None = None,
    ) -> Readings:
        """`readings` without its checks, for use inside compiled functions, with the `effects` known outside."""
        motion = self.delayed_motion(effects, dt, stroke, velocity)
        acting = self.acting(effects, dt, followed)
        parts = substeps if "lag" in effects else 1
        if parts > 1:
            (dt, motion, acting), substeps = finer(dt, *motion, acting, parts), 1
        force = march(law, dt, motion[0] - self.stroke_offset, motion[1], substeps, acting, state)
        return _readings(self, effects, force, dt, *motion, acting.temperature).every(parts)

    def acting(self, effects: tuple[str, ...], dt: Scalar, followed: Followed) -> Followed:
        """Temperature and command, this behind the actuator's lag, at the instants whose force the channel shows."""
        temperature, command = followed
        if command is not None and "command_lag" in effects:
            command = lagged(command, self.command_lag / dt)
        if "delay" not in effects:
            return Followed(temperature, command)
        samples = self.force_delay / dt
        return Followed(
            None if temperature is None else delayed(temperature, samples),
            None if command is None else delayed_straight(command, samples),
        )

    def delayed_motion(
        self, effects: tuple[str, ...], dt: Scalar, stroke: Signal, velocity: Signal
    ) -> tuple[Signal, Signal]:
        """The motion [m, m/s] whose force the force channel shows: between samples it is smoother than the force."""
        if "delay" not in effects:
            return stroke, velocity
        return delayed(stroke, self.force_delay / dt), delayed(velocity, self.force_delay / dt)

    def effects(self) -> tuple[str, ...]:
        """Which effects there are that depend on more than the instant; one that is traced counts as there."""
        numbers = {
            "inertia": (self.moving_mass,),
            "heat": (self.heating, self.initial_rise),
            "lag": (self.force_lag,),
            "command_lag": (self.command_lag,),
            "delay": (self.force_delay,),
        }
        values_of = {effect: [_checks.concrete(value) for value in values] for effect, values in numbers.items()}
        return tuple(effect for effect, values in values_of.items() if any(v is None or v.any() for v in values))


def _channel(name: str, values: SignalLike, time: Signal) -> Signal:
    """A channel beside the motion, checked."""
    channel = as_float(values, name)
    if channel.shape != time.shape:
        _checks.refuse(name, "be as long as `time`", f"of shape {channel.shape} for time {time.shape}")
    _checks.finite(name, channel)
    return channel


def gas_and_friction(rig: Rig, stroke: A, velocity: A) -> tuple[A, A]:
    """F_g + k (x − x₀) and F_f tanh(v/v_f) [N], which the machine adds at once, its oil at the reference temperature.

    Arguments:
        rig: the machine; with numbers of NumPy nothing is compiled.
        stroke: measured [m].
        velocity: [m/s].
    """
    gas = rig.gas_force + rig.gas_stiffness * (stroke - rig.stroke_offset)
    ratio = velocity / rig.friction_velocity
    friction = rig.friction * (np.tanh(ratio) if isinstance(ratio, np.ndarray) else jnp.tanh(ratio))
    return cast(A, gas), cast(A, friction)


@compiled_for_loops
def _readings(
    rig: Rig,
    effects: tuple[str, ...],
    law_force: Signal,
    dt: Scalar,
    stroke: Signal,
    velocity: Signal,
    temperature: Signal | None,
) -> Readings:
    """`Rig.readings` from the force of the law, without checks."""
    gas, friction = gas_and_friction(rig, stroke, velocity)
    samples = rig.force_delay / dt
    if temperature is not None:
        rise = temperature - rig.reference_temperature
    elif "heat" in effects:
        rise = _temperature_rise(rig, dt, law_force * velocity, friction * velocity)
    else:
        rise = jnp.zeros_like(law_force)
    force = law_force * (1.0 - rig.temperature_slope * rise) + gas * (1.0 + rig.gas_temperature_slope * rise)
    force = force + friction
    if "inertia" in effects:
        force = force + rig.moving_mass * slopes(velocity, dt)
    if "lag" in effects:
        force = lagged(force, rig.force_lag / dt)
    if temperature is None:
        temperature = rig.reference_temperature + (delayed(rise, -samples) if "delay" in effects else rise)
    return Readings(force + rig.force_offset, temperature)


def _temperature_rise(rig: Rig, dt: Scalar, law_power: Signal, friction_power: Signal) -> Signal:
    """ϑ [K] from the powers [W] at the reference temperature, by the trapezoidal rule."""

    def step(rise: Array, powers: tuple[Array, Array]) -> tuple[Array, Array]:
        law, friction = powers
        decay = 0.5 * dt * (rig.cooling + rig.heating * rig.temperature_slope * law)
        after = ((1.0 - decay) * rise + dt * rig.heating * (law + friction)) / (1.0 + decay)
        return after, rise  # the one before, as in `march`

    law_mean, friction_mean = (0.5 * (power[:-1] + power[1:]) for power in (law_power, friction_power))
    start = rig.initial_rise + jnp.zeros_like(law_power[0])
    last, before = jax.lax.scan(step, start, (law_mean, friction_mean))
    return jnp.append(before, last)
