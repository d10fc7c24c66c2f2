"""The numbers behind those that JAX traces, for checks and for what is decided before a program runs.

Under `jax.grad`, `jax.jvp`, `jax.linearize` and `jax.vmap` a number is traced, but its value is known; inside
`jax.jit`, `jax.lax.scan` and the like it is not. Nothing here may enter a result: derivatives would not pass.
"""

import functools
import inspect
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple, TypeVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.extend.core import (
    Var,
    unsafe_am_i_under_a_jit_DO_NOT_USE,  # pyright: ignore[reportPrivateImportUsage]
)
from jaxtyping import PyTree

from jaxdamp._forked import refuse_fork


Tree = TypeVar("Tree")
Function = TypeVar("Function", bound=Callable[..., object])


class Behind(NamedTuple):
    """A value behind a tracer, with an axis for each `jax.vmap` in front, the outermost first."""

    value: np.ndarray
    batch_axes: int


def look_behind(value: object) -> Behind | None:
    """The value behind derivatives and batches; None where no value is known yet."""
    if not isinstance(value, Tracer):
        return Behind(np.asarray(value), 0)
    if (primal := getattr(value, "primal", None)) is not None:
        return look_behind(primal)
    axis = getattr(value, "batch_dim", ...)
    if not isinstance(axis, int | None):
        return None
    whole = look_behind(value.val)  # pyright: ignore[reportAttributeAccessIssue]
    if whole is None or axis is None:
        return whole
    return Behind(np.moveaxis(whole.value, whole.batch_axes + axis, whole.batch_axes), whole.batch_axes + 1)


def behind(value: object) -> np.ndarray | None:
    """The value, or all values of a batch with the batch in front; None where no value is known yet."""
    batch = look_behind(value)
    return None if batch is None else batch.value


def is_traced(tree: PyTree) -> bool:
    """Whether JAX traces any leaf."""
    try:
        leaves = jax.tree.leaves(tree)
    except ValueError:  # JAX sorts the keys of a dictionary, which 1 and "ref" do not allow
        parts = jax.tree.leaves(tree, is_leaf=lambda node: isinstance(node, dict))
        return any(is_traced(list(part.values()) if isinstance(part, dict) else part) for part in parts)
    return any(isinstance(leaf, Tracer) for leaf in leaves)


def is_inside_program() -> bool:
    """Whether JAX is tracing a function that it compiles."""
    return unsafe_am_i_under_a_jit_DO_NOT_USE()


def at_compile_time() -> AbstractContextManager[None]:
    """Inside `jax.jit`: compute with known numbers now, rather than in the program."""
    return jax.ensure_compile_time_eval() if is_inside_program() else nullcontext()


def is_batched(tree: PyTree) -> bool:
    """Whether any leaf stands for a batch of `jax.vmap`, also below derivatives or a compiled function around it."""
    return any(map(_is_batched, jax.tree.leaves(tree)))


def _is_batched(value: object) -> bool:
    while isinstance(value, Tracer):
        if isinstance(getattr(value, "batch_dim", None), int):
            return True
        value = getattr(value, "primal", getattr(value, "val", None))
    return False


def known(tree: Tree) -> Tree | None:
    """The tree with the values behind its arrays; None where one of them is a batch or not known yet."""
    if not is_traced(tree):
        return tree
    arrays, static = eqx.partition(tree, eqx.is_array)
    batches = [look_behind(leaf) for leaf in jax.tree.leaves(arrays)]
    if any(leaf is None or leaf.batch_axes for leaf in batches):
        return None
    with at_compile_time():
        values = [jnp.asarray(leaf.value) for leaf in batches if leaf is not None]
    return eqx.combine(jax.tree.unflatten(jax.tree.structure(arrays), values), static)


def rows(tree: PyTree) -> list[np.ndarray] | None:
    """The values of all arrays of a tree for each car of a batch, shape (cars, ...); None where one is not known.

    One car if nothing is a batch. Batches within batches are laid out one after the other.
    """
    leaves = jax.tree.leaves(eqx.filter(tree, eqx.is_array))
    if not leaves:
        return []
    if not is_batched(leaves):
        values = [behind(leaf) for leaf in leaves]
        return None if any(value is None for value in values) else [np.asarray(value)[None] for value in values]
    batch = look_behind(jnp.concatenate([jnp.ravel(jax.lax.stop_gradient(leaf)) for leaf in leaves]))
    if batch is None:
        return None
    flat = batch.value.reshape(-1, batch.value.shape[-1])
    parts = np.split(flat, np.cumsum([leaf.size for leaf in leaves])[:-1], axis=1)
    return [part.reshape(-1, *leaf.shape).astype(leaf.dtype) for part, leaf in zip(parts, leaves, strict=True)]


def row(tree: Tree, values: list[np.ndarray], index: int) -> Tree:
    """The tree of one car of `rows`, with arrays of NumPy."""
    arrays, static = eqx.partition(tree, eqx.is_array)
    chosen = [np.asarray(value[index]) for value in values]
    return eqx.combine(jax.tree.unflatten(jax.tree.structure(arrays), chosen), static)


def of_known_numbers(function: Function) -> Function:
    """A function that needs known numbers: it refuses traced ones by argument, and works at once inside `jax.jit`."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: object, **kwargs: object) -> object:
        refuse_fork()
        if is_traced((args, kwargs)):
            from jaxdamp import _checks

            outside = f"Call `{function.__name__}` outside `jax.jit`, `jax.grad` and `jax.vmap`"
            remedy = f"{outside}: docs/from_jax.md says what can be traced in its place."
            for name, value in {**dict(zip(signature.parameters, args, strict=False)), **kwargs}.items():
                _checks.untraced(name, value, remedy)
        with at_compile_time():
            return function(*args, **kwargs)

    return cast(Function, call)


def equal(one: PyTree, other: PyTree) -> bool:
    """Whether two trees of known numbers are equal; on arrays of JAX each shape compared is a program."""

    def plain(tree: PyTree) -> PyTree:
        return jax.tree.map(lambda leaf: np.asarray(leaf) if eqx.is_array(leaf) else leaf, tree)

    return bool(eqx.tree_equal(plain(one), plain(other)))


def depends(function: Callable[[PyTree], PyTree], values: PyTree) -> bool:
    """Whether the result of a function depends on its argument; a call inside counts as depending on all of its inputs.

    Arguments:
        function: of one argument, a tree of arrays.
        values: an argument of this structure.
    """
    traced = jax.make_jaxpr(function)(values).jaxpr
    reached = set(traced.invars)
    for equation in traced.eqns:
        if any(isinstance(variable, Var) and variable in reached for variable in equation.invars):
            reached.update(equation.outvars)
    return any(isinstance(variable, Var) and variable in reached for variable in traced.outvars)
