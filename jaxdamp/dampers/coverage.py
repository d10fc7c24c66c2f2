"""The valid range of laws from data, in words, and the refusal of forces outside it."""

from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp.dampers.base import AbstractDamper


def coverage(law: AbstractDamper) -> str:
    """The valid range of a law and of the laws inside, in words; empty without limits.

    Arguments:
        law: the damper law.
    """
    return " ".join(filter(None, [law.validity(), *map(coverage, law.inner_laws())]))


def require_finite_force(law: AbstractDamper, force: Any, where: str) -> None:
    """Refuse forces [N] of a law that are not finite (traced ones cannot be checked).

    Arguments:
        law: the damper law.
        force: its forces [N].
        where: for the message, such as "over the whole motion".
    """
    known = _checks.concrete(force)
    if known is not None and not np.all(np.isfinite(known)):
        missing = f"{type(law).__name__} with none at {np.count_nonzero(~np.isfinite(known))} of {known.size} samples"
        _checks.refuse("law", f"give a finite force {where}", missing, coverage(law))
