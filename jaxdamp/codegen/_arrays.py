"""Primitives of JAX on arrays: arrays of atoms are rearranged while printing, which costs the program nothing.

Entries at places that may be known only when the program runs are looked up.
"""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NoReturn

import numpy as np

from jaxdamp.codegen._elementwise import Rule
from jaxdamp.codegen._jaxprs import Equation
from jaxdamp.codegen._program import COUNTER, Assign, Atom, Atoms, Constant, Writer, array_of, constant


MOST_WRITTEN_OUT = 256  # products of two matrices; more are computed in loops, since compilers are slow on long texts


def constants(value: np.ndarray) -> Atoms:
    """An array of numbers."""
    value = np.asarray(value)
    return array_of(value.shape, lambda at: constant(value[at], value.dtype.name))


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

            def taken(at: tuple[int, ...], rows: Atoms = rows, last: int = last, start: Atoms = start) -> Atom:
                entries = (rows[(at[0] + k, *at[1:])] for k in range(last + 1))
                return look_up(writer, entries, start.item(), equation.dtype)

            result = np.moveaxis(array_of((size, *rows.shape[1:]), taken), 0, axis)
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
    remaining = [axis for axis in range(count) if axis not in axes]
    rows = operands[0].transpose(*remaining, *axes).reshape((*equation.shape, -1))
    return [array_of(equation.shape, lambda at: _combined(writer, operation, list(rows[at]), equation.dtype, empty))]


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
    """The sums of products, written one by one, or as loops where they are many; batches one after the other."""
    (left_axes, right_axes), (left_batch, right_batch) = equation.parameters["dimension_numbers"]
    rows = _contracted_last(operands[0], left_batch, left_axes)
    columns = _contracted_last(operands[1], right_batch, right_axes)
    product = _looped_product if rows[0].size * columns.shape[1] > MOST_WRITTEN_OUT else _written_product
    result = [product(writer, one, other, equation.dtype) for one, other in zip(rows, columns, strict=True)]
    return [np.stack(result).reshape(equation.shape)]


def _contracted_last(array: Atoms, batch: tuple[int, ...], axes: tuple[int, ...]) -> Atoms:
    """As one matrix for each entry of a batch, whose columns are the contracted numbers."""
    free = [axis for axis in range(array.ndim) if axis not in axes and axis not in batch]
    counts = [int(np.prod([array.shape[axis] for axis in some])) for some in (batch, free, axes)]
    return array.transpose(*batch, *free, *axes).reshape(counts)


def _written_product(writer: Writer, rows: Atoms, columns: Atoms, dtype: str) -> Atoms:
    def total(at: tuple[int, ...]) -> Atom:
        pairs = zip(rows[at[0]], columns[at[1]], strict=True)
        return _combined(writer, "add", [writer.define("mul", pair, dtype) for pair in pairs], dtype, 0)

    return array_of((len(rows), len(columns)), total)


def _looped_product(writer: Writer, rows: Atoms, columns: Atoms, dtype: str) -> Atoms:
    (height, length), width = rows.shape, len(columns)
    left, right = writer.table(rows.ravel(), dtype), writer.table(columns.ravel(), dtype)
    products = writer.declare(dtype, size=height * width)

    def place(row: Atom, size: int, column: Atom) -> Atom:
        return writer.define("add", (writer.define("mul", (row, constant(size, COUNTER)), COUNTER), column), COUNTER)

    with writer.counted(height) as i, writer.counted(width) as k:
        total = writer.declare(dtype, constant(0, dtype))
        with writer.counted(length) as j:
            entries = (
                writer.define("look_up", (left, place(i, length, j)), dtype),
                writer.define("look_up", (right, place(k, length, j)), dtype),
            )
            product = writer.define("mul", entries, dtype)
            writer.assign([(total, writer.define("add", (total, product), dtype))])
        writer.put(Assign(products, total, place(i, width, k)))
    entries = (height, width)
    numbers = np.arange(height * width).reshape(entries)
    return array_of(entries, lambda at: writer.define("look_up", (products, constant(numbers[at], COUNTER)), dtype))


def _split(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    ends = np.cumsum(equation.parameters["sizes"])[:-1]
    return list(np.split(operands[0], ends, equation.parameters["axis"]))


def _unstack(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    rows = np.moveaxis(operands[0], equation.parameters["axis"], 0)
    return [rows[k : k + 1].reshape(shape) for k, shape in enumerate(equation.shapes)]


def _gather(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """`array[i]` and `array[i, k]`: whole rows, or entries, at places along the first axes."""
    numbers, sizes = equation.parameters["dimension_numbers"], equation.parameters["slice_sizes"]
    array, places = operands
    first = places.shape[-1]
    leading, trailing = tuple(range(first)), tuple(range(places.ndim - 1, len(equation.shape)))
    plain = (leading, leading, trailing) == (
        tuple(numbers.collapsed_slice_dims), tuple(numbers.start_index_map), tuple(numbers.offset_dims),
    )  # fmt: skip
    if not plain or tuple(sizes[first:]) != array.shape[first:] or _has_batches(numbers):
        _refuse("gather", "whole rows along the first axes")
    result = np.empty((*places.shape[:-1], *array.shape[first:]), object)
    for index in np.ndindex(*places.shape[:-1]):
        rows: Any = array
        for place in places[index]:
            rows = _row(writer, rows, place, equation.dtype)
        result[index] = rows
    return [result.reshape(equation.shape)]


def _row(writer: Writer, rows: Atoms, place: Atom, dtype: str) -> Any:
    """An entry along the first axis."""
    if rows.ndim == 1:
        return look_up(writer, rows, place, dtype)
    return array_of(rows.shape[1:], lambda at: look_up(writer, rows[(slice(None), *at)], place, dtype))


def _scatter(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """`array.at[i].set(...)`: a row, or a stretch of rows that begins at a known place; nothing outside the array."""
    array, places, update = operands
    numbers = equation.parameters["dimension_numbers"]
    row = tuple(numbers.inserted_window_dims) == (0,)
    along = tuple(numbers.scatter_dims_to_operand_dims) == (0,)
    if places.size != 1 or not along or _has_batches(numbers) or not (row or array.ndim == 1):
        _refuse("scatter", "one row, or a stretch of a vector")
    place, rows = places.item(), update.reshape(-1, *array.shape[1:])
    if isinstance(place, Constant):
        first, result = int(place.text), array.copy()
        if not 0 <= first <= len(array) - len(rows):
            _refuse("scatter", f"places inside the array, not {first} of {len(array)}")
        result[first : first + len(rows)] = rows
        return [result]
    if not row:
        _refuse("scatter", "a stretch of a vector at a known place")

    def chosen(at: tuple[int, ...]) -> Atom:
        here: Any = writer.define("eq", (place, constant(at[0], place.dtype)), "bool")
        return writer.define("select", (here, rows[(0, *at[1:])], array[at]), equation.dtype)

    return [array_of(array.shape, chosen)]


def _place_of_extreme(writer: Writer, equation: Equation, operands: list[Atoms]) -> list[Atoms]:
    """`argmax` and `argmin` of a vector: the first of equal entries; NaN is more extreme than any number."""
    vector = operands[0]
    if vector.ndim != 1:
        _refuse(equation.name, "vectors")
    order = "gt" if equation.name == "argmax" else "lt"
    extreme, place = vector[0], constant(0, equation.dtype)
    for number, entry in enumerate(vector[1:], 1):
        beyond = writer.define(order, (entry, extreme), "bool")
        if entry.dtype.startswith("float"):
            new = writer.define("ne", (entry, entry), "bool")
            old = writer.define("eq", (extreme, extreme), "bool")
            beyond = writer.define("or", (beyond, writer.define("and", (new, old), "bool")), "bool")
        extreme = writer.define("select", (beyond, entry, extreme), entry.dtype)
        place = writer.define("select", (beyond, constant(number, equation.dtype), place), equation.dtype)
    return [np.array(place, object)]


def _has_batches(numbers: object) -> bool:
    return bool(getattr(numbers, "operand_batching_dims", ()))


def _refuse(name: str, can: str) -> NoReturn:
    raise NotImplementedError(f"The primitive {name!r} can be printed for {can} only.")


RULES: dict[str, Rule] = {
    "broadcast_in_dim": _broadcast,
    **dict.fromkeys(("reshape", "squeeze", "expand_dims"), lambda writer, e, operands: [operands[0].reshape(e.shape)]),
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
    "gather": _gather,
    "scatter": _scatter,
    "argmax": _place_of_extreme,
    "argmin": _place_of_extreme,
}
