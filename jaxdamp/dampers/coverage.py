"""Laws made from data hold where the data are: what they say of that, and the refusal of forces beyond."""

from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp.dampers.base import AbstractDamper


def coverage(law: AbstractDamper) -> str:
    """Where a law and the laws inside it hold, in words; empty if they hold everywhere."""
    return " ".join(filter(None, [law.validity(), *map(coverage, law.inner_laws())]))


def refuse_gaps(law: AbstractDamper, force: Any, where: str) -> None:
    """Refuse forces [N] of a law that are not finite (traced ones cannot be checked)."""
    found = _checks.concrete(force)
    if found is not None and not np.all(np.isfinite(found)):
        missing = f"{type(law).__name__} with none at {np.count_nonzero(~np.isfinite(found))} of {found.size} samples"
        _checks.refuse("law", f"give a finite force {where}", missing, coverage(law))
