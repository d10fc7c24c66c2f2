"""Laws made from data have a force where the data are: where that is, in words, and the refusal of other forces."""

from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp.dampers.base import AbstractDamper


def coverage(law: AbstractDamper) -> str:
    """Where a law and the laws inside it hold, in words; empty if they hold everywhere."""
    return " ".join(filter(None, [law.validity(), *map(coverage, law.inner_laws())]))


def require_finite_force(law: AbstractDamper, force: Any, where: str) -> None:
    """Refuse forces [N] of a law that are not finite (traced ones cannot be checked)."""
    known = _checks.concrete(force)
    if known is not None and not np.all(np.isfinite(known)):
        missing = f"{type(law).__name__} with none at {np.count_nonzero(~np.isfinite(known))} of {known.size} samples"
        _checks.refuse("law", f"give a finite force {where}", missing, coverage(law))
