"""What an engine is: an object that integrates the equations of a vehicle and shows every instant to an observer."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple, final

import equinox as eqx
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import Mode
from jaxdamp._types import Scalar, ScalarLike, Signal
from jaxdamp._vectors import MemoryLayout
from jaxdamp.control import ControlLoop
from jaxdamp.dampers import AbstractDamper
from jaxdamp.rig import AbstractLawEngine
from jaxdamp.simulation.equations import STRAIGHT, Equations, RoadEdges, RoadInput, StepState
from jaxdamp.simulation.step_size import RunCheck
from jaxdamp.vehicles import System


class AbstractObserver(ABC):
    """What looks at a run while an engine drives it: it saves instants, or gathers numbers."""

    every: int = 1  # it saves one in so many instants
    saves_motion: bool = False  # it saves whole instants, so that the memory of a run grows with its length anyway

    @abstractmethod
    def begin(self, now: StepState, road: RoadInput) -> PyTree:
        """What is gathered at the first instant."""

    @abstractmethod
    def add(self, gathered: PyTree, now: StepState, road: RoadInput) -> PyTree:
        """What is gathered with one instant more."""

    @abstractmethod
    def saved(self, now: StepState, gathered: PyTree) -> PyTree:
        """What is saved of an instant."""


# heights [m] and rates [m/s] of the road, and commands, at the first instant of a run
FirstRows = tuple[Float[ArrayLike, " wheels"], Float[ArrayLike, " wheels"], Float[ArrayLike, " commands"] | None]


@final
class RunState(eqx.Module):
    """Where a run stopped, and from where another one goes on: `simulate(..., state=...)`.

    A tree of arrays, which `jax.lax.scan`, `jax.vmap` and `pickle` take.

    Attributes:
        time: instant at which the run stopped [s].
        now: motion (q, q̇), states and forces of the elements there, and what the engine remembers of earlier steps.
        first: heights [m] and rates [m/s] of the road and commands with which it began, from which displacements count.
        step: last step of the engine [s].
        engine: name of its class, which alone knows what it remembers.
    """

    time: Scalar
    now: StepState
    first: FirstRows
    step: float = eqx.field(static=True)
    engine: str = eqx.field(static=True)


class Outcome(NamedTuple):
    """What an engine gives back.

    Attributes:
        gathered: by the observer, up to the last instant.
        records: what the observer saved, with the instants along the first axis.
        states: of the elements at the end.
        status: what the engine says of the run, for `AbstractEngine.remedy`.
        last: the vehicle at the last instant, from which a run goes on; None of an engine that cannot.
    """

    gathered: PyTree
    records: PyTree
    states: list[Float[Array, " _state"]]
    status: PyTree = None
    last: StepState | None = None


class AbstractEngine(AbstractLawEngine):
    """How the equations of motion are integrated: `simulate(vehicle, road, engine=...)`, and the same for a `Ride`.

    The library has `Exponential`, with fixed steps, and `Adaptive`, the solvers of diffrax. An engine of one's own with
    fixed steps derives from `AbstractFixedStep` (`docs/own_engine.md`).
    """

    @property
    @abstractmethod
    def derivatives(self) -> tuple[Mode, ...]:
        """The modes of differentiation that pass through a run, among "forward" and "reverse"."""

    @abstractmethod
    def run(
        self,
        equations: Equations,
        heights: Float[Array, "time wheels"],
        dt: ScalarLike,
        start: Float[Array, " n"] | RunState,
        observer: AbstractObserver,
        edges: RoadEdges = STRAIGHT,
    ) -> Outcome:
        """Drive a run, inside a compiled function.

        Arguments:
            equations: of the vehicle, in the layout that `layout` chose.
            heights: of the road under the wheels at uniform instants [m], straight between them.
            dt: spacing of the instants [s].
            start: the motion (q, q̇) at the first instant, the elements at rest; or where an earlier run stopped.
            observer: sees every instant; one that saves one in `observer.every` need only see these.
            edges: the road beyond both ends of a run that goes on.
        """

    @property
    def derivatives_in_sweeps(self) -> tuple[Mode, ...]:
        """The modes that pass in a `sweep`, which spreads its points over devices."""
        return self.derivatives

    @property
    def spacing(self) -> float | None:
        """The spacing of instants that this engine is made for [s]; None if it takes that of the run."""
        return None

    @property
    def step_count(self) -> int:
        """Steps from one instant to the next; 1 also where the engine chooses its own."""
        return 1

    @property
    def runs_controllers(self) -> bool:
        """Whether it can run a vehicle with a controller, which is sampled at instants."""
        return False

    @property
    def runs_printed(self) -> bool:
        """Whether the loop is printed as C and compiled by the machine's C compiler, for many cars side by side."""
        return False

    def printed_in_sweeps(self) -> "AbstractEngine | None":
        """The engine of a sweep without derivatives, whose loop may be printed; None if it stays this one."""
        return None

    @property
    def is_printed(self) -> bool:
        """Whether its loop is printed as C."""
        return False

    def layout(self, states: int, *, side_by_side: bool) -> MemoryLayout:
        """How the vectors of a vehicle lie in memory.

        Arguments:
            states: length of the motion (q, q̇).
            side_by_side: many cars are driven at a time, by `jax.vmap`.
        """
        del states, side_by_side
        return MemoryLayout.ARRAY

    def prepared(self, check: RunCheck) -> "AbstractEngine":
        """The engine for a run, after the checks that its steps must pass; open choices are made by the vehicle."""
        check.road()
        return self

    def remedy(self, status: PyTree, dt: float) -> str:
        """What to do about a run that diverged."""
        del status
        return f"Take shorter steps than {dt:g} s."

    def respond(self, law: AbstractDamper, time: Signal, stroke: Signal, velocity: Signal) -> Signal:
        """The force of a law under a prescribed stroke; refused by engines that drive vehicles only."""
        del law, time, stroke, velocity
        remedy = "Leave it out, or pass `simulation.Exponential(substeps=...)` or `simulation.Adaptive(...)`."
        _checks.refuse("engine", "drive a law on the rig, too", repr(self), remedy)

    @contextmanager
    def naming_derivatives(self) -> Iterator[None]:
        """Say in an error of JAX about forward derivatives which engine does not pass them."""
        try:
            yield
        except TypeError as error:
            if "forward" in self.derivatives or "jvp" not in str(error):
                raise
            message = f"{self} passes no forward derivatives (`jax.jvp`, `jax.jacfwd`). {BOTH_WAYS}"
            raise TypeError(message) from error


BOTH_WAYS = "Differentiate in reverse (`jax.grad`), or take `simulation.Exponential()`, which passes both."


def chosen_engine(
    engine: AbstractEngine | None, default: AbstractEngine, dt: float | None, substeps: int | None
) -> tuple[AbstractEngine, float]:
    """The engine of a run and the spacing of its instants [s], of what the caller gave and left out."""
    if engine is None:
        engine = default
    elif substeps is not None:
        remedy = "Write `engine=simulation.Exponential(substeps=...)`."
        _checks.refuse("substeps", "be left out beside an engine, which has its own", substeps, remedy)
    spacing = engine.spacing
    if dt is None:
        return engine, 1e-3 if spacing is None else spacing
    dt = _checks.plain_number("dt", dt)
    if spacing is not None and spacing != dt:
        _checks.refuse("dt", f"be left out, or be that of the engine, {spacing:g} s", dt)
    return engine, dt


def check_control(engine: AbstractEngine, system: System, dt: float, duration: float, *, part: bool = False) -> None:
    """Refuse an engine that cannot run a controller, times of it that are not whole steps, and a delay without end.

    Arguments:
        engine: of the run.
        system: the vehicle.
        dt: spacing of the instants [s].
        duration: of the run [s].
        part: whether it is a part of a longer one.
    """
    control: ControlLoop | None = system.control
    if control is None:
        return
    if not engine.runs_controllers:
        remedy = "Leave it out, or drive `vehicle.passive`, with its dampers at fixed commands."
        _checks.refuse("engine", "have fixed steps to run a controller", repr(engine), remedy)
    for name in ("period", "delay"):
        value: float = getattr(control, name)
        steps = value / dt
        if abs(steps - round(steps)) > 1e-6 or (name == "period" and steps < 0.5):
            must = f"be a whole number of steps of {dt:g} s"
            near = max(round(steps), 1) * dt
            _checks.refuse(name, must, f"{value:g} s", f"Pass `{name}={near:g}`, or another `dt`.")
    whys = {
        "period": "The controller would take its first sample alone, at rest.",
        "delay": "No command of the controller would be applied.",
    }
    for name, why in whys.items():
        value = getattr(control, name)
        if not part and value >= duration:
            _checks.refuse(name, f"be shorter than the run of {duration:g} s", f"{value:g} s", why)


def check_demands(
    system: System, time: Signal, motion: Float[Array, "time n"], commands: Float[Array, "time commands"] | None
) -> None:
    """Refuse a policy that demanded what is no number, while the vehicle moved as it should.

    Arguments:
        system: the vehicle.
        time: of the instants [s].
        motion: at the instants.
        commands: of the dampers, then the demanded forces [N]; None without a controller.
    """
    control: ControlLoop | None = system.control
    if control is None or commands is None:
        return
    concrete, moved = _checks.concrete(commands), _checks.concrete(motion)
    if concrete is None or moved is None:
        return
    demands = concrete[:, len(control.ports) :]
    bad = ~np.isfinite(demands)
    if not bad.any():
        return
    first = int(np.argmax(bad.any(axis=1)))
    before = moved[max(first - 1, 0)]
    if np.all(np.abs(before) < SANE):  # else the vehicle was the first
        number = int(np.argmax(bad[first]))
        damper, policy = system.layout.ports[control.ports[number]], control.commanded_by[number]
        remedy = "Look for a division by zero, or a root or power of a negative number, among its signals and states."
        demand = f"{demands[first, number]} N for {damper} at the sample before {time[first]:g} s"
        _checks.refuse(f"policy ({policy})", "demand finite forces", demand, remedy)


SANE = 1e6  # m, m/s
