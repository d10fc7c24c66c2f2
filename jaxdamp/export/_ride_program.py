"""A vehicle with a law, and its ride metrics, as functions of their numbers, which the explorer computes."""

import dataclasses
from functools import cached_property

import equinox as eqx
import jax
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, PyTree

from jaxdamp import _checks
from jaxdamp._traced import equal
from jaxdamp.codegen import Program, Symbols, symbols
from jaxdamp.dampers import AbstractDamper, Condition
from jaxdamp.export._law_program import LawNumber, LawProgram
from jaxdamp.export._vehicle_program import FlatTree, Numbers, VehicleProgram, road_input
from jaxdamp.parameters import get, modules_inside, with_values
from jaxdamp.simulation import MetricObserver
from jaxdamp.vehicles import AbstractVehicle, Drawing, matrix, refuse_controller


class RideProgram(VehicleProgram):
    """A vehicle with a law at its dampers, whose rides can be printed: steps, and the observer of the metrics.

    The numbers of the law and those of the vehicle are different objects, p and q. The observer has an array g.

    Arguments:
        law: the law, which the vehicle holds.
        vehicle: the vehicle.
        dt: interval of the instants [s].
        count: number of the instants of a run.

    Attributes:
        numbers: parameters and settings of the vehicle but those of the law; "fixed" if they place points and wheels.
        metrics: the ride metrics that a run gathers.
    """

    def __init__(self, law: LawProgram, vehicle: AbstractVehicle, dt: float, count: int) -> None:
        refuse_controller(vehicle, "a page")
        super().__init__(vehicle, member=law.member)
        inside = [(prefix, module) for prefix, module in modules_inside(self.vehicle) if prefix]
        self._places = [prefix for prefix, module in inside if equal(module, law.law)]
        if not self._places:
            remedy = "Build it with the law: `QuarterCar(..., damper=law)`."
            _checks.refuse("vehicle", "hold the law as a damper", repr(type(vehicle).__name__), remedy)
        self.law = law
        self.numbers = [n for n in self.numbers if not any(n.path.startswith(prefix) for prefix in self._places)]
        self.numbers = [dataclasses.replace(n, kind="fixed") if moves else n for n, moves in self._that_place()]
        self.metrics = [m for m in vehicle.ride_metrics if not m.statistic.needs_record]
        self.dt, self.count = dt, count

    @property
    def needed(self) -> list[str]:
        """Names of the channels that the metrics need; they are the first numbers of g."""
        return list(dict.fromkeys(name for m in self.metrics for name in (m.channel, m.by) if name))

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the arrays m, c and g."""
        return super().sizes | {"g": self._gathered.count}

    def with_law(self, law: AbstractDamper) -> AbstractVehicle:
        """The vehicle with another law at its dampers."""
        return self._placed(self.vehicle, law)

    @cached_property
    def _gathered(self) -> FlatTree:
        """What the observer has gathered."""
        return self._flat(self._begun, self._held, self._carried, *self._road("h", "r"))

    def _begun(self, held: list[Array], now: list[Array], height: Array, rate: Array) -> PyTree:
        return self._observer(held).begin(self._carry.tree(now), road_input(height, rate))

    @cached_property
    def begin(self) -> Program:
        """`begin(m, c, h, r)`: the metrics with the first instant, g."""

        def begin(held: list[Array], now: list[Array], height: Array, rate: Array) -> list[Array]:
            return self._gathered.arrays(self._begun(held, now, height, rate))

        return self._lowered(begin, self._carried, *self._road("h", "r"))

    @cached_property
    def observe(self) -> Program:
        """`observe(m, c, g, h, r)`: the metrics with this instant, g."""

        def observe(
            held: list[Array], now: list[Array], gathered: list[Array], height: Array, rate: Array
        ) -> list[Array]:
            before, road = self._gathered.tree(gathered), road_input(height, rate)
            return self._gathered.arrays(self._observer(held).add(before, self._carry.tree(now), road))

        return self._lowered(observe, self._carried, self._observed_so_far, *self._road("h", "r"))

    @cached_property
    def end(self) -> Program:
        """`end(m, g)`: the metrics, in the order of `metrics`."""

        def end(held: list[Array], gathered: list[Array]) -> list[Array]:
            values = self._observer(held).end(self._gathered.tree(gathered), ())
            return [values[m.name] for m in self.metrics]

        return self._lowered(end, self._observed_so_far)

    @cached_property
    def drawing(self) -> Drawing:
        """How the vehicle is drawn in motion."""
        return Drawing(self.vehicle.frame(), [channel.name for channel in self.channels])

    @cached_property
    def moving(self) -> Program:
        """`moving(m, c, h, r)`: the coordinates [m, rad], then the forces of the dampers that are drawn [N]."""
        places = [channel.name for channel in self.channels]
        chosen = np.array([places.index(force) for force in self.drawing.forces], int)

        def moving(held: list[Array], motion: Array, *point: PyTree) -> list[Array]:
            _, outputs = self._observed(self._equations(held), motion, *point)
            return [motion[: len(self.layout.coordinates)], outputs[chosen]]

        motion, states, *road = self._point(of="c")
        return self._lowered(moving, motion, states, *road)

    def model_of(self, values: Numbers) -> AbstractVehicle:
        """The vehicle with other numbers, those of the law and its own."""
        of_law, of_vehicle = values
        car = with_values(self.vehicle, {n.path: value for n, value in zip(self.numbers, of_vehicle, strict=True)})
        return self._placed(car, self.law.model_of(of_law))

    def values(self, owner: str = "p") -> PyTree[Symbols]:
        """The numbers of the law, and those of the vehicle."""
        return self.law.values(owner), [symbols(f"q{self.member}{n.name}", n.value.shape) for n in self.numbers]

    def _conditions(self, model: eqx.Module) -> list[tuple[str, AbstractDamper, Condition]]:
        """Those of the other laws of the vehicle: the law has its own."""
        return [one for one in super()._conditions(model) if not one[0].startswith(tuple(self._places))]

    @property
    def _observed_so_far(self) -> list[Symbols]:
        return self._gathered.symbols("g", self.dtype)

    def _that_place(self) -> list[tuple[LawNumber, bool]]:
        """The numbers of the vehicle, and whether they place its points or its wheels."""

        def places(values: list[Array]) -> PyTree[Array]:
            frame = self.model_of(([number.value for number in self.law.numbers], values)).frame()
            points = [*(link.extension for link in frame.links), *(wheel.point for wheel in frame.wheels)]
            return matrix(points, frame.coordinates), [(wheel.behind, wheel.left) for wheel in frame.wheels]

        values = [number.value for number in self.numbers]
        changes = jax.tree.leaves(jax.jit(jax.jacfwd(lambda v: ravel_pytree(places(v))[0]))(values))
        return [(number, bool(np.any(change))) for number, change in zip(self.numbers, changes, strict=True)]

    def _observer(self, held: list[Array]) -> MetricObserver:
        return MetricObserver(self._equations(held), self.metrics, self.dt, self.count)

    def _placed(self, vehicle: AbstractVehicle, law: AbstractDamper) -> AbstractVehicle:
        places = [prefix[:-1] for prefix in self._places]
        return eqx.tree_at(lambda car: [get(car, place) for place in places], vehicle, [law] * len(places))
