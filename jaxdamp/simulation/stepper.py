"""What takes a vehicle over a step, and what a controller does between two steps."""

from abc import abstractmethod
from typing import cast, final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, ScalarLike
from jaxdamp.control import Commands, ControlLoop, Flags, Sampler, Signals, where
from jaxdamp.parameters import as_float
from jaxdamp.simulation.equations import Equations, RoadInput, StepState


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


@final
class Controller(eqx.Module):
    """What a controller does at the instants of a run.

    Arguments:
        stepper: of the engine.
        spacing: of the instants [s].
    """

    stepper: AbstractStepper
    spacing: Scalar
    sampler: Sampler

    def __init__(self, stepper: AbstractStepper, spacing: ScalarLike) -> None:
        self.stepper, self.spacing = stepper, as_float(spacing)
        equations = stepper.equations
        loop = cast(ControlLoop, equations.system.control)
        self.sampler = Sampler(loop, equations.system.laws, equations.layout, self.spacing)

    @property
    def loop(self) -> ControlLoop:
        """The controller as it is assembled."""
        return cast(ControlLoop, self.stepper.equations.system.control)

    def begin(self, now: StepState, road: RoadInput) -> StepState:
        """The vehicle at the first instant, before the first sample."""
        return now._replace(control=self.sampler.begin(self._signals(now, road)))

    def flags(self, count: int, begins: ScalarLike) -> Flags:
        """What happens at so many instants, the first of them at a time [s]."""
        return self.loop.flags(count, self.spacing, jnp.round(begins / self.spacing))

    def decided(self, now: StepState, road: RoadInput, flags: Flags) -> StepState:
        """After an instant: sensed and decided; where commands are applied, with the forces under them."""
        states = self.stepper.equations.ports.by_port(now.states)
        assert now.control is not None
        control = self.sampler.sampled(now.control, self._signals(now, road), states, flags)

        def commanded() -> StepState:
            commands, rises = self.loop.resumed(control, self.stepper.dt)
            return self.stepper.recommanded(now, road, commands, rises)._replace(control=None)

        chosen = where(flags.apply > 0.0, commanded, now._replace(control=None))
        return chosen._replace(control=control)

    def _signals(self, now: StepState, road: RoadInput) -> tuple[Signals, ...]:
        at_ports = self.stepper.equations.at_ports(now.motion, road)
        return self.sampler.signals(now.motion, now.force, road, at_ports)


@final
class ControlledStepper(AbstractStepper):
    """Steps of an engine with the commands that a vehicle has at their ends.

    Arguments:
        inner: of the engine, with its step `dt` [s].
    """

    equations: Equations
    dt: Scalar
    inner: AbstractStepper

    def __init__(self, inner: AbstractStepper) -> None:
        self.inner, self.equations, self.dt = inner, inner.equations, inner.dt

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
