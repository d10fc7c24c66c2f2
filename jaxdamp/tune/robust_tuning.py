"""`robust`: a tuning over scenarios, and what the scatter of its parameters costs."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Unpack

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._settings import part, with_defaults
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import Metric
from jaxdamp.parameters import free_parameters, match_paths
from jaxdamp.tune.minimising import minimise
from jaxdamp.tune.objective import Function
from jaxdamp.tune.result import ToleranceEffect, TuneResult, V
from jaxdamp.tune.risk import Risk
from jaxdamp.tune.scenarios import Road, Scenarios, check_scatter
from jaxdamp.tune.sensitivities import SensitivitySettings, sensitivity
from jaxdamp.tune.settings import DEFAULTS, RUN, Run, Settings
from jaxdamp.vehicles import AbstractVehicle


@of_known_numbers
@with_defaults(DEFAULTS)
def robust(
    metric: str | Metric | Function,
    vehicle: V,
    scenarios: Scenarios,
    *,
    risk: str | Risk | None = None,
    scatter: Mapping[str, float] | None = None,
    progress: Callable[[int, float], None] | None = None,
    **settings: Unpack[Settings],
) -> TuneResult[V]:
    """Minimise a metric over scenarios by its mean, its worst case or the mean of its worst share.

    Arguments:
        metric: as in `minimise`.
        vehicle: to start from.
        scenarios: roads and conditions; `tolerances(...)` makes conditions of a production scatter.
        risk: `"mean"`, `"worst"` or `CVaR(share)`, in place of that of the scenarios.
        scatter: standard deviations, relative to the values, of parameters whose cost is stated at the result, such as
            `{"damper.**_rate": 0.1}`; none if left out.
        progress: as in `minimise`.
        settings: keywords of `minimise`: `over`, `limits`, `duration`, `starts` and the others.

    Raises:
        ValueError: what `minimise` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> from jaxdamp.tune import Condition
    >>> loads = {"empty": Condition(), "laden": Condition({"sprung_mass": 1500.0})}
    >>> scenarios = Scenarios([roads.white("C", 20.0)], loads)
    >>> result = robust("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), scenarios, risk="worst")
    >>> result.converged
    True
    """
    call = "robust(metric, vehicle, scenarios)"
    check_module("vehicle", vehicle, (AbstractVehicle,), call)
    remedy = "Write `tune.Scenarios([road, ...], conditions)`; on one road call `minimise`."
    _checks.instance("scenarios", scenarios, Scenarios, "be made by `tune.Scenarios`", remedy)
    scenarios = scenarios if risk is None else scenarios.with_risk(risk)
    if scatter is not None:
        check_scatter(scatter)
        free_parameters(vehicle, over=list(scatter))  # unknown names are refused before the search
    tuning = minimise(metric, vehicle, scenarios, progress=progress, **settings)
    if not scatter:
        return tuning
    effects = tolerance_effects(
        metric, tuning.vehicle, scenarios, scatter, metrics=settings["metrics"], **part(settings, RUN)
    )
    return dataclasses.replace(tuning, tolerances=effects)


@of_known_numbers
@with_defaults(RUN)
def tolerance_effects(
    metric: str | Metric | Function,
    vehicle: AbstractVehicle,
    road: Road | Scenarios,
    scatter: Mapping[str, float],
    *,
    metrics: Sequence[str | Metric] = (),
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
        metrics: further metrics, which a function can use by name.
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
    of_scatter: SensitivitySettings = {"over": list(scatter), "dampers": None, "metrics": metrics, **run}
    result = sensitivity(metric, vehicle, road, second_order=True, **of_scatter)
    ((name, value),) = result.values.items()
    assert result.hessian is not None
    paths = [parameter.partition("[")[0] for parameter in result.parameters]
    by_path = {path: s for pattern, s in scatter.items() for path in match_paths(paths, [pattern])}
    effects = []
    for i, parameter in enumerate(result.parameters):
        s = by_path[paths[i]]
        first = result.gradient[name][i] * result.point[i] * s / abs(value)
        second = result.hessian[name][i, i] * (result.point[i] * s) ** 2 / abs(value)
        effects.append(ToleranceEffect(parameter, s, 0.5 * second, float(np.hypot(first, second / np.sqrt(2.0)))))
    return tuple(sorted(effects, key=lambda effect: -effect.deviation))
