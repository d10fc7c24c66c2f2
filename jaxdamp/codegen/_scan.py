"""`printed_scan`: `jax.lax.scan` for many points side by side, printed as C."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jax.extend.core import ClosedJaxpr
from jaxtyping import Array, PyTree

from jaxdamp.codegen._jaxprs import called, known, printing, with_constants_as_inputs
from jaxdamp.codegen._lanes import OF_POINT, OF_STEP, Loop, Operand, lanes_in_c
from jaxdamp.codegen._native import compiled_by, on_gpu, registered, registered_on_gpu


Lanes: TypeAlias = Sequence[bool]  # whether each array has one number, or array, for each point


def printed_scan(step: Callable[[PyTree, PyTree], PyTree], carry: PyTree, rows: PyTree) -> PyTree:
    """The carry after `carry = step(carry, row)` for each row, printed as C, for `jax.vmap` over many points.

    Points run side by side in vectors. What does not depend on the point, or not on the step, is computed once. The
    rows are the same for all points. Only values pass, no derivatives.

    Arguments:
        step: of numbers and small arrays in double precision; in loops inside it points wait for each other, branches
            run on GPUs only.
        carry: a tree of arrays.
        rows: a tree of arrays, one row for each step along the first axis.

    Raises:
        NotImplementedError: what cannot be printed, other types than float64, no C compiler, for GPUs no NVRTC,
            rows that differ from point to point.
    """
    carry, rows = jax.tree.map(jnp.asarray, (carry, rows))
    row = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), rows)
    with printing(vectors=True):
        body, constants = with_constants_as_inputs(step, (carry, row))
    start, tree = jax.tree.flatten(carry)
    scan = _Scan(body, [known(value) for value in constants])
    traced = [c for c, value in zip(constants, scan.values, strict=True) if value is None]
    for leaf in [*traced, *start, *jax.tree.leaves(rows)]:
        if leaf.dtype != jnp.float64:
            raise NotImplementedError(f"A loop over numbers of type {leaf.dtype} cannot be printed, only over float64.")
    run = custom_vmap(scan.of_one)
    run.def_vmap(scan.side_by_side)
    return jax.tree.unflatten(tree, run(traced, start, jax.tree.leaves(rows)))


@dataclass(frozen=True)
class _Scan:
    """A loop over rows."""

    body: ClosedJaxpr  # a step: constants, carry and row to carry
    values: list[np.ndarray | None]  # of the constants; None of those that JAX traces

    def loop(self, laned: tuple[Lanes, Lanes], traced: list[Array], start: list[Array], rows: list[Array]) -> Loop:
        """The printed loop, where some arrays have one number for each point."""
        inputs = iter([_operand(value, lane) for value, lane in zip(traced, laned[0], strict=True)])
        constants = [next(inputs) if v is None else Operand(v.shape, 0, v) for v in self.values]
        carried = [_operand(value, lane, OF_STEP) for value, lane in zip(start, laned[1], strict=True)]
        of_rows = [Operand(x.shape[1:], OF_STEP) for x in rows]
        return lanes_in_c(self.body, constants, carried, of_rows)

    def of_one(self, traced: list[Array], start: list[Array], rows: list[Array]) -> list[Array]:
        """One point: no vectors, so it is left to XLA; what cannot be printed is refused all the same."""
        compiled_by()
        loop = self.loop(([False] * len(traced), [False] * len(start)), traced, start, rows)
        _ = loop.kernel if on_gpu() else loop.text  # refused where vectors cannot follow

        def stride(carry: list[Array], row: list[Array]) -> tuple[list[Array], None]:
            inputs = iter(traced)
            constants = [next(inputs) if value is None else jnp.asarray(value) for value in self.values]
            return called(self.body, [*constants, *carry, *row]), None

        return jax.lax.scan(stride, start, rows)[0]

    def side_by_side(
        self, size: int, laned: Sequence[Lanes], traced: list[Array], start: list[Array], rows: list[Array]
    ) -> tuple[list[Array], list[bool]]:
        """Many points, and which numbers of the carry each of them has for itself."""
        if any(laned[2]):
            reason = "A printed loop has one table of rows for all points, and here each point has its own."
            raise NotImplementedError(f"{reason} Leave `printed` out: XLA then compiles the loop.")
        traced, start = jax.tree.map(jnp.asarray, (traced, start))  # of literals JAX hands plain numbers on
        loop = self.loop((laned[0], laned[1]), traced, start, rows)
        start = [
            jnp.broadcast_to(value, (size, *value.shape)) if lane and not had else value
            for value, lane, had in zip(start, loop.laned, laned[1], strict=True)
        ]
        shared, of_points = _stacked(traced, laned[0], size)
        now, state = _stacked(start, loop.laned, size)
        table = jnp.concatenate([jnp.reshape(x, (x.shape[0], -1)) for x in rows], axis=1)
        kinds = [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in (now, state)]
        name = registered_on_gpu(loop.kernel) if on_gpu() else registered(loop.text)
        printed = jax.ffi.ffi_call(name, kinds, vmap_method="sequential")
        now, state = printed(shared, of_points, now, state, table)
        return _unstacked(now, state, start, loop.laned), list(loop.laned)


def _operand(value: Array, lane: bool, level: int = 0) -> Operand:
    return Operand(value.shape[1:] if lane else value.shape, level | OF_POINT * lane)


def _stacked(values: list[Array], laned: Lanes, size: int) -> tuple[Array, Array]:
    """The numbers that all points share, and those of each point, (number, point)."""
    shared = [jnp.ravel(v) for v, lane in zip(values, laned, strict=True) if not lane]
    of_points = [jnp.reshape(v, (size, -1)).T for v, lane in zip(values, laned, strict=True) if lane]
    none = jnp.zeros((0,)), jnp.zeros((0, size))
    return jnp.concatenate([none[0], *shared]), jnp.concatenate([none[1], *of_points])


def _unstacked(shared: Array, of_points: Array, like: list[Array], laned: Lanes) -> list[Array]:
    """The arrays of the shapes of others, from the numbers that all points share and those of each point."""
    arrays, places = [], [0, 0]
    for value, lane in zip(like, laned, strict=True):
        count = value.size // (value.shape[0] if lane else 1)
        part = (of_points if lane else shared)[places[lane] : places[lane] + count]
        places[lane] += count
        arrays.append(jnp.reshape(part.T if lane else part, value.shape))
    return arrays
