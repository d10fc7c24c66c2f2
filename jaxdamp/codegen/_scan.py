"""`printed_scan`: `jax.lax.scan` for many points side by side, printed as C."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp.codegen._cuda import register_on_gpu
from jaxdamp.codegen._jaxprs import called, with_constants_as_inputs
from jaxdamp.codegen._lanes import OF_POINT, OF_STEP, Loop, Operand, lanes_in_c
from jaxdamp.codegen._lowering import printing
from jaxdamp.codegen._native import compiled_by, registered


def printed_scan(step: Callable[[Any, Any], Any], carry: Any, rows: Any, *, arithmetic: bool = False) -> Any:
    """The carry after `carry = step(carry, row)` for each row, printed as C, for `jax.vmap` over many points.

    Points run side by side in vectors. What does not depend on the point, or not on the step, is computed once. The
    rows are the same for all points. Only values pass, no derivatives.

    Arguments:
        step: of numbers and small arrays in double precision, without loops and branches inside.
        carry: a tree of arrays.
        rows: a tree of arrays, one row for each step along the first axis.
        arithmetic: refuse a step with functions such as exponentials, which are faster in XLA.

    Raises:
        NotImplementedError: what cannot be printed, other types than float64, no C compiler, for GPUs no NVRTC,
            rows that differ from point to point.
    """
    carry, rows = jax.tree.map(jnp.asarray, (carry, rows))
    row = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), rows)
    with printing():
        body, constants = with_constants_as_inputs(step, (carry, row))
    start, tree = jax.tree.flatten(carry)
    values = [_checks.concrete(c) for c in constants]
    moving = [c for c, value in zip(constants, values, strict=True) if value is None]
    for leaf in [*moving, *start, *jax.tree.leaves(rows)]:
        if leaf.dtype != jnp.float64:
            raise NotImplementedError(f"A loop over numbers of type {leaf.dtype} cannot be printed, only over float64.")

    def loop_of(laned: Any, moving: list[Any], start: list[Any], rows: list[Any]) -> Loop:
        inputs = iter([_operand(v, lane) for v, lane in zip(moving, laned[0], strict=True)])
        known = [next(inputs) if v is None else Operand(v.shape, 0, v) for v in values]
        carried = [_operand(v, lane, OF_STEP) for v, lane in zip(start, laned[1], strict=True)]
        return lanes_in_c(body, known, carried, [Operand(x.shape[1:], OF_STEP) for x in rows], arithmetic=arithmetic)

    def alone(moving: list[Any], start: list[Any], rows: list[Any]) -> list[Any]:
        """One point: no vectors, so it is left to XLA; what cannot be printed is refused all the same."""
        compiled_by()
        loop_of(([False] * len(moving), [False] * len(start)), moving, start, rows)

        def stride(carry: Any, row: list[Any]) -> tuple[Any, None]:
            given = iter(moving)
            known = [next(given) if v is None else v for v in values]
            return called(body, [*known, *carry, *row]), None

        return jax.lax.scan(stride, start, rows)[0]

    run: Any = jax.custom_batching.custom_vmap(alone)

    @run.def_vmap
    def side_by_side(size: int, laned: Any, *operands: Any) -> Any:
        moving, start, rows = operands
        if any(laned[2]):
            raise NotImplementedError("The rows of a loop, such as a road, must be the same for all points.")
        loop = loop_of(laned, moving, start, rows)
        start = [
            jnp.broadcast_to(v, (size, *v.shape)) if lane and not had else v
            for v, lane, had in zip(start, loop.laned, laned[1], strict=True)
        ]
        shared, own = _stacked(moving, laned[0], size)
        now, state = _stacked(start, loop.laned, size)
        table = jnp.concatenate([jnp.reshape(x, (x.shape[0], -1)) for x in rows], axis=1)
        kinds = [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in (now, state)]
        name = registered(loop.text)
        if jax.default_backend() == "gpu":
            register_on_gpu(loop.kernel, name)
        printed: Any = jax.ffi.ffi_call(name, kinds, vmap_method="sequential")
        now, state = printed(shared, own, now, state, table)
        return _unstacked(now, state, start, loop.laned), list(loop.laned)

    return jax.tree.unflatten(tree, run(moving, start, jax.tree.leaves(rows)))


def _operand(value: Any, lane: bool, level: int = 0) -> Operand:
    return Operand(value.shape[1:] if lane else value.shape, level | OF_POINT * lane)


def _stacked(values: list[Any], laned: Any, size: int) -> tuple[Array, Array]:
    """The numbers that all points share, and those of each point, (number, point)."""
    shared = [jnp.ravel(v) for v, lane in zip(values, laned, strict=True) if not lane]
    own = [jnp.reshape(v, (size, -1)).T for v, lane in zip(values, laned, strict=True) if lane]
    none = jnp.zeros((0,)), jnp.zeros((0, size))
    return jnp.concatenate([none[0], *shared]), jnp.concatenate([none[1], *own])


def _unstacked(shared: Array, own: Array, like: list[Any], laned: Any) -> list[Any]:
    found, places = [], [0, 0]
    for value, lane in zip(like, laned, strict=True):
        count = value.size // (value.shape[0] if lane else 1)
        part = (own if lane else shared)[places[lane] : places[lane] + count]
        places[lane] += count
        found.append(jnp.reshape(part.T if lane else part, value.shape))
    return found
