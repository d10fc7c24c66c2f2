"""Small vectors in two layouts: one array, or a tuple of scalars.

XLA compiles a loop over a tuple of scalars, or of contiguous lanes where many cars run side by side, into the code that
one would write by hand; where it is not told to compile small loops as one function, one array is better for one car.
"""

import operator
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, ScalarLike


# One array or a tuple of scalars, rows of them for a matrix; who calls knows which.
if TYPE_CHECKING:
    Vector: TypeAlias = Any
    Matrix: TypeAlias = Any
else:
    Vector = Float[Array, " _"] | tuple[Scalar, ...]
    Matrix = Float[Array, "_ _"] | tuple[tuple[Scalar, ...], ...]


def scalars(vector: Float[Array, " _"]) -> tuple[Scalar, ...]:
    """The entries of a vector."""
    return tuple(vector[i] for i in range(vector.shape[0]))


def rows(matrix: Float[Array, "_ _"]) -> tuple[tuple[Scalar, ...], ...]:
    """The entries of a matrix, row by row."""
    return tuple(scalars(matrix[i]) for i in range(matrix.shape[0]))


def times(matrix: Matrix, vector: Vector) -> Vector:
    """Matrix @ vector as products and sums, which XLA fuses with what is around them; a `dot` stands alone."""
    if isinstance(matrix, tuple):
        return tuple(_dot(row, vector) for row in matrix)
    return jnp.sum(matrix * jnp.asarray(vector)[None, :], axis=1)


def plus(*vectors: Vector) -> Vector:
    """The sum."""
    return _entrywise(lambda *entries: _sum(entries), *vectors)


def minus(one: Vector, other: Vector) -> Vector:
    """The difference."""
    return _entrywise(operator.sub, one, other)


def once(vector: Vector, unit: Scalar | None) -> Vector:
    """The same, to be computed once.

    XLA writes what goes into several sums anew in each of them, but not a quotient: scalars are divided by one, whose
    value the compiler must not know. That doubles the rate of many cars side by side; one car does better without.
    """
    return tuple(entry / unit for entry in vector) if unit is not None else vector


def once_in_derivatives(vector: Vector, unit: Scalar | None) -> Vector:
    """The same, its tangents and cotangents to be computed once: a quarter to a third less for many cars in reverse."""
    return tuple(_divided_in_derivatives(entry, unit) for entry in vector) if unit is not None else vector


@jax.custom_jvp
def _divided_in_derivatives(entry: Scalar, unit: Scalar) -> Scalar:
    del unit
    return entry


@_divided_in_derivatives.defjvp
def _divide(primals: tuple[Scalar, Scalar], tangents: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    (entry, unit), (change, _) = primals, tangents
    return entry, change / unit


def between(one: Vector, other: Vector, share: ScalarLike) -> Vector:
    """The point at a share of the way from one to the other."""
    return _entrywise(lambda a, b: a + share * (b - a), one, other)


def _entrywise(function: Callable[..., Any], *vectors: Vector) -> Vector:
    if isinstance(vectors[0], tuple):
        return tuple(function(*entries) for entries in zip(*vectors, strict=True))
    return function(*vectors)


def _dot(row: Sequence[Scalar], vector: Vector) -> Scalar:
    return _sum([a * b for a, b in zip(row, vector, strict=True)])


def _sum(parts: Sequence[Any]) -> Any:
    total = parts[0] if parts else jnp.zeros(())  # a vehicle without elements has sums of nothing
    for part in parts[1:]:
        total = total + part
    return total
