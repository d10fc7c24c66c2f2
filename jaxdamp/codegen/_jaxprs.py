"""The jaxprs of JAX: the only file that knows how JAX holds a traced function, and whether it is to be printed."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, TypeAlias

import jax
import numpy as np
from jax.core import ShapedArray, Tracer
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, Var, jaxpr_as_fun
from jaxtyping import Array, ArrayLike, PyTree


# Part of the key of compiled functions: what was traced to be printed is not taken for what XLA runs.
_PRINTING = jax.make_user_context("")


def printing(*, vectors: bool = False) -> AbstractContextManager[None]:
    """Functions traced inside are printed; for many points side by side in vectors, or for one."""
    return _PRINTING("vectors" if vectors else "numbers")


def is_printing() -> bool:
    """Whether the function that is being traced will be printed: it best uses elementary functions of a C library."""
    return bool(_PRINTING.value)


def is_printing_vectors() -> bool:
    """Whether it will be printed for many points side by side."""
    return _PRINTING.value == "vectors"


Inner: TypeAlias = Jaxpr | ClosedJaxpr


@dataclass(frozen=True)
class Equation:
    """One primitive with its parameters; shapes and types are those of its results."""

    name: str
    parameters: dict[str, Any]  # of JAX, another type for each primitive
    shapes: list[tuple[int, ...]]
    dtypes: list[str]

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the only result."""
        return self.shapes[0]

    @property
    def dtype(self) -> str:
        """The type of the only result."""
        return self.dtypes[0]

    def called(self) -> Inner:
        """The program that a call consists of."""
        function = self.parameters.get("_prim")
        if function is not None:  # from JAX 0.12, such as `custom_root`

            def expanded(*flat: Array) -> list[Array]:
                return jax.tree.leaves(function.expand(*jax.tree.unflatten(function.in_tree, flat)))

            return jax.make_jaxpr(expanded)(*function.in_avals_flat)
        return next(value for value in self.parameters.values() if hasattr(value, "eqns") or hasattr(value, "jaxpr"))


def scan_sizes(equation: Equation, operands: list[np.ndarray]) -> tuple[int, int]:
    """How many operands of a scan are the same in all steps, and how many are carried from step to step.

    By the ranks, which those over the steps lose inside: JAX 0.12 names the parameters otherwise than 0.10.
    """
    jaxpr, _ = opened(equation.parameters["jaxpr"])
    carried = sum(len(shape) == array_type(v).ndim for shape, v in zip(equation.shapes, jaxpr.outvars, strict=True))
    rows = sum(operand.ndim != array_type(v).ndim for operand, v in zip(operands, jaxpr.invars, strict=True))
    return len(operands) - rows - carried, carried


def array_type(value: Var | Literal) -> ShapedArray:
    """Shape and type of a value of a jaxpr, which is an array."""
    kind = value.aval
    assert isinstance(kind, ShapedArray), f"{kind} is no array"
    return kind


def known(value: ArrayLike) -> np.ndarray | None:
    """The value of an array; `None` of one that JAX traces."""
    return None if isinstance(value, Tracer) else np.asarray(value)


def traced(function: Callable[..., PyTree], inputs: list[tuple[tuple[int, ...], str]]) -> ClosedJaxpr:
    """The jaxpr of a function of arrays, given by their shapes and types."""
    return jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(*each) for each in inputs))


def with_constants_as_inputs(
    function: Callable[..., PyTree], arguments: tuple[PyTree, ...]
) -> tuple[ClosedJaxpr, list[Array]]:
    """The jaxpr of a function that closes over arrays, which may be traced; they come first among its inputs."""
    closed = jax.make_jaxpr(function)(*arguments)

    def outside(constants: list[Array], *flat: Array) -> list[Array]:
        return called(ClosedJaxpr(closed.jaxpr, constants), flat)

    return jax.make_jaxpr(outside)(closed.consts, *jax.tree.leaves(arguments)), closed.consts


def called(closed: ClosedJaxpr, flat: Sequence[Array]) -> list[Array]:
    """The results of a jaxpr on arrays, by JAX."""
    return jaxpr_as_fun(closed)(*flat)


def opened(inner: Inner) -> tuple[Jaxpr, list[np.ndarray]]:
    """A jaxpr and the values of its constants."""
    if isinstance(inner, ClosedJaxpr):
        return inner.jaxpr, [np.asarray(value) for value in inner.consts]
    return inner, []


def equations(jaxpr: Jaxpr) -> Iterator[tuple[Equation, list[Var | Literal], list[Var]]]:
    """Each equation with its operands and its results."""
    for e in jaxpr.eqns:
        shapes = [tuple(array_type(v).shape) for v in e.outvars]
        dtypes = [array_type(v).dtype.name for v in e.outvars]
        yield Equation(e.primitive.name, dict(e.params), shapes, dtypes), e.invars, e.outvars


def literal(operand: Literal) -> np.ndarray:
    """The value of an operand that is written as a number."""
    return np.asarray(operand.val, array_type(operand).dtype)
