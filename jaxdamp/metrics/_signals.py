"""Checks of signals, shared by the metrics."""

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._types import Signal, SignalLike


def as_signal(argument: str, signal: SignalLike, *, least: int = 1) -> Signal:
    """The signal as a JAX array, refused unless it has one axis and `least` samples."""
    array = jnp.asarray(signal)
    if array.ndim != 1:
        remedy = "Pass one channel at a time, or batch with jax.vmap."
        _checks.refuse(argument, "have one axis, time", f"of shape {array.shape}", remedy)
    if array.size < least:
        _checks.refuse(argument, f"hold at least {least} sample{'s' * (least > 1)}", f"of length {array.size}")
    return array


def same_length(first: str, one: Signal, second: str, other: Signal) -> None:
    """Refuse two signals of different length."""
    if one.shape != other.shape:
        remedy = "Cut or resample them to the same time base."
        _checks.refuse(second, f"be as long as `{first}` ({one.size} samples)", f"of length {other.size}", remedy)
