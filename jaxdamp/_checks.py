"""Checks of arguments. Every message names the argument, shows its value and says what to do instead."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, NoReturn

import numpy as np
from jax.core import Tracer


def refuse(argument: str, must: str, value: Any, remedy: str = "") -> NoReturn:
    """Raise the `ValueError` that all checks share."""
    remedy = f" {remedy}" if remedy else ""
    raise ValueError(f"Argument `{argument}` must {must}, but is {value}.{remedy}")


def concrete(value: Any) -> np.ndarray | None:
    """The value as a NumPy array, or `None` while JAX traces it (traced values cannot be checked)."""
    return None if isinstance(value, Tracer) else np.asarray(value)


def _numbers(argument: str, value: Any) -> np.ndarray | None:
    """`concrete`, but refusing what is no number."""
    array = concrete(value)
    if array is not None and array.dtype.kind not in "biufc":
        refuse(argument, "be a number", described(value))
    return array


def finite(argument: str, value: Any, remedy: str = "Look for NaN or a division by zero where it was made.") -> None:
    """Refuse NaN and infinity."""
    array = _numbers(argument, value)
    if array is not None and not np.all(np.isfinite(array)):
        refuse(argument, "be finite", array, remedy)


def positive(argument: str, value: Any, remedy: str = "") -> None:
    """Refuse anything that is not finite and greater than zero."""
    array = _numbers(argument, value)
    if array is not None and not (np.all(np.isfinite(array)) and np.all(array > 0)):
        refuse(argument, "be positive and finite", array, remedy)


def nonnegative(argument: str, value: Any, remedy: str = "") -> None:
    """Refuse anything that is not finite and at least zero."""
    array = _numbers(argument, value)
    if array is not None and not (np.all(np.isfinite(array)) and np.all(array >= 0)):
        refuse(argument, "be finite and not negative", array, remedy)


def described(value: Any) -> str:
    """A value in a few words, with its type: "the text 'linear'", "the number 1500.0", "a HalfCar"."""
    if value is None:
        return "None"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, str):
        return f"the text {value!r}"
    if isinstance(value, bool | int | float | complex | np.number):
        return f"the number {value}"
    name = type(value).__name__
    name = "array" if isinstance(value, np.ndarray) or hasattr(value, "aval") else name
    article = "an" if name[0] in "AEIOUaeiou" else "a"
    if isinstance(value, list | tuple | set | dict):
        return f"{article} {name} of {len(value)}"
    return f"{article} {name}" + (f" of shape {np.shape(value)}" if hasattr(value, "shape") else "")


def instance(argument: str, value: Any, kinds: type | tuple[type, ...], must: str, remedy: str = "") -> None:
    """Refuse an object of another kind, such as a road where a vehicle belongs."""
    if not isinstance(value, kinds):
        refuse(argument, must, described(value), remedy)


def one_of(argument: str, value: str, choices: Iterable[str]) -> None:
    """Refuse a word that is not among the choices; suggest the nearest one."""
    choices = list(choices)
    if value not in choices:
        near = nearest(value, choices)
        hint = f"Did you mean {near!r}?" if near else ""
        refuse(argument, f"be one of {', '.join(map(repr, choices))}", repr(value), hint)


def nearest(value: str, choices: Iterable[str]) -> str | None:
    """The choice that a mistyped word is most like, if any is like it."""
    return next(iter(get_close_matches(value, list(choices), 1)), None)
