"""Warnings at the line of the user's code, however many functions of the library lie between."""

import inspect
import warnings


_INSIDE = ("jaxdamp", "jaxtyping", "beartype", "equinox", "jax", "contextlib", "functools")


def warn(text: str, kind: type[Warning] = UserWarning) -> None:
    """Warn at the line that called the library."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and _is_inside(frame.f_globals.get("__name__", ""), frame.f_code.co_filename):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, kind, stacklevel=level)


def _is_inside(module: str, file: str) -> bool:
    return module.split(".")[0] in _INSIDE or file.startswith("<@beartype")
