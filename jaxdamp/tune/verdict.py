"""What came out of a tuning, in words: better or not, by how much, at what price, what holds it, and doubts."""

import enum
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jaxdamp._status import Status
from jaxdamp._tables import percentage
from jaxdamp.metrics import Metric
from jaxdamp.solve import Evaluation
from jaxdamp.tune.limits import Limit, LimitRange, amount, excess, in_each, lost_limits
from jaxdamp.tune.objective import Objective
from jaxdamp.tune.ranges import Change, SearchRange
from jaxdamp.tune.smooth import exact_counterpart
from jaxdamp.vehicles import AbstractVehicle, ChannelKind


if TYPE_CHECKING:
    from jaxdamp.tune.descending import Ended
    from jaxdamp.tune.result import Attempt, TuneResult


PRICED = (  # kinds of channels whose rise is a price: of body, travel and tyres, not the speed and power of the damper
    ChannelKind.HEIGHT, ChannelKind.ANGLE, ChannelKind.ACCELERATION, ChannelKind.ANGULAR_ACCELERATION,
    ChannelKind.STROKE, ChannelKind.TYRE_LOAD, ChannelKind.RELATIVE_TYRE_LOAD,
)  # fmt: skip
NOTICED = 0.05  # percent: smaller changes are none
SAME = 1e-3  # relative: nearer changes are those of one thing, as of the tyre load and its coefficient


def relative_change(before: float, after: float) -> float | None:
    """The change relative to the size before [%], positive where it rises, also of what is negative; none from zero."""
    return 100.0 * (after - before) / abs(before) if before else None


def signed_metrics(result: "TuneResult[AbstractVehicle]") -> set[str]:
    """Names of the metrics that may be negative, of which a change in percent says nothing."""
    metrics = (*result.start.layout.metrics, *(result.objective.metrics if result.objective else ()))
    return {metric.name for metric in metrics if metric.statistic.signed}


def change_in_percent(result: "TuneResult[AbstractVehicle]", name: str, before: float, after: float) -> float | None:
    """The change of a metric [%]; none from zero, and none of one that may be negative.

    Arguments:
        result: of the tuning.
        name: of the metric.
        before: its value at the start, in its unit.
        after: its value at the end, in its unit.
    """
    return None if name in signed_metrics(result) else relative_change(before, after)


def mean_change(result: "TuneResult[AbstractVehicle]", name: str) -> float | None:
    """The change of a metric [%], the mean on fresh roads if there are any; none as of `change_in_percent`."""
    if result.fresh is None or name not in result.fresh.before or name in signed_metrics(result):
        return change_in_percent(result, name, result.before[name], result.after[name])
    change = 100.0 * float(np.mean(result.fresh.change(name)))
    return change if np.isfinite(change) else None


class Outcome(enum.Enum):
    """What a tuning came to: compare with `is` in code; the value is the heading of a page on it."""

    BETTER = "A better damper"
    TRADE = "A trade, not a better damper"
    NOT_SHOWN = "Not shown to be better"
    NOT_BETTER = "No better damper"
    EXTRAPOLATED = "Not known to be better: outside the records"
    LIMIT_LOST = "No better damper: beyond its limits on other roads"
    LIMIT_NOT_MET = "No damper within the limits"


class Verdict(NamedTuple):
    """The outcome of a tuning and the sentence that says it."""

    outcome: Outcome  # what it came to
    sentence: str  # with its numbers

    @property
    def better(self) -> bool:
        """Whether the tuned vehicle may be called better than the start."""
        return self.outcome is Outcome.BETTER


def verdict_of(result: "TuneResult[AbstractVehicle]") -> Verdict:
    """The verdict on a tuning: on fresh roads if there are any, otherwise on the road of the tuning."""
    outside = f" by the law, but outside its records ({'; '.join(result.extrapolated)})" * bool(result.extrapolated)
    gain, words = _change(result)
    words += outside
    if result.violated:
        missed = "; ".join(result.violated.values())
        return Verdict(Outcome.LIMIT_NOT_MET, f"Limit not met: {missed}. {words}.")
    price, name = _price(result)
    cost = f"; price: {name} {percentage(price)}" if name else "; nothing else gets worse"
    held = _limits_in_words(result)
    error = 0.0 if result.fresh is None else 100.0 * result.fresh.half_width(result.metric)
    over = lost_limits(result.fresh, _allowed(result))
    lost = [f"{name} is {percentage(100 * x).removeprefix('+')} beyond its limit" for name, x in over.items()]
    if lost:
        outcome, first, held = Outcome.LIMIT_LOST, f"Not better: {'; '.join(lost)}; {words}", ""
    elif _is_none(gain, error):
        outcome, first = Outcome.NOT_BETTER, f"Not better, the start is as good: {words}"
    elif gain - error > -NOTICED and (result.fresh is None or gain > 0.0):
        outcome, first = Outcome.NOT_BETTER, f"Not better: {words}"
    elif not gain + error < -NOTICED:
        outcome, first = Outcome.NOT_SHOWN, f"Not shown to be better: {words}"
    elif result.extrapolated:
        outcome, first = Outcome.EXTRAPOLATED, f"Not known to be better: {words}"
    elif name and price > -gain:
        outcome, first = Outcome.TRADE, f"A trade: {words}"
    else:
        outcome, first = Outcome.BETTER, f"Better: {words}"
    return Verdict(outcome, f"{first}{cost}{held}.")


def _is_none(gain: float, error: float) -> bool:
    """Whether a gain of so many percent, with its error, is none."""
    return abs(gain) <= NOTICED and (error <= NOTICED or gain == 0.0)


def _allowed(result: "TuneResult[AbstractVehicle]", name: str = "") -> dict[str, LimitRange]:
    """The range of each limited metric, or of one of them, in every scenario."""
    allowed = {one: span for one, span in result.allowed.items() if name in ("", one)}
    return in_each(allowed, result.scenarios.names if result.scenarios else ())


def _change(result: "TuneResult[AbstractVehicle]") -> tuple[float, str]:
    """The change of the objective [%] and its words, with its interval and the roads that it holds for."""
    fresh, name = result.fresh, result.metric
    signed = name in signed_metrics(result)
    if fresh is None or not np.all(np.isfinite(fresh.change(name))):
        here = change_in_percent(result, name, result.before[name], result.after[name])
        sides = result.before[name], result.after[name]
        share = amount(sides[1], result.units[name], sides[0]) if here is None else percentage(here)
        change = relative_change(*sides)  # a change from zero is judged as one of 100 %, whatever the unit
        change = 100.0 * float(np.sign(sides[1] - sides[0])) if change is None else change
        return change, f"{name} {share} {result.elsewhere or 'on the road of the tuning'}"
    mean, half = 100.0 * float(np.mean(fresh.change(name))), 100.0 * fresh.half_width(name)
    roads = _fresh_roads(result) if fresh.roads > 1 else "1 fresh road, which gives no interval"
    sides = float(fresh.before[name].mean()), float(fresh.after[name].mean())
    share = amount(sides[1], result.units[name], sides[0]) if signed else percentage(mean, half)
    return mean, f"{name} {share} on {roads}"


def _fresh_roads(result: "TuneResult[AbstractVehicle]") -> str:
    """How many fresh roads there are, in words; of a tuning in scenarios each draw is one of all their roads."""
    count = 0 if result.fresh is None else result.fresh.roads
    return f"{count} fresh {'draws of the roads' if result.scenarios else 'roads'}"


def _price(result: "TuneResult[AbstractVehicle]") -> tuple[float, str]:
    """The largest rise of a metric of body, suspension travel or tyres [%], and its name; none if nothing rises.

    What is limited has its own words, and so have the metrics of its channel and those that change as it does.
    """
    metrics = {m.name: m for m in result.objective.metrics} if result.objective else {}
    named = {result.metric, *result.limits}
    limited = {metrics[name].channel for name in result.limits if name in metrics}
    changes = {mean_change(result, name) for name in named}
    worst = (NOTICED, "")
    for name in result.units:
        change, metric = mean_change(result, name), metrics.get(name)
        if change is None or name in named or any(x is not None and np.isclose(change, x, SAME) for x in changes):
            continue
        if metric is None or (metric.channel not in limited and _has_price(metric, result.start)):
            worst = max(worst, (change, name))
    return worst


def _has_price(metric: Metric, vehicle: AbstractVehicle) -> bool:
    """Whether a rise of a metric is a price."""
    return not metric.statistic.signed and vehicle.layout.by_name[metric.channel].kind in PRICED


def at_limit(result: "TuneResult[AbstractVehicle]", name: str) -> str:
    """How a metric stands at its limit, in words; nothing for one that does not."""
    which = "tightened limit" if name in result.tightened else "limit"
    return f"at its {which}" if name in result.active_limits else ""


def _limits_in_words(result: "TuneResult[AbstractVehicle]") -> str:
    """How much of each limit is used, and on how many fresh roads it is broken."""
    texts = []
    for name in result.limits:
        after, change = result.after[name], mean_change(result, name)
        share = amount(after, result.units[name]) if change is None else percentage(change)
        text = f"{name} {share}{', ' * (name in result.active_limits)}{at_limit(result, name)}"
        if (fresh := result.fresh) is not None and name in result.allowed:
            over = [excess(fresh, one, span) for one, span in _allowed(result, name).items()]
            beyond = int(np.sum(np.max(over, axis=0) > _ROUNDING))
            text += f", beyond it on {beyond} of {_fresh_roads(result)}" * bool(beyond)
        texts.append(text)
    return f"; limits: {'; '.join(texts)}" if texts else ""


_ROUNDING = 1e-12  # of a metric, by which its derivative times the parameter counts as zero
ALIKE = 1e-3  # relative difference of metrics at ends that count as one optimum
MOST_NAMED = 2  # numbers at bounds that are named with their values; of more, the table of parameters has them


def bound_notes(space: SearchRange, changes: tuple[Change, ...]) -> list[str]:
    """A sentence on the numbers at bounds for each origin of these, and the remedy."""
    groups: dict[str, list[Change]] = {}
    for change, origin in zip(changes, space.origin, strict=True):
        if change.note:
            groups.setdefault(origin["upper" in change.note], []).append(change)
    notes = space.notes_without_range(changes)
    for origin, group in groups.items():
        ends = [f"{c.name} ended {c.note}, {amount(c.after, c.unit)}" for c in group]
        if len(group) > MOST_NAMED:
            counts = Counter(c.name.partition("[")[0] for c in group)
            of = ", ".join(f"{count} of {path}" if count > 1 else path for path, count in counts.items())
            ends = [f"{len(group)} parameters ended at their bounds: {of}"]
        widen = f"`bounds={{{group[0].name.partition('[')[0]!r}: (lower, upper)}}`"
        reason = {
            "default": f"by default, in proportion to the start; other bounds: {widen}",
            "given": "as given",
            "domain": f"the end of the values {'they' if len(group) > 1 else 'it'} may take",
        }[origin]
        notes.append(f"{'; '.join(ends)} ({reason}). A better value may be beyond.")
    return notes


def early_end(ended: "Ended", max_steps: int) -> str:
    """Why a search that satisfied all limits did not converge."""
    slope = f"the remaining slope is {ended.slope_left():.1e} of the metric per 100 % of the parameters"
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
        f"The limit {limit.name} {limit.nearer(values[limit.name])} is not met: "
        f"{amount(values[limit.name], limit.unit)}. Relax it, or free more.{together}{bound}"
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
    tightened: Sequence[str],
) -> tuple[str, ...]:
    """What holds the search, in words: limits, shapes, bounds, and neighbours in ordered vectors."""
    groups: dict[str, list[str]] = {}
    for limit in held:
        text = f"{limit.of} {limit.nearer(values[limit.name])}{' (tightened)' * (limit.of in tightened)}"
        groups.setdefault(text, []).append(limit.name.removeprefix(limit.of))
    words = []
    for text, (first, *others) in groups.items():
        more = f" and {len(others)} more places" if others else ""
        words.append(f"{text},{first}{more}" if first else text)
    words += [f"{change.name} {change.note}, {amount(change.after, change.unit)}" for change in changes if change.note]
    rows, gaps = space.coordinates.order()
    touching = np.abs(rows @ (ended / space.unit) - gaps) < 1e-9 if gaps.size else np.zeros(0, bool)
    pairs = (np.array(space.free.names)[row != 0] for row in rows[touching])
    return (*words, *(f"{' = '.join(pair)}, which must increase" for pair in pairs))


def start_notes(attempts: Sequence["Attempt"], metric: str) -> list[str]:
    """How many searches ended at the best optimum, if not all did."""
    if not attempts:
        return []
    allowed = [a.metric for a in attempts if a.meets_limits] or [a.metric for a in attempts]
    best, furthest = min(allowed), max(allowed)
    alike = sum(value - best <= ALIKE * abs(best) for value in allowed)
    if alike == len(attempts):
        return []
    worst = f", the worst at {furthest:.5g}" if furthest - best > ALIKE * abs(best) else ""
    unmet = len(attempts) - len(allowed)
    failed = f", and {unmet} met no limits" if unmet and unmet < len(attempts) else ""
    return [f"{alike} of {len(attempts)} starts ended at the best {metric}, {best:.5g}{worst}{failed}."]


def violations(short: Sequence[Limit], values: Mapping[str, float]) -> dict[str, str]:
    """Each metric or shape beyond its limit, in words, at its worst place."""
    worst = sorted(short, key=lambda limit: limit.margin(values[limit.name]), reverse=True)
    at = {limit.of: (limit, values[limit.name]) for limit in worst}
    return {
        name: f"{limit.name} is {amount(value, limit.unit)}, and must be {limit.nearer(value)}"
        for name, (limit, value) in at.items()
    }


def tightened_notes(tightened: Sequence[str]) -> list[str]:
    """A sentence on the metrics whose limits were tighter in the search than they are."""
    words = "Tightened on the road of the tuning, so that they hold on others: the limits of"
    return [f"{words} {', '.join(tightened)}."] if tightened else []


def workshop_notes(space: SearchRange) -> list[str]:
    """A sentence on the free parameters that no workshop can change, one on those that no record determined."""
    fixed = [p.path for p in space.free.chosen if not p.adjustable]
    notes = [f"No workshop can change {', '.join(fixed)}: what was tuned cannot be built as it is."] if fixed else []
    left = ", ".join(space.undetermined)
    return [*notes, f"Not tuned, since the records of the fit do not determine it: {left}."] if left else notes


def without_effect(space: SearchRange, sides: tuple[Evaluation, Evaluation], ended: np.ndarray) -> tuple[str, ...]:
    """The parameters by which metric and limits have derivatives of zero at the start and the end, but for rounding.

    Choices are left out: other values may have an effect.
    """
    idle = ~space.is_choice
    for at, (_, rows, slopes) in zip((space.start, ended), sides, strict=True):
        rounded = np.abs(slopes * at / space.unit) <= _ROUNDING * abs(rows)[:, None]
        idle &= np.all((slopes == 0.0) | (rounded & (at != 0.0)), axis=0)
    return tuple(name for name, none in zip(space.free.names, idle, strict=True) if none)


def effect_notes(idle: Sequence[str], metric: str) -> list[str]:
    """A sentence on the parameters without effect on metric and limits."""
    if not idle:
        return []
    theirs = "their tuned values say" if len(idle) > 1 else "its tuned value says"
    remedy = "Free others, or choose another metric or road."
    return [f"No effect on {metric}: {', '.join(idle)}; {theirs} nothing. {remedy}"]
