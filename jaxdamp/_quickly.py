"""Functions of one vehicle, compiled in a third to two thirds of the time: they take longer to compile than to run."""

import functools
import os
from collections.abc import Callable
from typing import Literal, TypeVar, cast

import equinox as eqx
import jax

from jaxdamp._traced import is_inside_program, is_traced


Function = TypeVar("Function", bound=Callable[..., object])
Level = Literal[0, 1] | None

LEVEL = "xla_backend_optimization_level"
FEW = 64  # vehicles side by side, up to which compiling takes most of the time
# The quicker one of two code generators, of which later versions of JAX have one.
_GENERATOR = {"xla_cpu_use_fusion_emitters": False} if jax.__version_info__ < (0, 11) else {}
OPTIONS: dict[Level, dict[str, int | bool] | None] = {
    0: {LEVEL: 0, **_GENERATOR},
    1: {LEVEL: 1, **_GENERATOR},
    None: None,
}


def options_of(level: Level, platform: str) -> dict[str, int | bool] | None:
    """Options of the compiler at a level; those that the user has where XLA_FLAGS states a level, but for level 0."""
    stated = level == 1 and LEVEL in os.environ.get("XLA_FLAGS", "")
    return None if stated or platform != "cpu" else OPTIONS[level]


def compiled_quickly(function: Function, level: Callable[..., Level] = lambda *_, **__: 0) -> Function:
    """`equinox.filter_jit` of a function, with less optimisation where it is called by itself on a CPU.

    Inside a function that JAX compiles, differentiates or batches, it is a part of that one.

    Arguments:
        function: of the vehicle.
        level: of its arguments: 0 for what is needed once, without optimisation; 1 for loops over time of one vehicle,
            which are about as fast as with all optimisation (up to a tenth slower), unless XLA_FLAGS states a level;
            None for the options that the user has.
    """

    @functools.cache
    def compiled(level: Level) -> Callable[..., object]:
        options = options_of(level, jax.default_backend())
        return eqx.filter_jit(function, compiler_options=options)  # pyright: ignore[reportCallIssue]

    @functools.wraps(function)
    def call(*args: object, **kwargs: object) -> object:
        part = is_inside_program() or is_traced((args, kwargs))
        return compiled(None if part else level(*args, **kwargs))(*args, **kwargs)

    return cast(Function, call)


def compiled_for_loops(function: Function) -> Function:
    """`compiled_quickly` at level 1."""
    return compiled_quickly(function, lambda *_, **__: 1)
