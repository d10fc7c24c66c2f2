"""Primitives of JAX that contain other programs: loops stay loops, calls are written out."""

from collections.abc import Callable
from typing import Any

import numpy as np

from jaxdamp.codegen._jaxprs import Equation, Inner, scan_sizes
from jaxdamp.codegen._program import COUNTER, Assign, Atom, Atoms, Branch, Constant, Leave, Loop, Writer, constant


Evaluate = Callable[[Writer, Inner, list[Atoms]], list[Atoms]]
ControlRule = Callable[[Writer, Equation, list[Atoms], Evaluate], list[Atoms]]


def _call(writer: Writer, equation: Equation, operands: list[Atoms], evaluate: Evaluate) -> list[Atoms]:
    return evaluate(writer, equation.called(), operands)


def _linear_solve(writer: Writer, equation: Equation, operands: list[Atoms], evaluate: Evaluate) -> list[Atoms]:
    """`custom_linear_solve`: the program that solves, with its own constants and the right-hand sides."""
    counts, programs = equation.parameters["const_lengths"], equation.parameters["jaxprs"]
    first = counts.matvec + counts.vecmat
    right = operands[first + counts.solve + counts.transpose_solve :]
    return evaluate(writer, programs.solve, [*operands[first : first + counts.solve], *right])


def _platform(writer: Writer, equation: Equation, operands: list[Atoms], evaluate: Evaluate) -> list[Atoms]:
    """`platform_dependent`: what is meant for a CPU, or else for all platforms that are not named."""
    named = equation.parameters["platforms"]
    chosen = next((i for i, names in enumerate(named) if names is None or "cpu" in names), len(named) - 1)
    return [np.array(constant(chosen, equation.dtype), object)]


def _while(writer: Writer, equation: Equation, operands: list[Atoms], evaluate: Evaluate) -> list[Atoms]:
    p = equation.parameters
    first, second = p["cond_nconsts"], p["cond_nconsts"] + p["body_nconsts"]
    for_condition, for_body, start = operands[:first], operands[first:second], operands[second:]
    now = _declared(writer, equation, start)
    with writer.block() as body:
        (going,) = evaluate(writer, p["cond_jaxpr"], [*for_condition, *now])
        writer.put(Leave(going.item()))
        _assign(writer, now, evaluate(writer, p["body_jaxpr"], [*for_body, *now]))
    writer.put(Loop(body))
    return now


def _cond(writer: Writer, equation: Equation, operands: list[Atoms], evaluate: Evaluate) -> list[Atoms]:
    case, branches = operands[0].item(), equation.parameters["branches"]
    if isinstance(case, Constant) and case.dtype != "bool":
        return evaluate(writer, branches[min(max(int(case.text), 0), len(branches) - 1)], operands[1:])
    results = _declared(writer, equation, None)
    bodies = []
    for branch in branches:
        with writer.block() as body:
            _assign(writer, results, evaluate(writer, branch, operands[1:]))
        bodies.append(body)
    writer.put(Branch(case, bodies))
    return results


def _scan(writer: Writer, equation: Equation, operands: list[Atoms], evaluate: Evaluate) -> list[Atoms]:
    p = equation.parameters
    length, (first, carried) = p["length"], scan_sizes(equation, operands)
    second = first + carried
    if length <= p["unroll"]:
        return _written_out(writer, equation, operands, (first, second), evaluate)
    rows = [_tables(writer, array, length) for array in operands[second:]]
    now = _declared(writer, equation, operands[first:second])
    each_step = list(zip(equation.shapes, equation.dtypes, strict=True))[carried:]
    saved = [_arrays(writer, shape[1:], dtype, length) for shape, dtype in each_step]
    with writer.counted(length) as count:
        place = writer.define("sub", (constant(length - 1, COUNTER), count), COUNTER) if p["reverse"] else count
        here = [_entries(writer, tables, place) for tables in rows]
        after = evaluate(writer, p["jaxpr"], [*operands[:first], *now, *here])
        for arrays, values in zip(saved, after[carried:], strict=True):
            for array, value in zip(arrays.ravel(), values.ravel(), strict=True):
                writer.put(Assign(array, value, place))
        _assign(writer, now, after[:carried])
    return [*now, *(_read(writer, arrays, length) for arrays in saved)]


def _written_out(
    writer: Writer, equation: Equation, operands: list[Atoms], ends: tuple[int, int], evaluate: Evaluate
) -> list[Atoms]:
    """A scan that asks to be written out: the steps one after the other, on numbers that do not change."""
    p, (first, second) = equation.parameters, ends
    places = range(p["length"])[::-1] if p["reverse"] else range(p["length"])
    now, carried = operands[first:second], second - first
    saved = [np.empty(shape, object) for shape in equation.shapes[carried:]]
    for place in places:
        rows = [np.asarray(array[place], object) for array in operands[second:]]
        after = evaluate(writer, p["jaxpr"], [*operands[:first], *now, *rows])
        now = after[:carried]
        for array, values in zip(saved, after[carried:], strict=True):
            array[place] = values[()]
    return [*now, *saved]


def _read(writer: Writer, arrays: Atoms, length: int) -> Atoms:
    """What a scan has saved, the steps first."""
    result = np.empty((length, *arrays.shape), object)
    for place, *index in np.ndindex(*result.shape):
        result[(place, *index)] = _entry(writer, arrays[tuple(index)], constant(place, COUNTER))
    return result


def _entries(writer: Writer, tables: Atoms, place: Atom) -> Atoms:
    """The entry at a place of each table."""
    result = np.empty(tables.shape, object)
    for index in np.ndindex(*tables.shape):
        result[index] = _entry(writer, tables[index], place)
    return result


def _entry(writer: Writer, table: Any, place: Atom) -> Atom:
    return writer.define("look_up", (table, place), table.dtype)


def _tables(writer: Writer, array: Atoms, length: int) -> Atoms:
    """One table over the steps of a scan for each number of a step."""
    result = np.empty(array.shape[1:], object)
    for index in np.ndindex(*array.shape[1:]):
        entries = [array[(k, *index)] for k in range(length)]
        result[index] = writer.table(entries, entries[0].dtype)
    return result


def _arrays(writer: Writer, shape: tuple[int, ...], dtype: str, length: int) -> Atoms:
    """One array over the steps of a scan for each number of a step."""
    result = np.empty(shape, object)
    for index in np.ndindex(*shape):
        result[index] = writer.declare(dtype, size=length)
    return result


def _declared(writer: Writer, equation: Equation, start: list[Atoms] | None) -> list[Atoms]:
    """Variables for the results of a loop or a branch."""
    results = []
    kinds = list(zip(equation.shapes, equation.dtypes, strict=True))
    for k, (shape, dtype) in enumerate(kinds if start is None else kinds[: len(start)]):
        result = np.empty(shape, object)
        for index in np.ndindex(*shape):
            first: Any = None if start is None else start[k][index]
            result[index] = writer.declare(dtype, first)
        results.append(result)
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
RULES: dict[str, ControlRule] = {
    **dict.fromkeys(CALLS, _call),
    "custom_linear_solve": _linear_solve,
    "platform_index": _platform,
    "while": _while,
    "cond": _cond,
    "scan": _scan,
}
