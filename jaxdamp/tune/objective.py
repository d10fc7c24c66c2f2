"""What a tuning minimises: a ride metric, a metric of any channel, or a function of metrics."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias, final

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric, MetricValues, current_name
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.vehicles import AbstractVehicle, is_stationary


Function: TypeAlias = Callable[[Mapping[str, Scalar]], Scalar]


class Objective(NamedTuple):
    """What is minimised, with the metrics that it takes.

    Attributes:
        name: of the metric or the function.
        function: of the metrics by name; None for a metric.
        metrics: all metrics of the tuning, those for information included.
    """

    name: str
    function: Function | None
    metrics: tuple[Metric, ...]

    def of(self, values: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """The metrics with the function of them."""
        return dict(values) if self.function is None else {**values, self.name: self.function(MetricValues(values))}

    def units(self, vehicle: AbstractVehicle) -> dict[str, str]:
        """Unit of each metric; a function has none that is known."""
        units = {m.name: m.unit(vehicle.units) for m in self.metrics}
        return units if self.function is None else units | {self.name: ""}


@final
class _Asked(Mapping[str, Scalar]):
    """Metrics of ones that remembers which were asked for."""

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
    road: AbstractRoad | WhiteRoad,
    more: Sequence[str | Metric],
    limited: Sequence[str],
) -> Objective:
    """What is to be minimised on a road.

    Arguments:
        wanted: name of a ride metric, a metric, or a function of metrics by name.
        vehicle: that is tuned.
        road: of the tuning.
        more: further metrics, which the function or limits may name.
        limited: names of the metrics with limits.

    Raises:
        ValueError: an unknown metric, one that this kind of road does not give, or one without a
            slope; a function that does not give one number.
    """
    extra = vehicle.chosen_metrics(list(more), "metrics") if more else []
    extra += vehicle.chosen_metrics([wanted], "metric") if isinstance(wanted, Metric) else []
    known = {m.name: m for m in (*_given(vehicle, road, (*vehicle.ride_metrics, *extra)),)}
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
            _checks.refuse("metric", "have a slope", f"{one!r}, a count", "Tune on the dynamic load coefficient.")
    # The others are for information: those without weightings, counts and means, which may be negative.
    chosen = [m for m in known.values() if m.name in asked or _for_information(m)]
    return Objective(name, function, tuple(chosen))


def _given(vehicle: AbstractVehicle, road: AbstractRoad | WhiteRoad, metrics: Sequence[Metric]) -> list[Metric]:
    """The metrics that this kind of road gives: a white one what follows from an RMS."""
    return [m for m in metrics if not isinstance(road, WhiteRoad) or is_stationary(m, vehicle.layout.by_name)]


def _for_information(metric: Metric) -> bool:
    return metric.weighting is None and metric.statistic.differentiable and not metric.statistic.signed


def _name(function: Any) -> str:
    name = getattr(function, "__name__", "")
    return name if name.isidentifier() else "objective"


def _asked_by(function: Function, names: Sequence[str]) -> list[str]:
    """The metrics that a function looks at, and that it gives one number."""
    asked = _Asked(names)
    value = function(asked)
    if np.shape(value) != () or not np.issubdtype(jnp.result_type(value), np.floating):
        _checks.refuse("metric", "give one number", f"{_checks.described(value)} from {_name(function)!r}")
    return list(asked.names)
