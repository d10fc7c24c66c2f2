"""What a tuning computes of a vehicle: metrics on one road or over scenarios, in one compiled program."""

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._jacobian import Mode, value_and_jacobian
from jaxdamp._one_thread import usable_cores
from jaxdamp._quickly import FEW, Level, compiled_quickly
from jaxdamp._types import Scalar
from jaxdamp.parameters import FreeParameters
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import Ride, moves_axles
from jaxdamp.tune.limits import in_scenarios
from jaxdamp.tune.objective import Objective
from jaxdamp.tune.scenario_ride import TUNED, ScenarioRide
from jaxdamp.tune.scenarios import Road, Scenarios
from jaxdamp.tune.settings import RUN, Run
from jaxdamp.tune.shape import ShapeNumbers
from jaxdamp.vehicles import AbstractVehicle


LANES = 16  # points side by side in one call of the compiled program
FORWARD = 5  # parameters for each result, up to which forward derivatives of so many lanes are faster


def ride_on(vehicle: AbstractVehicle, road: Road | Scenarios, objective: Objective, run: Run) -> Ride | ScenarioRide:
    """The ride of a vehicle on a road or in scenarios, with all metrics of an objective."""
    if isinstance(road, Scenarios):
        return road.ride(vehicle, metrics=objective.metrics, **run)
    return Ride(vehicle, road, metrics=objective.metrics, **run)


@final
class Measurement(eqx.Module):
    """The metrics of a vehicle and the value of the objective, as functions of the vehicle.

    A pytree: programs of equal measurements, but for their numbers, are compiled once.
    """

    ride: Ride | ScenarioRide
    objective: Objective = eqx.field(static=True)
    curves: ShapeNumbers = eqx.field(static=True)
    each_of: tuple[str, ...] = eqx.field(static=True)
    axles_move: bool = eqx.field(static=True)

    def __init__(
        self,
        vehicle: AbstractVehicle,
        road: Road | Scenarios,
        objective: Objective,
        free: FreeParameters,
        *,
        each: Sequence[str] = (),
        curves: ShapeNumbers | None = None,
        run: Run = RUN,
    ) -> None:
        self.objective, self.each_of = objective, tuple(each)
        self.curves = ShapeNumbers(()) if curves is None else curves
        self.ride = ride_on(vehicle, road, objective, run)
        if isinstance(self.ride, ScenarioRide):
            _refuse_fixed(self.ride, free)
            self.ride.refuse_moved_axles("over", free.build, free.values)
            self.axles_move = False
        else:
            self.axles_move = self.ride.road is not None and moves_axles(free.build, free.values)

    @property
    def names(self) -> list[str]:
        """The names of all numbers: metrics, some of them in every scenario, and those of curves."""
        return list(dict.fromkeys([*self.objective.units(self.ride.vehicle), *self.limited_names]))

    @property
    def limited_names(self) -> list[str]:
        """The names of the numbers of single scenarios and of curves."""
        return [*(entry for name in self.each_of for entry in self.entries(name)), *self.curves.names]

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """Names of the scenarios; none for one road."""
        return self.ride.names if isinstance(self.ride, ScenarioRide) else ()

    def entries(self, name: str) -> list[str]:
        """The names of the values of one metric in every scenario; itself on one road."""
        return in_scenarios(name, self.scenario_names)

    def each(self, vehicle: AbstractVehicle) -> dict[str, Array]:
        """The metrics and the objective of a vehicle in each scenario, shape (scenarios,)."""
        assert isinstance(self.ride, ScenarioRide)
        return self.objective.of_each(self.ride.of_vehicle(vehicle).each())

    def __call__(self, vehicle: AbstractVehicle) -> dict[str, Scalar]:
        """The metrics and the objective of a vehicle by name; those of scenarios by their risk, and some in each."""
        ride = self.ride
        if isinstance(ride, ScenarioRide):
            each = self.each(vehicle)
            values = {name: ride.risk(of_all, ride.weights) for name, of_all in each.items()}
            values |= {entry: each[name][i] for name in self.each_of for i, entry in enumerate(self.entries(name))}
        elif self.axles_move:
            values = self.objective.of(ride.of_vehicle(vehicle)())
        else:  # on the same heights
            values = self.objective.of(eqx.tree_at(lambda ride: ride.vehicle, ride, vehicle)())
        return {**values, **self.curves(vehicle)}

    def by(self, ride: Ride | ScenarioRide) -> "Measurement":
        """The same by another ride of the vehicle."""
        return eqx.tree_at(lambda measured: measured.ride, self, ride)


def _level(
    measured: Measurement, free: FreeParameters, values: Float[Array, "*lanes free"], *_: object, **__: object
) -> Level:
    """Of optimisation: for few vehicles little, on white roads none."""
    ride = measured.ride
    road = ride.roads if isinstance(ride, ScenarioRide) else ride.road
    if values[..., 0].size * max(len(measured.scenario_names), 1) > FEW:
        return None
    return 0 if isinstance(road, WhiteRoad) else 1


@functools.partial(compiled_quickly, level=_level)
def _values(measured: Measurement, free: FreeParameters, values: Float[Array, "*lanes free"]) -> Array:
    """All numbers, shape (*lanes, numbers), of vectors of values."""

    def one(row: Array) -> Array:
        results = measured(free.build(row))
        return jnp.stack([results[name] for name in measured.names])

    return one(values) if values.ndim == 1 else jax.vmap(one)(values)


@functools.partial(compiled_quickly, level=_level)
def _values_and_slopes(
    measured: Measurement, free: FreeParameters, values: Float[Array, "*lanes free"], of: tuple[str, ...], mode: Mode
) -> tuple[Array, Array]:
    """All numbers, shape (*lanes, numbers), and derivatives of some of them, (*lanes, differentiated, free)."""
    entries = [str(i) for i in range(values.shape[-1])]

    def one(point: dict[str, Array]) -> dict[str, Array]:
        results = measured(free.build(jnp.stack([point[entry] for entry in entries])))
        return {name: results[name] for name in measured.names}

    point = {entry: values[..., i] for i, entry in enumerate(entries)}
    results, slopes = value_and_jacobian(one if values.ndim == 1 else jax.vmap(one), point, mode, of=of)
    rows = [jnp.stack([slopes[name][entry] for entry in entries], axis=-1) for name in of]
    return jnp.stack([results[name] for name in measured.names], axis=-1), jnp.stack(rows, axis=-2)


class Computed(NamedTuple):
    """Numbers of points, shape (points, numbers), and derivatives, shape (points, differentiated, free)."""

    values: Float[np.ndarray, "points numbers"]
    slopes: Float[np.ndarray, "points differentiated free"]


@final
class BatchProgram:
    """Numbers of many points, simulated a fixed number side by side, so that one program is enough.

    A few short rides are simulated one after the other, on each core, since their program compiles in a fraction of the
    time.

    Attributes:
        differentiated: names of the numbers with derivatives: objectives and what is limited.
        points: number of points computed with derivatives.
    """

    def __init__(self, measured: Measurement, free: FreeParameters, lanes: int) -> None:
        self.lanes, self.free, self.points = min(lanes, LANES), free, 0
        self._compiled = False
        self.differentiated = tuple(dict.fromkeys([*measured.objective.names, *measured.limited_names]))
        modes, few = measured.ride.derivatives, free.values.size <= FORWARD * len(self.differentiated)
        mode: Mode = "forward" if few or self.lanes < LANES else "reverse"
        self._mode: Mode = mode if mode in modes else modes[0]
        if self.lanes <= measured.ride.sequential_points // TUNED:
            self.lanes = 1
        self.measured = measured if self.lanes == 1 else measured.by(measured.ride.side_by_side())

    def values(self, designs: Float[np.ndarray, "points free"], ride: Ride | ScenarioRide | None = None) -> np.ndarray:
        """All numbers of designs, by another ride if one is given."""
        measured = self._on(ride)
        parts = [np.asarray(_values(measured, self.free, part), np.float64) for part in self._in_lanes(designs)]
        return np.concatenate([np.atleast_2d(part) for part in parts])[: len(designs)]

    def at(self, designs: Float[np.ndarray, "points free"], ride: Ride | ScenarioRide | None = None) -> Computed:
        """All numbers of designs, and derivatives by the physical values; by another ride if one is given."""
        self.points += len(designs)
        measured = self._on(ride)

        def computed(part: Array) -> Computed:
            values, slopes = _values_and_slopes(measured, self.free, part, self.differentiated, self._mode)
            return Computed(
                np.atleast_2d(np.asarray(values, np.float64)),
                np.asarray(slopes, np.float64).reshape(-1, *slopes.shape[-2:]),
            )

        values, slopes = zip(*self._by_cores(computed, self._in_lanes(designs)), strict=True)
        return Computed(np.concatenate(values)[: len(designs)], np.concatenate(slopes)[: len(designs)])

    def _on(self, ride: Ride | ScenarioRide | None) -> Measurement:
        """What is computed, by another ride if one is given."""
        if ride is None:
            return self.measured
        return self.measured.by(ride if self.lanes == 1 else ride.side_by_side())

    def _by_cores(self, compute: Callable[[Array], Computed], parts: Sequence[Array]) -> list[Computed]:
        """One part on each core, once the program is compiled: a car's loop takes one of them."""
        first, self._compiled = [] if self._compiled else [compute(parts[0])], True
        others = parts[len(first) :]
        if len(others) < 2:
            return [*first, *map(compute, others)]
        with ThreadPoolExecutor(usable_cores()) as pool:
            return [*first, *pool.map(compute, others)]

    def _in_lanes(self, designs: Float[np.ndarray, "points free"]) -> list[Array]:
        """Designs in groups, the last one filled up; each alone where there is one lane."""
        filled = np.concatenate([designs, np.repeat(designs[:1], -len(designs) % self.lanes, axis=0)])
        filled = filled.astype(self.free.values.dtype)
        groups = filled if self.lanes == 1 else filled.reshape(-1, self.lanes, designs.shape[1])
        return [jnp.asarray(group) for group in groups]


def _refuse_fixed(ride: ScenarioRide, free: FreeParameters) -> None:
    """Refuse free parameters that scenarios set to values, since they would have no effect there."""
    fixed = [path for path, factors in ride.factors.items() if np.any(np.asarray(factors) == 0.0)]
    for path in [p.path for p in free.chosen] + [path for path, _ in free.ties]:
        if path in fixed:
            remedy = "Give the condition a factor instead of a value, or name the parameter in `freeze`."
            _checks.refuse("over", f"not free {path}, which a condition of the scenarios sets", "free", remedy)
