"""Checks of arguments. Every message contains the argument, its value and the remedy.

JAX is imported where numbers are checked, so that a command which refuses a path need not wait for it.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NoReturn

import numpy as np


MOST_SHOWN = 8  # largest number of array elements shown in a message


class ArgumentError(ValueError):
    """A value that an argument must not have.

    `str(error)` refers to arguments in Python. Its parts are stored separately, so that the command line can refer to
    options instead.

    Attributes:
        argument: name of the argument at fault; empty if a file is at fault.
        settings: the arguments with values that the message mentions, each as `str(setting)`.
        where: the file or table with which the message begins; empty if it is about no file.
    """

    def __init__(self, message: str, *settings: "Setting", argument: str = "") -> None:
        super().__init__(message)
        self.argument = argument
        self.settings = settings
        self.where = ""


@dataclass(frozen=True)
class Setting:
    """An argument with its value, as written in a message.

    Attributes:
        argument: name of the argument.
        value: its value, which may be a mapping; an ellipsis stands for a value that the user must fill in.

    >>> str(Setting("sign", "rebound-positive")), str(Setting("columns", {"time": None, "stroke": ...}))
    ('sign="rebound-positive"', 'columns={"time": None, "stroke": ...}')
    """

    argument: str
    value: object = ...

    def __str__(self) -> str:
        return f"{self.argument}={_literal(self.value)}"


def _literal(value: object) -> str:
    """A value as Python source, with double quotes."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_literal(key)}: {_literal(item)}" for key, item in value.items()) + "}"
    if isinstance(value, str) and '"' not in value:
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:g}"
    return "..." if value is ... else repr(value)


def refuse(argument: str, must: str, value: object, remedy: str = "", *settings: Setting) -> NoReturn:
    """Raise the common error of all checks; `settings` are those that the remedy mentions."""
    remedy = f" {remedy}" if remedy else ""
    message = f"Argument `{argument}` must {must}, but is {summary(value)}.{remedy}"
    raise ArgumentError(message, *settings, argument=argument)


def summary(value: Any, wrong: np.ndarray | None = None) -> object:
    """A value as shown in a message: of many numbers only their count and the first wrong one.

    Arguments:
        value: any value.
        wrong: for an array, which of its numbers are wrong.

    >>> summary(np.linspace(0.0, 1.0, 101))
    '101 numbers from 0 to 1'
    >>> summary(np.array([1.0, -2.0] * 10), np.array([False, True] * 10))
    '20 numbers, 10 of them wrong, the first -2 at index 1'
    """
    if not (isinstance(value, np.ndarray) or hasattr(value, "aval")) or value.size <= MOST_SHOWN:
        return value
    array = np.asarray(value)
    shape = "" if array.ndim == 1 else f" in shape {array.shape}"
    if wrong is None or not np.any(wrong):
        spread = f" from {array.min():.6g} to {array.max():.6g}" if np.issubdtype(array.dtype, np.number) else ""
        return f"{array.size} numbers{shape}{spread}"
    first = np.argwhere(wrong)[0].tolist()
    index = first[0] if len(first) == 1 else tuple(first)
    count = np.count_nonzero(wrong)
    return f"{array.size} numbers{shape}, {count} of them wrong, the first {array[tuple(first)]:.6g} at index {index}"


def concrete(value: object) -> np.ndarray | None:
    """The value as a NumPy array, or `None` while JAX traces it.

    Under `jax.grad` too, so that what is computed with it keeps its derivatives; checks take `_traced.behind`.
    """
    from jax.core import Tracer

    return None if isinstance(value, Tracer) else np.asarray(value)


def _numbers(argument: str, value: object) -> np.ndarray | None:
    """The value, also behind derivatives and batches; None inside `jax.jit`. What is no real number is refused.

    So is a process where JAX would hang: what checks its numbers here goes on to compute with them.
    """
    from jaxdamp._forked import refuse_fork
    from jaxdamp._traced import behind

    refuse_fork()
    array = behind(value)
    if array is not None and array.dtype.kind not in "biuf":
        refuse(argument, "be a real number" if array.dtype.kind == "c" else "be a number", described(value))
    return array


def finite(argument: str, value: object, remedy: str = "Look for NaN or a division by zero where it was made.") -> None:
    """Refuse NaN and infinity."""
    array = _numbers(argument, value)
    if array is not None and not np.all(np.isfinite(array)):
        refuse(argument, "be finite", summary(array, ~np.isfinite(array)), remedy)


def positive(argument: str, value: object, remedy: str = "") -> None:
    """Refuse anything that is not finite and greater than zero."""
    array = _numbers(argument, value)
    if array is not None and not (np.all(np.isfinite(array)) and np.all(array > 0)):
        refuse(argument, "be positive and finite", summary(array, ~(np.isfinite(array) & (array > 0))), remedy)


COLDEST = 150.0  # K, below which no damper works: such a number is in degrees Celsius


def kelvin(argument: str, value: object) -> None:
    """Refuse temperatures that cannot be in kelvin."""
    array = _numbers(argument, value)
    if array is not None and not (np.all(np.isfinite(array)) and np.all(array > COLDEST)):
        wrong = summary(array, ~(np.isfinite(array) & (array > COLDEST)))
        refuse(argument, f"be in kelvin, above {COLDEST:g}", wrong, "Of a temperature in °C, write it plus 273.15.")


def untraced(
    argument: str, tree: object, remedy: str = "Call it outside `jax.jit`, `jax.grad` and `jax.vmap`."
) -> None:
    """Refuse a tree with numbers that JAX traces, where numbers must be known and derivatives do not pass."""
    from jaxdamp._traced import is_traced

    if is_traced(tree):
        refuse(argument, "have numbers that are known", "traced", remedy)


def plain_number(argument: str, value: object, remedy: str = "Close over a plain number.") -> float:
    """A number that must be known before a program is compiled, and takes no part in derivatives."""
    array = None if concrete(value) is None else _numbers(argument, value)
    if array is None or array.ndim:
        must = "be one plain number" if array is not None else "be a plain number, on which the length of a run depends"
        refuse(argument, must, "traced" if array is None else f"of shape {array.shape}", remedy)
    return float(array)


def nonnegative(argument: str, value: object, remedy: str = "") -> None:
    """Refuse anything that is not finite and at least zero."""
    array = _numbers(argument, value)
    if array is not None and not (np.all(np.isfinite(array)) and np.all(array >= 0)):
        wrong = ~(np.isfinite(array) & (array >= 0))
        refuse(argument, "be finite and not negative", summary(array, wrong), remedy)


def described(value: Any) -> str:
    """A value in a few words, with its type: "the text 'linear'", "the number 1500.0", "a HalfCar"."""
    if value is None or isinstance(value, bool):
        return str(value)
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, str):
        return f"the text {value!r}"
    if isinstance(value, int | float | complex | np.number):
        return f"the number {value}"
    name = type(value).__name__
    name = "array" if isinstance(value, np.ndarray) or hasattr(value, "aval") else name
    article = "an" if name[0] in "AEIOUaeiou" else "a"
    if isinstance(value, list | tuple | set | dict):
        return f"{article} {name} of {len(value)}"
    return f"{article} {name}" + (f" of shape {np.shape(value)}" if hasattr(value, "shape") else "")


def instance(argument: str, value: object, kinds: type | tuple[type, ...], must: str, remedy: str = "") -> None:
    """Refuse an object of a wrong type, such as a road instead of a vehicle."""
    if not isinstance(value, kinds):
        refuse(argument, must, described(value), remedy)


def counts(**values: int | None) -> None:
    """Refuse counts that are not whole or below one; None stands for one that was left out."""
    for argument, value in values.items():
        if value is not None and (not hasattr(value, "__index__") or np.ndim(value)):
            refuse(argument, "be a whole number", described(value))
        if value is not None and value < 1:
            refuse(argument, "be 1 or more", value)


def seed(value: int) -> None:
    """Refuse a seed of NumPy's generators that is not a whole number from zero on."""
    if not hasattr(value, "__index__") or np.ndim(value) or value < 0:
        refuse("seed", "be a whole number, 0 or more", described(value))


def part_of(argument: str, text: str) -> tuple[int, int]:
    """The number of a part, and of how many.

    >>> part_of("block", "17/200")
    (17, 200)
    """
    match = re.fullmatch(r"\s*(\d+)\s*/\s*(\d+)\s*", text)
    part, parts = map(int, match.groups()) if match else (0, 0)
    if not 1 <= part <= parts:
        remedy = "Number the parts from 1: in an array job of 4, '1/4' to '4/4'."
        refuse(argument, "be a part such as '1/4'", repr(text), remedy)
    return part, parts


def one_of(argument: str, value: str, choices: Iterable[str]) -> None:
    """Refuse a text that is not among the choices; suggest the nearest one."""
    choices = list(choices)
    if not isinstance(value, str):  # which may be an array, and is near to no word
        refuse(argument, f"be one of {', '.join(map(repr, choices))}", described(value))
    if value not in choices:
        near = nearest(value, choices)
        hint = f"Did you mean {near!r}?" if near else ""
        refuse(argument, f"be one of {', '.join(map(repr, choices))}", repr(value), hint)


def nearest(value: str, choices: Iterable[str]) -> str | None:
    """The choice that is most similar to a mistyped word, if any."""
    return next(iter(get_close_matches(value, list(choices), 1)), None)
