"""Primitives of JAX on arrays: arrays of atoms are rearranged while printing, which costs the program nothing."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np

from jaxdamp.codegen._elementwise import Rule
from jaxdamp.codegen._jaxprs import Equation
from jaxdamp.codegen._program import Atom, Atoms, Constant, Writer, constant


def constants(value: np.ndarray) -> Atoms:
    """An array of numbers."""
    value = np.asarray(value)
    result = np.empty(value.shape, object)
    for index in np.ndindex(*value.shape):
        result[index] = constant(value[index], value.dtype.name)
    return result


def look_up(writer: Writer, entries: Iterable[Any], index: Atom, dtype: str) -> Atom:
    """One of several numbers, the index being limited to those that exist, as JAX limits it."""
    entries = list(entries)
    if len(set(entries)) == 1:
        return entries[0]
    if isinstance(index, Constant):
        return entries[min(max(int(index.text), 0), len(entries) - 1)]
    low = writer.define("max", (index, constant(0, index.dtype)), index.dtype)
    inside = writer.define("min", (low, constant(len(entries) - 1, index.dtype)), index.dtype)
    return writer.define("look_up", (writer.table(entries, dtype), inside), dtype)


def _broadcast(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    shape = [1] * len(equation.shape)
    for axis, size in zip(equation.parameters["broadcast_dimensions"], operands[0].shape, strict=True):
        shape[axis] = size
    return [np.broadcast_to(operands[0].reshape(shape), equation.shape)]


def _reshape(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    return [operands[0].reshape(equation.shape)]


def _slice(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    p = equation.parameters
    strides = p["strides"] or (1,) * operands[0].ndim
    cuts = zip(p["start_indices"], p["limit_indices"], strides, strict=True)
    return [operands[0][tuple(slice(*cut) for cut in cuts)]]


def _dynamic_slice(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    result = operands[0]
    for axis, (start, size) in enumerate(zip(operands[1:], equation.parameters["slice_sizes"], strict=True)):
        last = result.shape[axis] - size
        if last:
            rows = np.moveaxis(result, axis, 0)
            taken = np.empty((size, *rows.shape[1:]), object)
            for index in np.ndindex(*taken.shape):
                entries = (rows[(index[0] + k, *index[1:])] for k in range(last + 1))
                taken[index] = look_up(writer, entries, start.item(), equation.dtype)
            result = np.moveaxis(taken, 0, axis)
    return [result]


def _iota(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    counts = np.indices(equation.shape)[equation.parameters["dimension"]]
    return [constants(counts.astype(equation.dtype))]


def _pad(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    configuration = equation.parameters["padding_config"]
    if any(low < 0 or high < 0 or between for low, high, between in configuration):
        raise NotImplementedError("The primitive 'pad' with gaps or negative widths cannot be printed.")
    result = np.full(equation.shape, operands[1].item(), object)
    result[tuple(slice(low, low + n) for (low, _, _), n in zip(configuration, operands[0].shape, strict=True))] = (
        operands[0]
    )
    return [result]


REDUCTIONS = {
    "reduce_sum": ("add", 0),
    "reduce_prod": ("mul", 1),
    "reduce_max": ("max", -np.inf),
    "reduce_min": ("min", np.inf),
    "reduce_and": ("and", True),
    "reduce_or": ("or", False),
}


def _reduce(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    operation, empty = REDUCTIONS[equation.name]
    axes, count = equation.parameters["axes"], operands[0].ndim
    kept = [axis for axis in range(count) if axis not in axes]
    rows = operands[0].transpose(*kept, *axes).reshape((*equation.shape, -1))
    result = np.empty(equation.shape, object)
    for index in np.ndindex(*equation.shape):
        result[index] = _combined(writer, operation, list(rows[index]), equation.dtype, empty)
    return [result]


def _combined(writer: Writer, operation: str, atoms: list[Atom], dtype: str, empty: float | int) -> Atom:
    if not atoms:
        return constant(empty, dtype)
    total = atoms[0]
    for atom in atoms[1:]:
        total = writer.define(operation, (total, atom), dtype)
    return total


def _cumulative_sum(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    rows = np.moveaxis(operands[0], equation.parameters["axis"], 0).copy()
    order = range(len(rows))[::-1] if equation.parameters["reverse"] else range(len(rows))
    for last, now in pairwise(order):
        for index in np.ndindex(*rows.shape[1:]):
            pair = rows[(last, *index)], rows[(now, *index)]
            rows[(now, *index)] = writer.define("add", pair, equation.dtype)
    return [np.moveaxis(rows, 0, equation.parameters["axis"])]


def _dot(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    (left_axes, right_axes), (batch, _) = equation.parameters["dimension_numbers"]
    if batch:
        raise NotImplementedError("The primitive 'dot_general' with batch dimensions cannot be printed.")
    rows = _contracted_last(operands[0], left_axes)
    columns = _contracted_last(operands[1], right_axes)
    result = np.empty((len(rows), len(columns)), object)
    for i, k in np.ndindex(*result.shape):
        products = [writer.define("mul", pair, equation.dtype) for pair in zip(rows[i], columns[k], strict=True)]
        result[i, k] = _combined(writer, "add", products, equation.dtype, 0)
    return [result.reshape(equation.shape)]


def _contracted_last(array: Atoms, axes: tuple[int, ...]) -> Atoms:
    """As a matrix whose columns are the contracted numbers."""
    free = [axis for axis in range(array.ndim) if axis not in axes]
    rows = int(np.prod([array.shape[axis] for axis in free]))
    return array.transpose(*free, *axes).reshape(rows, int(np.prod([array.shape[axis] for axis in axes])))


def _split(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    ends = np.cumsum(equation.parameters["sizes"])[:-1]
    return list(np.split(operands[0], ends, equation.parameters["axis"]))


def _unstack(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    rows = np.moveaxis(operands[0], equation.parameters["axis"], 0)
    return [rows[k : k + 1].reshape(shape) for k, shape in enumerate(equation.shapes)]


RULES: dict[str, Rule] = {
    "broadcast_in_dim": _broadcast,
    **dict.fromkeys(("reshape", "squeeze", "expand_dims"), _reshape),
    "slice": _slice,
    "dynamic_slice": _dynamic_slice,
    "iota": _iota,
    "pad": _pad,
    **dict.fromkeys(REDUCTIONS, _reduce),
    "cumsum": _cumulative_sum,
    "dot_general": _dot,
    "split": _split,
    "unstack": _unstack,
    "transpose": lambda writer, e, operands: [operands[0].transpose(e.parameters["permutation"])],
    "rev": lambda writer, e, operands: [np.flip(operands[0], e.parameters["dimensions"])],
    "concatenate": lambda writer, e, operands: [np.concatenate(operands, e.parameters["dimension"])],
    "tile": lambda writer, e, operands: [np.tile(operands[0], e.parameters["reps"])],
    "stack": lambda writer, e, operands: [np.stack(operands, e.parameters["axis"])],
}
