"""The loop of all engines with fixed steps.

XLA compiles a loop on a CPU into one function, ten times as fast, if its body touches few bytes: 1 kB unless told
otherwise (`jaxdamp.configure`). A quarter car with most memoryless laws stays below that because a step is written in
small arrays and carries no more than it must.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import TypeAlias, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, PyTree

from jaxdamp._jacobian import Mode
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar, ScalarLike
from jaxdamp._vectors import MemoryLayout, between, laid_out
from jaxdamp.codegen import printed_scan
from jaxdamp.control import Flags
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver, Outcome, RunState
from jaxdamp.simulation.equations import FOR_REVERSE, STRAIGHT, Equations, RoadEdges, RoadInput, StepState
from jaxdamp.simulation.stepper import AbstractStepper, ControlledStepper, Controller


Carry: TypeAlias = tuple[StepState, PyTree, RoadInput, tuple[Array, ...]]
Row: TypeAlias = tuple[Array, Flags | None]  # the road ahead, and what a controller does
BLOCK = 16_384  # instants, of which reverse derivatives keep what they need; longer runs are driven twice


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
        controller = None
        if equations.system.control is not None:
            controller, stepper = Controller(stepper, dt), ControlledStepper(stepper)
        heights, start, edges = varying_as((heights, start, edges), eqx.filter(stepper, eqx.is_array))
        rated = equations.road_deflection is not None or not observer.saves_motion
        road = _RoadRows(heights, jnp.asarray(0.5 / dt, dtype=heights.dtype), equations.layout, edges, rated=rated)

        def step(carry: Carry, row: Row) -> Carry:
            """To the next instant; where rates are needed, with the height of the one after it."""
            (now, gathered, begin, window), (ahead, flags) = carry, row
            if controller is not None and flags is not None:
                now = controller.decided(now, begin, flags)
            end, window = road.reached(window, ahead)
            after = _over(stepper, now, begin, end, self.step_count)
            return after, observer.add(gathered, after, end), end, window

        goes_on = isinstance(start, RunState)
        if isinstance(start, RunState):
            now = stepper.resumed(start.now, road.first, stepper.dt / start.step)
        else:
            now = stepper.start(start, road.first)
        flags = None
        if controller is not None:
            now = now if goes_on else controller.begin(now, road.first)
            flags = controller.flags(road.ahead.shape[0], start.time if isinstance(start, RunState) else 0.0)
        carry = varying_as((now, observer.begin(now, road.first), road.first, road.window))
        if self.runs_printed:
            carry = self._printed(step, carry, (road.ahead, flags), observer)
            return self._outcome(carry, observer.saved(carry[0], carry[1]), equations)
        carry, records = _driven(step, carry, (road.ahead, flags), observer)
        return self._outcome(carry, records, equations)

    def _outcome(self, carry: Carry, records: PyTree, equations: Equations) -> Outcome:
        return Outcome(carry[1], records, equations.ports.by_port(carry[0].states), last=carry[0])

    def _printed(
        self, step: Callable[[PyTree, PyTree], PyTree], carry: Carry, rows: Row, observer: AbstractObserver
    ) -> Carry:
        """The carry at the end of a loop that is printed; refused where something of each instant is saved."""
        try:
            if jax.tree.leaves(observer.saved(carry[0], carry[1])):
                raise NotImplementedError("Instants are saved, as `simulate` and metrics of a whole record need them.")
            return printed_scan(step, carry, rows)
        except NotImplementedError as error:
            message = f"{self} cannot print this run: {error} Leave `printed` out: XLA then compiles the loop."
            raise NotImplementedError(message) from error


@final
class _RoadRows:
    """The road as the loop takes it: under the first instant, what stands before the next, and the rows.

    Arguments:
        heights: at the instants [m], shape (time, wheels).
        half_rate: one over two spacings of the instants [1/s].
        layout: of the vehicle's vectors.
        edges: the road beyond both ends.
        rated: whether rates are needed.
    """

    def __init__(
        self, heights: Array, half_rate: Array, layout: MemoryLayout, edges: RoadEdges, *, rated: bool
    ) -> None:
        self._half_rate, self._layout, self._rated = half_rate, layout, rated
        self.first, self.window, self.ahead = RoadInput(laid_out(heights[0], layout), None), (), heights[1:]
        if rated:
            rise = heights[1] - heights[0]
            self.first = self._at(heights[0], 2.0 * rise if edges.before is None else heights[1] - edges.before)
            self.window = heights[0], heights[1]
            last = 2.0 * heights[-1] - heights[-2] if edges.after is None else edges.after  # as straight as it came
            self.ahead = jnp.concatenate([heights[2:], last[None]])

    def reached(self, window: tuple[Array, ...], ahead: Array) -> tuple[RoadInput, tuple[Array, ...]]:
        """The road at the end of a step, and what stands before the next."""
        if not self._rated:
            return RoadInput(laid_out(ahead, self._layout), None), ()
        height, coming = window
        return self._at(coming, ahead - height), (coming, ahead)

    def _at(self, height: Array, rise: Array) -> RoadInput:
        return RoadInput(laid_out(height, self._layout), laid_out(self._half_rate * rise, self._layout))


def _driven(
    step: Callable[[Carry, Row], Carry], carry: Carry, rows: Row, observer: AbstractObserver
) -> tuple[Carry, PyTree]:
    """The carry after all rows, and what the observer saved; reverse derivatives keep what they need of a block."""
    policy = jax.checkpoint_policies.save_only_these_names(FOR_REVERSE)
    lean = step if observer.saves_motion else jax.checkpoint(step, policy=policy, prevent_cse=False)

    def stride(carry: Carry, row: Row) -> tuple[Carry, PyTree]:
        if observer.every == 1:
            carry = lean(carry, row)
        else:
            carry, _ = jax.lax.scan(lambda carry, row: (lean(carry, row), None), carry, row)
        return carry, observer.saved(carry[0], carry[1])

    def drive(carry: Carry, rows: Row) -> tuple[Carry, PyTree]:
        return jax.lax.scan(stride, carry, rows)

    count = rows[0].shape[0]
    parts = [jax.tree.map(lambda y: y[None], observer.saved(carry[0], carry[1]))]
    whole = 0 if observer.saves_motion or count <= BLOCK else count // BLOCK * BLOCK
    if whole:
        blocks = jax.tree.map(lambda y: y[:whole].reshape(-1, BLOCK, *y.shape[1:]), rows)
        carry, saved = jax.lax.scan(jax.checkpoint(drive), carry, blocks)
        parts.append(jax.tree.map(lambda y: y.reshape(-1, *y.shape[2:]), saved))
    remaining = jax.tree.map(lambda y: y[whole:], rows)
    if observer.every > 1:
        remaining = jax.tree.map(lambda y: y.reshape(-1, observer.every, *y.shape[1:]), remaining)
    carry, saved = drive(carry, remaining)
    return carry, jax.tree.map(lambda *ys: jnp.concatenate(ys), *parts, saved)


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
