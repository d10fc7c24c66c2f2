"""A vehicle on one wheel with a law, and its ride metrics, as functions of its numbers, which are printed."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._vectors import MemoryLayout
from jaxdamp.codegen import Program, Symbols, lower, symbols
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges
from jaxdamp.export._law_program import LawProgram, law_numbers
from jaxdamp.parameters import get, modules_inside, with_values
from jaxdamp.simulation import Equations, Exponential, MetricObserver, RoadInput, settled
from jaxdamp.vehicles import AbstractVehicle


class _Numbers:
    """How the numbers of a tree lie in one array of the program."""

    def __init__(self) -> None:
        self.count = 0
        self._shapes: list[tuple[int, ...]] = []
        self._structure: Any = None
        self._rest: Any = None

    def taken(self, tree: Any) -> list[Any]:
        """The arrays of a tree, whose structure is remembered."""
        held, self._rest = eqx.partition(tree, eqx.is_inexact_array)
        leaves, self._structure = jax.tree.flatten(held)
        self._shapes = [leaf.shape for leaf in leaves]
        self.count = sum(leaf.size for leaf in leaves)
        return leaves

    def tree(self, leaves: Sequence[Any]) -> Any:
        """The tree with these arrays."""
        return eqx.combine(jax.tree.unflatten(self._structure, leaves), self._rest)

    def symbols(self, name: str, first: int = 0) -> list[Symbols]:
        """The arrays as stretches of one array of the program, from a place on."""
        ends = np.cumsum([int(np.prod(shape)) for shape in self._shapes])
        names = np.array([f"{name}[{first + k}]" for k in range(self.count)], object)
        parts = np.split(names, ends[:-1]) if self._shapes else []
        return [Symbols(part.reshape(shape)) for part, shape in zip(parts, self._shapes, strict=True)]


class VehicleProgram:
    """A vehicle on one wheel with a law at its dampers, whose steps can be printed.

    The functions of `_vehicle_program` are those of a `Ride`: the exponential step, the observer of the metrics.

    Arguments:
        law: the law, which the vehicle holds.
        vehicle: with one wheel.
        dt: interval of the instants [s].
        count: number of the instants of a run.

    Attributes:
        numbers: parameters and settings of the vehicle but those of the law.
        metrics: the ride metrics that a run gathers.
        channels: the channels whose values `observe` leaves in `c`.
    """

    def __init__(self, law: LawProgram, vehicle: AbstractVehicle, dt: float, count: int) -> None:
        wheels = vehicle.wheel_names
        if len(wheels) != 1:
            must, remedy = "be a vehicle with one wheel", "Take a `QuarterCar`."
            _checks.refuse("vehicle", must, f"a {type(vehicle).__name__} with {len(wheels)}", remedy)
        self.law, self.vehicle = law, without_fitted_ranges(vehicle)
        inside = [(prefix, module) for prefix, module in modules_inside(self.vehicle) if prefix]
        self._places = [prefix for prefix, module in inside if eqx.tree_equal(module, law.law)]
        if not self._places:
            remedy = "Build it with the law: `QuarterCar(..., damper=law)`."
            _checks.refuse("vehicle", "hold the law as a damper", repr(type(vehicle).__name__), remedy)
        own = law_numbers(self.vehicle)
        self.numbers = [n for n in own if not any(n.path.startswith(prefix) for prefix in self._places)]
        self.metrics = [m for m in vehicle.ride_metrics if not m.statistic.needs_record]
        self.dt, self.count = dt, count
        self._stepper, self._now, self._gathered = _Numbers(), _Numbers(), _Numbers()

    @cached_property
    def channels(self) -> list[str]:
        """Names of the channels that the metrics need; their values lie in `c` from `first_channel` on."""
        return list(dict.fromkeys(name for m in self.metrics for name in (m.channel, m.by) if name))

    @property
    def first_channel(self) -> int:
        """The place in `c` of the first channel."""
        return self._now.count

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the arrays m and c, once `prepare` and `start` are there."""
        return {"m": self._stepper.count, "c": self._now.count + self._gathered.count}

    def with_law(self, law: AbstractDamper) -> AbstractVehicle:
        """The vehicle with another law at its dampers."""
        return self._placed(self.vehicle, law)

    @cached_property
    def prepare(self) -> Program:
        """`prepare(p, q, dt)`: the matrices of a step of dt [s], with the numbers of the law: m."""

        def prepare(of_law: list[Any], own: list[Any], dt: Any) -> list[Any]:
            car = with_values(self.vehicle, {n.path: value for n, value in zip(self.numbers, own, strict=True)})
            car = self._placed(car, self.law.law_of(of_law))
            equations = Equations(car.system(), MemoryLayout.SCALARS)
            return self._stepper.taken(Exponential().stepper(equations, dt))

        own = [symbols(f"q.{n.name}", n.value.shape) for n in self.numbers]
        return lower(prepare, self.law.values(), own, symbols("dt"))

    @cached_property
    def start(self) -> Program:
        """`start(m, h, r)`: at rest on a road of height h [m] and rate r [m/s]: c."""

        def start(held: list[Any], height: Any, rate: Any) -> list[Any]:
            stepper, observer = self._engine(held)
            road = RoadInput((height,), (rate,))
            now = stepper.start(settled(stepper.equations.system, height[None]), road)
            return [*self._now.taken(now), *self._gathered.taken(observer.begin(now, road))]

        return lower(start, self._held, symbols("h"), symbols("r"))

    @cached_property
    def step(self) -> Program:
        """`step(m, c, h0, r0, h1, r1)`: the motion a step later, the first part of c."""

        def step(held: list[Any], now: list[Any], *road: Any) -> list[Any]:
            begin, end = (RoadInput((height,), (rate,)) for height, rate in (road[:2], road[2:]))
            stepper, _ = self._engine(held)
            return self._now.taken(stepper(self._now.tree(now), begin, end))

        return lower(step, self._held, self._carried[0], *map(symbols, ("h0", "r0", "h1", "r1")))

    @cached_property
    def observe(self) -> Program:
        """`observe(m, c, h, r)`: the metrics with this instant, the second part of c."""

        def observe(held: list[Any], now: list[Any], gathered: list[Any], height: Any, rate: Any) -> list[Any]:
            _, observer = self._engine(held)
            road = RoadInput((height,), (rate,))
            return self._gathered.taken(observer.add(self._gathered.tree(gathered), self._now.tree(now), road))

        return lower(observe, self._held, *self._carried, symbols("h"), symbols("r"))

    @cached_property
    def end(self) -> Program:
        """`end(m, c)`: the metrics, in the order of `metrics`."""

        def end(held: list[Any], gathered: list[Any]) -> list[Any]:
            _, observer = self._engine(held)
            values = observer.end(self._gathered.tree(gathered), ())
            return [values[m.name] for m in self.metrics]

        return lower(end, self._held, self._carried[1])

    @property
    def _held(self) -> list[Symbols]:
        _ = self.prepare
        return self._stepper.symbols("m")

    @property
    def _carried(self) -> tuple[list[Symbols], list[Symbols]]:
        _ = self.start
        return self._now.symbols("c"), self._gathered.symbols("c", self._now.count)

    def _engine(self, held: list[Any]) -> tuple[Any, MetricObserver]:
        stepper = self._stepper.tree(held)
        return stepper, MetricObserver(stepper.equations, self.metrics, self.dt, self.count)

    def _placed(self, vehicle: AbstractVehicle, law: AbstractDamper) -> AbstractVehicle:
        places = [prefix[:-1] for prefix in self._places]
        return eqx.tree_at(lambda car: [get(car, place) for place in places], vehicle, [law] * len(places))
