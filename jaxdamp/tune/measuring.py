"""What a tuning computes of a vehicle: the metrics of its objective on one road, or over scenarios."""

from collections.abc import Callable, Sequence
from typing import Any, final

import equinox as eqx
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Scalar
from jaxdamp.parameters import FreeParameters
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import Ride, moves_axles
from jaxdamp.tune.objective import Objective
from jaxdamp.tune.scenario_ride import ScenarioRide
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.vehicles import AbstractVehicle


@final
class Measurement:
    """The metrics of a vehicle and the value of the objective, as functions of the vehicle.

    Arguments:
        vehicle: with which the checks of a ride are done.
        road: one road, or scenarios.
        objective: with all metrics.
        free: parameters that change.
        each: names of metrics whose value in every scenario is given too, as "name in 'scenario'".
        duration: as in `simulate`.
        dt: as in `simulate`.
    """

    def __init__(
        self,
        vehicle: AbstractVehicle,
        road: Road | Scenarios,
        objective: Objective,
        free: FreeParameters,
        *,
        each: Sequence[str] = (),
        duration: float | None = None,
        dt: float = 1e-3,
    ) -> None:
        self.objective, self.road, self._each = objective, road, list(each)
        self._run: dict[str, Any] = {"duration": duration, "dt": dt}
        self.ride = self._ride(vehicle, road)
        if isinstance(self.ride, ScenarioRide):
            _refuse_fixed(self.ride, free)
            self.ride.refuse_moved_axles("over", free.build, free.values)
        self._follows = (
            isinstance(self.ride, Ride) and self.ride.road is not None and moves_axles(free.build, free.values)
        )
        names = list(objective.units(vehicle))
        self.names = [*names, *(entry for name in self._each for entry in self.entries(name) if entry not in names)]

    def on_road(self, road: Road | Scenarios) -> Ride | ScenarioRide:
        """The ride of the vehicle on another road, or in other scenarios."""
        return self._ride(self.ride.vehicle, road)

    def _ride(self, vehicle: AbstractVehicle, road: Road | Scenarios) -> Ride | ScenarioRide:
        metrics = self.objective.metrics
        if isinstance(road, Scenarios):
            return road.ride(vehicle, metrics=metrics, **self._run)
        return Ride(vehicle, road, metrics=metrics, **self._run)

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """Names of the scenarios; none for one road."""
        return self.ride.names if isinstance(self.ride, ScenarioRide) else ()

    @property
    def white(self) -> bool:
        """Whether nothing is driven over."""
        return self.road.white if isinstance(self.road, Scenarios) else isinstance(self.road, WhiteRoad)

    def entries(self, name: str) -> list[str]:
        """The names of the values of one metric in every scenario; itself on one road."""
        return [f"{name} in {scenario!r}" for scenario in self.scenario_names] or [name]

    def each(self, vehicle: AbstractVehicle) -> dict[str, Any]:
        """The metrics and the objective of a vehicle in each scenario, shape (scenarios,)."""
        assert isinstance(self.ride, ScenarioRide)
        return self.objective.of_each(self.ride.of_vehicle(vehicle).each())

    def __call__(self, vehicle: AbstractVehicle) -> dict[str, Scalar]:
        """The metrics and the objective of a vehicle by name; those of scenarios by their risk, and some in each."""
        return self.by(self.ride, vehicle)

    def by(self, ride: Ride | ScenarioRide, vehicle: AbstractVehicle) -> dict[str, Scalar]:
        """The same by another ride, of `on_road`."""
        if isinstance(ride, ScenarioRide):
            each = self.objective.of_each(ride.of_vehicle(vehicle).each())
            values = {name: ride.risk(of_all, ride.weights) for name, of_all in each.items()}
            return values | {entry: each[name][i] for name in self._each for i, entry in enumerate(self.entries(name))}
        if self._follows:
            return self.objective.of(ride.of_vehicle(vehicle)())
        return self.objective.of(eqx.tree_at(lambda ride: ride.vehicle, ride, vehicle)())  # on the same heights

    def rides_of(self) -> list[Callable[[AbstractVehicle], Ride]]:
        """For each road a function that makes the checked ride of a vehicle on it, in no special condition."""
        roads = [s.road for s in self.road.scenarios] if isinstance(self.road, Scenarios) else [self.road]
        distinct = list({id(road): road for road in roads}.values())

        def on(road: Road) -> Callable[[AbstractVehicle], Ride]:
            return lambda vehicle: Ride(vehicle, road, metrics=self.objective.metrics, **self._run)

        return [on(road) for road in distinct]


def _refuse_fixed(ride: ScenarioRide, free: FreeParameters) -> None:
    """Refuse free parameters that scenarios set to values, since they would have no effect there."""
    fixed = [path for path, factors in ride.factors.items() if np.any(np.asarray(factors) == 0.0)]
    for path in [p.path for p in free.chosen] + [path for path, _ in free.ties]:
        if path in fixed:
            remedy = "Give the condition a factor instead of a value, or name the parameter in `freeze`."
            _checks.refuse("over", f"not free {path}, which a condition of the scenarios sets", "free", remedy)
