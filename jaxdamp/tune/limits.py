"""Hard limits of a tuning: on metrics, in every scenario, and on the shape of the force-velocity curve."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp.metrics import Metric, current_name


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


def spans(limits: Mapping[str | Metric, Any] | None, known: Sequence[str]) -> tuple[dict[str, Span], list[Metric]]:
    """The spans of limits by the current names of the metrics, and the metrics that are no names.

    Raises:
        ValueError: limits that are neither a largest value nor a smallest and a largest one.
    """
    if not isinstance(limits, Mapping | None):
        _checks.refuse("limits", "be a mapping of metrics to limits", _checks.described(limits))
    found = {
        one.name if isinstance(one, Metric) else current_name(one, known): _span(one, span)
        for one, span in (limits or {}).items()
    }
    return found, [one for one in (limits or {}) if isinstance(one, Metric)]


def _span(one: str | Metric, given: Any) -> Span:
    label = f"limits[{one.name if isinstance(one, Metric) else one!r}]"
    must = "be the largest allowed value, or the smallest and the largest one"
    pair = given if isinstance(given, tuple | list) else (None, given)
    try:
        lower, upper = (
            default if x is None else float(x) for x, default in zip(pair, (-math.inf, math.inf), strict=True)
        )
    except (TypeError, ValueError):
        _checks.refuse(label, must, repr(given), "Write 0.1, or (-0.08, 0.1); None for an end without a limit.")
    if not lower < upper:
        _checks.refuse(label, f"{must}, in increasing order", repr(given))
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


def margins(limits: Iterable[Limit], values: Mapping[str, float]) -> np.ndarray:
    """Relative distances to every end of every limit, in the order of `margin_slopes`."""
    rows = []
    for limit in limits:
        rows += [(limit.upper - values[limit.name]) / limit.scale] * math.isfinite(limit.upper)
        rows += [(values[limit.name] - limit.lower) / limit.scale] * math.isfinite(limit.lower)
    return np.array(rows)


def margin_slopes(limits: Iterable[Limit], slopes: Mapping[str, np.ndarray]) -> np.ndarray:
    """The derivatives of `margins`."""
    rows = []
    for limit in limits:
        rows += [-slopes[limit.name] / limit.scale] * math.isfinite(limit.upper)
        rows += [slopes[limit.name] / limit.scale] * math.isfinite(limit.lower)
    return np.array(rows)
