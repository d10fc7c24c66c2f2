"""A law, or a law on a machine, as plain numbers and how they are put together."""

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import PyTree

from jaxdamp.dampers import without_fitted_ranges


class LawNumbers(NamedTuple):
    """A law, or a law on a machine, as plain numbers.

    Attributes:
        key: its structure, and what of it is no number of a program.
        tree: how it is put together.
        others: its leaves, with None in place of arrays of numbers.
        arrays: the arrays of numbers, in the order of the leaves.
    """

    key: Hashable
    tree: PyTree
    others: tuple[object, ...]
    arrays: list[np.ndarray]

    def built(self, arrays: Sequence[object]) -> PyTree:
        """The same with other numbers."""
        numbers = iter(arrays)
        return jax.tree.unflatten(self.tree, [next(numbers) if leaf is None else leaf for leaf in self.others])

    @property
    def flat(self) -> np.ndarray:
        """All numbers, as the C functions take them."""
        return np.concatenate([np.zeros(0), *map(np.ravel, self.arrays)])


def is_number(leaf: object) -> bool:
    """Whether a leaf of a law is an array of numbers that a program takes."""
    return isinstance(leaf, jax.Array | np.ndarray) and np.issubdtype(leaf.dtype, np.floating)


def numbers_of(law: PyTree) -> LawNumbers:
    """The numbers of a law whose values are known; the range that it was fitted to is left out."""
    leaves, tree = jax.tree.flatten(without_fitted_ranges(law))
    others = tuple(None if is_number(leaf) else leaf for leaf in leaves)
    arrays = [np.asarray(leaf, np.float64) for leaf in leaves if is_number(leaf)]
    fixed = tuple(np.asarray(leaf).tobytes() if isinstance(leaf, jax.Array) else repr(leaf) for leaf in others)
    return LawNumbers((tree, fixed, tuple(array.shape for array in arrays)), tree, others, arrays)
