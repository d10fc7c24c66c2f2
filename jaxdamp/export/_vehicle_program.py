"""A vehicle as functions of its numbers, which are printed in other languages, with what is computed once before."""

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxdamp._vectors import MemoryLayout, scalars
from jaxdamp.codegen import Constant, Program, Symbols, Variable, lower, printing, symbols
from jaxdamp.export._law_program import AbstractProgram
from jaxdamp.simulation import Equations, Exponential, RoadInput, settled, substeps_needed
from jaxdamp.vehicles import AbstractVehicle, Channel, ChannelKind


LONGEST_STEP = 1e-3  # s
Numbers: TypeAlias = PyTree[Array]  # of a vehicle, in the order of `PreparedProgram.numbers`


class FlatTree:
    """How the numbers of a tree lie in one array of the program.

    Arguments:
        shapes: such a tree, with `jax.ShapeDtypeStruct` in place of arrays of numbers.

    Attributes:
        count: the length of the array.
    """

    def __init__(self, shapes: PyTree) -> None:
        arrays, self._others = eqx.partition(shapes, lambda leaf: isinstance(leaf, jax.ShapeDtypeStruct))
        leaves, self._structure = jax.tree.flatten(arrays)
        self._shapes = [leaf.shape for leaf in leaves]
        self.count = sum(math.prod(shape) for shape in self._shapes)

    def arrays(self, tree: PyTree) -> list[Array]:
        """The arrays of a tree."""
        return jax.tree.leaves(eqx.filter(tree, eqx.is_array))

    def tree(self, arrays: Sequence[Array]) -> PyTree:
        """The tree with these arrays."""
        return eqx.combine(jax.tree.unflatten(self._structure, arrays), self._others)

    def symbols(self, name: str, dtype: str) -> list[Symbols]:
        """The arrays as stretches of one array of the program."""
        ends = np.cumsum([math.prod(shape) for shape in self._shapes])
        names = np.array([f"{name}[{k}]" for k in range(self.count)], object)
        parts = np.split(names, ends[:-1]) if self._shapes else []
        return [Symbols(part.reshape(shape), dtype) for part, shape in zip(parts, self._shapes, strict=True)]


class PreparedProgram(AbstractProgram):
    """A vehicle, or a part of it, that goes from step to step by functions that can be printed.

    What follows from the parameters and the step alone lies in an array m, which `prepare` fills. What a run carries
    from step to step is an array c.
    """

    def __init__(self, vehicle: AbstractVehicle, dtype: str = "float64", member: str = "->") -> None:
        super().__init__(vehicle, dtype, member)
        self.vehicle = vehicle

    @abstractmethod
    def _prepared(self, values: Numbers, dt: Array) -> PyTree:
        """What takes a step of dt [s]."""

    @abstractmethod
    def _started(self, held: list[Array], *inputs: Array) -> PyTree:
        """What a run carries at its first instant."""

    @property
    @abstractmethod
    def _inputs(self) -> list[Symbols]:
        """What is given at an instant."""

    @cached_property
    def longest_step(self) -> float:
        """The longest step [s] that keeps every law stable, at most 1 ms."""
        return LONGEST_STEP / substeps_needed(self.vehicle, LONGEST_STEP)

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the arrays m and c."""
        return {"m": self.prepare.results.size, "c": self._carry.count}

    @cached_property
    def prepare(self) -> Program:
        """`prepare(p, dt)`: m, the matrices of a step of dt [s] and the numbers of the laws."""
        return Program(self._matrices.statements, np.array(list(self._entries.values()), object))

    @cached_property
    def _matrices(self) -> Program:
        """The arrays of the stepper."""

        def prepare(values: Numbers, dt: Array) -> list[Array]:
            return self._stepper.arrays(self._prepared(values, dt))

        return lower(prepare, self.values(), self._symbols("dt"), finite=True)

    @cached_property
    def _stepper(self) -> FlatTree:
        """What takes a step."""
        return self._flat(self._prepared, self.values(), self._symbols("dt"))

    @cached_property
    def _entries(self) -> dict[str, Variable]:
        """What m holds, by names; the same number stands in it once."""
        atoms = (atom for part in self._matrices.results for atom in part.flat)
        return {atom.name: atom for atom in atoms if not isinstance(atom, Constant)}

    @cached_property
    def _held(self) -> list[Symbols]:
        """The stepper: numbers that are known, such as the zeros of a matrix, and the others as entries of m."""
        place = {name: f"m[{k}]" for k, name in enumerate(self._entries)}
        name = np.frompyfunc(lambda atom: atom if isinstance(atom, Constant) else place[atom.name], 1, 1)
        return [Symbols(np.array(name(part), object), self.dtype) for part in self._matrices.results]

    @cached_property
    def _carry(self) -> FlatTree:
        """What a run carries from step to step."""
        return self._flat(self._started, self._held, *self._inputs)

    @cached_property
    def start(self) -> Program:
        """`start(m, ...)`: c at the first instant, with what is given there."""

        def start(held: list[Array], *inputs: Array) -> list[Array]:
            return self._carry.arrays(self._started(held, *inputs))

        return self._lowered(start, *self._inputs)

    @property
    def _carried(self) -> list[Symbols]:
        return self._carry.symbols("c", self.dtype)

    def _lowered(self, function: Callable[..., PyTree], *arguments: PyTree[Symbols]) -> Program:
        """A function of the stepper and other arguments."""
        return lower(function, self._held, *arguments, finite=True)

    def _flat(self, function: Callable[..., PyTree], *arguments: PyTree[Symbols]) -> FlatTree:
        """How the numbers of what a function returns lie in an array of the program."""

        def shape(symbols: Symbols) -> jax.ShapeDtypeStruct:
            return jax.ShapeDtypeStruct(symbols.names.shape, symbols.dtype)

        with printing(), jax.enable_x64(self.dtype == "float64"):
            shapes = jax.tree.map(shape, arguments, is_leaf=lambda leaf: isinstance(leaf, Symbols))
            return FlatTree(eqx.filter_eval_shape(function, *shapes))


class VehicleProgram(PreparedProgram):
    """A vehicle whose functions can be printed: those of a run of `simulate`, and those of solvers of other programs.

    The first numbers of the carry c are the states x of the equations of motion: q, q̇ and the states of the elements.
    The road is the heights h [m] under the wheels and their rates r [m/s].

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
        return Exponential().stepper(Equations(self.model_of(values).system(), MemoryLayout.SCALARS), dt)

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
            equations = Equations(self.model_of(values).system(), MemoryLayout.SCALARS)
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
