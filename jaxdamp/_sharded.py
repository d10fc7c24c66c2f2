"""Beginnings of loops inside `jax.shard_map`, which tells values that differ between devices from those that do not."""

from typing import Any, TypeVar

import jax
from jaxtyping import PyTree


Tree = TypeVar("Tree")


def varying_as(tree: Tree, *others: object) -> Tree:
    """The tree, its arrays taken for different on the devices on which any of these arrays, or its own, differ.

    A loop whose beginning is a constant, and whose end is not, is refused there otherwise.
    """
    axes = frozenset().union(*map(_axes, jax.tree.leaves((tree, others))))

    def varying(leaf: object) -> PyTree:
        more = axes - _axes(leaf)
        return jax.lax.pcast(leaf, tuple(more), to="varying") if more else leaf

    return jax.tree.map(varying, tree) if axes else tree


def _axes(leaf: object) -> frozenset[object]:
    if not isinstance(leaf, jax.Array):
        return frozenset()
    kind: Any = jax.typeof(leaf)
    return kind.mat.varying if hasattr(kind, "mat") else kind.vma  # the latter before jax 0.10
