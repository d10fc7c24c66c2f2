"""A vehicle as functions of its numbers, which are printed in other languages."""

from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdamp._vectors import MemoryLayout, scalars
from jaxdamp.codegen import Program, Symbols, lower, symbols
from jaxdamp.export._prepared_program import Numbers, PreparedProgram
from jaxdamp.simulation import Equations, Exponential, RoadInput, settled
from jaxdamp.vehicles import AbstractVehicle, Channel, ChannelKind


class VehicleProgram(PreparedProgram):
    """A vehicle whose functions can be printed: those of a run of `simulate`, and those of solvers of other programs.

    The first numbers of the carry c are the states x of the equations of motion: q, q̇ and the states of the elements.
    The road is the heights h [m] under the wheels and their rates r [m/s].

    Arguments:
        vehicle: any vehicle.
        dtype: the type of all numbers, "float64" or "float32".
        member: what the language writes between `p` and the name of a number: "->" in C, "." in JavaScript.

    Attributes:
        wheels: their number.
    """

    def __init__(self, vehicle: AbstractVehicle, dtype: str = "float64", member: str = "->") -> None:
        super().__init__(vehicle, dtype, member)
        self.layout, self.wheels = vehicle.layout, len(vehicle.wheel_names)
        self._state_sizes = [int(law.initial_state().size) for law in self.vehicle.elements()]

    @property
    def states(self) -> list[tuple[str, str]]:
        """Name and unit of each state: coordinates, their rates, and the states of the elements, without units."""
        names = self.layout.coordinates
        units = [self.layout.units.get(name, "m") for name in names]
        rates = [(f"{name}_rate", f"{unit}/s") for name, unit in zip(names, units, strict=True)]
        sizes = zip(self.layout.ports, self._state_sizes, strict=True)
        return [*zip(names, units, strict=True), *rates, *((f"{p}[{k}]", "") for p, n in sizes for k in range(n))]

    @property
    def heights(self) -> list[Channel]:
        """The heights of the road, one for each wheel."""
        return [channel for channel in self.layout.channels if channel.kind is ChannelKind.ROAD_HEIGHT]

    @property
    def channels(self) -> list[Channel]:
        """The channels that the vehicle gives: all but the heights of the road."""
        return [channel for channel in self.layout.channels if channel.kind is not ChannelKind.ROAD_HEIGHT]

    def _prepared(self, values: Numbers, dt: Array) -> PyTree:
        return Exponential().stepper(Equations(self.vehicle_of(values).system(), MemoryLayout.SCALARS), dt)

    def _started(self, held: list[Array], *inputs: Array) -> PyTree:
        """At rest in the static equilibrium on a road."""
        stepper = self._stepper.tree(held)
        return stepper.start(settled(stepper.equations.system, inputs[0]), road_input(*inputs))

    @property
    def _inputs(self) -> list[Symbols]:
        return self._road("h", "r")

    @cached_property
    def step(self) -> Program:
        """`step(m, c, h0, r0, h1, r1)`: c a step later, the road being straight."""

        def step(held: list[Array], now: list[Array], *road: Array) -> list[Array]:
            after = self._stepper.tree(held)(self._carry.tree(now), road_input(*road[:2]), road_input(*road[2:]))
            return self._carry.arrays(after)

        return self._lowered(step, self._carried, *self._road("h0", "r0", "h1", "r1"))

    @cached_property
    def resume(self) -> Program:
        """`resume(m, c, h, r, ratio)`: c at this instant after another `prepare`; ratio of the steps, new to old."""

        def resume(held: list[Array], now: list[Array], height: Array, rate: Array, ratio: Array) -> list[Array]:
            again = self._stepper.tree(held).resumed(self._carry.tree(now), road_input(height, rate), ratio)
            return self._carry.arrays(again)

        return self._lowered(resume, self._carried, *self._road("h", "r"), self._symbols("ratio"))

    @cached_property
    def outputs(self) -> Program:
        """`outputs(m, x, h, r)`: the channels, in the order of `channels`."""
        return self._lowered(lambda held, *point: self._observed(self._equations(held), *point)[1], *self._point())

    @cached_property
    def state_rate(self) -> Program:
        """`state_rate(m, x, h, r)`: the time derivatives of the states."""
        return self._lowered(lambda held, *point: self._observed(self._equations(held), *point)[0], *self._point())

    @cached_property
    def derivative(self) -> Program:
        """The changes of the rates of the states and of the channels for changes of p, x, h and r."""

        def observed(values: Numbers, *point: PyTree) -> PyTree:
            equations = Equations(self.vehicle_of(values).system(), MemoryLayout.SCALARS)
            return self._observed(equations, *point)

        arguments, changes = (self.values(), *self._point()), (self.values("dp"), *self._point("d"))
        return lower(lambda point, change: jax.jvp(observed, point, change)[1], arguments, changes, finite=True)

    def _observed(
        self, equations: Equations, motion: Array, states: list[Array], height: Array, rate: Array
    ) -> tuple[tuple[Array, list[Array]], Array]:
        """The rates of the states, and the channels."""
        deflections = equations.at_ports(scalars(motion), road_input(height, rate))
        force = jnp.asarray(equations.ports.force(*deflections, states), motion.dtype)
        rates = equations.system.motion(motion, force, height, rate)
        outputs = equations.system.channels([channel.name for channel in self.channels])
        return (rates, equations.ports.state_rate(*deflections, states)), outputs(motion, force, height, rate)

    def _equations(self, held: list[Array]) -> Equations:
        return self._stepper.tree(held).equations

    def _point(self, d: str = "", of: str = "x") -> tuple[PyTree[Symbols], ...]:
        """The states, from the array `of`, and the road: motion, the states of each element, heights, rates."""
        names = symbols(f"{d}{of}", (len(self.states),), self.dtype).names
        motion, *states = np.split(names, np.cumsum([2 * len(self.layout.coordinates), *self._state_sizes])[:-1])
        return Symbols(motion, self.dtype), [Symbols(s, self.dtype) for s in states], *self._road(f"{d}h", f"{d}r")

    def _road(self, *names: str) -> list[Symbols]:
        return [symbols(name, (self.wheels,), self.dtype) for name in names]


def road_input(height: Array, rate: Array) -> RoadInput:
    """Heights and rates as scalars."""
    return RoadInput(scalars(height), scalars(rate))
