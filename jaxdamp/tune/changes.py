"""Changes of metrics by a tuning in percent, which those that may be negative do not have."""

from typing import TYPE_CHECKING

import numpy as np

from jaxdamp.vehicles import AbstractVehicle


if TYPE_CHECKING:
    from jaxdamp.tune.result import TuneResult


def relative_change(before: float, after: float) -> float | None:
    """The change relative to the size before [%], positive where it rises, also of what is negative; none from zero."""
    return 100.0 * (after - before) / abs(before) if before else None


def signed_metrics(result: "TuneResult[AbstractVehicle]") -> set[str]:
    """Names of the metrics that may be negative, of which a change in percent says nothing."""
    known = (*result.start.layout.metrics, *(result.objective.metrics if result.objective else ()))
    return {metric.name for metric in known if metric.statistic.signed}


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
