"""The ride metrics of a vehicle in all scenarios, driven side by side."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._jacobian import Mode
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric, MetricValues
from jaxdamp.parameters import checked, get, match_paths, modules_inside, replace, with_values
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import AbstractEngine, Ride, moves_axles
from jaxdamp.tune.risk import Risk
from jaxdamp.vehicles import AbstractVehicle


if TYPE_CHECKING:
    from jaxdamp.tune.scenarios import Condition, Scenario


@final
class ScenarioRide(eqx.Module):
    """The metrics of a vehicle over scenarios as a function of its parameters; made by `Scenarios.ride`.

    It is called as a `Ride` is, and `sweep`, `jax.jacfwd` and `jax.grad` take it as they take a `Ride`. `each` gives
    the metrics of every scenario. The conditions change numbers by `factor * value + offset`.

    Attributes:
        ride: of the vehicle on the first road, for many cars at a time.
        roads: heights under the wheels in each scenario [m], shape (scenarios, time, wheels); or stacked white roads.
        factors: by path, in each scenario.
        offsets: by path, in each scenario.
        weights: of the scenarios, which add up to one.
        names: of the scenarios.
        delays_axles: whether the delay from axle to axle follows from the vehicle, so that its axles must not move.
        risk: how a metric becomes one number.
    """

    ride: Ride
    roads: Float[Array, "scenarios time wheels"] | WhiteRoad
    factors: dict[str, Float[Array, "scenarios ..."]]
    offsets: dict[str, Float[Array, "scenarios ..."]]
    weights: Float[Array, " scenarios"]
    names: tuple[str, ...] = eqx.field(static=True)
    delays_axles: bool = eqx.field(static=True)
    risk: Risk = eqx.field(static=True)

    def __repr__(self) -> str:
        return f"Ride of a {type(self.ride.vehicle).__name__} in {len(self.names)} scenarios"

    @property
    def vehicle(self) -> AbstractVehicle:
        """Where parameters that are not given come from, without conditions."""
        return self.ride.vehicle

    @property
    def metrics(self) -> tuple[Metric, ...]:
        """All metrics."""
        return self.ride.metrics

    @property
    def units(self) -> dict[str, str]:
        """Units of the metrics, and of the parameters."""
        return self.ride.units

    @property
    def lanes(self) -> int:
        """How many points a CPU core computes best side by side."""
        return max(self.ride.lanes // len(self.names), 1)

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """The modes of differentiation that pass in a sweep."""
        return self.ride.derivatives

    def side_by_side(self) -> "ScenarioRide":
        """The same: it drives many cars at a time in any case."""
        return self

    def of_vehicle(self, vehicle: AbstractVehicle) -> "ScenarioRide":
        """The same scenarios for another vehicle."""
        return eqx.tree_at(lambda whole: whole.ride, self, self.ride.of_vehicle(vehicle))

    def out_of_domain(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Why the vehicle cannot have the values of each of many points: a text, empty where it can."""
        return self.ride.out_of_domain(columns)

    def each(self, point: Mapping[str, Any] | None = None) -> dict[str, Float[Array, " scenarios"]]:
        """The metrics by name in every scenario, with other values of the parameters at these paths."""
        point = dict(point or {})
        vehicle = replace(self.vehicle, point) if point else self.vehicle
        if point:
            self.refuse_moved_axles("point", lambda values: replace(self.vehicle, values), point)

        def one(road: Any, factors: dict[str, Any], offsets: dict[str, Any]) -> dict[str, Scalar]:
            changed = {path: factors[path] * get(vehicle, path) + offsets[path] for path in factors}
            ride = self.ride.of_vehicle(with_values(vehicle, changed))
            field = "road" if isinstance(self.roads, WhiteRoad) else "heights"
            return dict(eqx.tree_at(lambda ride: getattr(ride, field), ride, road)())

        by_name = jax.vmap(one)(self.roads, self.factors, self.offsets)
        return MetricValues.with_units({m.name: by_name[m.name] for m in self.metrics}, self.units)

    def refuse_moved_axles(self, argument: str, build: Callable[[Any], AbstractVehicle], values: Any) -> None:
        """Refuse values that move an axle, where the road under it has been sampled already."""
        if self.delays_axles and moves_axles(build, values):
            remedy = "Change it on one road at a time, or on `roads.white`."
            _checks.refuse(
                argument, "not move an axle in scenarios, whose roads are sampled once", "one that does", remedy
            )

    def __call__(self, point: Mapping[str, Any] | None = None) -> dict[str, Scalar]:
        """The metrics by name, one number for all scenarios."""
        values = {name: self.risk(each, self.weights) for name, each in self.each(point).items()}
        return MetricValues.with_units(values, self.units)


def scenario_ride(
    vehicle: AbstractVehicle,
    scenarios: Sequence["Scenario"],
    risk: Risk,
    *,
    metrics: Sequence[str | Metric] | None,
    duration: float | None,
    dt: float | None,
    engine: AbstractEngine | None,
) -> ScenarioRide:
    """The ride of a vehicle in scenarios, after the checks of a `Ride` on each road and in each condition."""
    check_module("vehicle", vehicle, (AbstractVehicle,), "scenarios.ride(vehicle)")
    factors, offsets = _changes(vehicle, [scenario.condition for scenario in scenarios])
    white = isinstance(scenarios[0].road, WhiteRoad)
    checked_rides: dict[int, Ride] = {}
    steps, first = 0, None
    for i, scenario in enumerate(scenarios):
        values = {path: np.asarray(factors[path][i] * get(vehicle, path) + offsets[path][i]) for path in factors}
        changed = checked(with_values(vehicle, {path: jnp.asarray(value) for path, value in values.items()}))
        new_road, new_condition = id(scenario.road) not in checked_rides, scenario.road is scenarios[0].road
        if not (new_road or new_condition):
            continue  # each road and each condition is checked once
        ride = Ride(changed, scenario.road, metrics=metrics, duration=duration, dt=dt, engine=engine)
        checked_rides.setdefault(id(scenario.road), ride)
        if first is None or ride.substeps > steps:
            first, steps = ride, ride.substeps
    assert first is not None
    rides = [checked_rides[id(scenario.road)] for scenario in scenarios]
    counts = {0 if ride.heights is None else ride.heights.shape[0] for ride in rides}
    if len(counts) > 1:
        lengths = ", ".join(sorted(f"{(count - 1) * first.dt:g} s" for count in counts))
        _checks.refuse("roads", "be driven for the same time", lengths, "Pass `duration`.")
    inputs: Any = [ride.road if white else ride.heights for ride in rides]
    common = eqx.tree_at(lambda r: (r.vehicle, r.road), first, (vehicle, inputs[0] if white else None), is_leaf=_none)
    weights = jnp.asarray([scenario.weight for scenario in scenarios])
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *inputs)
    changes = [{path: jnp.stack(change) for path, change in side.items()} for side in (factors, offsets)]
    names = tuple(scenario.name for scenario in scenarios)
    delays = not white and any(ride.road is not None for ride in rides)
    ride = ScenarioRide(common.side_by_side(), stacked, changes[0], changes[1], weights, names, delays, risk)
    paths = {path: get(vehicle, path) for path in factors}
    if paths:
        ride.refuse_moved_axles("conditions", lambda values: with_values(vehicle, values), paths)
    return ride


def _none(leaf: Any) -> bool:
    return leaf is None


def _changes(
    vehicle: AbstractVehicle, conditions: Sequence["Condition"]
) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
    """Factor and offset of every number that a condition changes, by path, in each scenario."""
    known = numbers(vehicle)
    changes = [(_by_path(known, c.values, "values"), _by_path(known, c.factors, "factors")) for c in conditions]
    factors: dict[str, list[Any]] = {}
    offsets: dict[str, list[Any]] = {}
    for path in dict.fromkeys(path for values, shares in changes for path in (*values, *shares)):
        shape = np.shape(known[path])
        for values, shares in changes:
            if path in values and path in shares:
                remedy = "Multiply the value by the factor."
                _checks.refuse("Condition", f"have a value or a factor for {path}", "both", remedy)
            set_to, factor = values.get(path, 0.0), 0.0 if path in values else shares.get(path, 1.0)
            for number in (set_to, factor):
                if np.shape(number) not in ((), shape) or not np.all(np.isfinite(number)):
                    _checks.refuse(f"Condition of {path!r}", f"be finite numbers in shape {shape}", number)
            factors.setdefault(path, []).append(jnp.broadcast_to(jnp.asarray(factor, float), shape))
            offsets.setdefault(path, []).append(jnp.broadcast_to(jnp.asarray(set_to, float), shape))
    return factors, offsets


def numbers(tree: Any) -> dict[str, Any]:
    """All parameters and settings of a module by path."""
    by_path = {}
    for prefix, module in modules_inside(tree):
        for field in type(module).__dataclass_fields__.values():  # type: ignore[attr-defined]
            if "parameter" in field.metadata or "setting" in field.metadata:
                by_path[prefix + field.name] = getattr(module, field.name)
    return by_path


def _by_path(known: Mapping[str, Any], changes: Mapping[str, Any], argument: str) -> dict[str, Any]:
    if not isinstance(changes, Mapping):
        _checks.refuse(
            argument, "be a mapping of parameters to numbers", repr(changes), "Write `{'sprung_mass': 1e3}`."
        )
    return {path: value for name, value in changes.items() for path in match_paths(list(known), [name])}
