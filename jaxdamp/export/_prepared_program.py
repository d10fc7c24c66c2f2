"""Functions of the numbers of a vehicle, which are printed in other languages, with what is computed once before."""

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

from jaxdamp.codegen import Constant, Program, Symbols, Variable, lower, printing, symbols
from jaxdamp.export._law_program import law_numbers
from jaxdamp.parameters import with_values
from jaxdamp.vehicles import AbstractVehicle


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


class PreparedProgram:
    """A vehicle, or a part of it, that goes from step to step by functions that can be printed.

    What follows from the parameters and the step alone lies in an array m, which `prepare` fills. What a run carries
    from step to step is an array c.

    Arguments:
        vehicle: any vehicle.
        dtype: the type of all numbers, "float64" or "float32".
        member: what the language writes between `p` and the name of a number: "->" in C, "." in JavaScript.

    Attributes:
        vehicle: the vehicle.
        numbers: its parameters and settings.
    """

    def __init__(self, vehicle: AbstractVehicle, dtype: str = "float64", member: str = "->") -> None:
        self.vehicle, self.dtype, self.member = vehicle, dtype, member
        self.numbers = law_numbers(vehicle)

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

    def vehicle_of(self, values: Numbers) -> AbstractVehicle:
        """The vehicle with other numbers, in the order of `numbers`."""
        vehicle = jax.tree.map(lambda a: jnp.asarray(a, self.dtype) if eqx.is_inexact_array(a) else a, self.vehicle)
        return with_values(vehicle, {n.path: value for n, value in zip(self.numbers, values, strict=True)})

    def values(self, owner: str = "p") -> PyTree[Symbols]:
        """All numbers, as members of an object of the program."""
        return [symbols(f"{owner}{self.member}{n.name}", n.value.shape, self.dtype) for n in self.numbers]

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

    def _symbols(self, name: str) -> Symbols:
        return symbols(name, (), self.dtype)
