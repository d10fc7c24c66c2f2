"""JAX functions of numbers and small arrays as programs of scalars."""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import numpy as np
from jax.extend.core import Literal, Var
from jaxtyping import Array, PyTree

from jaxdamp.codegen import _arrays, _control, _elementwise
from jaxdamp.codegen._jaxprs import Inner, equations, literal, opened, traced
from jaxdamp.codegen._printing import printing
from jaxdamp.codegen._program import Atoms, Constant, Statement, Variable, Writer, pruned


@dataclass(frozen=True)
class Symbols:
    """An input of a printed function: the text of each of its numbers.

    Attributes:
        names: an array of texts such as `"p->rate"`, of the shape of the input; a `Constant` where a number is known.
        dtype: the type of the numbers.
    """

    names: np.ndarray
    dtype: str = "float64"


def symbols(name: str, shape: tuple[int, ...] = (), dtype: str = "float64") -> Symbols:
    """An input by its name: `x`, or `x[0]`, `x[1]`, ... in the order of memory.

    Arguments:
        name: of the input in the C text.
        shape: of the input.
        dtype: of its numbers.
    """
    names = np.empty(shape, object)
    for place, index in enumerate(np.ndindex(*shape)):
        names[index] = f"{name}[{place}]" if shape else name
    return Symbols(names, dtype)


@dataclass(frozen=True)
class Program:
    """A JAX function as scalar statements.

    Attributes:
        statements: in the order of execution, without those that no result needs.
        results: the result of the function, with arrays of atoms in place of arrays of numbers.
    """

    statements: list[Statement]
    results: PyTree


def lower(function: Callable[..., PyTree], *arguments: PyTree, finite: bool = False) -> Program:
    """Translate a function of trees of arrays into scalar statements.

    Arguments:
        function: any function that JAX can trace, of arrays whose sizes are known.
        arguments: trees with `Symbols` in place of arrays.
        finite: take all numbers for finite: products with zero and sums with zero are then not written, which makes
            texts with large sparse matrices short.

    Raises:
        NotImplementedError: a primitive that cannot be printed; the message names it.
    """
    inputs, tree = jax.tree.flatten(arguments, is_leaf=lambda leaf: isinstance(leaf, Symbols))
    structure = []

    def flat(*values: Array) -> list[Array]:
        results, shape = jax.tree.flatten(function(*jax.tree.unflatten(tree, values)))
        structure.append(shape)
        return results

    writer = Writer(finite)
    with printing(), jax.enable_x64(any(leaf.dtype.endswith("64") for leaf in inputs)):
        jaxpr = traced(flat, [(leaf.names.shape, leaf.dtype) for leaf in inputs])
        results = evaluated(writer, jaxpr, [_atoms(leaf) for leaf in inputs])
    needed = {atom.name for array in results for atom in array.ravel() if isinstance(atom, Variable)}
    return Program(pruned(writer.statements, needed), jax.tree.unflatten(structure[-1], results))


def _atoms(leaf: Symbols) -> Atoms:
    result = np.empty(leaf.names.shape, object)
    for index in np.ndindex(*leaf.names.shape):
        name: object = leaf.names[index]
        result[index] = name if isinstance(name, Constant) else Variable(str(name), leaf.dtype)
    return result


def evaluated(writer: Writer, inner: Inner, operands: list[Atoms]) -> list[Atoms]:
    """The results of a jaxpr on arrays of atoms; what they take is written."""
    jaxpr, values = opened(inner)
    atoms_of: dict[Var, Atoms] = dict(zip(jaxpr.constvars, map(_arrays.constants, values), strict=True))
    atoms_of |= zip(jaxpr.invars, operands, strict=True)

    def read(operand: Var | Literal) -> Atoms:
        return _arrays.constants(literal(operand)) if isinstance(operand, Literal) else atoms_of[operand]

    for equation, reads, writes in equations(jaxpr):
        atoms = [read(operand) for operand in reads]
        if equation.name in _control.RULES:
            results = _control.RULES[equation.name](writer, equation, atoms, evaluated)
        else:
            results = _rule(equation.name)(writer, equation, atoms)
        atoms_of |= zip(writes, results, strict=True)
    return [read(operand) for operand in jaxpr.outvars]


def _rule(name: str) -> _elementwise.Rule:
    rule = _elementwise.RULES.get(name) or _arrays.RULES.get(name)
    if rule is None:
        raise NotImplementedError(
            f"The primitive {name!r} of JAX cannot be printed. Write the function with others, such as "
            "`jnp.where`, arithmetic and elementary functions."
        )
    return rule
