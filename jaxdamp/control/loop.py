"""The loop of control: sense, demand, command, wait, follow.

At a sampling instant the sensors see the vehicle just before, under the old command, and the policy demands a force.
The command whose force comes nearest waits for the delay and becomes the target, which the actuator follows with its
lag, exactly over each step.
"""

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp._vectors import Matrix, MemoryLayout, SmallVector, laid_out, scalars, times
from jaxdamp.codegen import is_printing
from jaxdamp.control.actuator import RateLimit, decay
from jaxdamp.control.levels import forces_both_ways, interpolated, laws_at_levels, scheduled_in
from jaxdamp.control.policies import Signals
from jaxdamp.control.sensors import Noise, Reader, Sensors, noise_of, readers
from jaxdamp.control.together import AbstractVehiclePolicy, EachDamper
from jaxdamp.dampers import AbstractDamper
from jaxdamp.vehicles import LinearMap


Commands = tuple[Scalar, ...]
Tree = TypeVar("Tree", bound=PyTree)


class ControlState(NamedTuple):
    """Where the control is at an instant, with an entry for each damper.

    Attributes:
        seen: the signals after the sensors' filter.
        policies: state of the policies.
        demand: demanded force of the last sample [N].
        waiting: commands that wait for the delay, the oldest first.
        target: what the actuator follows.
        command: what the damper has.
        filters: what the filters of the sensors remember of the last sample.
    """

    seen: tuple[Signals, ...]
    policies: PyTree
    demand: tuple[Scalar, ...]
    waiting: tuple[Commands, ...]
    target: Commands
    command: Commands
    filters: tuple[PyTree, ...]


class Flags(NamedTuple):
    """What a controller does at the instants of a run.

    Attributes:
        sample: 1.0 where the sensors are read, else 0.0.
        apply: 1.0 where a command becomes the target, else 0.0.
        noise: of the sensors at the last sample, of variance one; None without sensors.
    """

    sample: Float[Array, " time"]
    apply: Float[Array, " time"]
    noise: Noise | None = None


def where(flag: Array, changed: Callable[[], Tree], same: Tree) -> Tree:
    """What changes at few instants, computed at these alone; in loops printed as C, which have no branches, at all.

    Arguments:
        flag: whether it changes.
        changed: computes it.
        same: what it is otherwise.
    """
    if is_printing():
        return jax.tree.map(lambda new, old: jnp.where(flag, new, old), changed(), same)
    return jax.lax.cond(flag, changed, lambda: same)


@final
class ControlLoop(eqx.Module):
    """A controller assembled for the equations of a vehicle.

    Attributes:
        policy: of all dampers.
        body: velocity of the body above each damper from the rates of the coordinates, shape (dampers, q).
        pitch, roll: the parts of it that come from its turning.
        tyre: height of the wheel below each damper from the coordinates, shape (dampers, q).
        ground: that of the road from the heights under the wheels, shape (dampers, wheels).
        acceleration: acceleration of the body above each damper.
        actuator_lag: [s].
        sensor_lag: [s].
        still: velocity below which the quotient of a demanded force and a velocity is rounded [m/s].
        dampers: their names.
        ports: of the dampers.
        period: [s].
        delay: [s].
        sensors: of each damper that has some.
        rate_limit: of the actuators.
        repeated: the ports of lift-off that repeat the law of a damper, each with the number of that damper.
    """

    policy: AbstractVehiclePolicy
    body: Float[Array, "dampers q"]
    pitch: Float[Array, "dampers q"]
    roll: Float[Array, "dampers q"]
    tyre: Float[Array, "dampers q"]
    ground: Float[Array, "dampers wheels"]
    acceleration: LinearMap
    actuator_lag: Scalar
    sensor_lag: Scalar
    still: Scalar
    dampers: tuple[str, ...] = eqx.field(static=True)
    ports: tuple[int, ...] = eqx.field(static=True)
    period: float = eqx.field(static=True)
    delay: float = eqx.field(static=True)
    sensors: tuple[Sensors | None, ...] = ()
    rate_limit: RateLimit | None = None
    repeated: tuple[tuple[int, int], ...] = eqx.field(static=True, default=())

    def laws(self, laws: Sequence[AbstractDamper], command: Commands) -> tuple[AbstractDamper, ...]:
        """The law at each port, the dampers at their commands."""
        changed = list(laws)
        repeated = [(port, command[number]) for port, number in self.repeated]
        for port, u in [*zip(self.ports, command, strict=True), *repeated]:
            changed[port] = interpolated(laws[port], u)
        return tuple(changed)

    def present(self, laws: Sequence[AbstractDamper]) -> Commands:
        """The commands that the laws have, with which a run begins."""
        return tuple(scheduled_in(laws[port])[0].command for port in self.ports)

    @property
    def commanded_by(self) -> tuple[str, ...]:
        """The class of the policy of each damper."""
        each = self.policy.policies if isinstance(self.policy, EachDamper) else {}
        return tuple(type(each.get(name, self.policy)).__name__ for name in self.dampers)

    def levels(self, laws: Sequence[AbstractDamper]) -> tuple[Float[Array, " levels"], ...]:
        """The commands of each damper at which its law is given."""
        return tuple(scheduled_in(laws[port])[0].levels for port in self.ports)

    def flags(self, count: int, dt: Scalar, first: ScalarLike) -> Flags:
        """Of so many instants, of which the first has a number in the whole run."""
        number = first + jnp.arange(count, dtype=dt.dtype)
        every, late = jnp.round(self.period / dt), jnp.round(self.delay / dt)
        sample, apply = ((jnp.mod(number - start, every) == 0.0).astype(dt.dtype) for start in (0.0, late))
        samples, concrete = jnp.floor(number / every), _checks.concrete(dt)
        if concrete is None:
            return Flags(sample, apply, noise_of(self.sensors, samples))
        of_samples = samples[0] + jnp.arange(count // max(round(self.period / float(concrete)), 1) + 2, dtype=dt.dtype)
        noise = noise_of(self.sensors, of_samples)  # drawn once for each sample
        return Flags(sample, apply, None if noise is None else noise[(samples - samples[0]).astype(int)])

    @property
    def waiting(self) -> int:
        """How many commands wait at a time: those of the present sample, and of those within the delay."""
        return math.floor(self.delay / self.period * (1 + 1e-9)) + 1

    def followed(self, state: ControlState, dt: Scalar) -> Commands:
        """The commands a step of dt [s] later."""
        pairs = zip(state.target, state.command, strict=True)
        if self.rate_limit is not None:
            return tuple(t + self.rate_limit.followed(u - t, dt, self.actuator_lag) for t, u in pairs)
        left = decay(dt, self.actuator_lag)
        return tuple(t + left * (u - t) for t, u in pairs)

    def resumed(self, state: ControlState, dt: Scalar) -> tuple[Commands, Commands]:
        """Commands at an instant under its target; and how much they were greater a step of dt [s] before.

        As if the actuator had always followed this target; without a lag the command is the target. A lag shorter than
        the step is not resolved: the command then begins where its mean over the step is right if it runs straight.
        """
        lag, pairs = self.actuator_lag, [(t, u - t) for t, u in zip(state.target, state.command, strict=True)]
        if self.rate_limit is not None:
            begins, rises = zip(*(self.rate_limit.resumed(away, dt, lag) for _, away in pairs), strict=True)
            return tuple(t + begin for (t, _), begin in zip(pairs, begins, strict=True)), rises
        steps = dt / jnp.where(lag > dt, lag, dt)  # at most one, also where the other branch counts
        left = decay(dt, lag)
        begin = jnp.where(lag > dt, 1.0, 2.0 * lag / dt * (1.0 - left) - left)
        rise = jnp.where(lag > dt, jnp.exp(steps) - 1.0, 0.0)
        return tuple(t + begin * away for t, away in pairs), tuple(rise * away for _, away in pairs)


@final
class Sampler(eqx.Module):
    """The part of a controller that runs at the instants, with what is the same at all of them computed once.

    Arguments:
        loop: the controller.
        laws: of the ports of the vehicle.
        layout: of its vectors.
        dt: spacing of the instants [s].
    """

    _loop: ControlLoop
    _present: Commands
    _body: Matrix
    _pitch: Matrix
    _roll: Matrix
    _tyre: Matrix
    _ground: Matrix
    _acceleration: LinearMap
    _readers: tuple[Reader, ...]
    _levels: list[tuple[Scalar, ...]]
    _laws: list[list[AbstractDamper]]
    _small: list[list[Scalar]]

    def __init__(self, loop: ControlLoop, laws: Sequence[AbstractDamper], layout: MemoryLayout, dt: Scalar) -> None:
        self._loop, self._present = loop, loop.present(laws)
        rows = (loop.body, loop.pitch, loop.roll, loop.tyre, loop.ground)
        self._body, self._pitch, self._roll, self._tyre, self._ground = (laid_out(part, layout) for part in rows)
        self._acceleration = loop.acceleration if layout is MemoryLayout.ARRAY else loop.acceleration.scalars()
        sensors = loop.sensors or (None,) * len(loop.ports)
        self._readers = readers(sensors, loop.sensor_lag, dt, loop.period)
        self._levels = [scalars(levels) for levels in loop.levels(laws)]
        self._laws = [laws_at_levels(laws[port]) for port in loop.ports]
        self._small = [[_rise(pair, loop.still) for pair in itertools.pairwise(laws)] for laws in self._laws]

    def begin(self, signals: tuple[Signals, ...]) -> ControlState:
        """Before the first sample, which the first instant takes."""
        zero = jnp.zeros_like(signals[0].stroke)
        command = tuple(u + zero for u in self._present)
        states = jax.tree.map(jnp.asarray, self._loop.policy.initial_state(self._loop.dampers))
        filters = tuple(reader.begin(seen) for reader, seen in zip(self._readers, signals, strict=True))
        waiting = (command,) * self._loop.waiting
        return ControlState(signals, states, (zero,) * len(command), waiting, command, command, filters)

    def signals(
        self,
        motion: SmallVector,
        force: SmallVector,
        road: tuple[SmallVector, SmallVector | None],
        at_ports: tuple[SmallVector, SmallVector],
    ) -> tuple[Signals, ...]:
        """What the sensors see of each damper."""
        position, rates = motion[: len(motion) // 2], motion[len(motion) // 2 :]
        velocity, pitch, roll = (times(rows, rates) for rows in (self._body, self._pitch, self._roll))
        acceleration, (stroke, rate) = self._acceleration(motion, force, *road), at_ports
        tyre, ground = times(self._tyre, position), times(self._ground, road[0])
        return tuple(
            Signals(
                velocity[i],
                velocity[i] - rate[port],
                acceleration[i],
                stroke[port],
                rate[port],
                pitch[i],
                roll[i],
                tyre[i] - ground[i],
            )
            for i, port in enumerate(self._loop.ports)
        )

    def sampled(
        self, state: ControlState, signals: tuple[Signals, ...], states: Sequence[Array], flags: Flags
    ) -> ControlState:
        """After an instant: the sensors follow the signals; at a sample a new command waits, at its time it is applied.

        Arguments:
            state: before.
            signals: at the instant.
            states: of the laws of the ports.
            flags: of this instant.
        """
        seen = tuple(reader.filtered(*pair) for reader, *pair in zip(self._readers, state.seen, signals, strict=True))
        policies, demand, waiting, filters = where(
            flags.sample > 0.0,
            lambda: self._decided(state, seen, states, flags),
            (state.policies, state.demand, state.waiting, state.filters),
        )
        target = tuple(
            jnp.where(flags.apply > 0.0, new, old) for new, old in zip(waiting[0], state.target, strict=True)
        )
        return ControlState(seen, policies, demand, waiting, target, state.command, filters)

    def _decided(
        self, state: ControlState, seen: tuple[Signals, ...], states: Sequence[Array], flags: Flags
    ) -> tuple[PyTree, tuple[Scalar, ...], tuple[Commands, ...], tuple[PyTree, ...]]:
        """States of the policies, demands, commands that wait and filters after a sample."""
        readings = [
            reader(one, before, flags.noise)
            for reader, one, before in zip(self._readers, seen, state.filters, strict=True)
        ]
        names, read = self._loop.dampers, [signals for signals, _ in readings]
        forces, policies = self._loop.policy(dict(zip(names, read, strict=True)), state.policies)
        if missing := {*names} - {*forces}:
            _checks.refuse("policy", "demand a force of every damper", f"one without {', '.join(sorted(missing))}")
        demand = tuple(forces[name] + jnp.zeros_like(old) for name, old in zip(names, state.demand, strict=True))
        wanted = tuple(
            self._nearest(i, demand[i], one, states[port])
            for i, (port, one) in enumerate(zip(self._loop.ports, read, strict=True))
        )
        filters = tuple(after for _, after in readings)
        decided = policies, demand, (*state.waiting[1:], wanted), filters
        before = (state.policies, state.demand, state.waiting, state.filters)
        return jax.tree.map(lambda new, old: jnp.asarray(new, jnp.result_type(old)), decided, before)

    def _nearest(self, damper: int, demand: Scalar, seen: Signals, state: Array) -> Scalar:
        """The command whose force comes nearest to the demanded one, at the present motion and states of the law.

        Between two levels the force is taken as straight in the command. Each share is rounded where the levels' forces
        differ little, as much as they differ at the velocity `still`, and at both ends: it has derivatives everywhere,
        and never leaves the levels. Where the forces of three levels or more are not in their order, it is that of the
        two levels between which the force comes nearest.
        """
        forces = [law.force(seen.stroke, seen.velocity, state) for law in self._laws[damper]]
        levels, command = self._levels[damper], self._levels[damper][0]
        rises, nearest = [after - before for before, after in itertools.pairwise(forces)], []
        for i, (rise, small) in enumerate(zip(rises, self._small[damper], strict=True)):
            share = _rounded_limits((demand - forces[i]) * rise / (rise * rise + small * small + LEAST))
            part = (levels[i + 1] - levels[i]) * share
            command = command + part
            nearest.append((abs(forces[i] + rise * share - demand), levels[i] + part))
        if len(rises) == 1:
            return command
        in_order = (functools.reduce(jnp.minimum, rises) >= 0.0) | (functools.reduce(jnp.maximum, rises) <= 0.0)
        (miss, best), *others = nearest
        for other, candidate in others:
            best, miss = jnp.where(other < miss, candidate, best), jnp.minimum(other, miss)
        return jnp.where(in_order, command, best)


def _rise(pair: Sequence[AbstractDamper], velocity: Scalar) -> Scalar:
    """By how much the forces of two laws differ at a velocity in extension, or, where they do not, in compression."""
    rises = jnp.diff(forces_both_ways(pair, velocity))[:, 0]
    return jnp.where(rises[0] == 0.0, rises[1], rises[0])


LEAST = 1e-12  # N², where two levels have the same force
ROUNDED = 0.1  # share of the range over which its limits are rounded
FAR = 100.0  # shares, from where on nothing changes


def _rounded_limits(share: Scalar) -> Scalar:
    """A share between zero and one, smooth: (1 + √(s² + w²) − √((s − 1)² + w²))/2."""
    share = within(share, -FAR, FAR)  # roots of far greater numbers would differ by rounding alone
    above = share - 1.0
    return 0.5 * (1.0 + jnp.sqrt(share * share + ROUNDED**2) - jnp.sqrt(above * above + ROUNDED**2))
