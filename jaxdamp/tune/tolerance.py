"""What a scatter of parameters costs: the change of a metric on average, and its own scatter."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Unpack

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import Column, Table
from jaxdamp._traced import of_known_numbers
from jaxdamp.parameters import match_paths
from jaxdamp.tune.sensitivities import sensitivity
from jaxdamp.tune.settings import RUN, Run, completed
from jaxdamp.vehicles import AbstractVehicle


class ToleranceEffect(NamedTuple):
    """The effect of the scatter of one parameter on a metric, to second order.

    Attributes:
        parameter: its name.
        scatter: its standard deviation relative to its value.
        mean: mean change of the metric, relative: half the second derivative times the variance.
        deviation: standard deviation of the metric, relative: slope times deviation, and the part of the curvature.
    """

    parameter: str
    scatter: float
    mean: float
    deviation: float

    def sentence(self, metric: str) -> str:
        """In words, such as "A 10 % scatter of damper.blow_off_rate costs 1.4 % of rms_sprung_acceleration"."""
        verb = "costs" if self.mean >= 0.0 else "gains"
        cost = f"{verb} {100 * abs(self.mean):.2g} % of {metric} on average, and scatters it by"
        return f"A {100 * self.scatter:g} % scatter of {self.parameter} {cost} {100 * self.deviation:.2g} %."


@of_known_numbers
def tolerance_effects(
    metric: Any,
    vehicle: AbstractVehicle,
    road: Any,
    scatter: Mapping[str, float],
    **run: Unpack[Run],
) -> tuple[ToleranceEffect, ...]:
    """The effect of the scatter of each parameter on a metric, from its first and second derivatives.

    For a parameter p with standard deviation s p, normally distributed, the metric m changes on average by
    m'' (s p)²/2 and has the variance (m' s p)² + (m'' (s p)²)²/2.

    Arguments:
        metric: as in `sensitivity`, a single one.
        vehicle: with all parameters at their nominal values.
        road: as in `sensitivity`.
        scatter: standard deviation of each parameter relative to its value, by path, last part or pattern.
        run: `duration`, `dt` and `engine`, as in `simulate` (see `Run`).

    Raises:
        ValueError: scatters that are not positive; what `sensitivity` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> effect, = tolerance_effects("rms_sprung_acceleration", car, roads.white("C", 20.0), {"damper.rate": 0.1})
    >>> print(effect.sentence("comfort"))
    A 10 % scatter of damper.rate costs 0.35 % of comfort on average, and scatters it by 2.8 %.
    """
    check_scatter(scatter)
    if isinstance(metric, Sequence) and not isinstance(metric, str):
        remedy = "Call it once for each metric."
        _checks.refuse("metric", "be a single one", _checks.described(metric), remedy)
    completed("tolerance_effects", run, RUN)
    result = sensitivity(metric, vehicle, road, over=list(scatter), dampers=None, second_order=True, **run)
    ((name, value),) = result.values.items()
    assert result.hessian is not None
    paths = [parameter.partition("[")[0] for parameter in result.parameters]
    by_path = {path: s for pattern, s in scatter.items() for path in match_paths(paths, [pattern])}
    effects = []
    for i, parameter in enumerate(result.parameters):
        s = by_path[paths[i]]
        first = result.gradient[name][i] * result.point[i] * s / value
        second = result.hessian[name][i, i] * (result.point[i] * s) ** 2 / value
        effects.append(ToleranceEffect(parameter, s, 0.5 * second, float(np.hypot(first, second / np.sqrt(2.0)))))
    return tuple(sorted(effects, key=lambda effect: -effect.deviation))


def check_scatter(scatter: Any) -> None:
    """Refuse what is no mapping of parameters to positive standard deviations."""
    remedy = "Write `{'damper.**_rate': 0.1}`: 0.1 is a standard deviation of 10 %."
    if not isinstance(scatter, Mapping) or not scatter:
        _checks.refuse("scatter", "be a mapping of one or more parameters", _checks.described(scatter), remedy)
    for name, deviation in scatter.items():
        _checks.positive(f"scatter[{name!r}]", deviation, remedy)


def tolerance_table(effects: Sequence[ToleranceEffect], metric: str) -> Table:
    """A row for each parameter, the most effective first."""
    columns = (
        Column("parameter"),
        Column("scatter", "%", ".3g"),
        Column(f"{metric}, mean", "%", "+.3f"),
        Column("scatter of it", "%", ".3f"),
    )
    rows = ((e.parameter, 100 * e.scatter, 100 * e.mean, 100 * e.deviation) for e in effects)
    return Table(f"What the scatter of parameters costs {metric}", columns, tuple(rows))
