"""The changes and the end of a tuning, as records and in words."""

import numpy as np

from jaxdamp._status import Status
from jaxdamp.tune.ranges import FACTOR, SearchRange
from jaxdamp.tune.result import Change
from jaxdamp.tune.searching import Ended


def changes_of(space: SearchRange, values: np.ndarray) -> tuple[Change, ...]:
    """Every free number before and after, with its bounds."""
    free = space.free
    notes = [f"at its {side} bound" if side else "" for side in space.side(values)]
    columns = (free.names, space.start, values, free.owners, notes, space.lower, space.upper, free.followers)
    return tuple(
        Change(name, float(before), float(after), p.unit, note, float(lower), float(upper), followers)
        for name, before, after, p, note, lower, upper, followers in zip(*columns, strict=True)
    )


def bound_notes(space: SearchRange, changes: tuple[Change, ...]) -> list[str]:
    """A sentence for each number at a bound: which bound, and the remedy."""
    notes = []
    for change, origin in zip(changes, space.origin, strict=True):
        if not change.note:
            continue
        upper = "upper" in change.note
        widen = f"`bounds={{{change.name.partition('[')[0]!r}: (lower, upper)}}`"
        default = f"{FACTOR:g} times" if abs(change.after) > abs(change.before) else f"1/{FACTOR:g} of"
        reason = {
            "default": f"by default {default} its start; other bounds: {widen}",
            "given": "as given",
            "domain": "the end of the values it may take",
        }[origin[upper]]
        value = f"{change.after:.5g} {change.unit}".rstrip()
        notes.append(f"{change.name} ended {change.note}, {value} ({reason}). A better value may be beyond.")
    return notes


def early_end(ended: Ended, max_steps: int) -> str:
    """Why a search that satisfied all limits did not converge."""
    slope = f"the remaining slope is {ended.slope_left:.1e} of the metric per 100 % of the parameters"
    if ended.out_of_steps:
        return f"The search stopped after {max_steps} steps, before an optimum: {slope}. Allow more with `max_steps`."
    return (
        f"{Status.NO_BETTER_STEP.sentence.rstrip('.')}: {slope}. A peak has a kink where another instant becomes the "
        "largest. Compare with a tuning from another start."
    )
