"""A condition between several parameters of a law, and the refusal of laws that violate one."""

from typing import Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import row, rows


class Condition(NamedTuple):
    """A lower limit of one parameter of a law that depends on its other parameters."""

    parameter: str
    least: Any  # in the unit of the parameter
    formula: str  # the limit in words
    reason: str  # the consequence of a lower value, a sentence


def check_conditions(law: Any) -> None:
    """Refuse parameters that violate a condition between them (inside `jax.jit` they are not known)."""
    values = rows(law) if law.has_conditions() else None
    if not values:
        return
    for index in range(len(values[0])):
        one = row(law, values, index)
        for condition in one.conditions():
            value = np.asarray(getattr(one, condition.parameter))
            if not np.all(value > condition.least):
                must = f"be above {condition.formula}, {np.array2string(np.asarray(condition.least), precision=4)}"
                _checks.refuse(f"{type(law).__name__}.{condition.parameter}", must, value, condition.reason)
