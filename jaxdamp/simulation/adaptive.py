"""The adaptive engine: the same equations handed to diffrax, as reference and for stiff laws."""

from typing import TYPE_CHECKING, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import Mode
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp.dampers import AbstractDamper
from jaxdamp.rig import solve_law
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver, Outcome, RunState
from jaxdamp.simulation.equations import STRAIGHT, Equations, RoadEdges, RoadInput, StepState, road_rate
from jaxdamp.vehicles import States


if TYPE_CHECKING:
    import diffrax


STEPS_PER_INSTANT = 100  # on average: more are a law too fast for the solver, and would take for ever


@final
class Adaptive(AbstractEngine):
    """Steps of a diffrax solver, as long as its tolerances allow; they end where the slope of the road changes.

    It saves the whole run, also for a `Ride`. Derivatives pass in one mode: forward ones go along with the run, reverse
    ones drive it again from checkpoints (not in a `sweep`).

    Arguments:
        solver: any of diffrax; Tsit5 if left out, `diffrax.Kvaerno5()` for stiff laws.
        rtol: relative tolerance.
        atol: absolute tolerance, in the units of the states (m, m/s).
        mode: the derivatives that pass, `"forward"` (`jax.jvp`, `jax.jacfwd`) or `"reverse"` (`jax.grad`).

    >>> from jaxdamp import roads, simulate, vehicles
    >>> bump = roads.cosine_bump(0.05, start=0.1, duration=0.25)
    >>> simulate(vehicles.presets.quarter_car_000(), bump, duration=0.5, engine=Adaptive(rtol=1e-6))
    Response of a QuarterCar over 0.5 s, 501 instants, 12 channels
    """

    solver: "diffrax.AbstractSolver | None" = None
    rtol: float = eqx.field(static=True, default=1e-8)
    atol: float = eqx.field(static=True, default=1e-10)
    mode: Mode = eqx.field(static=True, default="forward")

    def __check_init__(self) -> None:
        from jaxdamp._driven import check_solver

        check_solver(self._solver(), self.rtol, self.atol)
        _checks.one_of("mode", self.mode, ["forward", "reverse"])

    def _solver(self) -> "diffrax.AbstractSolver":
        import diffrax

        return diffrax.Tsit5() if self.solver is None else self.solver

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """The mode that was chosen."""
        return (self.mode,)

    @property
    def derivatives_in_sweeps(self) -> tuple[Mode, ...]:
        """Forward ones alone: the checkpoints of diffrax do not go with `jax.shard_map`."""
        return ("forward",) if self.mode == "forward" else ()

    def run(
        self,
        equations: Equations,
        heights: Float[Array, "time wheels"],
        dt: ScalarLike,
        start: Float[Array, " n"] | RunState,
        observer: AbstractObserver,
        edges: RoadEdges = STRAIGHT,
    ) -> Outcome:
        """The run by the solver; the observer sees its instants afterwards."""
        from jaxdamp._driven import solve

        count = heights.shape[0]
        time = dt * jnp.arange(count, dtype=heights.dtype)

        def road(t: Scalar) -> RoadInput:
            index = jnp.clip(jnp.floor(t / dt).astype(int), 0, count - 2)
            slope = (heights[index + 1] - heights[index]) / dt
            return RoadInput(heights[index] + slope * (t - time[index]), slope)

        def field(t: Scalar, y: tuple[Array, States]) -> tuple[Array, States]:
            return equations.rates(*y, road(t))

        first = start.now if isinstance(start, RunState) else equations.at_rest(start, road(time[0]))
        begin = first.motion, first.states
        options = {"mode": self.mode, "every": observer.every}
        solver, limit = self._solver(), STEPS_PER_INSTANT
        run, status = solve(field, begin, time, solver, self.rtol, self.atol, steps_per_instant=limit, **options)
        instants = (*run, heights[:: observer.every], road_rate(heights, dt, edges)[:: observer.every])

        def see(instant: tuple) -> tuple[StepState, RoadInput]:
            motion, states, height, slope = instant
            ground = RoadInput(height, slope)
            return equations.at(motion, states, ground), ground

        def add(gathered: PyTree, instant: tuple) -> tuple[PyTree, PyTree]:
            now, ground = see(instant)
            gathered = observer.add(gathered, now, ground)
            return gathered, observer.saved(now, gathered)

        now, ground = see(jax.tree.map(lambda y: y[0], instants))
        gathered = observer.begin(now, ground)
        first = observer.saved(now, gathered)
        gathered, saved = jax.lax.scan(add, gathered, jax.tree.map(lambda y: y[1:], instants))
        records = jax.tree.map(lambda y, following: jnp.concatenate([y[None], following]), first, saved)
        last, _ = see(jax.tree.map(lambda y: y[-1], instants))
        return Outcome(gathered, records, equations.ports.by_port(last.states), status, last)

    def remedy(self, status: PyTree, dt: float) -> str:
        """What the solver says of a run that diverged, and what to do about it."""
        from jaxdamp._driven import verdict

        said = verdict(status) or "finished"
        return f"The solver says: {said} Fast laws need `engine=simulation.Adaptive(diffrax.Kvaerno5())`."

    def respond(self, law: AbstractDamper, time: Signal, stroke: Signal, velocity: Signal) -> Signal:
        """The force of a law [N], its states by the solver, the stroke cubic between the instants."""
        return solve_law(law, time, stroke, velocity, self._solver(), self.rtol, self.atol, self.mode)
