"""Primitives of JAX that read and write entries of arrays at places that may be known only when the program runs."""

from typing import Any, NoReturn

import numpy as np

from jaxdamp.codegen._arrays import look_up
from jaxdamp.codegen._elementwise import Rule
from jaxdamp.codegen._jaxprs import Equation
from jaxdamp.codegen._program import Atom, Atoms, Constant, Writer, constant


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
    result = np.empty(rows.shape[1:], object)
    for index in np.ndindex(*result.shape):
        result[index] = look_up(writer, rows[(slice(None), *index)], place, dtype)
    return result


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
    result = np.empty(array.shape, object)
    for index in np.ndindex(*array.shape):
        here = writer.define("eq", (place, constant(index[0], place.dtype)), "bool")
        chosen: Any = here, rows[(0, *index[1:])], array[index]
        result[index] = writer.define("select", chosen, equation.dtype)
    return [result]


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
    "gather": _gather,
    "scatter": _scatter,
    "argmax": _place_of_extreme,
    "argmin": _place_of_extreme,
}
