"""The changes and the end of a tuning, as records and in words."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp._status import Status
from jaxdamp.solve import Evaluation
from jaxdamp.tune.descending import Ended
from jaxdamp.tune.limits import Limit, LimitRange
from jaxdamp.tune.objective import Objective
from jaxdamp.tune.ranges import FACTOR, SearchRange
from jaxdamp.tune.result import Attempt, Change
from jaxdamp.tune.smooth import exact_counterpart


_ROUNDING = 1e-12  # of a metric, by which its derivative times the parameter counts as zero
ALIKE = 1e-3  # relative difference of metrics at ends that count as one optimum


def changes_of(space: SearchRange, values: np.ndarray) -> tuple[Change, ...]:
    """Every free number before and after, with its bounds."""
    free = space.free
    notes = [f"at its {side} bound" if side else "" for side in space.side(values)]
    zeros = np.abs(values) < _ROUNDING * np.abs(space.unit)
    columns = (
        free.names,
        space.start,
        np.where(zeros, 0.0, values),
        free.owners,
        notes,
        space.lower,
        space.upper,
        free.followers,
    )
    return tuple(
        Change(name, float(before), float(after), p.unit, note, float(lower), float(upper), followers)
        for name, before, after, p, note, lower, upper, followers in zip(*columns, strict=True)
    )


def bound_notes(space: SearchRange, changes: tuple[Change, ...]) -> list[str]:
    """A sentence on the numbers at bounds for each origin of these, and the remedy."""
    groups: dict[str, list[Change]] = {}
    for change, origin in zip(changes, space.origin, strict=True):
        if change.note:
            groups.setdefault(origin["upper" in change.note], []).append(change)
    notes = []
    for origin, group in groups.items():
        ends = [f"{c.name} ended {c.note}, {c.after:.5g} {c.unit}".rstrip() for c in group]
        widen = f"`bounds={{{group[0].name.partition('[')[0]!r}: (lower, upper)}}`"
        reason = {
            "default": f"by default 1/{FACTOR:g} of the start or {FACTOR:g} times it; other bounds: {widen}",
            "given": "as given",
            "domain": "the end of the values it may take",
        }[origin]
        notes.append(f"{'; '.join(ends)} ({reason}). A better value may be beyond.")
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


def missed_notes(short: Sequence[Limit], values: Mapping[str, float], changes: Sequence[Change]) -> list[str]:
    """A sentence for each metric or shape that violates its limit, at its worst place, with what binds it."""
    worst: dict[str, Limit] = {}
    for limit in sorted(short, key=lambda limit: limit.margin(values[limit.name])):
        worst.setdefault(limit.of, limit)
    bounds = [change.name for change in changes if change.note]
    bound = f" The search is held by the bounds of {', '.join(bounds)}." if bounds else ""
    together = f" Not met together: {', '.join(worst)}." if len(worst) > 1 else ""
    return [
        f"The limit {limit.name} {limit.nearer(values[limit.name])} is not met: {values[limit.name]:.4g}. Relax it, or "
        f"free more.{together}{bound}"
        for limit in worst.values()
    ]


def true_value_notes(
    objective: Objective, values: Mapping[str, float], before: Mapping[str, float], allowed: Mapping[str, LimitRange]
) -> list[str]:
    """A sentence for each limit on a smooth metric that the true one does not meet."""
    notes = []
    for metric in objective.metrics:
        exact = exact_counterpart(metric)
        if exact is not None and metric.name in allowed:
            lower, upper = allowed[metric.name].at(before[metric.name])
            if not lower <= values[exact.name] <= upper:
                beyond = f"the true {exact.name} is {values[exact.name]:.4g}, beyond the limit"
                notes.append(f"{metric.name} is limited, but {beyond}.")
    return notes


def active_words(
    held: Sequence[Limit],
    values: Mapping[str, float],
    changes: Sequence[Change],
    space: SearchRange,
    ended: np.ndarray,
) -> tuple[str, ...]:
    """What holds the search, in words: limits, shapes, bounds, and neighbours in ordered vectors."""
    groups: dict[str, list[str]] = {}
    for limit in held:
        text = f"{limit.of} {limit.nearer(values[limit.name])}"
        groups.setdefault(text, []).append(limit.name.removeprefix(limit.of))
    words = []
    for text, (first, *others) in groups.items():
        more = f" and {len(others)} more places" if others else ""
        words.append(f"{text},{first}{more}" if first else text)
    words += [
        f"{change.name} {change.note}, {change.after:.4g} {change.unit}".rstrip() for change in changes if change.note
    ]
    rows, gaps = space.coordinates.order()
    touching = np.abs(rows @ (ended / space.unit) - gaps) < 1e-9 if gaps.size else np.zeros(0, bool)
    pairs = (np.array(space.free.names)[row != 0] for row in rows[touching])
    return (*words, *(f"{' = '.join(pair)}, which must increase" for pair in pairs))


def start_notes(attempts: Sequence[Attempt], metric: str) -> list[str]:
    """How many searches ended at the best optimum, if not all did."""
    if not attempts:
        return []
    allowed = [a.metric for a in attempts if a.meets_limits] or [a.metric for a in attempts]
    best, furthest = min(allowed), max(allowed)
    alike = sum(value - best <= ALIKE * abs(best) for value in allowed)
    if alike == len(attempts):
        return []
    rest = f", the worst at {furthest:.5g}" if furthest - best > ALIKE * abs(best) else ""
    unmet = len(attempts) - len(allowed)
    failed = f", and {unmet} met no limits" if unmet and unmet < len(attempts) else ""
    return [f"{alike} of {len(attempts)} starts ended at the best {metric}, {best:.5g}{rest}{failed}."]


def violations(short: Sequence[Limit], values: Mapping[str, float]) -> dict[str, str]:
    """Each metric or shape beyond its limit, in words, at its worst place."""
    worst = sorted(short, key=lambda limit: limit.margin(values[limit.name]), reverse=True)
    return {
        limit.of: f"{limit.name} is {values[limit.name]:.4g}, and must be {limit.nearer(values[limit.name])}"
        for limit in worst
    }


def tightened_notes(limits: Sequence[Limit], searched: Sequence[Limit]) -> list[str]:
    """A sentence on the limits that were tighter in the search than they are."""
    pairs = zip(limits, searched, strict=True)
    tight = [one.name for one, other in pairs if (one.lower, one.upper) != (other.lower, other.upper)]
    words = "Tightened on the road of the tuning, so that they hold on others: the limits of"
    return [f"{words} {', '.join(tight)}."] if tight else []


def workshop_notes(space: SearchRange) -> list[str]:
    """A sentence on the free parameters that no workshop can change."""
    fixed = [p.path for p in space.free.chosen if not p.adjustable]
    return [f"No workshop can change {', '.join(fixed)}: what was tuned cannot be built as it is."] if fixed else []


def without_effect(space: SearchRange, sides: tuple[Evaluation, Evaluation], ended: np.ndarray) -> tuple[str, ...]:
    """The parameters by which the derivative of the metric is zero at the start and at the end, but for rounding.

    Arguments:
        space: the free parameters.
        sides: metric and derivatives at the start and at the end.
        ended: the values at the end.
    """
    idle = np.ones(len(ended), bool)
    for at, (_, rows, slopes) in zip((space.start, ended), sides, strict=True):
        rounded = np.abs(slopes[0] * at / space.unit) <= _ROUNDING * abs(rows[0])
        idle &= (slopes[0] == 0.0) | (rounded & (at != 0.0))
    return tuple(name for name, none in zip(space.free.names, idle, strict=True) if none)


def effect_notes(idle: Sequence[str], metric: str) -> list[str]:
    """A sentence on the parameters without effect."""
    if not idle:
        return []
    theirs = "their tuned values say" if len(idle) > 1 else "its tuned value says"
    remedy = "Free others, or choose another metric or road."
    return [f"No effect on {metric}: {', '.join(idle)}; {theirs} nothing. {remedy}"]
