"""The jaxprs of JAX: the only file that knows how JAX holds a traced function."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jax.extend import core


Inner = Any  # a jaxpr, open or closed


@dataclass(frozen=True)
class Equation:
    """One primitive with its parameters; shapes and types are those of its results."""

    name: str
    parameters: dict[str, Any]
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

            def expanded(*flat: Any) -> list[Any]:
                return jax.tree.leaves(function.expand(*jax.tree.unflatten(function.in_tree, flat)))

            return jax.make_jaxpr(expanded)(*function.in_avals_flat)
        return next(value for value in self.parameters.values() if hasattr(value, "eqns") or hasattr(value, "jaxpr"))


def scan_sizes(equation: Equation, operands: list[np.ndarray]) -> tuple[int, int]:
    """How many operands of a scan are the same in all steps, and how many are carried from step to step.

    By the ranks, which those over the steps lose inside: JAX 0.12 names the parameters otherwise than 0.10.
    """
    jaxpr, _ = opened(equation.parameters["jaxpr"])
    carried = sum(len(shape) == v.aval.ndim for shape, v in zip(equation.shapes, jaxpr.outvars, strict=True))
    rows = sum(operand.ndim != v.aval.ndim for operand, v in zip(operands, jaxpr.invars, strict=True))
    return len(operands) - rows - carried, carried


def traced(function: Callable[..., Any], inputs: list[tuple[tuple[int, ...], str]]) -> Inner:
    """The jaxpr of a function of arrays, given by their shapes and types."""
    return jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(*each) for each in inputs))


def with_constants_as_inputs(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Inner, list[Any]]:
    """The jaxpr of a function that closes over arrays, which may be traced; they come first among its inputs."""
    closed = jax.make_jaxpr(function)(*arguments)

    def outside(constants: list[Any], *flat: Any) -> list[Any]:
        return called(core.ClosedJaxpr(closed.jaxpr, constants), flat)

    return jax.make_jaxpr(outside)(closed.consts, *jax.tree.leaves(arguments)), closed.consts


def called(closed: Inner, flat: Sequence[Any]) -> list[Any]:
    """The results of a jaxpr on arrays, by JAX."""
    return core.jaxpr_as_fun(closed)(*flat)


def opened(inner: Inner) -> tuple[Any, list[np.ndarray]]:
    """A jaxpr and the values of its constants."""
    jaxpr = inner.jaxpr if hasattr(inner, "consts") else inner
    return jaxpr, [np.asarray(value) for value in getattr(inner, "consts", [])]


def equations(jaxpr: Any) -> Iterator[tuple[Equation, list[Any], list[Any]]]:
    """Each equation with its operands and its results."""
    for e in jaxpr.eqns:
        shapes = [tuple(v.aval.shape) for v in e.outvars]
        dtypes = [v.aval.dtype.name for v in e.outvars]
        yield Equation(e.primitive.name, dict(e.params), shapes, dtypes), e.invars, e.outvars


def literal(operand: Any) -> np.ndarray | None:
    """The value of an operand that is written as a number; `None` of a variable."""
    if not isinstance(operand, core.Literal):
        return None
    kind: Any = operand.aval
    return np.asarray(operand.val, kind.dtype)
