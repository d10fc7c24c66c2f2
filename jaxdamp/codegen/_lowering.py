"""JAX functions of numbers and small arrays as programs of scalars; loops stay loops, calls are written out."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

import jax
import numpy as np
from jax.extend.core import Literal, Var
from jaxtyping import Array, PyTree

from jaxdamp.codegen import _arrays, _elementwise
from jaxdamp.codegen._jaxprs import Equation, Inner, equations, literal, opened, printing, scan_sizes, traced
from jaxdamp.codegen._program import (
    COUNTER,
    Assign,
    Atom,
    Atoms,
    Branch,
    Constant,
    Leave,
    Loop,
    Statement,
    Variable,
    Writer,
    array_of,
    constant,
    pruned,
)


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
    places = count()
    return Symbols(array_of(shape, lambda _: f"{name}[{next(places)}]" if shape else name), dtype)


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


_COMPLEX = "Complex numbers cannot be printed. Write real and imaginary parts as real numbers."


def _atoms(leaf: Symbols) -> Atoms:
    def atom(index: tuple[int, ...]) -> Atom:
        name: object = leaf.names[index]
        return name if isinstance(name, Constant) else Variable(str(name), leaf.dtype)

    return array_of(leaf.names.shape, atom)


def evaluated(writer: Writer, inner: Inner, operands: list[Atoms]) -> list[Atoms]:
    """The results of a jaxpr on arrays of atoms; what they take is written."""
    jaxpr, values = opened(inner)
    if any(np.iscomplexobj(value) for value in values):
        raise NotImplementedError(_COMPLEX)
    atoms_of: dict[Var, Atoms] = dict(zip(jaxpr.constvars, map(_arrays.constants, values), strict=True))
    atoms_of |= zip(jaxpr.invars, operands, strict=True)

    def read(operand: Var | Literal) -> Atoms:
        return _arrays.constants(literal(operand)) if isinstance(operand, Literal) else atoms_of[operand]

    for equation, reads, writes in equations(jaxpr):
        if any(dtype.startswith("complex") for dtype in equation.dtypes):
            raise NotImplementedError(_COMPLEX)
        atoms = [read(operand) for operand in reads]
        atoms_of |= zip(writes, _rule(equation.name)(writer, equation, atoms), strict=True)
    return [read(operand) for operand in jaxpr.outvars]


def _rule(name: str) -> _elementwise.Rule:
    rule = CONTROL.get(name) or _elementwise.RULES.get(name) or _arrays.RULES.get(name)
    if rule is None:
        raise NotImplementedError(
            f"The primitive {name!r} of JAX cannot be printed. Write the function with others, such as "
            "`jnp.where`, arithmetic and elementary functions."
        )
    return rule


def _call(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    return evaluated(writer, equation.called(), operands)


def _linear_solve(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """`custom_linear_solve`: the program that solves, with its own constants and the right-hand sides."""
    counts, programs = equation.parameters["const_lengths"], equation.parameters["jaxprs"]
    first = counts.matvec + counts.vecmat
    right = operands[first + counts.solve + counts.transpose_solve :]
    return evaluated(writer, programs.solve, [*operands[first : first + counts.solve], *right])


def _platform(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """`platform_dependent`: what is meant for a CPU, or else for all platforms that are not named."""
    named = equation.parameters["platforms"]
    chosen = next((i for i, names in enumerate(named) if names is None or "cpu" in names), len(named) - 1)
    return [np.array(constant(chosen, equation.dtype), object)]


def _while(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    p = equation.parameters
    first, second = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    for_condition, for_body, start = operands[:first], operands[first:second], operands[second:]
    now = _declared(writer, equation, start)
    with writer.block() as body:
        (going,) = evaluated(writer, p["cond_jaxpr"], [*for_condition, *now])
        writer.put(Leave(going.item()))
        _assign(writer, now, evaluated(writer, p["body_jaxpr"], [*for_body, *now]))
    writer.put(Loop(body))
    return now


def _cond(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    case, branches = operands[0].item(), equation.parameters["branches"]
    if isinstance(case, Constant) and case.dtype != "bool":
        return evaluated(writer, branches[min(max(int(case.text), 0), len(branches) - 1)], operands[1:])
    results = _declared(writer, equation, None)
    bodies = []
    for branch in branches:
        with writer.block() as body:
            _assign(writer, results, evaluated(writer, branch, operands[1:]))
        bodies.append(body)
    writer.put(Branch(case, bodies))
    return results


def _scan(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    p = equation.parameters
    length, (first, carried) = p["length"], scan_sizes(equation, operands)
    second = first + carried
    if length <= p["unroll"]:
        return _written_out(writer, equation, operands, (first, second))
    rows = [_tables(writer, array, length) for array in operands[second:]]
    now = _declared(writer, equation, operands[first:second])
    each_step = list(zip(equation.shapes, equation.dtypes, strict=True))[carried:]
    saved = [
        array_of(shape[1:], lambda _, dtype=dtype: writer.declare(dtype, size=length)) for shape, dtype in each_step
    ]
    with writer.counted(length) as count:
        place = writer.define("sub", (constant(length - 1, COUNTER), count), COUNTER) if p["reverse"] else count
        here = [_entries(writer, tables, place) for tables in rows]
        after = evaluated(writer, p["jaxpr"], [*operands[:first], *now, *here])
        for arrays, values in zip(saved, after[carried:], strict=True):
            for array, value in zip(arrays.ravel(), values.ravel(), strict=True):
                writer.put(Assign(array, value, place))
        _assign(writer, now, after[:carried])
    places = [constant(place, COUNTER) for place in range(length)]
    return [*now, *(np.stack([_entries(writer, arrays, place) for place in places]) for arrays in saved)]


def _written_out(writer: Writer, equation: Equation, operands: list[Atoms], ends: tuple[int, int]) -> list[Atoms]:
    """A scan that asks to be written out: the steps one after the other, on numbers that do not change."""
    p, (first, second) = equation.parameters, ends
    places = range(p["length"])[::-1] if p["reverse"] else range(p["length"])
    now, carried = operands[first:second], second - first
    saved = [np.empty(shape, object) for shape in equation.shapes[carried:]]
    for place in places:
        rows = [np.asarray(array[place], object) for array in operands[second:]]
        after = evaluated(writer, p["jaxpr"], [*operands[:first], *now, *rows])
        now = after[:carried]
        for array, values in zip(saved, after[carried:], strict=True):
            array[place] = values[()]
    return [*now, *saved]


def _entries(writer: Writer, tables: Atoms, place: Atom) -> Atoms:
    """The entry at a place of each table."""
    return array_of(tables.shape, lambda at: writer.define("look_up", (tables[at], place), tables[at].dtype))


def _tables(writer: Writer, array: Atoms, length: int) -> Atoms:
    """One table over the steps of a scan for each number of a step."""

    def table(at: tuple[int, ...]) -> Variable:
        entries: list[Any] = [array[(k, *at)] for k in range(length)]
        return writer.table(entries, entries[0].dtype)

    return array_of(array.shape[1:], table)


def _declared(writer: Writer, equation: Equation, start: list[Atoms] | None) -> list[Atoms]:
    """Variables for the results of a loop or a branch."""
    results = []
    kinds = list(zip(equation.shapes, equation.dtypes, strict=True))
    for k, (shape, dtype) in enumerate(kinds if start is None else kinds[: len(start)]):
        first = np.full(shape, None) if start is None else start[k]
        results.append(array_of(shape, lambda at, dtype=dtype, first=first: writer.declare(dtype, first[at])))
    return results


def _assign(writer: Writer, targets: list[Atoms], values: list[Atoms]) -> None:
    pairs = [
        pair
        for target, value in zip(targets, values, strict=True)
        for pair in zip(target.ravel(), value.ravel(), strict=True)
    ]
    writer.assign(pairs)


CALLS = (
    "jit pjit closed_call core_call eval_jaxpr call_hi_primitive remat remat2 checkpoint "
    "custom_jvp_call custom_vjp_call custom_vjp_call_jaxpr"
).split()
CONTROL: dict[str, _elementwise.Rule] = {
    **dict.fromkeys(CALLS, _call),
    "custom_linear_solve": _linear_solve,
    "platform_index": _platform,
    "while": _while,
    "cond": _cond,
    "scan": _scan,
}
