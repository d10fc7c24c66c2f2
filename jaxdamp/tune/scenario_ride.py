"""The ride metrics of a vehicle in all scenarios."""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._jacobian import Mode
from jaxdamp._quickly import Level, compiled_quickly
from jaxdamp._traced import is_batched
from jaxdamp._types import Point, Scalar
from jaxdamp.metrics import Metric, MetricValues
from jaxdamp.parameters import checked, get, match_paths, modules_inside, replace, with_values
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import Designs, Ride, moves_axles, refuse_without_stationary_motion
from jaxdamp.tune.risk import Risk
from jaxdamp.tune.settings import Run
from jaxdamp.vehicles import AbstractVehicle


if TYPE_CHECKING:
    from jaxdamp.tune.scenarios import Condition, Scenario


T = TypeVar("T")
K = TypeVar("K")
TUNED = 2  # times as long as a sweep of few cars: a tuning drives its cars dozens of times


@final
class ScenarioRide(eqx.Module):
    """The metrics of a vehicle over scenarios as a function of its parameters; made by `Scenarios.ride`.

    It is called as a `Ride` is, and `sweep`, `jax.jacfwd` and `jax.grad` take it as they take a `Ride`. `each` gives
    the metrics of every scenario. The conditions change numbers by `factor * value + offset`.
    """

    ride: Ride  # of the vehicle on the first road
    roads: Float[Array, "scenarios time wheels"] | WhiteRoad  # heights under the wheels [m]; or stacked white roads
    factors: dict[str, Float[Array, "scenarios ..."]]  # by path, in each scenario
    offsets: dict[str, Float[Array, "scenarios ..."]]  # by path, in each scenario
    weights: Float[Array, " scenarios"]  # of the scenarios, which add up to one
    names: tuple[str, ...] = eqx.field(static=True)  # of the scenarios
    in_turn: bool = eqx.field(static=True)  # driven one after the other, not side by side
    delays_axles: bool = eqx.field(static=True)  # by the distance of the axles, which must not move then
    risk: Risk = eqx.field(static=True)  # how a metric becomes one number

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
    def sequential_points(self) -> int:
        """Up to how many points a CPU has sooner one after the other."""
        return self.ride.sequential_points // len(self.names) if self.in_turn else 0

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """The modes of differentiation that pass in a sweep."""
        return self.ride.derivatives

    def side_by_side(self) -> "ScenarioRide":
        """The same, compiled for many cars at a time."""
        together = eqx.tree_at(lambda scenarios: scenarios.ride, self, self.ride.side_by_side())
        object.__setattr__(together, "in_turn", False)
        return together

    def reaching(self, columns: Mapping[str, np.ndarray]) -> "ScenarioRide":
        """The same with as many substeps as the steepest of these values need, if they were not asked for."""
        return eqx.tree_at(lambda scenarios: scenarios.ride, self, self.ride.reaching(columns, self._designs()))

    def of_vehicle(self, vehicle: AbstractVehicle) -> "ScenarioRide":
        """The same scenarios for another vehicle."""
        return eqx.tree_at(lambda scenarios: scenarios.ride, self, self.ride.of_vehicle(vehicle))

    def out_of_domain(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Why the vehicle cannot have the values of each of many points: a text, empty where it can."""
        return self.ride.out_of_domain(columns, self._designs())

    def _designs(self) -> Designs[str]:
        return _in_all(functools.partial(replace, self.vehicle), self.factors, self.offsets, self.ride.dt)

    def each(self, point: Point | None = None) -> dict[str, Float[Array, " scenarios"]]:
        """The metrics by name in every scenario, with other values of the parameters at these paths."""
        point = dict(point or {})
        vehicle = replace(self.vehicle, point) if point else self.vehicle
        if point:
            self.refuse_moved_axles("point", lambda values: replace(self.vehicle, values), point)
        white = isinstance(self.roads, WhiteRoad)
        by_name = _in_each(self.side_by_side() if is_batched((self, vehicle)) else self, vehicle)
        concrete = [number for value in by_name.values() if (number := _checks.concrete(value)) is not None]
        lost = np.flatnonzero(~np.any(np.isfinite(concrete), axis=0)) if white and concrete else np.zeros(0, int)
        if lost.size and np.ndim(concrete[0]) == 1:
            each = self.roads, self.factors, self.offsets
            road, factors, offsets = jax.tree.map(lambda leaf: leaf[lost[0]], each)
            refuse_without_stationary_motion(_in(vehicle, factors, offsets), road)
        return MetricValues.with_units({m.name: by_name[m.name] for m in self.metrics}, self.units)

    def refuse_moved_axles(self, argument: str, build: Callable[[T], AbstractVehicle], values: T) -> None:
        """Refuse values that move an axle, where the road under it has been sampled already."""
        if self.delays_axles and moves_axles(build, values):
            remedy = "Change it on one road at a time, or on `roads.white`."
            _checks.refuse(
                argument, "not move an axle in scenarios, whose roads are sampled once", "one that does", remedy
            )

    def __call__(self, point: Point | None = None) -> dict[str, Scalar]:
        """The metrics by name, one number for all scenarios."""
        values = {name: self.risk(each, self.weights) for name, each in self.each(point).items()}
        return MetricValues.with_units(values, self.units)


def _in_one(
    scenarios: ScenarioRide,
    vehicle: AbstractVehicle,
    road: Array | WhiteRoad,
    factors: dict[str, Array],
    offsets: dict[str, Array],
) -> dict[str, Scalar]:
    """The metrics of a vehicle by name in one scenario."""
    ride = scenarios.ride.of_vehicle(_in(vehicle, factors, offsets))
    field = "road" if isinstance(road, WhiteRoad) else "heights"
    return dict(eqx.tree_at(lambda ride: getattr(ride, field), ride, road)())


def _in(vehicle: AbstractVehicle, factors: dict[str, Array], offsets: dict[str, Array]) -> AbstractVehicle:
    """The vehicle in one scenario."""
    return _changed(vehicle, {path: (factors[path], offsets[path]) for path in factors})


def _in_all(
    build: Callable[[dict[K, Scalar | float]], AbstractVehicle],
    factors: dict[str, Array],
    offsets: dict[str, Array],
    dt: float,
) -> Designs[K]:
    """The designs of a vehicle in all scenarios."""
    if not factors:
        return Designs(build, dt)
    return Designs(
        lambda numbers: eqx.filter_vmap(_in, in_axes=(None, 0, 0))(build(numbers), factors, offsets), dt, True
    )


def designs_under(
    conditions: Sequence["Condition"],
    vehicle: AbstractVehicle,
    build: Callable[[dict[K, Scalar | float]], AbstractVehicle],
    dt: float,
) -> Designs[K]:
    """The designs of a vehicle under all of these conditions, for steps of dt [s]."""
    return _in_all(build, *_stacked(_changes(vehicle, conditions)), dt)


def _stacked(changes: Mapping[str, Sequence[tuple[Array, Array]]]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Factors and offsets by path, with an axis for the scenarios in front."""
    factors, offsets = (
        {path: jnp.stack([pair[i] for pair in pairs]) for path, pairs in changes.items()} for i in (0, 1)
    )
    return factors, offsets


def _level(scenarios: ScenarioRide, vehicle: AbstractVehicle) -> Level:
    if isinstance(scenarios.roads, WhiteRoad):
        return 0
    return 1 if scenarios.in_turn else None


@functools.partial(compiled_quickly, level=_level)
def _in_each(scenarios: ScenarioRide, vehicle: AbstractVehicle) -> dict[str, Float[Array, " scenarios"]]:
    """The metrics of a vehicle by name in every scenario."""
    one, each = functools.partial(_in_one, scenarios, vehicle), (scenarios.roads, scenarios.factors, scenarios.offsets)
    return jax.lax.map(lambda rows: one(*rows), each) if scenarios.in_turn else jax.vmap(one)(*each)


def scenario_ride(
    vehicle: AbstractVehicle,
    scenarios: Sequence["Scenario"],
    risk: Risk,
    metrics: Sequence[str | Metric] | None,
    run: Run,
) -> ScenarioRide:
    """The ride of a vehicle in scenarios, after the checks of a `Ride` on each road and in each condition."""
    check_module("vehicle", vehicle, (AbstractVehicle,), "scenarios.ride(vehicle)")
    changes = _changes(vehicle, [scenario.condition for scenario in scenarios])
    first, rides = _checked_rides(vehicle, scenarios, changes, metrics, run)
    white = isinstance(scenarios[0].road, WhiteRoad)
    inputs = [ride.road if white else ride.heights for ride in rides]
    common = eqx.tree_at(
        lambda r: (r.vehicle, r.road), first, (vehicle, inputs[0] if white else None), is_leaf=lambda leaf: leaf is None
    )
    factors, offsets = _stacked(changes)
    in_turn = len(scenarios) <= common.sequential_points // TUNED
    ride = ScenarioRide(
        ride=common if in_turn else common.side_by_side(),
        roads=jax.tree.map(lambda *leaves: jnp.stack(leaves), *inputs),
        factors=factors,
        offsets=offsets,
        weights=jnp.asarray([scenario.weight for scenario in scenarios]),
        names=tuple(scenario.name for scenario in scenarios),
        in_turn=in_turn,
        delays_axles=not white and any(ride.road is not None for ride in rides),
        risk=risk,
    )
    if changes:
        paths = {path: get(vehicle, path) for path in changes}
        ride.refuse_moved_axles("conditions", lambda values: with_values(vehicle, values), paths)
    return ride


def _checked_rides(
    vehicle: AbstractVehicle,
    scenarios: Sequence["Scenario"],
    changes: Mapping[str, Sequence[tuple[Array, Array]]],
    metrics: Sequence[str | Metric] | None,
    run: Run,
) -> tuple[Ride, list[Ride]]:
    """The ride with the most substeps, and one on the road of each scenario; roads and conditions are checked once."""
    by_road: dict[int, Ride] = {}
    most: Ride | None = None
    for i, scenario in enumerate(scenarios):
        if id(scenario.road) in by_road and scenario.road is not scenarios[0].road:
            continue
        changed = _changed(vehicle, {path: pairs[i] for path, pairs in changes.items()})
        ride = Ride(checked(changed), scenario.road, metrics=metrics, **run)
        by_road.setdefault(id(scenario.road), ride)
        if most is None or ride.substeps > most.substeps:
            most = ride
    assert most is not None
    rides = [by_road[id(scenario.road)] for scenario in scenarios]
    counts = {0 if ride.heights is None else ride.heights.shape[0] for ride in rides}
    if len(counts) > 1:
        lengths = ", ".join(sorted(f"{(count - 1) * most.dt:g} s" for count in counts))
        _checks.refuse("roads", "be driven for the same time", lengths, "Pass `duration`.")
    return most, rides


def in_condition(vehicle: AbstractVehicle, condition: "Condition") -> AbstractVehicle:
    """A vehicle in a condition."""
    return checked(_changed(vehicle, {path: pairs[0] for path, pairs in _changes(vehicle, [condition]).items()}))


def _changed(vehicle: AbstractVehicle, changes: Mapping[str, tuple[Array, Array]]) -> AbstractVehicle:
    """The vehicle with factor · value + offset for each of these numbers."""
    return with_values(vehicle, {path: factor * get(vehicle, path) + add for path, (factor, add) in changes.items()})


def _changes(vehicle: AbstractVehicle, conditions: Sequence["Condition"]) -> dict[str, list[tuple[Array, Array]]]:
    """Factor and offset of every number that a condition changes, by path, in each scenario."""
    before = numbers(vehicle)
    each = [(_by_path(before, c.values, "values"), _by_path(before, c.factors, "factors")) for c in conditions]
    paths = dict.fromkeys(path for values, factors in each for path in (*values, *factors))
    return {path: [_change(path, np.shape(before[path]), *pair) for pair in each] for path in paths}


def _change(path: str, shape: tuple[int, ...], values: Point, factors: Point) -> tuple[Array, Array]:
    """Factor and offset of a number: one and zero where the condition leaves it as it is."""
    if path in values and path in factors:
        _checks.refuse("Condition", f"have a value or a factor for {path}", "both", "Multiply the value by the factor.")
    offset, factor = values.get(path, 0.0), 0.0 if path in values else factors.get(path, 1.0)
    for number in (offset, factor):
        if np.shape(number) not in ((), shape) or not np.all(np.isfinite(number)):
            _checks.refuse(f"Condition of {path!r}", f"be finite numbers in shape {shape}", number)
    broadcast = (jnp.broadcast_to(jnp.asarray(number, float), shape) for number in (factor, offset))
    return tuple(broadcast)  # type: ignore[return-value]


def numbers(tree: eqx.Module) -> dict[str, Array]:
    """All parameters and settings of a module by path."""
    by_path = {}
    for prefix, module in modules_inside(tree):
        for field in type(module).__dataclass_fields__.values():  # type: ignore[attr-defined]
            if "parameter" in field.metadata or "setting" in field.metadata:
                by_path[prefix + field.name] = getattr(module, field.name)
    return by_path


def _by_path(numbers: Mapping[str, Array], changes: Point, argument: str) -> Point:
    if not isinstance(changes, Mapping):
        _checks.refuse(
            argument, "be a mapping of parameters to numbers", repr(changes), "Write `{'sprung_mass': 1e3}`."
        )
    return {path: value for name, value in changes.items() for path in match_paths(list(numbers), [name])}
