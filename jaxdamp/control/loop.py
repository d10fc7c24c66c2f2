"""The loop of control: sense, demand, command, wait, follow.

At a sampling instant the sensors see the vehicle just before, under the old command, and the policy demands a force.
The command whose force comes nearest waits for the delay and becomes the target, which the actuator follows with its
lag, exactly over each step.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxdamp._limits import within
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp._vectors import MemoryLayout, Vector, laid_out, scalars, times
from jaxdamp.control.policies import AbstractPolicy, Signals
from jaxdamp.dampers import AbstractDamper, Scheduled
from jaxdamp.vehicles import LinearMap


Commands = tuple[Scalar, ...]


class ControlState(NamedTuple):
    """Where the control is at an instant, with an entry for each damper.

    Attributes:
        seen: the signals after the sensors' filter.
        policies: states of the policies.
        demand: demanded force of the last sample [N].
        waiting: commands that wait for the delay, the oldest first.
        target: what the actuator follows.
        command: what the damper has.
    """

    seen: tuple[Signals, ...]
    policies: tuple[PyTree, ...]
    demand: tuple[Scalar, ...]
    waiting: tuple[Commands, ...]
    target: Commands
    command: Commands


class Flags(NamedTuple):
    """What a controller does at the instants of a run.

    Attributes:
        sample: 1.0 where the sensors are read, else 0.0.
        apply: 1.0 where a command becomes the target, else 0.0.
    """

    sample: Float[Array, " time"]
    apply: Float[Array, " time"]


def at_command(law: AbstractDamper, command: Scalar) -> AbstractDamper:
    """The law of an element with the parameters, or forces, of its `Scheduled` law at a command."""
    return _replaced(law, lambda scheduled: scheduled.at(command))


def scheduled_in(law: AbstractDamper) -> list[Scheduled]:
    """The `Scheduled` laws in the law of an element."""
    return [node for node in jax.tree.leaves(law, is_leaf=_scheduled) if _scheduled(node)]


def laws_at_levels(law: AbstractDamper) -> list[AbstractDamper]:
    """The law of an element at each level of its `Scheduled` law."""
    count = len(scheduled_in(law)[0].laws)
    return [_replaced(law, lambda scheduled, number=number: scheduled.at_level(number)) for number in range(count)]


def _replaced(law: AbstractDamper, by: Callable[[Scheduled], AbstractDamper]) -> AbstractDamper:
    """The law of an element with another law in place of its `Scheduled` law."""
    return jax.tree.map(lambda node: by(node) if _scheduled(node) else node, law, is_leaf=_scheduled)


def _scheduled(node: object) -> bool:
    return isinstance(node, Scheduled)


@final
class ControlLoop(eqx.Module):
    """A controller assembled for the equations of a vehicle.

    Attributes:
        policies: of each damper.
        body: velocity of the body above each damper from the rates of the coordinates, shape (dampers, q).
        acceleration: acceleration of the body above each damper.
        actuator_lag: [s].
        sensor_lag: [s].
        still: velocity below which the quotient of a demanded force and a velocity is rounded [m/s].
        ports: of the dampers.
        period: [s].
        delay: [s].
    """

    policies: tuple[AbstractPolicy, ...]
    body: Float[Array, "dampers q"]
    acceleration: LinearMap
    actuator_lag: Scalar
    sensor_lag: Scalar
    still: Scalar
    ports: tuple[int, ...] = eqx.field(static=True)
    period: float = eqx.field(static=True)
    delay: float = eqx.field(static=True)

    def laws(self, laws: Sequence[AbstractDamper], command: Commands) -> tuple[AbstractDamper, ...]:
        """The law at each port, the dampers at their commands."""
        changed = list(laws)
        for port, u in zip(self.ports, command, strict=True):
            changed[port] = at_command(laws[port], u)
        return tuple(changed)

    def present(self, laws: Sequence[AbstractDamper]) -> Commands:
        """The commands that the laws have, with which a run begins."""
        return tuple(scheduled_in(laws[port])[0].command for port in self.ports)

    def flags(self, count: int, dt: Scalar, first: ScalarLike) -> Flags:
        """Of so many instants, of which the first has a number in the whole run."""
        number = first + jnp.arange(count, dtype=dt.dtype)
        every, late = jnp.round(self.period / dt), jnp.round(self.delay / dt)
        return Flags(*((jnp.mod(number - start, every) == 0.0).astype(dt.dtype) for start in (0.0, late)))

    @property
    def waiting(self) -> int:
        """How many commands wait at a time: those of the present sample, and of those within the delay."""
        return math.floor(self.delay / self.period * (1 + 1e-9)) + 1

    def followed(self, state: ControlState, dt: Scalar) -> Commands:
        """The commands a step of dt [s] later."""
        decay = _decay(dt, self.actuator_lag)
        return tuple(t + decay * (u - t) for t, u in zip(state.target, state.command, strict=True))

    def resumed(self, state: ControlState, dt: Scalar) -> tuple[Commands, Commands]:
        """Commands at an instant under its target; and how much they were greater a step of dt [s] before.

        As if the actuator had always followed this target; without a lag the command is the target. A lag shorter than
        the step is not resolved: the command then begins where its mean over the step is right if it runs straight.
        """
        lag = self.actuator_lag
        steps = dt / jnp.where(lag > dt, lag, dt)  # at most one, also where the other branch counts
        decay = _decay(dt, lag)
        begin = jnp.where(lag > dt, 1.0, 2.0 * lag / dt * (1.0 - decay) - decay)
        rise = jnp.where(lag > dt, jnp.exp(steps) - 1.0, 0.0)
        pairs = [(t, u - t) for t, u in zip(state.target, state.command, strict=True)]
        return tuple(t + begin * left for t, left in pairs), tuple(rise * left for _, left in pairs)


@final
class Sampler:
    """The part of a controller that runs at the instants, with what is the same at all of them computed once.

    Arguments:
        loop: the controller.
        laws: of the ports of the vehicle.
        layout: of its vectors.
        dt: spacing of the instants [s].
    """

    def __init__(self, loop: ControlLoop, laws: Sequence[AbstractDamper], layout: MemoryLayout, dt: Scalar) -> None:
        self._loop, self._present = loop, loop.present(laws)
        self._body = laid_out(loop.body, layout)
        self._acceleration = loop.acceleration if layout is MemoryLayout.ARRAY else loop.acceleration.scalars()
        self._share = 1.0 - _decay(dt, loop.sensor_lag)
        self._levels = [scalars(scheduled_in(laws[port])[0].levels) for port in loop.ports]
        self._laws = [laws_at_levels(laws[port]) for port in loop.ports]
        self._small = [
            [jnp.diff(forces_at(pair, loop.still))[0] for pair in itertools.pairwise(laws)] for laws in self._laws
        ]

    def begin(self, signals: tuple[Signals, ...]) -> ControlState:
        """Before the first sample, which the first instant takes."""
        zero = jnp.zeros_like(signals[0].stroke)
        command = tuple(u + zero for u in self._present)
        states = tuple(jax.tree.map(jnp.asarray, policy.initial_state()) for policy in self._loop.policies)
        return ControlState(signals, states, (zero,) * len(command), (command,) * self._loop.waiting, command, command)

    def signals(
        self, motion: Vector, force: Vector, road: tuple[Vector, Vector | None], at_ports: tuple[Vector, Vector]
    ) -> tuple[Signals, ...]:
        """What the sensors see of each damper."""
        velocity = times(self._body, motion[len(motion) // 2 :])
        acceleration, (stroke, rate) = self._acceleration(motion, force, *road), at_ports
        return tuple(
            Signals(velocity[i], velocity[i] - rate[port], acceleration[i], stroke[port], rate[port])
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
        seen = jax.tree.map(lambda old, new: old + self._share * (new - old), state.seen, signals)
        pairs = [policy(*of_one) for policy, *of_one in zip(self._loop.policies, seen, state.policies, strict=True)]
        demand = tuple(force + jnp.zeros_like(old) for (force, _), old in zip(pairs, state.demand, strict=True))
        wanted = tuple(
            self._nearest(i, demand[i], one, states[port])
            for i, (port, one) in enumerate(zip(self._loop.ports, seen, strict=True))
        )
        decided = (tuple(after for _, after in pairs), demand, (*state.waiting[1:], wanted))
        before = (state.policies, state.demand, state.waiting)
        policies, demand, waiting = jax.tree.map(
            lambda new, old: jnp.where(flags.sample > 0.0, new, old), decided, before
        )
        target = tuple(
            jnp.where(flags.apply > 0.0, new, old) for new, old in zip(waiting[0], state.target, strict=True)
        )
        return ControlState(seen, policies, demand, waiting, target, state.command)

    def _nearest(self, damper: int, demand: Scalar, seen: Signals, state: Array) -> Scalar:
        """The command whose force comes nearest to the demanded one, at the present motion and states of the law.

        Between two levels the force is taken as straight in the command. Each share is rounded where the levels' forces
        differ little, as much as they differ at the velocity `still`, and at both ends: it has derivatives everywhere,
        and never leaves the levels.
        """
        forces = [law.force(seen.stroke, seen.velocity, state) for law in self._laws[damper]]
        levels, command = self._levels[damper], self._levels[damper][0]
        for i, small in enumerate(self._small[damper]):
            rise = forces[i + 1] - forces[i]
            share = (demand - forces[i]) * rise / (rise * rise + small * small + LEAST)
            command = command + (levels[i + 1] - levels[i]) * _rounded_limits(share)
        return command


def forces_at(laws: Sequence[AbstractDamper], velocity: Scalar) -> Float[Array, " laws"]:
    """The forces of laws [N] at a velocity that has been held, with the states that the first of them then has."""
    zero, first = jnp.zeros_like(velocity), laws[0]
    state = first.initial_state()
    if state.size:

        def held(state: Array, _: None) -> tuple[Array, None]:
            return first.advance(zero, velocity, zero, velocity, state, HELD / STEPS), None

        state, _ = jax.lax.scan(held, state, None, length=STEPS)
    return jnp.stack([law.force(zero, velocity, state) for law in laws])


HELD, STEPS = 0.2, 200  # s, and steps, in which friction and hysteresis at a velocity settle
LEAST = 1e-12  # N², where two levels have the same force
ROUNDED = 0.1  # share of the range over which its limits are rounded
FAR = 100.0  # shares, from where on nothing changes


def _rounded_limits(share: Scalar) -> Scalar:
    """A share between zero and one, smooth: (1 + √(s² + w²) − √((s − 1)² + w²))/2."""
    share = within(share, -FAR, FAR)  # roots of far greater numbers would differ by rounding alone
    above = share - 1.0
    return 0.5 * (1.0 + jnp.sqrt(share * share + ROUNDED**2) - jnp.sqrt(above * above + ROUNDED**2))


def _decay(dt: Scalar, lag: Scalar) -> Scalar:
    """exp(−dt/lag), zero without a lag."""
    has_lag = lag > 0.0
    return jnp.where(has_lag, jnp.exp(-dt / jnp.where(has_lag, lag, 1.0)), 0.0)
