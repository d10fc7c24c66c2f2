"""The exponential engine: linear part exact, element forces predicted and corrected.

Over a step the road runs straight and the element forces run on the parabola through the step before, so that masses
and springs are carried on exactly by the matrix exponential, however stiff the tyre. The forces at the end of the step
are first predicted from the motion under extrapolated forces, then corrected: third order in the step where laws are
smooth, second order at their kinks. It is an exponential Adams method with one correction (on these methods: Hochbruck
and Ostermann, Exponential integrators, Acta Numerica 2010).
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import Mode
from jaxdamp._matrices import phi_functions
from jaxdamp._types import Scalar, Signal
from jaxdamp._vectors import (
    Matrix,
    MemoryLayout,
    SmallVector,
    laid_out,
    materialise_derivatives_once,
    materialise_once,
    minus,
    plus,
    times,
)
from jaxdamp.configuration import target
from jaxdamp.control import Commands
from jaxdamp.dampers import AbstractDamper
from jaxdamp.rig import march
from jaxdamp.simulation.equations import Equations, RoadInput, StepState
from jaxdamp.simulation.fixed_step import AbstractFixedStep
from jaxdamp.simulation.step_size import RunCheck
from jaxdamp.simulation.stepper import AbstractStepper
from jaxdamp.vehicles import Earlier, LinearMap


@final
class Propagator(eqx.Module):
    """x₁ = Φ x₀ + H₀ f₀ + H₁ (f₁ − f₀) + H₂ (f₁ − 2 f₀ + f₋₁) + R₀ z₀ + R₁ (z₁ − z₀).

    Exact for element forces f [N] that run over the step on the parabola through f₋₁, one step earlier, f₀ and f₁, and
    for heights z [m] that run straight. Motion x = (q, q̇).
    """

    phi: Float[Array, "n n"]
    force_held: Float[Array, "n ports"]
    force_ramp: Float[Array, "n ports"]
    force_bend: Float[Array, "n ports"]
    road_held: Float[Array, "n wheels"]
    road_ramp: Float[Array, "n wheels"]

    @classmethod
    def over(cls, rate: LinearMap, dt: Scalar) -> "Propagator":
        """The matrices of a step of dt [s] of ẋ = A x + B f + R z + S ż.

        Φ = φ₀(A dt), H₀ = φ₁ B dt, H₁ = φ₂ B dt, H₂ = (φ₃ − φ₂/2) B dt.
        """
        phi, held, ramp, bend = phi_functions(rate.motion * dt)
        forces, heights = rate.force * dt, rate.road * dt
        return cls(
            phi,
            held @ forces,
            ramp @ forces,
            (bend - 0.5 * ramp) @ forces,
            held @ heights,
            ramp @ heights + held @ rate.road_rate,
        )


FEW_STATES = 4  # up to which one car is best written number by number, if loops are fused


class StepBefore(NamedTuple):
    """Forces [N] of the elements a step before, and the states that are extrapolated, one and two steps before."""

    force: SmallVector
    states: Earlier


@final
class ExponentialStepper(AbstractStepper):
    """The matrices of a step; see `Propagator` for their formulas.

    Arguments:
        equations: of the vehicle.
        dt: the step [s].
    """

    equations: Equations
    dt: Scalar
    phi: Matrix
    earlier_input: Matrix  # of the forces a step before, of those now, and of their correction
    force_input: Matrix
    correction: Matrix
    opaque_one: Scalar | None  # 1.0, whose value the compiler does not know
    road_held: Matrix
    road_ramp: Matrix

    def __init__(self, equations: Equations, dt: Scalar) -> None:
        exact, layout = Propagator.over(equations.system.motion, dt), equations.layout
        many = layout is MemoryLayout.LANES
        self.equations, self.dt = equations, dt
        self.opaque_one = jnp.where(jnp.isnan(exact.phi[0, 0]), jnp.nan, 1.0) if many else None
        self.phi, self.earlier_input = laid_out(exact.phi, layout), laid_out(-exact.force_ramp, layout)
        self.force_input = laid_out(exact.force_held + exact.force_ramp, layout)
        self.correction = laid_out(exact.force_ramp + exact.force_bend, layout)
        self.road_held, self.road_ramp = laid_out(exact.road_held, layout), laid_out(exact.road_ramp, layout)

    def start(self, motion: Float[Array, " n"], road: RoadInput) -> StepState:
        """The vehicle at the first instant; its elements have been at rest."""
        now = self.equations.at_rest(motion, road)
        return now._replace(memory=StepBefore(now.force, self.equations.ports.first_earlier(now.states)))

    def __call__(self, now: StepState, begin: RoadInput, end: RoadInput) -> StepState:
        """A step later."""
        ports, rise, before = self.equations.ports, minus(end.height, begin.height), now.memory
        driven = plus(times(self.road_held, begin.height), times(self.road_ramp, rise), times(self.phi, now.motion))
        driven = plus(driven, times(self.earlier_input, before.force))
        ahead = plus(driven, times(self.force_input, now.force))  # last, as this force is known last
        old, new = self.equations.at_ports(now.motion, begin), self._reached(ahead, end)
        predicted = ports.force(*new, ports.predict(*old, *new, now.states, before.states, self.dt))
        missed = plus(minus(predicted, now.force), minus(before.force, now.force))
        motion = plus(ahead, times(self.correction, materialise_once(missed, self.opaque_one)))
        new = self._reached(motion, end)
        states = ports.advance(*old, *new, now.states, self.dt)
        memory = StepBefore(now.force, ports.next_earlier(now.states, before.states))
        return StepState(motion, states, ports.force(*new, states), memory)

    def resumed(self, now: StepState, road: RoadInput, ratio: Scalar) -> StepState:
        """The same instant for this stepper after another, whose step was shorter or whose parameters differed.

        The memory keeps its differences from the present, times the ratio of this step to the last one.
        """
        again = self.equations.at(now.motion, now.states, road)

        def before(old: object, then: object, present: object) -> PyTree:
            return jax.tree.map(lambda old, then, present: present + ratio * (old - then), old, then, present)

        held = [None if old is None else state for old, state in zip(now.memory.states[0], now.states, strict=True)]
        earlier = tuple(before(states, held, held) for states in now.memory.states)
        return again._replace(memory=StepBefore(before(now.memory.force, now.force, again.force), earlier))

    def recommanded(self, now: StepState, road: RoadInput, commands: Commands, rises: Commands) -> StepState:
        """The same instant under other commands, the memory as if their targets had always been the same.

        The force a step before is that of the motion carried back by its acceleration, at the command carried back
        along its slope: the step after a jump of the command then is of third order, too.
        """
        dt, n = self.dt, len(now.motion) // 2
        equations = self.equations.at_commands(commands)
        after = equations.at(now.motion, now.states, road)
        rate = self.equations.system.motion
        rate = rate if self.equations.layout is MemoryLayout.ARRAY else rate.scalars()
        acceleration = rate(after.motion, after.force, road.height, road.rate)[n:]
        (x, v), a = equations.at_ports(now.motion, road), times(self.equations.deflection, acceleration)
        moved = _each(lambda x, v, a: x - dt * (v - 0.5 * dt * a), x, v, a), _each(lambda v, a: v - dt * a, v, a)

        def force(commands: Commands) -> SmallVector:
            return self.equations.at_commands(commands).ports.force(*moved, now.states)

        before, change = jax.jvp(force, (commands,), (rises,))
        return after._replace(memory=now.memory._replace(force=plus(before, change)))

    def _reached(self, motion: SmallVector, road: RoadInput) -> tuple[SmallVector, SmallVector]:
        deflection, rate = self.equations.at_ports(motion, road)
        one = self.opaque_one
        return materialise_derivatives_once(deflection, one), materialise_derivatives_once(rate, one)


def _each(function: Callable[..., Scalar], *vectors: SmallVector) -> SmallVector:
    """A function of the entries of vectors, one by one."""
    if isinstance(vectors[0], tuple):
        return tuple(function(*entries) for entries in zip(*vectors, strict=True))
    return function(*vectors)


@final
class Exponential(AbstractFixedStep):
    """Fixed steps of third order, the linear part exact: the engine of `simulate` and `Ride`.

    Second order where laws have kinks or states; 1 ms is right for cars. Forward and reverse derivatives pass.

    Arguments:
        dt: spacing of the instants [s]; that of the run if left out.
        substeps: steps between two instants; as many as the steepest law needs (friction at standstill, a bristle, oil)
            if left out, so that every step is stable. The road stays straight between instants.
        printed: print the loop over time as C and let the machine's C compiler (gcc, clang) make vector code of it:
            for a `Ride` in a `sweep` or under `jax.vmap`, in double precision. The numbers are the same to rounding,
            and come 1 to 12 times as fast (`docs/speed.md`). On a GPU the loop is one CUDA kernel, 4 to 40 times as
            fast as XLA there. Derivatives do not pass. What cannot be printed, such as a step with branches on a
            processor, is refused with the reason (`NotImplementedError`). If left out (None), a `sweep` prints what can
            be printed, and if it takes more than a minute compares it with the loop of XLA; with False all is left to
            XLA.

    >>> from jaxdamp import roads, simulate, vehicles
    >>> bump = roads.cosine_bump(0.05, start=0.1, duration=0.25)
    >>> simulate(vehicles.presets.quarter_car_000(), bump, duration=1.0, engine=Exponential(dt=5e-4))
    Response of a QuarterCar over 1 s, 2001 instants, 12 channels
    """

    dt: float | None = eqx.field(static=True, default=None)
    substeps: int | None = eqx.field(static=True, default=None)
    printed: bool | None = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        if self.dt is not None:
            _checks.positive("dt", self.dt)
        if self.substeps is not None and (not isinstance(self.substeps, int | np.integer) or self.substeps < 1):
            _checks.refuse("substeps", "be a whole number, 1 or more", repr(self.substeps))

    @property
    def spacing(self) -> float | None:
        """Its own step, if it has one [s]."""
        return self.dt

    @property
    def step_count(self) -> int:
        """Steps from one instant to the next."""
        return self.substeps or 1

    def layout(self, states: int, *, side_by_side: bool) -> MemoryLayout:
        """Lanes for many cars; scalars for one small car where loops are compiled as one function, and in C."""
        if self.printed:
            return MemoryLayout.SCALARS
        if side_by_side:
            return MemoryLayout.LANES
        return MemoryLayout.SCALARS if target().fused_loops and states <= FEW_STATES else MemoryLayout.ARRAY

    @property
    def runs_printed(self) -> bool:
        """As asked for."""
        return bool(self.printed)

    def printed_in_sweeps(self) -> "Exponential | None":
        """Printed, if nobody has said."""
        return dataclasses.replace(self, printed=True) if self.printed is None else None

    @property
    def is_printed(self) -> bool:
        """If it was told so."""
        return self.printed is True

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """Both, but none through a printed loop."""
        return () if self.printed else super().derivatives

    def stepper(self, equations: Equations, dt: Scalar) -> ExponentialStepper:
        """The matrices of a step of dt [s]."""
        return ExponentialStepper(equations, dt)

    def prepared(self, check: RunCheck) -> "Exponential":
        """The same with as many substeps as the laws need, if none were asked for."""
        return dataclasses.replace(self, substeps=check.substeps(self.substeps))

    def remedy(self, status: PyTree, dt: float) -> str:
        """What to do about a run that diverged."""
        solver = "an implicit solver, `engine=simulation.Adaptive(diffrax.Kvaerno5())`"
        return f"Take a shorter step than {dt:g} s, or {solver}."

    def respond(self, law: AbstractDamper, time: Signal, stroke: Signal, velocity: Signal) -> Signal:
        """The force of a law [N], by the steps that it brings."""
        if self.dt is not None:
            _checks.refuse("engine", "have no step of its own on the rig, where the instants are given", repr(self))
        return march(law, (time[-1] - time[0]) / (time.size - 1), stroke, velocity, self.step_count)
