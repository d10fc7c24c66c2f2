"""`Ride`: a vehicle on a road as one function of its parameters, the metrics gathered while it drives."""

import copy
import dataclasses
import functools
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._forked import refuse_fork
from jaxdamp._jacobian import Mode
from jaxdamp._many_points import outside_domains
from jaxdamp._quickly import compiled_quickly
from jaxdamp._traced import is_batched, look_behind
from jaxdamp._types import Point, Scalar
from jaxdamp._vectors import MemoryLayout
from jaxdamp._warned import warn
from jaxdamp.codegen import compiler
from jaxdamp.configuration import one_at_a_time, target
from jaxdamp.dampers import RangeUse, has_fitted_range
from jaxdamp.metrics import Metric, MetricValues
from jaxdamp.parameters import as_float, match_paths, named_parameters, parameters, replace
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation.engine import AbstractEngine, check_control, chosen_engine
from jaxdamp.simulation.equations import Equations, settled
from jaxdamp.simulation.exponential import Exponential
from jaxdamp.simulation.many_designs import Designs, steepest_between, too_steep
from jaxdamp.simulation.notes import range_uses
from jaxdamp.simulation.observer import MetricObserver, recorded
from jaxdamp.simulation.run import refuse_stacked, run_check, sampled
from jaxdamp.simulation.stability import MOST
from jaxdamp.simulation.stationary import (
    refuse_without_stationary_motion,
    stationary_dampers,
    stationary_metrics,
    stationary_range_use,
)
from jaxdamp.simulation.wheels import delays_by_itself, heights_under_wheels, moves_axles
from jaxdamp.vehicles import AbstractVehicle, EquivalentDamper, is_stationary, refuse_controller


# Steps of all cars together up to which they are driven one after the other: a first sweep then takes a fifth (full
# cars) to five sixths (linear quarter cars) of the time, later ones about as long (`python -m benchmarks.few_cars`).
SEQUENCE = 400_000


@final
class Ride(eqx.Module):
    """The ride metrics of a vehicle on a road as a pure function of its parameters: `ride({path: value})`.

    The same numbers as `simulate(...).metrics()`, but gathered in the loop over time: nothing is kept of the run, so
    that memory does not grow with its length, and many cars run side by side. `sweep`, `jax.jit`, `jax.vmap`,
    `jax.jacfwd` and `jax.grad` take it as it is. Forward derivatives keep nothing of the run; reverse
    ones keep up to four numbers of each element and the channels of up to 16 384 instants, and drive longer runs twice.

    Where the road reaches the rear axles by the vehicle's own axle positions, parameters that move an axle take part:
    its road is then computed anew.

    On a white road (`roads.white`) the same call gives the stationary ride: metrics that follow from an RMS, without a
    run. Each law is replaced by the linear one that is equivalent in the motion that results, taken as normally
    distributed (`vehicles.linearise` says how accurate that is); `equivalent_dampers` names it. `duration`, `dt`,
    `substeps` and `engine` are then refused.

    Metrics are gathered, but for those that need the whole record (`percentile`, "max_transient_value", a function of
    your own): their channels are saved, so that memory grows with the run.

    Arguments:
        vehicle: where parameters that are not given come from.
        road: as in `simulate`, or `roads.white(...)`.
        metrics: names among `vehicle.ride_metrics`, the short ones "comfort", "travel" and "grip"
            (`vehicle.goal_metrics`), or a `metrics.Metric` of any channel; all ride metrics if left out. Fewer are
            faster.
        duration: as in `simulate`.
        dt: as in `simulate`; it is checked here, with the numbers of this vehicle. Points far from it are driven with
            the same steps unchecked; in a `sweep` those that no step can follow fail.
        substeps: of the exponential engine between two instants; as many as the laws of this vehicle need if left out,
            in a `sweep` as many as the steepest end of its axes. For a ride made inside `jax.jit` see `simulate`.
        engine: as in `simulate`. One that is not `Exponential` may save the whole run.

    Raises:
        ValueError: an unknown metric or parameter; a metric that a white road does not give; what `simulate` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> bump = roads.cosine_bump(0.05, start=0.5, duration=0.25)
    >>> ride = Ride(car, bump, metrics=["working_space_peak_to_peak"], duration=3.0)
    >>> {name: round(float(value), 3) for name, value in ride({"damper.rate": 2500.0}).items()}
    {'working_space_peak_to_peak': 0.072}
    """

    vehicle: AbstractVehicle
    heights: Float[Array, "time wheels"] | None  # of a road that is driven over
    road: AbstractRoad | WhiteRoad | None  # a white one, or where the delay of its axles follows from the vehicle
    engine: AbstractEngine  # with as many substeps as this vehicle needs
    layout: MemoryLayout = eqx.field(static=True)
    dt: float = eqx.field(static=True)
    chooses_steps: bool = eqx.field(static=True)  # whether nobody asked for so many substeps
    metrics: tuple[Metric, ...] = eqx.field(static=True)

    def __init__(
        self,
        vehicle: AbstractVehicle,
        road: AbstractRoad | WhiteRoad,
        *,
        metrics: Sequence[str | Metric] | None = None,
        duration: float | None = None,
        dt: float | None = None,
        substeps: int | None = None,
        engine: AbstractEngine | None = None,
    ) -> None:
        check_module("vehicle", vehicle, (AbstractVehicle,), "Ride(vehicle, road)")
        check_module("road", road, (AbstractRoad, WhiteRoad), "Ride(vehicle, road)")
        if engine is not None:
            check_module("engine", engine, (AbstractEngine,), "Ride(vehicle, road, engine=...)")
        refuse_stacked(vehicle)
        white = isinstance(road, WhiteRoad)
        chosen, self.vehicle = vehicle.chosen_metrics(metrics, white=white), vehicle
        if isinstance(road, WhiteRoad):
            refuse_controller(vehicle, "a ride on a white road")
            unused = {"duration": duration, "dt": dt, "substeps": substeps, "engine": engine}
            for name, value in unused.items():
                if value is not None:
                    remedy = "Leave it out: the answer is that of the stationary motion, without a run."
                    _checks.refuse(name, "not be given on a white road", value, remedy)
            self.road, self.heights, self.dt = road, None, 1e-3
            self.engine, self.layout, self.chooses_steps = Exponential(), MemoryLayout.ARRAY, False
            self.metrics = _stationary(vehicle, chosen, all_of_them=metrics is None)
            return
        engine, self.dt = chosen_engine(engine, Exponential(substeps=substeps), dt, substeps)
        _, self.heights = sampled(vehicle, road, duration, self.dt)
        length, concrete = (self.heights.shape[0] - 1) * self.dt, _checks.concrete(self.heights)
        check_control(engine, vehicle.system(), self.dt, length)
        if road.shortest_event is not None and concrete is not None and np.all(concrete == concrete[0]):
            text = f"The road stays level for the whole run of {length:g} s: its bump comes later."
            warn(f"{text} Pass a longer `duration`, or an earlier `start` of the bump.")
        self.road = road if delays_by_itself(vehicle, road) else None
        self.chooses_steps = isinstance(engine, Exponential) and engine.substeps is None
        self.engine = engine.prepared(run_check(vehicle, vehicle.system(), road, self.heights, self.dt))
        self.layout = self.engine.layout(2 * len(vehicle.coordinates), side_by_side=False)
        self.metrics = tuple(chosen)
        for metric in self.metrics:
            metric.samples(self.heights.shape[0], self.dt)  # a window that does not fit is refused here

    # By identity, whatever is equal, as JAX asks of a function: `jax.jit(ride)`.
    __hash__ = object.__hash__

    def __repr__(self) -> str:
        on = repr(self.road) if isinstance(self.road, WhiteRoad) else f"by {self.engine}"
        return f"Ride of a {type(self.vehicle).__name__}, {len(self.metrics)} metrics, {on}"

    @property
    def units(self) -> dict[str, str]:
        """Units of the metrics, and of the parameters by path and by its last part."""
        channels = self.vehicle.units
        by_path = {p.path: p.unit for p in parameters(self.vehicle, commands=True)}
        by_name = {path.rpartition(".")[2]: unit for path, unit in by_path.items()}
        return by_name | by_path | {m.name: m.unit(channels) for m in self.metrics}

    @property
    def lanes(self) -> int:
        """How many cars a CPU core drives best side by side: if loops are fused, what stays in its nearest cache.

        A printed loop takes 32 at a time by itself; the more there are, the less its matrices cost.
        """
        if self.engine.runs_printed:
            return 2048
        return 128 if target().fused_loops else 2048

    @property
    def sequential_points(self) -> int:
        """Up to how many cars a CPU has sooner one after the other, whose program compiles in less time."""
        if self.engine.runs_printed or self.heights is None or jax.default_backend() != "cpu":
            return 0
        return SEQUENCE // ((self.heights.shape[0] - 1) * self.substeps)

    @property
    def derivatives(self) -> tuple[Mode, ...]:
        """The modes of differentiation that pass in a sweep: those of the engine, both on a white road."""
        return ("forward", "reverse") if isinstance(self.road, WhiteRoad) else self.engine.derivatives_in_sweeps

    @property
    def substeps(self) -> int:
        """Steps of the engine between two instants."""
        return self.engine.step_count

    def of_vehicle(self, vehicle: AbstractVehicle) -> "Ride":
        """The same ride of another vehicle, with the road under its axles wherever they are."""
        ride = eqx.tree_at(lambda ride: ride.vehicle, self, vehicle)
        if self.road is None or self.heights is None or isinstance(self.road, WhiteRoad):
            return ride
        time = self.dt * jnp.arange(self.heights.shape[0], dtype=float)
        return eqx.tree_at(lambda ride: ride.heights, ride, heights_under_wheels(vehicle, self.road, time))

    def side_by_side(self) -> "Ride":
        """The same, compiled for many cars at a time, as `sweep` and `jax.vmap` of a ride compile it by themselves.

        Only a compiled function that is batched afterwards, `jax.vmap(jax.jit(ride))`, needs to be told so.
        """
        other, states = copy.copy(self), 2 * len(self.vehicle.coordinates)
        object.__setattr__(other, "layout", self.engine.layout(states, side_by_side=True))
        return other

    def reaching(self, columns: Mapping[str, np.ndarray], designs: Designs[str] | None = None) -> "Ride":
        """The same with as many substeps as the steepest of these values need, if they were not asked for.

        Arguments:
            columns: values of parameters by name.
            designs: the vehicles with them, if it is not this one alone.
        """
        if not self.chooses_steps:
            return self
        count = min(steepest_between(designs or self._designs(), self.vehicle, columns), MOST)
        assert isinstance(self.engine, Exponential)
        engine = dataclasses.replace(self.engine, substeps=max(count, self.substeps))
        return eqx.tree_at(lambda ride: ride.engine, self, engine)

    def printed_side_by_side(self) -> "Ride | None":
        """The same with its loop printed as C, if the engine allows it, numbers are double and a compiler is at hand.

        A `sweep` without derivatives runs this form; one that takes long compares it with that of XLA.
        """
        engine = self.engine.printed_in_sweeps()
        if engine is None or self.heights is None or self.heights.dtype != jnp.float64 or compiler() is None:
            return None
        return eqx.tree_at(lambda ride: ride.engine, self, engine).side_by_side()

    @property
    def is_printed(self) -> bool:
        """Whether its loop is printed as C."""
        return self.engine.is_printed

    def range_use(self, point: Point | None = None) -> dict[str, list[RangeUse]]:
        """What each damper does at a point beside the range that its law was fitted to; only of laws that have one.

        It drives the run once more and keeps it: ask it of the few points that matter, not of a whole sweep. On a white
        road the velocity of each damper is normally distributed, and reaches three standard deviations.

        `dampers.range_use` says what is compared; `RangeUse.outside` says whether a range is left.
        """
        vehicle = replace(self.vehicle, dict(point or {}))
        if not has_fitted_range(vehicle):
            return {}
        if isinstance(self.road, WhiteRoad):
            return stationary_range_use(vehicle, self.road)
        heights, step = self.of_vehicle(vehicle).heights, jnp.asarray(self.dt, dtype=float)
        assert heights is not None
        system = vehicle.system()
        saved, _ = recorded(self.engine, system, heights, step, None, 1, None)
        return range_uses(vehicle, system.form, saved.motion, saved.road, saved.road_rate, saved.port_force)

    def equivalent_dampers(self, point: Point | None = None) -> dict[str, EquivalentDamper]:
        """On a white road, the linear damper that stands for each law at a point; empty on other roads.

        `EquivalentDamper.words` says it as in "Gaussian, equivalent slope 2006 N s/m at 0.21 m/s RMS".
        """
        if not isinstance(self.road, WhiteRoad):
            return {}
        return stationary_dampers(replace(self.vehicle, dict(point or {})), self.road)

    def out_of_domain(self, columns: Mapping[str, np.ndarray], designs: Designs[str] | None = None) -> np.ndarray:
        """Why the vehicle cannot have the values of each of many points: a text, empty where it can.

        Arguments:
            columns: values of parameters by name, one for each point.
            designs: the vehicles with them, if it is not this one alone.
        """
        reasons = outside_domains(self.vehicle, columns)
        left = np.flatnonzero(reasons == "")
        if left.size and not isinstance(self.road, WhiteRoad) and isinstance(self.engine, Exponential):
            inside = {name: column[left] for name, column in columns.items()}
            reasons[left] = too_steep(designs or self._designs(), self.vehicle, inside, self.substeps)
        return reasons

    def _designs(self) -> Designs[str]:
        return Designs(functools.partial(replace, self.vehicle), self.dt)

    def __call__(self, point: Point | None = None) -> dict[str, Scalar]:
        """The metrics by name, with other values of the parameters at these paths."""
        refuse_fork()
        point = dict(point or {})
        for name, value in point.items():
            if np.shape(value) != ():
                self._check_shape(name, np.shape(value))
        numbers = {name: value for name, value in point.items() if look_behind(value) is not None}
        if numbers:  # checked here; the compiled function is for all values
            replace(self.vehicle, numbers)
        point = {name: as_float(value, name) for name, value in point.items()}
        ride = self.side_by_side() if is_batched((self, point)) else self
        with self.engine.naming_derivatives():
            values = _drive(ride, point)
        concrete = [number for value in values.values() if (number := _checks.concrete(value)) is not None]
        if isinstance(self.road, WhiteRoad) and not all(np.all(np.isfinite(number)) for number in concrete):
            refuse_without_stationary_motion(replace(self.vehicle, point), self.road)
        return MetricValues.with_units(values, self.units)

    def _check_shape(self, name: str, shape: tuple[int, ...]) -> None:
        """Refuse several numbers for one, which would be several cars."""
        shapes = {p.path: p.value.shape for p in named_parameters(self.vehicle, [name])}
        for path in match_paths(list(shapes), [name]):
            if shapes[path] != shape:
                must = "be one number for one car" if shapes[path] == () else f"be of shape {shapes[path]}"
                remedy = "For several cars use `jaxdamp.sweep(ride, {...})`, or `jax.vmap(ride)`."
                _checks.refuse(f"point[{name!r}]", must, f"of shape {shape}", remedy)


@functools.partial(compiled_quickly, level=lambda ride, point: 0 if isinstance(ride.road, WhiteRoad) else 1)
def _drive(ride: Ride, point: dict[str, Array]) -> dict[str, Scalar]:
    """The metrics of the vehicle at a point."""
    vehicle = replace(ride.vehicle, point)
    if isinstance(ride.road, WhiteRoad):
        return stationary_metrics(vehicle, ride.road, ride.metrics)
    if ride.road is not None and point and moves_axles(lambda point: replace(ride.vehicle, point), point):
        ride = ride.of_vehicle(vehicle)
    heights = ride.heights
    assert heights is not None
    equations = Equations(vehicle.system(), ride.layout)
    observer = MetricObserver(equations, ride.metrics, ride.dt, heights.shape[0])
    with one_at_a_time() if ride.layout is MemoryLayout.SCALARS else nullcontext():
        outcome = ride.engine.run(equations, heights, ride.dt, settled(equations.system, heights[0]), observer)
    return observer.end(outcome.gathered, outcome.records)


def _stationary(vehicle: AbstractVehicle, chosen: Sequence[Metric], *, all_of_them: bool) -> tuple[Metric, ...]:
    """The metrics among these that a white road gives; where they are wanted by name, all of them must be."""
    closed = tuple(m for m in chosen if is_stationary(m, vehicle.layout.by_name))
    missing = [m.name for m in chosen if m not in closed]
    if missing and not all_of_them:
        names = [m.name for m in vehicle.ride_metrics if is_stationary(m, vehicle.layout.by_name)]
        remedy = f"It has no peaks, counts, means or powers, but {', '.join(names)}. Drive over `roads.iso8608(...)`."
        _checks.refuse("metrics", "follow from an RMS on a white road", ", ".join(missing), remedy)
    return closed
