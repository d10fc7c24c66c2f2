"""The objective of a tuning: a ride metric, a metric of any channel, or a function of metrics."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric, MetricValues, current_name
from jaxdamp.tune.smooth import exact_counterpart
from jaxdamp.vehicles import AbstractVehicle, is_stationary


Function: TypeAlias = Callable[[Mapping[str, Scalar]], Scalar]


class Objective(NamedTuple):
    """The objective of a tuning and the metrics that it needs.

    Attributes:
        name: of the metric or the function.
        function: of the metrics by name; None for a metric.
        metrics: all metrics of the tuning, those for information included.
        beside: the true peaks and settling times that are shown beside smooth ones.
    """

    name: str
    function: Function | None
    metrics: tuple[Metric, ...]
    beside: tuple[Metric, ...] = ()

    def of(self, values: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """The metrics, and the value of the function."""
        return dict(values) if self.function is None else {**values, self.name: self.function(MetricValues(values))}

    def of_each(self, values: Mapping[str, Array]) -> dict[str, Array]:
        """The same of several vehicles or scenarios, along the first axis of each value."""
        return jax.vmap(self.of)(dict(values))

    def units(self, vehicle: AbstractVehicle) -> dict[str, str]:
        """Unit of each metric; that of a function is unknown."""
        units = {m.name: m.unit(vehicle.units) for m in self.metrics}
        return units if self.function is None else units | {self.name: ""}


@final
class _Asked(Mapping[str, Scalar]):
    """Metrics with the value one, which record the names that a function uses."""

    def __init__(self, names: Sequence[str]) -> None:
        self.values_of, self.names = MetricValues(dict.fromkeys(names, jnp.ones(()))), dict[str, None]()

    def __getitem__(self, name: str) -> Scalar:
        value = self.values_of[name]
        self.names[current_name(name, self.values_of.keys())] = None
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self.values_of)

    def __len__(self) -> int:
        return len(self.values_of)


def objective_of(
    wanted: str | Metric | Function,
    vehicle: AbstractVehicle,
    more: Sequence[str | Metric],
    limited: Sequence[str],
    *,
    white: bool,
) -> Objective:
    """The objective of a tuning on a road.

    Arguments:
        wanted: name of a ride metric, a metric, or a function of metrics by name.
        vehicle: the vehicle to tune.
        more: further metrics, which the function or limits can use.
        limited: names of the metrics with limits.
        white: whether roads are white, so that only metrics that follow from an RMS are available.

    Raises:
        ValueError: an unknown metric, one that is not available on this kind of road, or one without a derivative; a
            function that does not return one number.
    """
    extra = vehicle.chosen_metrics(list(more), "metrics") if more else []
    extra += vehicle.chosen_metrics([wanted], "metric") if isinstance(wanted, Metric) else []
    beside = tuple(exact for exact in map(exact_counterpart, extra) if exact is not None)
    extra += beside
    all_metrics = (*vehicle.ride_metrics, *extra)
    known = {m.name: m for m in all_metrics if not white or is_stationary(m, vehicle.layout.by_name)}
    asked = [m.name for m in extra]
    function = None
    if isinstance(wanted, str | Metric):
        name = current_name(wanted, known) if isinstance(wanted, str) else wanted.name
        asked.append(name)
    else:
        function, name = wanted, _name(wanted)
        asked += _asked_by(wanted, list(known))
        if name in known:
            _checks.refuse("metric", "have a name that no metric has", repr(name), "Give the function another name.")
    asked += limited
    for one in asked:
        _checks.one_of("metric", one, known)
        if not known[one].statistic.differentiable:
            remedy = (
                "Tune on the dynamic load coefficient; limit `Metric('relative_tyre_load', 'minimum')` to (-1, None)."
            )
            _checks.refuse("metric", "have a slope", f"{one!r}, a count", remedy)
    # Further metrics for information: those without weightings, counts and means, which may be negative.
    chosen = [m for m in known.values() if m.name in asked or _for_information(m)]
    return Objective(name, function, tuple(chosen), beside)


def _for_information(metric: Metric) -> bool:
    return metric.weighting is None and metric.statistic.differentiable and not metric.statistic.signed


def _name(function: Any) -> str:
    name = getattr(function, "__name__", "")
    return name if name.isidentifier() else "objective"


def _asked_by(function: Function, names: Sequence[str]) -> list[str]:
    """The metrics that a function uses, after a check that it returns one number."""
    asked = _Asked(names)
    value = function(asked)
    if np.shape(value) != () or not np.issubdtype(jnp.result_type(value), np.floating):
        _checks.refuse("metric", "give one number", f"{_checks.described(value)} from {_name(function)!r}")
    return list(asked.names)
