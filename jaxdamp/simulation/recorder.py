"""Runs of which the instants are saved."""

from typing import NamedTuple, final

import equinox as eqx
import jax
from jaxtyping import Array, Float, PyTree

from jaxdamp._types import Scalar
from jaxdamp._vectors import Vector
from jaxdamp.simulation.engine import AbstractEngine, AbstractObserver, RunState
from jaxdamp.simulation.equations import Equations, RoadEdges, RoadInput, StepState, road_rate, settled
from jaxdamp.vehicles import States, System


class Saved(NamedTuple):
    """What is saved of a run, at the instants that are saved; the states of the laws, and the vehicle, at the end."""

    motion: Float[Array, "time n"]
    port_force: Float[Array, "time ports"]
    road: Float[Array, "time wheels"]
    road_rate: Float[Array, "time wheels"]
    final_state: list[Float[Array, " _state"]]
    last: StepState | None


@final
class Recorder(AbstractObserver):
    """Saves motion and states at one in `every` instants."""

    saves_motion = True

    def __init__(self, every: int) -> None:
        self.every = every

    def begin(self, now: StepState, road: RoadInput) -> tuple[()]:
        """Nothing is gathered."""
        return ()

    def add(self, gathered: tuple[()], now: StepState, road: RoadInput) -> tuple[()]:
        """Nothing is gathered."""
        return ()

    def saved(self, now: StepState, gathered: tuple[()]) -> tuple[Vector, States]:
        """Motion and states: forces follow from them, and a loop that does not save them has a small body."""
        return now.motion, now.states


@eqx.filter_jit
def recorded(
    engine: AbstractEngine,
    system: System,
    heights: Float[Array, "time wheels"],
    dt: Scalar,
    start: Float[Array, " n"] | RunState | None = None,
    every: int = 1,
    edges: RoadEdges | None = None,
) -> tuple[Saved, PyTree]:
    """Motion (q, q̇) and element forces at every instant of the road, or every so many-th; what the engine says of it.

    From `start`, or settled and at rest on the road's first height. Elements that stand on the road take its rate as
    the mean of the slopes before and after an instant. Vectors are arrays, which are saved as they are.

    Arguments:
        engine: the engine with its step.
        system: the vehicle.
        heights: of the road under each wheel [m, up], shape (time, wheels).
        dt: step of the heights [s].
        start: q and q̇ at the beginning, shape (n,), or where an earlier run stopped; at rest if left out.
        every: number of instants from one that is saved to the next.
        edges: the road beyond both ends of a run that goes on.
    """
    equations = Equations(system)
    start = settled(system, heights[0]) if start is None else start
    beyond = () if edges is None else (edges,)
    outcome = engine.run(equations, heights, dt, start, Recorder(every), *beyond)
    motion, states = outcome.records
    heights, slopes = heights[::every], road_rate(heights, dt, *beyond)[::every]

    def force(motion: Array, states: States, height: Array, slope: Array) -> Array:
        return equations.at(motion, states, RoadInput(height, slope)).force

    forces = jax.vmap(force)(motion, states, heights, slopes)
    return Saved(motion, forces, heights, slopes, outcome.states, outcome.last), outcome.status
