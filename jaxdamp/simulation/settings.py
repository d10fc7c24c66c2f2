"""The keywords of simulations, and their defaults."""

from collections.abc import Mapping
from typing import TypedDict

from jaxdamp.simulation.engine import AbstractEngine, RunState


class Run(TypedDict, total=False):
    """How a vehicle is driven: keywords of `simulate`, and of everything in `tune` that drives.

    Arguments:
        duration: length of the run [s]; the road's own if it has one and this is left out, or what is left of it.
        dt: spacing of the instants [s], 1 ms if left out; for the exponential engine also its step (third order,
            second where laws have kinks or states; 1 ms is right for cars). Where it is coarse a `CoarseStepWarning`
            states the estimated error; what the vehicle cannot bear is refused.
        engine: `simulation.Exponential()`, fixed steps, if left out; `simulation.Adaptive()`, a diffrax solver, such as
            `simulation.Adaptive(diffrax.Kvaerno5())` for a stiff law; or one of your own (`docs/own_engine.md`); in
            `tune` one that passes derivatives by parameters.
    """

    duration: float | None
    dt: float | None
    engine: AbstractEngine | None


class SimulationSettings(Run, total=False):
    """All keywords of `simulate` but `return_state`: those of `Run`, and these.

    Arguments:
        start: coordinates [m, rad] at time zero that differ from the equilibrium, such as `{"pitch": 0.05}`; at rest.
        state: where an earlier run of the same kind of vehicle and engine stopped.
        substeps: of the exponential engine between two instants; as many as the steepest law needs (friction at
            standstill, a bristle, oil) if left out, so that every step is stable. The road stays straight between
            instants. Under `jax.grad`, `jax.jvp` and `jax.vmap` they are those of the numbers that are differentiated,
            the most of a batch. Inside `jax.jit` the numbers of a vehicle that is an argument are not known: pass
            `substeps` (`simulation.substeps_needed`), or a `TracedStepWarning` says what is assumed.
        every: save every so many-th instant only, of long runs. The motion is the same, but metrics, the energy balance
            and notes then know no more than what is saved; `Ride` gathers metrics at every instant and saves none.
    """

    start: Mapping[str, float] | None
    state: RunState | None
    substeps: int | None
    every: int


RUN: Run = {"duration": None, "dt": None, "engine": None}
SIMULATION: SimulationSettings = {**RUN, "start": None, "state": None, "substeps": None, "every": 1}
