"""The controller of a vehicle as functions of its numbers, which are printed in other languages."""

import dataclasses
from functools import cached_property
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._types import Scalar
from jaxdamp._vectors import MemoryLayout
from jaxdamp.codegen import Program, Symbols, lower, symbols
from jaxdamp.control import Controlled, ControlLoop, ControlState, Sampler, Signals
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._controlled_program import Clock, ControlledProgram, names_in, with_first_commands, with_sensors
from jaxdamp.export._law_program import LawProgram
from jaxdamp.export._vehicle_program import Numbers, PreparedProgram, VehicleProgram
from jaxdamp.parameters import parameters
from jaxdamp.vehicles import AbstractVehicle, LinearMap


class ControllerState(NamedTuple):
    """What a controller without its vehicle carries from instant to instant."""

    control: ControlState  # as in a run
    states: tuple[Array, ...]  # of its copies of the laws
    motion: tuple[tuple[Scalar, ...], ...]  # stroke and velocity of each damper whose law has states
    since: Scalar  # instants since a sample


@final
class SampledController(eqx.Module):
    """A controller without its vehicle: it decides by signals that it is given.

    For dampers whose laws have states it carries copies of the laws, which follow the measured strokes and velocities
    under its own commands as the actuators follow them. Without states it needs no actuator.
    """

    loop: ControlLoop  # the controller as it is assembled for the vehicle
    laws: tuple[AbstractDamper, ...]  # of the ports of the vehicle
    sampler: Sampler
    dt: Scalar  # from instant to instant [s]

    def __init__(self, loop: ControlLoop, laws: tuple[AbstractDamper, ...], dt: Scalar) -> None:
        self.laws, self.dt = tuple(laws[port] for port in loop.ports), dt
        parts = {field.name: getattr(loop, field.name) for field in dataclasses.fields(loop)}
        geometry = {n: y for n, y in parts.items() if isinstance(y, LinearMap) or getattr(y, "ndim", 0) == 2}
        fields = jax.tree.map(jnp.zeros_like, geometry)  # of the vehicle, where signals come from
        fields |= {"ports": tuple(range(len(loop.ports)))}
        fields |= {"sensors": with_sensors(loop.sensors, lambda sensors: sensors.outside())}
        if not any(law.initial_state().size for law in self.laws):
            fields |= {"delay": 0.0, "actuator_lag": jnp.zeros_like(loop.actuator_lag), "rate_limit": None}
        self.loop = dataclasses.replace(loop, **fields)
        self.sampler = Sampler(self.loop, self.laws, MemoryLayout.SCALARS, dt)

    def begin(self, seen: tuple[Signals, ...]) -> ControllerState:
        """After the first instant, which is a sample."""
        states = tuple(law.initial_state() for law in self.laws)
        return self._decided(self.sampler.begin(seen), states, jnp.zeros_like(self.dt), seen)

    def __call__(self, now: ControllerState, seen: tuple[Signals, ...]) -> ControllerState:
        """After another instant."""
        commands = self.loop.followed(now.control, self.dt)
        copies = zip(self.loop.laws(self.laws, commands), now.motion, seen, now.states, strict=True)
        states = tuple(self._advanced(*copy) for copy in copies)
        since = Clock(self.loop, self.dt).after(now.since)
        return self._decided(now.control._replace(command=commands), states, since, seen)

    def _advanced(self, law: AbstractDamper, before: tuple[Scalar, ...], now: Signals, state: Array) -> Array:
        """The states of a copy at this instant; a law without states has no motion before."""
        if not before:
            return state
        stroke, velocity = before
        return law.advance(stroke, velocity, now.stroke, now.velocity, state, self.dt)

    def _decided(
        self, control: ControlState, states: tuple[Array, ...], since: Scalar, seen: tuple[Signals, ...]
    ) -> ControllerState:
        control = self.sampler.sampled(control, seen, states, Clock(self.loop, self.dt).flags(since))
        motion = tuple((one.stroke, one.velocity) if s.size else () for one, s in zip(seen, states, strict=True))
        return ControllerState(control, states, motion, since)


class Line(NamedTuple):
    """An input or an output of a controller."""

    name: str  # of the damper and the signal
    unit: str  # SI unit; that of the levels for a command
    description: str  # its meaning and sign


_INPUTS = {
    "body_velocity": ("m/s", "velocity of the body above {}, up"),
    "wheel_velocity": ("m/s", "velocity of the wheel below {}, up"),
    "body_acceleration": ("m/s^2", "acceleration of the body above {}, up"),
    "stroke": ("m", "deflection of {}, extension positive"),
    "velocity": ("m/s", "rate of the stroke of {}, extension positive"),
    "pitch_velocity": ("m/s", "part of the velocity of the body above {} that comes from its pitch, up"),
    "roll_velocity": ("m/s", "part of the velocity of the body above {} that comes from its roll, up"),
    "tyre_deflection": ("m", "height of the wheel below {} over the road, from rest"),
}


class ControllerProgram(PreparedProgram):
    """The controller of a vehicle alone: inputs are what the sensors measure, outputs what the dampers are told.

    Noise and errors of sensors are no part of it, nor is the delay; the sensors' filter is. The last number of the
    carry c are the steps since a sample.

    Attributes:
        dampers: names of those that it commands.
        inputs: what it needs to be given, in the order of the array u.
        follows_states: whether it carries copies of the laws, because they have states.
        delay: from a sample to its command, for the copies; zero without them [s].
    """

    vehicle: Controlled
    sampled = True

    def __init__(self, vehicle: Controlled, dtype: str) -> None:
        super().__init__(vehicle, dtype)
        loop: ControlLoop = vehicle.system().control
        self.dampers = [vehicle.layout.ports[port] for port in loop.ports]
        self.follows_states = any(vehicle.elements()[port].initial_state().size for port in loop.ports)
        self.delay = vehicle.delay if self.follows_states else 0.0
        self.inputs = [
            Line(f"{damper}_{signal}", unit, said.format(damper))
            for damper in self.dampers
            for signal, (unit, said) in ((signal, _INPUTS[signal]) for signal in Signals._fields)
        ]
        used = names_in(self._matrices)
        self.numbers = [n for n in with_first_commands(self) if f"p->{n.name}" in used]
        used = names_in(self._decision)
        self.inputs = [line for k, line in enumerate(self.inputs) if f"u[{k}]" in used]

    @property
    def outputs(self) -> list[Line]:
        """What it gives, in the order of the array y."""
        commands = [Line(f"{d}_command", "", f"command of {d}, in the unit of its levels") for d in self.dampers]
        counts = {d: self.vehicle.frame().element(d).count for d in self.dampers}
        of = {d: f"{d}, of {n} equal ones together" if n > 1 else d for d, n in counts.items()}
        said = "force demanded of {}, positive where it resists extension"
        return commands + [Line(f"{d}_demand", "N", said.format(of[d])) for d in self.dampers]

    def _prepared(self, values: Numbers, dt: Array) -> PyTree:
        system = self.model_of(values).system()
        return SampledController(system.control, system.laws, dt)

    @property
    def notes(self) -> list[str]:
        """What is inside of it, and what is not."""
        filtered = "The sensors' filter is inside (sensor_lag); errors of sensors, the delay and the actuator are not."
        if not self.follows_states:
            return [filtered]
        return [
            filtered,
            "c holds copies of the laws of the dampers, since their force depends on their history. They follow the",
            "measured strokes and velocities, each under its command as the delay and the actuator_lag let it act.",
        ]

    def _started(self, held: list[Array], *inputs: Array) -> ControllerState:
        return self._stepper.tree(held).begin(self._seen(*inputs))

    @cached_property
    def step(self) -> Program:
        """`step(m, c, u)`: c after the next instant."""

        def step(held: list[Array], now: list[Array], given: Array) -> list[Array]:
            return self._carry.arrays(self._stepper.tree(held)(self._carry.tree(now), self._seen(given)))

        return self._lowered(step, self._carried, *self._inputs)

    @cached_property
    def resume(self) -> Program:
        """`resume(c, ratio)`: c at this instant after another `prepare`; ratio of the steps, new to old."""

        def resume(now: list[Array], ratio: Array) -> list[Array]:
            state: ControllerState = self._carry.tree(now)
            return self._carry.arrays(state._replace(since=jnp.round(state.since / ratio)))

        return lower(resume, self._carried, self._symbols("ratio"), finite=True)

    @cached_property
    def output(self) -> Program:
        """`output(c)`: the commands of the last sample, and the forces demanded."""
        return lower(lambda now: _decisions(self._carry.tree(now)), self._carried, finite=True)

    @property
    def _decision(self) -> Program:
        """What a step leaves but its signals, as if the filter of the sensors had passed what they measure."""

        def decision(held: list[Array], now: list[Array], given: Array) -> list[Array]:
            state, seen = self._carry.tree(now), self._seen(given)
            state = state._replace(control=state.control._replace(seen=seen))
            after: ControllerState = self._stepper.tree(held)(state, seen)
            return jax.tree.leaves((after.control._replace(seen=()), after.states))

        return self._lowered(decision, self._carried, *self._inputs)

    def run(self, given: Float[Array, "time inputs"], dt: float) -> Float[Array, "time outputs"]:
        """The outputs at instants dt [s] apart, computed by JAX."""

        @eqx.filter_jit
        def run(vehicle: Controlled) -> Array:
            system = vehicle.system()
            controller = SampledController(system.control, system.laws, jnp.asarray(dt, dtype=float))
            first = controller.begin(self._seen(given[0]))

            def step(now: ControllerState, given: Array) -> tuple[ControllerState, Array]:
                after = controller(now, self._seen(given))
                return after, _decisions(after)

            _, others = jax.lax.scan(step, first, given[1:])
            return jnp.concatenate([_decisions(first)[None], others])

        return run(self.vehicle)

    @property
    def _inputs(self) -> list[Symbols]:
        return [symbols("u", (len(self.inputs),), self.dtype)]

    def _seen(self, given: Array) -> tuple[Signals, ...]:
        """The signals of each damper; zero where nothing depends on them."""
        values = {line.name: given[k] for k, line in enumerate(self.inputs)}
        nothing = jnp.zeros_like(given[0])
        names = [[f"{damper}_{signal}" for signal in Signals._fields] for damper in self.dampers]
        return tuple(Signals(*(values.get(name, nothing) for name in row)) for row in names)


def _decisions(state: ControllerState) -> Array:
    """Commands, then demanded forces."""
    return jnp.stack([*state.control.waiting[-1], *state.control.demand])


def program_of(
    law: AbstractDamper | AbstractVehicle, part: str, dtype: str = "float64"
) -> LawProgram | VehicleProgram | ControllerProgram:
    """What is printed of a law, of a vehicle, or of the controller of a vehicle."""
    _checks.one_of("part", part, ("whole", "controller"))
    if isinstance(law, Controlled):
        if part == "controller":
            return ControllerProgram(law, dtype)
        noisy = [p.path for p in parameters(law.sensors) if p.path.endswith("noise") and np.any(p.value)]
        if noisy:
            remedy = "Set it to zero, as by `parameters.replace`, or export the controller alone, which has none."
            _checks.refuse(f"sensors.{noisy[0]}", "be zero in C and FMU, which draw no random numbers", "not", remedy)
        return ControlledProgram(law, dtype)
    if part == "controller":
        remedy = "Give a car that has one, `control.Controlled(car, policy)`."
        _checks.refuse("part", f"be 'whole' for a {type(law).__name__}, which has no controller", part, remedy)
    return LawProgram(law, dtype) if isinstance(law, AbstractDamper) else VehicleProgram(law, dtype)
