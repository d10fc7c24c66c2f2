"""Small vectors in two layouts: one array, or a tuple of scalars.

XLA compiles a loop over a tuple of scalars, or of contiguous lanes where many cars run side by side, into the code that
one would write by hand; without the compiler options of `jaxdamp.configure`, one array is better for one car.
"""

import operator
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar, ScalarLike


# One array or a tuple of scalars, rows of them for a matrix, as the caller chooses.
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
    """Matrix @ vector as products and sums, which XLA fuses with other operations, unlike a `dot`."""
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

    XLA computes a term again for each sum that uses it, but not a quotient: scalars are therefore divided by a one that
    the compiler does not know. This doubles the speed of many cars side by side; a single car is faster without.
    """
    return tuple(entry / unit for entry in vector) if unit is not None else vector


def once_in_derivatives(vector: Vector, unit: Scalar | None) -> Vector:
    """The same, with tangents and cotangents computed once: 25 to 33 % less time for many cars in reverse mode."""
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
