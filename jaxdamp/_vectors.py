"""Small vectors in memory: one array, or a tuple of scalars.

XLA compiles a loop over a tuple of scalars, or of contiguous lanes where many cars run side by side, into the code that
one would write by hand; without the compiler options of `jaxdamp.configure`, one array is better for one car.
"""

import enum
import operator
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, PyTree

from jaxdamp._types import Scalar, ScalarLike


# One array or a tuple of scalars, rows of them for a matrix, as `MemoryLayout` says.
if TYPE_CHECKING:
    SmallVector: TypeAlias = PyTree
    Matrix: TypeAlias = PyTree
else:
    SmallVector = Float[Array, " _"] | tuple[Scalar, ...]
    Matrix = Float[Array, "_ _"] | tuple[tuple[Scalar, ...], ...]


class MemoryLayout(enum.Enum):
    """How the vectors of a vehicle lie in memory: part of what a compiled function is, chosen by the engine."""

    ARRAY = "one array"
    SCALARS = "a tuple of scalars, for one small car"
    LANES = "a tuple of scalars, each a lane for every car of a batch"


def joined(parts: Sequence[Float[Array, " _"]]) -> Float[Array, " _"]:
    """The entries of several vectors; of known ones without a program for it."""
    if any(isinstance(part, Tracer) for part in parts):
        return jnp.concatenate(parts)
    together = np.concatenate(parts)
    return jnp.asarray(together, together.dtype)


def scalars(vector: Float[Array, " _"]) -> tuple[Scalar, ...]:
    """The entries of a vector."""
    return tuple(vector[i] for i in range(vector.shape[0]))


def rows(matrix: Float[Array, "_ _"]) -> tuple[tuple[Scalar, ...], ...]:
    """The entries of a matrix, row by row."""
    return tuple(scalars(matrix[i]) for i in range(matrix.shape[0]))


def laid_out(values: Array, layout: MemoryLayout) -> SmallVector | Matrix:
    """A vector or a matrix in a layout."""
    if layout is MemoryLayout.ARRAY:
        return values
    return scalars(values) if values.ndim == 1 else rows(values)


def times(matrix: Matrix, vector: SmallVector) -> SmallVector:
    """Matrix @ vector as products and sums, which XLA fuses with other operations, unlike a `dot`."""
    if isinstance(matrix, tuple):
        return tuple(_dot(row, vector) for row in matrix)
    return jnp.sum(matrix * jnp.asarray(vector)[None, :], axis=1)


def plus(*vectors: SmallVector) -> SmallVector:
    """The sum."""
    return _entrywise(lambda *entries: _sum(entries), *vectors)


def minus(one: SmallVector, other: SmallVector) -> SmallVector:
    """The difference."""
    return _entrywise(operator.sub, one, other)


def materialise_once(vector: SmallVector, opaque_one: Scalar | None) -> SmallVector:
    """The same vector, which the compiler computes once and does not repeat in every expression that uses it.

    XLA writes what goes into several sums anew in each of them, but not a quotient: scalars are divided by 1.0, whose
    value the compiler must not know. That doubles the rate of many cars side by side; one car does better without.
    """
    return tuple(entry / opaque_one for entry in vector) if opaque_one is not None else vector


def materialise_derivatives_once(vector: SmallVector, opaque_one: Scalar | None) -> SmallVector:
    """The same, its tangents and cotangents computed once: a quarter to a third less for many cars in reverse."""
    if opaque_one is None:
        return vector
    return tuple(_divided_in_derivatives(entry, opaque_one) for entry in vector)


@jax.custom_jvp
def _divided_in_derivatives(entry: Scalar, opaque_one: Scalar) -> Scalar:
    del opaque_one
    return entry


@_divided_in_derivatives.defjvp
def _divide(primals: tuple[Scalar, Scalar], tangents: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    (entry, opaque_one), (change, _) = primals, tangents
    return entry, change / opaque_one


def between(one: SmallVector, other: SmallVector, share: ScalarLike) -> SmallVector:
    """The point at a share of the way from one to the other."""
    return _entrywise(lambda a, b: a + share * (b - a), one, other)


def _entrywise(function: Callable[..., Scalar], *vectors: SmallVector) -> SmallVector:
    if isinstance(vectors[0], tuple):
        return tuple(function(*entries) for entries in zip(*vectors, strict=True))
    return function(*vectors)


def _dot(row: Sequence[Scalar], vector: SmallVector) -> Scalar:
    return _sum([a * b for a, b in zip(row, vector, strict=True)])


def _sum(parts: Sequence[Scalar]) -> Scalar:
    total = parts[0] if parts else jnp.zeros(())  # a vehicle without elements has sums of nothing
    for part in parts[1:]:
        total = total + part
    return total
