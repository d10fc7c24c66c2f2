"""Assertions that also hold where Python runs without its own (`python -O`), and their messages."""

from collections.abc import Callable
from typing import Any

import numpy as np


def require(condition: Any, message: str) -> None:
    """Raise an `AssertionError` with the message unless the condition holds."""
    if not condition:
        raise AssertionError(message)


def require_equal(found: Any, expected: Any, message: str, *, rtol: float = 0.0, atol: float = 0.0) -> None:
    """Raise an `AssertionError` with the message and the largest difference unless two arrays agree."""
    found, expected = np.asarray(found), np.asarray(expected)
    require(found.shape == expected.shape, f"{message} Their shapes are {found.shape} and {expected.shape}.")
    excess = np.abs(found - expected) - rtol * np.abs(expected)
    if found.size and not np.all(excess <= atol):
        worst = np.unravel_index(int(np.argmax(np.nan_to_num(excess, nan=np.inf))), found.shape)
        raise AssertionError(f"{message} The largest difference is {found[worst]!r} against {expected[worst]!r}.")


def require_refusal(
    call: Callable[[], Any], words: tuple[str, ...], kinds: tuple[type[Exception], ...], message: str
) -> None:
    """Raise an `AssertionError` with the message unless a call raises one of these errors and names what is wrong."""
    try:
        call()
    except kinds as error:
        text = str(error)
        require(any(word in text for word in words), f"{message} The error does not name it: {text}")
    else:
        raise AssertionError(f"{message} It is accepted.")
