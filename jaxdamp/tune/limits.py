"""Hard limits of a tuning, on metrics in every scenario and on the shape of a curve; how they hold on fresh roads."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._display import Display
from jaxdamp._tables import typeset_unit
from jaxdamp.metrics import Metric, current_name


if TYPE_CHECKING:
    from jaxdamp.tune.rescoring import Rescore


EXAMPLE = "Write `{'working_space_peak_to_peak': 0.1}`, or `{...: (smallest, largest)}`."
ENDS = "Write 0.1, or (-0.08, 0.1); None for an end without a limit, '+10%' for one relative to the start."
WITHIN = 0.01  # relative excess over a limit on fresh roads up to which it counts as met
PERCENT = re.compile(r"([+-]\d+(?:\.\d*)?) *%")
End: TypeAlias = float | int | str | None  # of a limit: in its unit, or relative to the start; None for none
Ends: TypeAlias = End | Sequence[End]  # the upper one, or both
Limits: TypeAlias = Mapping[str, Ends] | Mapping[Metric, Ends] | Mapping[str | Metric, Ends]
Span = tuple[float, float]  # smallest and largest allowed value, infinite without one


class LimitRange(NamedTuple):
    """The allowed range of a metric as it is written: ends in its unit, or relative to the start."""

    lower: float  # smallest allowed value, or its relative distance from the start; −∞ without one
    upper: float  # the largest one, likewise; ∞ without one
    relative: tuple[bool, bool] = (False, False)  # whether the two ends are relative to the start

    def at(self, start: float) -> Span:
        """Smallest and largest allowed value where the start has this value; shares of a negative one by its size."""
        ends = zip((self.lower, self.upper), self.relative, strict=True)
        lower, upper = (start + end * abs(start) if relative else end for end, relative in ends)
        return lower, upper


class Limit(NamedTuple):
    """The allowed range of one number."""

    name: str  # of the number among those that the search computes
    of: str  # name of the metric or of the shape constraint that it belongs to
    lower: float  # smallest allowed value, −∞ without one
    upper: float  # largest allowed value, ∞ without one
    scale: float  # of distances to the limit
    unit: str = ""  # of the number
    is_shape: bool = False  # whether it belongs to the shape of a curve, not to a metric

    def margin(self, value: float) -> float:
        """Relative distance to the nearer end, negative beyond it."""
        return min(self.upper - value, value - self.lower) / self.scale

    def tightened(self, by: float, value: float) -> "Limit":
        """The same, with the end nearer to a value inwards by a share of the scale, from the value if that is inside.

        A limit that other roads break need not be reached on this one: moved alone, it would leave all as it is.
        """
        if self.upper - value <= value - self.lower:
            return self._replace(upper=min(self.upper, value) - by * self.scale) if by else self
        return self._replace(lower=max(self.lower, value) + by * self.scale) if by else self

    def nearer(self, value: float) -> str:
        """The nearer end in words, such as "≤ 0.1 m"."""
        sign, end = ("≤", self.upper) if self.upper - value <= value - self.lower else ("≥", self.lower)
        return f"{sign} {amount(end, self.unit)}"


def amount(value: float, unit: str, *before: float, link: str = " -> ", digits: int = 4) -> str:
    """A value with its unit as people read it; with others before it, that are linked to it.

    >>> amount(0.1, "m"), amount(0.75, "m/s^2", 0.8), amount(0.02, "m", 0.01, link=" to ")
    ('100 mm', '0.8 -> 0.75 m/s²', '10 to 20 mm')
    """
    shown = Display().read(unit)  # where others are shown, sentences are brought to them as a whole
    numbers = link.join(f"{shown(one):.{digits}g}" for one in (*before, value))
    return f"{numbers} {typeset_unit(shown.unit)}".rstrip()


def in_scenarios(name: str, scenarios: Sequence[str]) -> list[str]:
    """The names of the values of one metric in every scenario; itself where there are none.

    >>> in_scenarios("grip", ["empty", "laden"])
    ["grip in 'empty'", "grip in 'laden'"]
    """
    return [f"{name} in {scenario!r}" for scenario in scenarios] or [name]


def limit_spans(
    limits: Limits | None, metrics: Sequence[str], start: Mapping[str, float] | None = None
) -> dict[str, Span]:
    """The smallest and the largest allowed value of metrics by their current names, infinite without one.

    Arguments:
        limits: `{metric: largest value}` or `{metric: (smallest, largest)}`, by name or as a `metrics.Metric`; None for
            an end without a limit, `"+10%"` for one relative to the start.
        metrics: names of metrics, for those that were renamed.
        start: the metrics of the start, for relative limits.

    Raises:
        ValueError: limits that are neither a largest value nor a smallest and a largest one; a relative one without a
            start.

    >>> limit_spans({"grip": "+10%", "travel": (0.02, 0.1)}, ["grip", "travel"], {"grip": 1000.0})
    {'grip': (-inf, 1100.0), 'travel': (0.02, 0.1)}
    """
    spans = {}
    for name, allowed in limit_ranges(limits, metrics).items():
        if any(allowed.relative) and (start is None or name not in start):
            _checks.refuse(f"limits[{name!r}]", "be a number here, where there is no start", "relative to one", ENDS)
        spans[name] = span_from(name, allowed, math.nan if start is None else float(start.get(name, math.nan)))
    return spans


def span_from(name: str, allowed: LimitRange, start: float) -> Span:
    """Smallest and largest allowed value of a metric that starts at this value.

    Raises:
        ValueError: no value lies between them, since one of them is relative to the start.
    """
    lower, upper = allowed.at(start)
    if lower >= upper:
        must = f"leave values between its ends, where {name} starts at {start:.4g}"
        remedy = "One end is relative to the start: write both as numbers, or both relative."
        _checks.refuse(f"limits[{name!r}]", must, f"{lower:.4g} to {upper:.4g}", remedy)
    return lower, upper


def limit_ranges(limits: Limits | None, metrics: Sequence[str]) -> dict[str, LimitRange]:
    """The allowed ranges of metrics by their current names, as they are written."""
    if not isinstance(limits, Mapping | None):
        _checks.refuse("limits", "be a mapping of metrics to limits", _checks.described(limits), EXAMPLE)
    return {
        one.name if isinstance(one, Metric) else current_name(one, metrics): _range(one, span)
        for one, span in (limits or {}).items()
    }


def _range(one: str | Metric, given: Ends) -> LimitRange:
    """A limit as it is written, checked."""
    label = f"limits[{one.name if isinstance(one, Metric) else one!r}]"
    must = "be the largest allowed value, or the smallest and the largest one"
    pair = (None, given) if not isinstance(given, Sequence) or isinstance(given, str) else given
    try:
        (lower, lower_relative), (upper, upper_relative) = map(_end, pair, (-math.inf, math.inf))
    except (TypeError, ValueError):
        _checks.refuse(label, must, repr(given), ENDS)
    if len(pair) != 2 or all(end is None for end in pair):
        _checks.refuse(label, must, repr(given), ENDS)
    comparable = lower_relative == upper_relative
    if math.isnan(lower) or math.isnan(upper) or (comparable and lower >= upper):
        _checks.refuse(label, f"{must}, in increasing order", repr(given), "Write (-0.08, 0.1).")
    if math.isinf(lower) and math.isinf(upper):
        _checks.refuse(label, "be finite", repr(given), "Leave the limit out, or write None for an end without one.")
    return LimitRange(lower, upper, (lower_relative, upper_relative))


def _end(end: End, default: float) -> tuple[float, bool]:
    """One end of a limit as a number, and whether it is relative to the start; the default for None."""
    if isinstance(end, str):
        share = PERCENT.fullmatch(end.strip())
        if share is None:
            raise ValueError
        return 0.01 * float(share.group(1)), True
    return default if end is None else float(end), False


def written(span: Span) -> str:
    """A span in words: "limit 0.1", "at least -0.08", "-0.08 to 0.1"."""
    lower, upper = span
    if math.isinf(lower):
        return f"limit {upper:.4g}"
    return f"at least {lower:.4g}" if math.isinf(upper) else f"limits {lower:.4g} to {upper:.4g}"


def scaled(lower: float, upper: float, start: float) -> float:
    """The scale of distances: the magnitude of the finite ends, or of the start if these are zero."""
    return max((abs(end) for end in (lower, upper) if math.isfinite(end)), default=0.0) or abs(start) or 1.0


class LimitEnd(NamedTuple):
    """One end of a limit: `sign * number` must not be above `sign * value`; the sign is −1 for a smallest value."""

    name: str
    sign: float
    value: float
    scale: float


def end_moved(limit: Limit, end: LimitEnd, to: float) -> str:
    """A limit with another end, in words."""
    sign = "≤" if end.sign > 0 else "≥"
    return f"{limit.name} {sign} {amount(to, limit.unit)} instead of {amount(end.value, limit.unit)}"


def limit_ends(limits: Iterable[Limit]) -> list[LimitEnd]:
    """The finite ends of all limits."""
    ends = [
        LimitEnd(limit.name, sign, value, limit.scale)
        for limit in limits
        for sign, value in ((1.0, limit.upper), (-1.0, limit.lower))
    ]
    return [end for end in ends if math.isfinite(end.value)]


def in_each(allowed: Mapping[str, LimitRange], scenarios: Sequence[str]) -> dict[str, LimitRange]:
    """The ranges of limited metrics in every scenario, by the names of their values there."""
    return {one: span for name, span in allowed.items() for one in in_scenarios(name, scenarios)}


def lost_limits(fresh: "Rescore | None", allowed: Mapping[str, LimitRange]) -> dict[str, float]:
    """The mean excess over limits that are broken on average over fresh roads, by more than the error of this mean.

    The ranges are those in every scenario (`in_each`).
    """
    if fresh is None or fresh.roads < 2:
        return {}
    over = {name: excess(fresh, name, limit) for name, limit in allowed.items()}
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
    """Half the interval of the mean of independent values, by Student's distribution; infinite for one value.

    Arguments:
        values: one for each road.
        level: of the interval.
    """
    from scipy.special import stdtrit

    if len(values) < 2:
        return np.inf
    return float(stdtrit(len(values) - 1, 0.5 + 0.5 * level) * np.std(values, ddof=1) / np.sqrt(len(values)))


def decided(fresh: "Rescore", allowed: Mapping[str, LimitRange]) -> bool:
    """Whether further roads would change nothing: the sign of the gain and every limit are certain, or the error small.

    It is asked again as roads are added, hence at 99 %.
    """
    offsets = [fresh.change(fresh.metric), *(excess(fresh, name, limit) - WITHIN for name, limit in allowed.items())]
    halves = [half_interval(offset, 0.99) for offset in offsets]
    return all(abs(np.mean(offset)) > half or half < WITHIN for offset, half in zip(offsets, halves, strict=True))
