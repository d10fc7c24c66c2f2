"""Checks of signals and a safe root, shared by the metrics."""

import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork
from jaxdamp._types import ScalarLike, Signal, SignalLike


def as_signal(argument: str, signal: SignalLike, *, least: int = 1) -> Signal:
    """The signal as a JAX array of floats, refused unless it has one axis and `least` samples."""
    refuse_fork()
    array = jnp.asarray(signal)
    if not jnp.issubdtype(array.dtype, jnp.inexact):
        array = array.astype(float)
    if array.ndim != 1:
        remedy = "Pass one channel at a time, or batch with jax.vmap."
        _checks.refuse(argument, "have one axis, time", f"of shape {array.shape}", remedy)
    if array.size < least:
        _checks.refuse(argument, f"hold at least {least} sample{'s' * (least > 1)}", f"of length {array.size}")
    return array


def as_numbers(*values: ArrayLike) -> list[Array]:
    """Numbers or arrays of them as floats of one type, the one that JAX finds for all."""
    refuse_fork()
    dtype = jnp.result_type(*values)
    dtype = dtype if jnp.issubdtype(dtype, jnp.floating) else jnp.result_type(float)
    return [jnp.asarray(value, dtype) for value in values]


def same_length(first: str, one: Signal, second: str, other: Signal) -> None:
    """Refuse two signals of different length."""
    if one.shape != other.shape:
        remedy = "Cut or resample them to the same time base."
        _checks.refuse(second, f"be as long as `{first}` ({one.size} samples)", f"of length {other.size}", remedy)


def check_interval(dt: ScalarLike | int) -> None:
    """Refuse a sampling interval that is not positive and finite."""
    _checks.positive("dt", dt, "It is the sampling interval in s.")
