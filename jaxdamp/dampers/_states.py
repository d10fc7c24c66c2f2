"""Checks of the states that a law is given."""

from typing import NoReturn

from jaxdamp import _checks
from jaxdamp._types import Scalar, State
from jaxdamp.parameters import Module


def own_states(law: Module, state: State, count: int) -> list[Scalar]:
    """The states as a list of scalars, after a check of their number.

    Arguments:
        law: the damper law.
        state: its states, shape (count,).
        count: number of states that the law has.
    """
    if state.size != count:
        refuse_number(state, f"{count} number{'s' * (count != 1)} for {type(law).__name__}")
    return list(state)


def refuse_number(state: State, right: str) -> NoReturn:
    """Refuse another number of states than the right one, in words."""
    _checks.refuse("state", f"hold {right}", f"of shape {state.shape}", "Start from `law.initial_state()`.")
