"""Functions of one vehicle that take longer to compile than to run: compiled in a third of the time."""

import functools
from collections.abc import Callable
from typing import TypeVar, cast

import equinox as eqx
import jax

from jaxdamp._traced import is_inside_program, is_traced


Function = TypeVar("Function", bound=Callable[..., object])

# Without optimisation, and by the quicker one of two code generators, of which later versions of JAX have one.
OPTIONS: dict[str, int | bool] = {"xla_backend_optimization_level": 0}
if jax.__version_info__ < (0, 11):
    OPTIONS["xla_cpu_use_fusion_emitters"] = False


def compiled_quickly(function: Function, small: Callable[..., bool] = lambda *_, **__: True) -> Function:
    """`equinox.filter_jit` of a function; without optimisation where it is called by itself on a CPU.

    Inside a function that JAX compiles, differentiates or batches, it is a part of that one.

    Arguments:
        function: of the vehicle.
        small: whether its arguments are so few numbers that it runs for a shorter time than it compiles.
    """
    part = eqx.filter_jit(function)
    alone = eqx.filter_jit(function, compiler_options=OPTIONS)  # pyright: ignore[reportCallIssue]

    @functools.wraps(function)
    def call(*args: object, **kwargs: object) -> object:
        by_itself = small(*args, **kwargs) and not is_inside_program() and not is_traced((args, kwargs))
        return (alone if by_itself and jax.default_backend() == "cpu" else part)(*args, **kwargs)

    return cast(Function, call)
