"""The loop of all engines with fixed steps.

XLA compiles a loop on a CPU into one function, ten times as fast, if its body touches few bytes: 1 kB unless told
otherwise (`jaxdamp.configure`). A quarter car with most memoryless laws stays below that because a step is written in
small arrays and carries no more than it must.
"""

from abc import abstractmethod
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, PyTree

from jaxdamp._jacobian import Mode
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp._vectors import between, laid_out
from jaxdamp.codegen import printed_scan
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


class AbstractFixedStep(AbstractEngine):
    """An engine of equal steps: it has one method, `stepper`, and `step_count` where an interval takes several."""

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """Both: the loop has a fixed length. A step with a loop of its own may say otherwise."""
        return ("forward", "reverse")

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
        heights, start, edges = varying_as((heights, start, edges), eqx.filter(stepper, eqx.is_array))
        half_rate, layout = jnp.asarray(0.5 / dt, dtype=heights.dtype), equations.layout
        rated = equations.road_deflection is not None or not observer.saves_motion

        def at(height: Array, rate: Array) -> RoadInput:
            return RoadInput(laid_out(height, layout), laid_out(rate, layout))

        def step(carry: Carry, ahead: Array) -> Carry:
            """To the next instant; where rates are needed, with the height of the one after it."""
            now, gathered, begin, window = carry
            if rated:
                height, coming = window
                end, window = at(coming, half_rate * (ahead - height)), (coming, ahead)
            else:
                end = RoadInput(laid_out(ahead, layout), None)
            after = _over(stepper, now, begin, end, self.step_count)
            return after, observer.add(gathered, after, end), end, window

        policy = jax.checkpoint_policies.save_only_these_names(FOR_REVERSE)
        lean = step if observer.saves_motion else jax.checkpoint(step, policy=policy, prevent_cse=False)

        def stride(carry: Carry, ahead: Array) -> tuple[Carry, PyTree]:
            if observer.every == 1:
                carry = lean(carry, ahead)
            else:
                carry, _ = jax.lax.scan(lambda carry, ahead: (lean(carry, ahead), None), carry, ahead)
            return carry, observer.saved(carry[0], carry[1])

        def drive(carry: Carry, road: Array) -> tuple[Carry, PyTree]:
            return jax.lax.scan(stride, carry, road)

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
        carry = varying_as((now, observer.begin(now, first), first, window))
        if self.runs_printed:
            carry = self._printed(step, carry, road, observer)
            return self._outcome(carry, observer.saved(carry[0], carry[1]), equations)
        parts = [jax.tree.map(lambda y: y[None], observer.saved(now, carry[1]))]
        whole = 0 if observer.saves_motion or road.shape[0] <= BLOCK else road.shape[0] // BLOCK * BLOCK
        if whole:
            blocks = road[:whole].reshape(-1, BLOCK, *road.shape[1:])
            carry, saved = jax.lax.scan(jax.checkpoint(drive), carry, blocks)
            parts.append(jax.tree.map(lambda y: y.reshape(-1, *y.shape[2:]), saved))
        remaining = road[whole:]
        if observer.every > 1:
            remaining = remaining.reshape(-1, observer.every, *remaining.shape[1:])
        carry, saved = drive(carry, remaining)
        records = jax.tree.map(lambda *ys: jnp.concatenate(ys), *parts, saved)
        return self._outcome(carry, records, equations)

    def _outcome(self, carry: Carry, records: PyTree, equations: Equations) -> Outcome:
        return Outcome(carry[1], records, equations.ports.by_port(carry[0].states), last=carry[0])

    def _printed(self, step: Any, carry: Carry, road: Array, observer: AbstractObserver) -> Carry:
        """The carry at the end of a loop that is printed; refused where something of each instant is saved."""
        try:
            if jax.tree.leaves(observer.saved(carry[0], carry[1])):
                raise NotImplementedError("Instants are saved, as `simulate` and metrics of a whole record need them.")
            return printed_scan(step, carry, road, arithmetic=self.prints_arithmetic)
        except NotImplementedError as error:
            message = f"{self} cannot print this run: {error} Leave `printed` out: XLA then compiles the loop."
            raise NotImplementedError(message) from error


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
