"""What came out of a tuning: better or not, by how much, at what price, where it was tried."""

import enum
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp._tables import percent_change, typeset_unit
from jaxdamp.metrics import Metric
from jaxdamp.tune.limits import LimitRange
from jaxdamp.vehicles import AbstractVehicle, ChannelKind


if TYPE_CHECKING:
    from jaxdamp.tune.rescoring import Rescore
    from jaxdamp.tune.result import TuneResult


WITHIN = 0.01  # relative excess over a limit on fresh roads up to which it counts as met
PRICED = (  # kinds of channels whose rise is a price: of body, travel and tyres, not the speed and power of the damper
    ChannelKind.HEIGHT, ChannelKind.ANGLE, ChannelKind.ACCELERATION, ChannelKind.ANGULAR_ACCELERATION,
    ChannelKind.STROKE, ChannelKind.TYRE_LOAD, ChannelKind.RELATIVE_TYRE_LOAD,
)  # fmt: skip
NOTICED = 0.05  # percent: smaller changes are none


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
    """The outcome of a tuning and the sentence that says it.

    Attributes:
        outcome: what it came to.
        sentence: with its numbers.
    """

    outcome: Outcome
    sentence: str

    @property
    def better(self) -> bool:
        """Whether the tuned vehicle may be called better than the start."""
        return self.outcome is Outcome.BETTER


def verdict_of(result: "TuneResult[Any]") -> Verdict:
    """The verdict on a tuning: on fresh roads if there are any, otherwise on the road of the tuning."""
    if result.violated:
        missed = "; ".join(result.violated.values())
        return Verdict(Outcome.LIMIT_NOT_MET, f"Limit not met: {missed}. {_change(result)[1]}.")
    price, name = _price(result)
    gain, words = _change(result)
    cost = f"; price: {name} {price:+.1f} %" if name else "; nothing else gets worse"
    held = _limits_in_words(result)
    error = 0.0 if result.fresh is None else 100.0 * result.fresh.half_width(result.metric)
    lost = [f"{name} is {100 * x:.1f} % beyond its limit" for name, x in lost_limits(result).items()]
    if lost:
        outcome, first, held = Outcome.LIMIT_LOST, f"Not better: {'; '.join(lost)}; {words}", ""
    elif gain - error > -NOTICED and (result.fresh is None or gain > 0.0):
        outcome, first = Outcome.NOT_BETTER, f"Not better: {words}"
    elif not gain + error < -NOTICED:
        outcome, first = Outcome.NOT_SHOWN, f"Not shown to be better: {words}"
    elif result.extrapolated:
        outside = "; ".join(result.extrapolated)
        outcome = Outcome.EXTRAPOLATED
        first = f"Not known to be better: {words} by the law, but outside its records ({outside})"
    elif name and price > -gain:
        outcome, first = Outcome.TRADE, f"A trade: {words}"
    else:
        outcome, first = Outcome.BETTER, f"Better: {words}"
    return Verdict(outcome, f"{first}{cost}{held}.")


def _change(result: "TuneResult[Any]") -> tuple[float, str]:
    """The change of the objective [%] and its words, with its interval and the roads that it holds for."""
    fresh, name = result.fresh, result.metric
    here = percent_change(result.before[name], result.after[name])
    if fresh is None or not np.all(np.isfinite(fresh.change(name))):
        before, after = (f"{side[name]:.4g}" for side in (result.before, result.after))
        change = 100.0 * (result.after[name] - result.before[name]) if here is None else here
        share = f"{before} -> {after}" if here is None else f"{here:+.1f} %"
        return change, f"{name} {share} {result.elsewhere or 'on the road of the tuning'}"
    mean, half = 100.0 * float(np.mean(fresh.change(name))), 100.0 * fresh.half_width(name)
    error = f" ± {half:.1f}" if np.isfinite(half) else ""
    roads = f"{fresh.roads} fresh roads" if fresh.roads > 1 else "1 fresh road, which gives no interval"
    return mean, f"{name} {mean:+.1f}{error} % on {roads}"


def _price(result: "TuneResult[Any]") -> tuple[float, str]:
    """The largest rise of a metric of body, suspension travel or tyres [%], and its name; none if nothing rises.

    What is limited has its own words, and so have the metrics of its channel and those that change as it does.
    """
    metrics = {m.name: m for m in result.objective.metrics} if result.objective else {}
    named = {result.metric, *result.limits}
    limited = {metrics[name].channel for name in result.limits if name in metrics}
    known = {_mean_change(result, name) for name in named}
    worst = (NOTICED, "")
    for name in result.units:
        change, metric = _mean_change(result, name), metrics.get(name)
        if change is None or name in named or any(x is not None and np.isclose(change, x, 1e-6) for x in known):
            continue
        if metric is None or (metric.channel not in limited and _has_price(metric, result.start)):
            worst = max(worst, (change, name))
    return worst


def _has_price(metric: Metric, vehicle: AbstractVehicle) -> bool:
    """Whether a rise of a metric is a price."""
    return not metric.statistic.signed and vehicle.layout.by_name[metric.channel].kind in PRICED


def _mean_change(result: "TuneResult[Any]", name: str) -> float | None:
    """The change of a metric [%], the mean on fresh roads if there are any; none from zero."""
    if result.fresh is None or name not in result.fresh.before:
        return percent_change(result.before[name], result.after[name])
    change = 100.0 * float(np.mean(result.fresh.change(name)))
    return change if np.isfinite(change) else None


def _limits_in_words(result: "TuneResult[Any]") -> str:
    """How much of each limit is used, and on how many fresh roads it is broken."""
    texts = []
    for name in result.limits:
        after, change = result.after[name], _mean_change(result, name)
        share = f"{after:.4g} {typeset_unit(result.units[name])}".rstrip() if change is None else f"{change:+.1f} %"
        text = f"{name} {share}{', at its limit' * (name in result.active_limits)}"
        if result.fresh is not None and name in result.allowed:
            beyond = int(np.sum(excess(result.fresh, name, result.allowed[name]) > WITHIN))
            text += f", beyond it on {beyond} of {result.fresh.roads} fresh roads" * bool(beyond)
        texts.append(text)
    return f"; limits: {'; '.join(texts)}" if texts else ""


def lost_limits(result: "TuneResult[Any]") -> dict[str, float]:
    """The mean excess over limits that are broken on average over fresh roads, by more than the error of this mean."""
    if result.fresh is None or result.fresh.roads < 2:
        return {}
    over = {name: excess(result.fresh, name, allowed) for name, allowed in result.allowed.items()}
    return {name: float(np.mean(x)) for name, x in over.items() if np.mean(x) - half_interval(x) > WITHIN}


def excess(fresh: "Rescore", name: str, allowed: LimitRange) -> Float[np.ndarray, " roads"]:
    """Excess over a limit on each fresh road, relative to it, negative inside."""
    over = []
    for before, after in zip(fresh.before[name], fresh.after[name], strict=True):
        lower, upper = allowed.at(float(before))
        size = max(abs(end) for end in (lower, upper) if np.isfinite(end)) or 1.0
        over.append(max(after - upper, lower - after) / size)
    return np.array(over)


def half_interval(values: Float[np.ndarray, " roads"], level: float = 0.95) -> float:
    """Half the interval of the mean of independent values, by Student's distribution; infinite for one value."""
    from scipy.stats import t

    if len(values) < 2:
        return np.inf
    return float(t.ppf(0.5 + 0.5 * level, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))


def decided(fresh: "Rescore", allowed: Mapping[str, LimitRange]) -> bool:
    """Whether further roads would change nothing: the sign of the gain and every limit are certain, or the error small.

    It is asked again as roads are added, hence at 99 %.
    """
    offsets = [fresh.change(fresh.metric), *(excess(fresh, name, limit) - WITHIN for name, limit in allowed.items())]
    halves = [half_interval(offset, 0.99) for offset in offsets]
    return all(abs(np.mean(offset)) > half or half < WITHIN for offset, half in zip(offsets, halves, strict=True))
