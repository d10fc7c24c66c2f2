"""The loop of all engines with fixed steps.

XLA compiles a loop on a CPU into one function, ten times as fast, if its body touches few bytes: 1 kB unless told
otherwise (`jaxdamp.configure`). A quarter car with most memoryless laws stays below that because a step is written in
small arrays and carries no more than it must.
"""

from abc import abstractmethod
from typing import Any, TypeAlias, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, PyTree

from jaxdamp._jacobian import Mode
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp._vectors import between, laid_out
from jaxdamp.codegen import printed_scan
from jaxdamp.control import Commands, ControlLoop, Flags, Signals
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver, Outcome, RunState
from jaxdamp.simulation.equations import FOR_REVERSE, STRAIGHT, Equations, RoadEdges, RoadInput, StepState


Carry: TypeAlias = tuple[StepState, PyTree, RoadInput, tuple[Array, ...]]
BLOCK = 16_384  # instants, of which reverse derivatives keep what they need; longer runs are driven twice


class AbstractStepper(eqx.Module):
    """What carries a vehicle over one step.

    Attributes:
        equations: of the vehicle.
        dt: the step [s].
    """

    equations: eqx.AbstractVar[Equations]
    dt: eqx.AbstractVar[Scalar]

    @abstractmethod
    def __call__(self, now: StepState, begin: RoadInput, end: RoadInput) -> StepState:
        """The vehicle a step later, while the road goes straight from `begin` to `end`.

        The rates in `begin` and `end` are means of the slopes before and after these instants, for elements that stand
        on the road; None where there are none.
        """

    def start(self, motion: Float[Array, " n"], road: RoadInput) -> StepState:
        """The vehicle at the first instant, its elements at rest."""
        return self.equations.at_rest(motion, road)

    def resumed(self, now: StepState, road: RoadInput, ratio: Scalar) -> StepState:
        """The same instant for this stepper after another, from which a run goes on; here with the memory as it is.

        Arguments:
            now: the vehicle at the last instant of the other.
            road: under the wheels.
            ratio: this step to that of the other.
        """
        del ratio
        return self.equations.at(now.motion, now.states, road, now.memory)

    def with_equations(self, equations: Equations) -> "AbstractStepper":
        """The same stepper for a vehicle that differs in its laws alone."""
        return eqx.tree_at(lambda stepper: stepper.equations, self, equations)

    def recommanded(self, now: StepState, road: RoadInput, commands: Commands, rises: Commands) -> StepState:
        """The same instant from which a run goes on with other commands; here with the memory as it is.

        Arguments:
            now: the vehicle under the old commands.
            road: under the wheels.
            commands: of the dampers from now on.
            rises: how much greater they were a step before, had their targets always been the same.
        """
        del rises
        after = self.with_equations(self.equations.at_commands(commands))
        return after.resumed(now, road, jnp.ones_like(self.dt))


class AbstractFixedStep(AbstractEngine):
    """An engine of equal steps: it has one method, `stepper`, and `step_count` where an interval takes several."""

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """Both: the loop has a fixed length. A step with a loop of its own may say otherwise."""
        return ("forward", "reverse")

    @property
    def runs_controllers(self) -> bool:
        """Between its steps."""
        return True

    @property
    def prints_arithmetic(self) -> bool:
        """Whether a loop with exponentials, powers and the like is refused, where it would be printed."""
        return False

    @abstractmethod
    def stepper(self, equations: Equations, dt: Scalar) -> AbstractStepper:
        """What takes a step of dt [s], made once before the loop."""

    def run(
        self,
        equations: Equations,
        heights: Float[Array, "time wheels"],
        dt: ScalarLike,
        start: Float[Array, " n"] | RunState,
        observer: AbstractObserver,
        edges: RoadEdges = STRAIGHT,
    ) -> Outcome:
        """Step after step; of a long run reverse derivatives keep the beginnings of blocks only."""
        stepper = self.stepper(equations, jnp.asarray(dt / self.step_count, dtype=float))
        controller = None if equations.system.control is None else Controller(stepper, dt)
        if controller is not None:
            stepper = ControlledStepper(stepper)
        heights, start, edges = varying_as((heights, start, edges), eqx.filter(stepper, eqx.is_array))
        half_rate, layout = jnp.asarray(0.5 / dt, dtype=heights.dtype), equations.layout
        rated = equations.road_deflection is not None or not observer.saves_motion

        def at(height: Array, rate: Array) -> RoadInput:
            return RoadInput(laid_out(height, layout), laid_out(rate, layout))

        def step(carry: Carry, row: tuple[Array, Flags | None]) -> Carry:
            """To the next instant; where rates are needed, with the height of the one after it."""
            (now, gathered, begin, window), (ahead, flags) = carry, row
            if controller is not None and flags is not None:
                now = controller.decided(now, begin, flags)
            if rated:
                height, coming = window
                end, window = at(coming, half_rate * (ahead - height)), (coming, ahead)
            else:
                end = RoadInput(laid_out(ahead, layout), None)
            after = _over(stepper, now, begin, end, self.step_count)
            return after, observer.add(gathered, after, end), end, window

        policy = jax.checkpoint_policies.save_only_these_names(FOR_REVERSE)
        lean = step if observer.saves_motion else jax.checkpoint(step, policy=policy, prevent_cse=False)

        def stride(carry: Carry, row: PyTree) -> tuple[Carry, PyTree]:
            if observer.every == 1:
                carry = lean(carry, row)
            else:
                carry, _ = jax.lax.scan(lambda carry, row: (lean(carry, row), None), carry, row)
            return carry, observer.saved(carry[0], carry[1])

        def drive(carry: Carry, rows: PyTree) -> tuple[Carry, PyTree]:
            return jax.lax.scan(stride, carry, rows)

        first = RoadInput(laid_out(heights[0], layout), None)
        window, road = (), heights[1:]
        if rated:
            rise = heights[1] - heights[0]
            first = at(heights[0], half_rate * (2.0 * rise if edges.before is None else heights[1] - edges.before))
            window = heights[0], heights[1]
            ahead = 2.0 * heights[-1] - heights[-2] if edges.after is None else edges.after  # as straight as it came
            road = jnp.concatenate([heights[2:], ahead[None]])
        if isinstance(start, RunState):
            now = stepper.resumed(start.now, first, stepper.dt / start.step)
        else:
            now = stepper.start(start, first)
        flags = None
        if controller is not None:
            now = now if isinstance(start, RunState) else controller.begin(now, first)
            begins = jnp.round(start.time / dt) if isinstance(start, RunState) else 0
            flags = equations.system.control.flags(road.shape[0], dt, begins)
        rows = road, flags
        carry = varying_as((now, observer.begin(now, first), first, window))
        if self.runs_printed:
            carry = self._printed(step, carry, rows, observer)
            return self._outcome(carry, observer.saved(carry[0], carry[1]), equations)
        parts = [jax.tree.map(lambda y: y[None], observer.saved(now, carry[1]))]
        whole = 0 if observer.saves_motion or road.shape[0] <= BLOCK else road.shape[0] // BLOCK * BLOCK
        if whole:
            blocks = jax.tree.map(lambda y: y[:whole].reshape(-1, BLOCK, *y.shape[1:]), rows)
            carry, saved = jax.lax.scan(jax.checkpoint(drive), carry, blocks)
            parts.append(jax.tree.map(lambda y: y.reshape(-1, *y.shape[2:]), saved))
        remaining = jax.tree.map(lambda y: y[whole:], rows)
        if observer.every > 1:
            remaining = jax.tree.map(lambda y: y.reshape(-1, observer.every, *y.shape[1:]), remaining)
        carry, saved = drive(carry, remaining)
        records = jax.tree.map(lambda *ys: jnp.concatenate(ys), *parts, saved)
        return self._outcome(carry, records, equations)

    def _outcome(self, carry: Carry, records: PyTree, equations: Equations) -> Outcome:
        return Outcome(carry[1], records, equations.ports.by_port(carry[0].states), last=carry[0])

    def _printed(self, step: Any, carry: Carry, rows: PyTree, observer: AbstractObserver) -> Carry:
        """The carry at the end of a loop that is printed; refused where something of each instant is saved."""
        try:
            if jax.tree.leaves(observer.saved(carry[0], carry[1])):
                raise NotImplementedError("Instants are saved, as `simulate` and metrics of a whole record need them.")
            return printed_scan(step, carry, rows, arithmetic=self.prints_arithmetic)
        except NotImplementedError as error:
            message = f"{self} cannot print this run: {error} Leave `printed` out: XLA then compiles the loop."
            raise NotImplementedError(message) from error


@final
class Controller(eqx.Module):
    """What a controller does at the instants of a run.

    Arguments:
        stepper: of the engine.
        spacing: of the instants [s].
    """

    stepper: AbstractStepper
    loop: ControlLoop
    spacing: Scalar

    def __init__(self, stepper: AbstractStepper, spacing: ScalarLike) -> None:
        self.stepper, self.loop = stepper, stepper.equations.system.control
        self.spacing = jnp.asarray(spacing, dtype=float)

    def begin(self, now: StepState, road: RoadInput) -> StepState:
        """The vehicle at the first instant, before the first sample."""
        return now._replace(control=self.loop.begin(self.stepper.equations.system.laws, self._signals(now, road)))

    def decided(self, now: StepState, road: RoadInput, flags: Flags) -> StepState:
        """After an instant: sensed and decided; where commands are applied, with the forces under them."""
        equations, loop, before = self.stepper.equations, self.loop, now.control
        laws, states = equations.system.laws, equations.ports.by_port(now.states)
        control = loop.sampled(before, self._signals(now, road), laws, states, self.spacing, flags)
        commands, rises = loop.resumed(control, self.stepper.dt)
        after = self.stepper.recommanded(now, road, commands, rises)
        chosen = jax.tree.map(
            lambda new, old: jnp.where(flags.apply > 0.0, new, old), after, now._replace(control=None)
        )
        return chosen._replace(control=control)

    def _signals(self, now: StepState, road: RoadInput) -> tuple[Signals, ...]:
        return self.loop.signals(now.motion, now.force, road, self.stepper.equations.at_ports(now.motion, road))


@final
class ControlledStepper(AbstractStepper):
    """Steps of an engine with the commands that a vehicle has at their ends."""

    inner: AbstractStepper

    @property
    def equations(self) -> Equations:
        """Of the engine's stepper."""
        return self.inner.equations

    @property
    def dt(self) -> Scalar:
        """The step [s]."""
        return self.inner.dt

    def start(self, motion: Float[Array, " n"], road: RoadInput) -> StepState:
        """The vehicle at the first instant."""
        return self.inner.start(motion, road)

    def resumed(self, now: StepState, road: RoadInput, ratio: Scalar) -> StepState:
        """The same instant after another stepper."""
        control = now.control
        equations = self.equations if control is None else self.equations.at_commands(control.command)
        return self.inner.with_equations(equations).resumed(now, road, ratio)._replace(control=control)

    def __call__(self, now: StepState, begin: RoadInput, end: RoadInput) -> StepState:
        """A step later, the actuators with it."""
        control = now.control
        assert control is not None
        commands = self.equations.system.control.followed(control, self.dt)
        after = self.inner.with_equations(self.equations.at_commands(commands))(now, begin, end)
        return after._replace(control=control._replace(command=commands))


def _over(stepper: AbstractStepper, now: StepState, begin: RoadInput, end: RoadInput, substeps: int) -> StepState:
    """So many equal steps later, over which the road is straight."""
    if substeps == 1:
        return stepper(now, begin, end)

    def at(share: ScalarLike) -> RoadInput:
        rate = None if begin.rate is None or end.rate is None else between(begin.rate, end.rate, share)
        return RoadInput(between(begin.height, end.height, share), rate)

    def step(i: ArrayLike, now: StepState) -> StepState:
        done = jnp.asarray(i, stepper.dt.dtype)
        return stepper(now, at(done / substeps), at((done + 1.0) / substeps))

    return jax.lax.fori_loop(0, substeps, step, now)
