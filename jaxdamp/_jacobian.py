"""Values and derivatives of named results by named inputs, for one point or for a batch of independent points."""

import math
from collections.abc import Callable, Collection, Mapping
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array


Mode = Literal["forward", "reverse"]
Results = dict[str, Array]
INPUTS_FOR_A_RESULT = 2  # each input costs about one run in forward mode, each result about three in reverse mode


def choose_mode(inputs: int, results: int) -> Mode:
    """Forward mode, which stores no steps, for up to twice as many inputs as results; otherwise reverse mode."""
    return "forward" if inputs <= INPUTS_FOR_A_RESULT * results else "reverse"


def with_jacobian(function: Callable[[Array], Array]) -> Callable[[Array], tuple[Array, Array]]:
    """The same function of a vector with its Jacobian, in forward mode: value and derivatives."""

    def both(x: Array) -> tuple[Array, Array]:
        slopes, value = jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True)(x)
        return value, slopes

    return both


def value_and_jacobian(
    function: Callable[[dict[str, Array]], Mapping[str, Array]],
    point: Mapping[str, Array],
    mode: Mode = "forward",
    of: Collection[str] | None = None,
) -> tuple[Results, dict[str, Results]]:
    """Results at a point, and their derivatives by each of its entries.

    The entries of the point all have one shape: `()` for one point, or `(lanes,)` for a batch, for which `function` is
    `jax.vmap` of the function of one point, so that no lane depends on another. Batch first and differentiate then:
    tangents are (inputs, lanes) with the lanes side by side in memory, and what does not depend on them is computed
    once. (`jax.vmap(jax.jacfwd(...))` puts the inputs side by side, which is several times slower.)

    Arguments:
        function: point → results; each result has the shape of an entry, and may have further axes after it.
        point: entries by name, floating.
        mode: `"forward"`, all tangents in one pass; or `"reverse"`, one cotangent for each number of a result.
        of: names of the results to differentiate; all that are floating if left out.

    Returns:
        The results, and `slopes[result][entry]`, each of the shape of its result.

    >>> point = {"a": jnp.array([1.0, 2.0]), "b": jnp.array([3.0, 4.0])}
    >>> value, slopes = value_and_jacobian(jax.vmap(lambda p: {"y": p["a"] * p["b"]}), point)
    >>> slopes["y"]["a"].tolist(), slopes["y"]["b"].tolist()
    ([3.0, 4.0], [1.0, 2.0])
    """
    point = dict(point)

    def split(point: dict[str, Array]) -> tuple[Results, Results]:
        results = function(point)
        chosen = [
            name for name in results if jnp.issubdtype(results[name].dtype, jnp.floating) and (of is None or name in of)
        ]
        smooth = {name: results[name] for name in chosen}
        return smooth, {name: value for name, value in results.items() if name not in smooth}

    smooth, others, slopes = _forward(split, point) if mode == "forward" else _reverse(split, point)
    return smooth | others, slopes


Split = Callable[[dict[str, Array]], tuple[Results, Results]]


def _forward(split: Split, point: dict[str, Array]) -> tuple[Results, Results, dict[str, Results]]:
    names = list(point)
    zeros = {name: jnp.zeros((len(names), *value.shape), value.dtype) for name, value in point.items()}
    tangents = {name: zeros[name].at[i].set(1.0) for i, name in enumerate(names)}

    def push(tangent: dict[str, Array]) -> tuple[Results, Results, Results]:
        smooth, along, others = jax.jvp(split, (point,), (tangent,), has_aux=True)
        return smooth, along, others

    smooth, along, others = jax.vmap(push, out_axes=(None, 0, None))(tangents)
    slopes = {result: {name: rows[i] for i, name in enumerate(names)} for result, rows in along.items()}
    return smooth, others, slopes


def _reverse(split: Split, point: dict[str, Array]) -> tuple[Results, Results, dict[str, Results]]:
    smooth, pull, others = jax.vjp(split, point, has_aux=True)
    lanes = next(iter(point.values())).shape
    shapes = {name: value.shape[len(lanes) :] for name, value in smooth.items()}  # shape of a result at one point
    starts, total = {}, 0
    for name, shape in shapes.items():
        starts[name] = total
        total += math.prod(shape)
    seeds = {}
    for name, value in smooth.items():
        rows = jnp.eye(total, math.prod(shapes[name]), -starts[name], dtype=value.dtype)
        seeds[name] = jnp.broadcast_to(rows.reshape(total, *(1,) * len(lanes), *shapes[name]), (total, *value.shape))
    (pulled,) = jax.vmap(pull)(seeds)

    def of_result(rows: Array, name: str) -> Array:
        rows = rows[starts[name] : starts[name] + math.prod(shapes[name])]
        return jnp.moveaxis(rows, 0, -1).reshape(*lanes, *shapes[name])

    slopes = {name: {entry: of_result(rows, name) for entry, rows in pulled.items()} for name in smooth}
    return smooth, others, slopes
