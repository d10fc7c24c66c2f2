"""Hard limits of a tuning: on metrics, in every scenario, and on the shape of the force-velocity curve."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp.metrics import Metric, current_name


EXAMPLE = "Write `{'working_space_peak_to_peak': 0.1}`, or `{...: (smallest, largest)}`."
Span = tuple[float, float]  # smallest and largest allowed value, infinite without one


class Limit(NamedTuple):
    """The allowed range of one number.

    Attributes:
        name: of the number among those that the search computes.
        of: name of the metric or of the shape constraint that it belongs to.
        lower: smallest allowed value, −∞ without one.
        upper: largest allowed value, ∞ without one.
        scale: of distances to the limit.
        unit: of the number.
        is_shape: whether it belongs to the shape of a curve, not to a metric.
    """

    name: str
    of: str
    lower: float
    upper: float
    scale: float
    unit: str = ""
    is_shape: bool = False

    def margin(self, value: float) -> float:
        """Relative distance to the nearer end, negative beyond it."""
        return min(self.upper - value, value - self.lower) / self.scale

    def nearer(self, value: float) -> str:
        """The nearer end in words, such as "<= 0.1 m"."""
        sign, end = ("<=", self.upper) if self.upper - value <= value - self.lower else (">=", self.lower)
        return f"{sign} {end:.4g} {typeset_unit(self.unit)}".rstrip()


def limit_spans(limits: Mapping[Any, Any] | None, known: Sequence[str]) -> dict[str, Span]:
    """The smallest and the largest allowed value of metrics by their current names, infinite without one.

    Arguments:
        limits: `{metric: largest value}` or `{metric: (smallest, largest)}`, by name or as a `metrics.Metric`; None for
            an end without a limit.
        known: names of metrics, for those that were renamed.

    Raises:
        ValueError: limits that are neither a largest value nor a smallest and a largest one.
    """
    if not isinstance(limits, Mapping | None):
        _checks.refuse("limits", "be a mapping of metrics to limits", _checks.described(limits), EXAMPLE)
    return {
        one.name if isinstance(one, Metric) else current_name(one, known): _span(one, span)
        for one, span in (limits or {}).items()
    }


def _span(one: str | Metric, given: Any) -> Span:
    label = f"limits[{one.name if isinstance(one, Metric) else one!r}]"
    must = "be the largest allowed value, or the smallest and the largest one"
    pair = given if isinstance(given, tuple | list) else (None, given)
    if any(isinstance(end, str) for end in pair) or all(end is None for end in pair):
        _checks.refuse(label, must, repr(given), "Write 0.1, or (-0.08, 0.1); None for an end without a limit.")
    try:
        lower, upper = (
            default if x is None else float(x) for x, default in zip(pair, (-math.inf, math.inf), strict=True)
        )
    except (TypeError, ValueError):
        _checks.refuse(label, must, repr(given), "Write 0.1, or (-0.08, 0.1); None for an end without a limit.")
    if not lower < upper:
        _checks.refuse(label, f"{must}, in increasing order", repr(given), "Write (-0.08, 0.1).")
    return lower, upper


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


def limit_ends(limits: Iterable[Limit]) -> list[LimitEnd]:
    """The finite ends of all limits."""
    ends = [
        LimitEnd(limit.name, sign, value, limit.scale)
        for limit in limits
        for sign, value in ((1.0, limit.upper), (-1.0, limit.lower))
    ]
    return [end for end in ends if math.isfinite(end.value)]


def margins(ends: Iterable[LimitEnd], values: Mapping[str, Any]) -> np.ndarray:
    """Relative distances to ends of limits, negative beyond them."""
    return np.array([end.sign * (end.value - values[end.name]) / end.scale for end in ends])


def margin_slopes(ends: Iterable[LimitEnd], slopes: Mapping[str, np.ndarray]) -> np.ndarray:
    """The derivatives of `margins`."""
    return np.array([-end.sign * slopes[end.name] / end.scale for end in ends])
