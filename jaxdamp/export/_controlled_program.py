"""A controlled vehicle as functions of its numbers, which are printed in other languages."""

import dataclasses
import re
from collections.abc import Callable
from functools import cached_property
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from jaxdamp._types import Scalar
from jaxdamp.codegen import Program, lower
from jaxdamp.control import Controlled, ControlLoop, Flags, Sensors
from jaxdamp.export._law_program import LawNumber
from jaxdamp.export._vehicle_program import Numbers, PreparedProgram, VehicleProgram
from jaxdamp.simulation import ControlledStepper, Controller, RoadInput, StepState
from jaxdamp.vehicles import AbstractVehicle


class Clock(eqx.Module):
    """The instants of a controller, counted from one sample to the next, so that no number grows with time.

    There is no noise of sensors.
    """

    loop: ControlLoop  # the controller
    dt: Scalar  # from instant to instant [s]

    def flags(self, count: Scalar) -> Flags:
        """What happens at an instant, so many after a sample."""
        loop = dataclasses.replace(self.loop, sensors=())
        return jax.tree.map(lambda flags: flags[0], loop.flags(1, self.dt, count))

    def after(self, count: Scalar) -> Scalar:
        """The count of the next instant."""
        return jnp.where(count + 1.5 > self.loop.period / self.dt, 0.0, count + 1.0)


@final
class SampledStepper(eqx.Module):
    """Steps of a controlled vehicle; what they carry is the vehicle and the count of the clock."""

    controller: Controller

    @property
    def _inner(self) -> ControlledStepper:
        return ControlledStepper(self.controller.stepper)

    @property
    def equations(self) -> PyTree:
        """Of the vehicle."""
        return self.controller.stepper.equations

    def start(self, motion: Array, road: RoadInput) -> tuple[StepState, Scalar]:
        """At the first instant, before its sample."""
        now = self.controller.begin(self._inner.start(motion, road), road)
        return now, jnp.zeros_like(self.controller.spacing)

    def __call__(self, now: tuple[StepState, Scalar], begin: RoadInput, end: RoadInput) -> tuple[StepState, Scalar]:
        """A step later, after what the controller decides at its beginning."""
        (state, count), clock = now, Clock(self.controller.loop, self.controller.spacing)
        decided = self.controller.decided(state, begin, clock.flags(count))
        return self._inner(decided, begin, end), clock.after(count)

    def resumed(self, now: tuple[StepState, Scalar], road: RoadInput, ratio: Scalar) -> tuple[StepState, Scalar]:
        """The same instant with other parameters or another step."""
        return self._inner.resumed(now[0], road, ratio), jnp.round(now[1] / ratio)


class ControlledProgram(VehicleProgram):
    """A vehicle with its controller, whose steps are those of `simulate`: instants and steps are the same.

    Behind the states the carry c has what the controller carries, and as its last number the steps since a sample.

    Attributes:
        delay: from a sample to its command [s].
    """

    vehicle: Controlled
    sampled = True

    def __init__(self, vehicle: Controlled, dtype: str) -> None:
        super().__init__(vehicle, dtype)
        self.delay = vehicle.delay
        used = names_in(self._matrices)
        self.numbers = [n for n in with_first_commands(self) if f"p->{n.name}" in used]

    def model_of(self, values: Numbers) -> AbstractVehicle:
        """The vehicle with other numbers, its sensors without noise."""
        return with_sensors(super().model_of(values), lambda sensors: sensors.without_noise())

    def _prepared(self, values: Numbers, dt: Array) -> PyTree:
        return SampledStepper(Controller(super()._prepared(values, dt), dt))

    @cached_property
    def outputs(self) -> Program:
        """`outputs(m, c, h, r)`: the channels, in the order of `channels`."""
        names = [channel.name for channel in self.channels]

        def outputs(held: list[Array], now: list[Array], height: Array, rate: Array) -> PyTree:
            state: StepState = self._carry.tree(now)[0]
            assert state.control is not None
            force = jnp.stack([*state.force, *state.control.command, *state.control.demand])
            channels = self._equations(held).system.channels(names)
            return channels(jnp.stack(state.motion), force, height, rate)

        return self._lowered(outputs, self._carried, *self._road("h", "r"))


def with_sensors(tree: PyTree, change: Callable[[Sensors], Sensors]) -> PyTree:
    """A controller, or its vehicle, with other sensors."""

    def sensors(node: object) -> bool:
        return isinstance(node, Sensors)

    return jax.tree.map(lambda node: change(node) if sensors(node) else node, tree, is_leaf=sensors)


def with_first_commands(program: PreparedProgram) -> list[LawNumber]:
    """The numbers, of which the commands that a controller changes are where a run begins, and no input."""
    loop: ControlLoop = program.vehicle.system().control

    def present(values: Numbers) -> list[Array]:
        return list(loop.present(program.model_of(values).elements()))

    first = names_in(lower(present, program.values()))
    about = {"kind": "setting", "meaning": "command before the first sample"}
    owner = f"p{program.member}"
    return [dataclasses.replace(n, **about) if f"{owner}{n.name}" in first else n for n in program.numbers]


def names_in(program: Program) -> set[str]:
    """All names in the statements and results of a program; those of arrays also without the index."""
    atoms = [atom for part in jax.tree.leaves(program.results) for atom in part.flat]
    names = re.findall(r"name='([^']*)'", repr((program.statements, atoms)))
    return {*names, *(name.partition("[")[0] for name in names)}
