"""Operations on numbers that are known when a program is printed."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np


# Only what IEEE 754 defines to the last bit: the text must not depend on the machine that prints it.
_EXACT: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "neg": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "max": np.maximum,
    "min": np.minimum,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "eq": np.equal,
    "ne": np.not_equal,
    "and": np.bitwise_and,
    "or": np.bitwise_or,
    "xor": np.bitwise_xor,
    "not": np.invert,
    "select": lambda chosen, yes, no: yes if chosen else no,
}


def folded(operation: str, values: Sequence[Any], dtype: str) -> Any:
    """The result of an operation on known numbers; `None` if it is left to the program."""
    if operation == "convert":
        return np.asarray(values[0]).astype(dtype)[()]
    with np.errstate(all="ignore"):
        if operation == "div" and dtype.startswith("float"):
            return np.divide(*values)
        return _EXACT[operation](*values) if operation in _EXACT else None


def simplified(operation: str, texts: Sequence[str]) -> int | None:
    """The operand that a sum or a product is equal to, where another one is zero or one and all numbers are finite.

    Arguments:
        operation: name of it.
        texts: the operands: numbers as Python writes them, or names.

    Returns:
        0 or 1, the place of the operand; None if no operand is the result.
    """
    zeros, ones = [text in ("0.0", "-0.0") for text in texts], [text == "1.0" for text in texts]
    if operation == "mul":
        return next((place for place in (0, 1) if zeros[place] or ones[1 - place]), None)
    if operation == "div":
        return 0 if zeros[0] or ones[1] else None
    if operation == "add" and zeros[0]:
        return 1
    return 0 if operation in ("add", "sub") and zeros[1] else None
