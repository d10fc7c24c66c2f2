"""What a test machine adds to the force of a law before it stands in a record."""

import dataclasses
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._types import Number, Scalar, Signal, SignalLike, State
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import Module, as_float, check_parameters, nonnegative, parameter, positive, readable, setting
from jaxdamp.rig.marching import march, slopes
from jaxdamp.rig.response import respond
from jaxdamp.rig.sensor import delayed, lagged


not_positive = dataclasses.replace(
    nonnegative,
    name="zero or negative, since gas pushes the rod out while force counts positive when it resists extension",
    contains=lambda a: bool((a <= 0).all()),
    from_raw=lambda raw, scale: -nonnegative.from_raw(raw, scale),
    to_raw=lambda value, scale: nonnegative.to_raw(-value, scale),
    lower=-jnp.inf,
    upper=0.0,
)


class Readings(NamedTuple):
    """What the sensors of a machine would show without noise.

    Attributes:
        force: of the load cell [N], positive when it resists extension, shape (time,).
        temperature: of the damper [K], shape (time,).
    """

    force: Signal
    temperature: Signal


@final
class Rig(Module):
    """A test machine as the force channel of its records sees it: gas, friction, mass, heat, delay, lag and offsets.

    With ϑ, the temperature above that of the law's own numbers, and x = x_measured − x₀:

        F(t) = F_law(x, v) (1 − κ ϑ) + (G + k x)(1 + γ ϑ) + F_f tanh(v / v_f) + m v'
        ϑ' = h (F_law (1 − κ ϑ) + F_f tanh(v / v_f)) v − c ϑ
        F_measured(t) = F₀ + (F behind a first-order lag)(t − delay)

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
    initial_rise: Number = parameter("K", "ϑ at the start, above the reference temperature", default=0.0)
    reference_temperature: Number = setting("K", "temperature of the law's own numbers", positive, default=293.15)

    def __check_init__(self) -> None:
        check_parameters(self)

    def __repr__(self) -> str:
        return readable(self)

    def force(
        self,
        law: AbstractDamper,
        time: SignalLike,
        stroke: SignalLike,
        velocity: SignalLike | None = None,
        *,
        temperature: SignalLike | None = None,
        substeps: int = 1,
    ) -> Signal:
        """Force [N] that the load cell would show while the machine moves a damper; the arguments are `readings`'s."""
        return self.readings(law, time, stroke, velocity, temperature=temperature, substeps=substeps).force

    def readings(
        self,
        law: AbstractDamper,
        time: SignalLike,
        stroke: SignalLike,
        velocity: SignalLike | None = None,
        *,
        temperature: SignalLike | None = None,
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
            substeps: steps of a law with states from one instant to the next.

        Returns:
            Force and temperature.

        Raises:
            ValueError: what `jaxdamp.respond` refuses; a temperature that is not finite or of another length.
        """
        time, stroke = as_float(time, "time"), as_float(stroke, "stroke")
        dt = (time[-1] - time[0]) / (time.size - 1)
        rate = jnp.asarray(jnp.gradient(stroke, dt)) if velocity is None else as_float(velocity, "velocity")
        if temperature is not None:
            temperature = as_float(temperature, "temperature")
            if temperature.shape != time.shape:
                value = f"of shape {temperature.shape} for time {time.shape}"
                _checks.refuse("temperature", "be as long as `time`", value)
            _checks.finite("temperature", temperature)
        motion = self.delayed_motion(self.effects(), dt, stroke, rate)
        temperatures = temperature if law.traits().temperature_dependent else None
        start = (law if temperatures is None else law.at_temperature(temperatures[0])).initial_state()
        inside = motion[0] - self.stroke_offset
        law_force = respond(law, time, inside, motion[1], state=start, temperature=temperatures, substeps=substeps)
        return _readings(self, self.effects(), law_force, dt, *motion, temperature)

    def march(
        self,
        law: AbstractDamper,
        effects: tuple[str, ...],
        dt: Scalar,
        stroke: Signal,
        velocity: Signal,
        temperature: Signal | None = None,
        substeps: int = 1,
        state: State | None = None,
    ) -> Readings:
        """`readings` without its checks, for use inside compiled functions, with the `effects` known outside."""
        stroke, velocity = self.delayed_motion(effects, dt, stroke, velocity)
        force = march(law, dt, stroke - self.stroke_offset, velocity, substeps, temperature, state)
        return _readings(self, effects, force, dt, stroke, velocity, temperature)

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
            "delay": (self.force_delay,),
        }
        values_of = {effect: [_checks.concrete(value) for value in values] for effect, values in numbers.items()}
        return tuple(effect for effect, values in values_of.items() if any(v is None or v.any() for v in values))


def gas_and_friction(rig: Rig, stroke: Array, velocity: Array) -> tuple[Array, Array]:
    """F_g + k (x − x₀) and F_f tanh(v/v_f) [N], which the machine adds at once, its oil at the reference temperature.

    Arguments:
        rig: the machine.
        stroke: measured [m].
        velocity: [m/s].
    """
    gas = rig.gas_force + rig.gas_stiffness * (stroke - rig.stroke_offset)
    return gas, rig.friction * jnp.tanh(velocity / rig.friction_velocity)


@eqx.filter_jit
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
        rise = delayed(rise, samples) if "delay" in effects else rise
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
