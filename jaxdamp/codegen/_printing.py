"""Whether a function is being traced to be printed: it may then choose operations that other languages have."""

from contextlib import AbstractContextManager

import jax


# Part of the key of compiled functions: what was traced to be printed is not taken for what XLA runs.
_PRINTING = jax.make_user_context(False)


def printing() -> AbstractContextManager[None]:
    """Functions traced inside are printed."""
    return _PRINTING(True)


def is_printing() -> bool:
    """Whether the function that is being traced will be printed: it best uses elementary functions of a C library."""
    return bool(_PRINTING.value)
