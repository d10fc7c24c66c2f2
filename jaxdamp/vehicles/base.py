"""The base class of all vehicles: everything follows from the frame of parts."""

import functools
from abc import abstractmethod
from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork
from jaxdamp._quickly import compiled_quickly
from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper
from jaxdamp.metrics import Metric, current_name
from jaxdamp.parameters import AbstractDeclared
from jaxdamp.vehicles.channels import channels_of
from jaxdamp.vehicles.chosen_metrics import GOALS, chosen_metrics, metrics_of_goal
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.port_form import PortForm
from jaxdamp.vehicles.system import Layout, System, assemble, layout_of


class AbstractVehicle(AbstractDeclared):
    """Masses and springs with damper laws at ports.

    A vehicle declares its parameters and has one method, `frame`, which returns its parts; the `layout` and the
    assembled `system` follow from it. `docs/vehicles.md` shows an example.
    """

    @abstractmethod
    def frame(self) -> Frame:
        """The parts, from the geometry."""

    def system(self) -> System:
        """The assembled vehicle: matrices, laws, outputs. Compiled once for all vehicles of one layout."""
        refuse_fork()
        return _assembled(self)

    @property
    def passive(self) -> "AbstractVehicle":
        """The vehicle without its controller (`control.Controlled`), its dampers at fixed commands; mostly itself."""
        return self

    @property
    def layout(self) -> Layout:
        """Names of coordinates, ports, wheels, channels and metrics, independent of all parameter values."""
        leaves, structure = jax.tree.flatten(self)
        shapes = (jax.ShapeDtypeStruct(leaf.shape, leaf.dtype) if eqx.is_array(leaf) else leaf for leaf in leaves)
        return _layout_of(structure, tuple(shapes))

    def port_form(self) -> PortForm:
        """The matrices, built from geometry."""
        return self.frame().port_form()

    def elements(self) -> tuple[AbstractDamper, ...]:
        """The law at each port."""
        return self.frame().elements()

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates, heights [m] and angles [rad]."""
        return self.layout.coordinates

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel."""
        return dict(self.layout.units)

    @property
    def descriptions(self) -> dict[str, str]:
        """Meaning of each channel, its positive direction, and the number of dampers or wheels it stands for."""
        return {channel.name: channel.description for channel in self.layout.channels}

    @property
    def ride_metrics(self) -> tuple[Metric, ...]:
        """The predefined ride metrics."""
        return self.layout.metrics

    def chosen_metrics(
        self, wanted: Sequence[str | Metric] | None, argument: str = "metrics", *, white: bool = False
    ) -> list[Metric]:
        """These metrics, by the names of ride metrics or as a `Metric` of any channel; all ride metrics if None.

        The short names "comfort", "travel" and "grip" mean what `goal_metrics` says, on a `white` road its RMS.

        Raises:
            ValueError: an unknown name or channel, with the nearest known one; the message names `argument`.
        """
        return chosen_metrics(self.layout, wanted, argument, white=white)

    def goal_metrics(self, goal: str, *, white: bool = False) -> list[str]:
        """The names of the ride metrics that a short name means: "comfort", "travel" or "grip"; or of one metric.

        Comfort is the weighted RMS acceleration of the body [m/s^2]; travel the working space of every suspension, peak
        to peak, on a white road its RMS [m]; grip the RMS variation of the load of every tyre [N]. The same names are
        taken by `Ride`, `simulate(...).metrics`, `tune` and the command line.

        Arguments:
            goal: such a name, or that of a ride metric.
            white: for stationary rides on a white road.

        Raises:
            ValueError: an unknown name.

        >>> from jaxdamp import vehicles
        >>> vehicles.presets.half_car_002().goal_metrics("grip")
        ['rms_front_dynamic_tyre_load', 'rms_rear_dynamic_tyre_load']
        """
        if goal not in GOALS:
            _checks.one_of("goal", current_name(goal, [m.name for m in self.layout.metrics]), self.metric_words)
            return [goal]
        return metrics_of_goal(self.layout, goal, white=white)

    @property
    def metric_words(self) -> list[str]:
        """All names that a ride metric may have: the short ones first."""
        return [*GOALS, *(metric.name for metric in self.layout.metrics)]

    def static_wheel_loads(self) -> Float[Array, " wheels"]:
        """Load of each wheel at rest on level ground [N] (see `Frame.static_wheel_loads`)."""
        return self.frame().static_wheel_loads()

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of the wheels, in the order of the columns of a road with one column for each wheel."""
        return self.layout.wheels

    @property
    def axle_positions(self) -> Float[Array, " axles"]:
        """Distance of each axle behind the front axle [m]."""
        return jnp.stack([wheel.behind for wheel in self.frame().wheels if not wheel.beside])

    @property
    def track_width(self) -> Scalar:
        """Largest distance between left and right wheels [m]; zero where a wheel stands for both sides."""
        offsets = jnp.stack([wheel.left for wheel in self.frame().wheels])
        return jnp.max(offsets) - jnp.min(offsets)


def refuse_controller(vehicle: AbstractVehicle, asker: str) -> None:
    """Refuse a vehicle with a controller, where its laws alone count.

    Arguments:
        vehicle: any vehicle.
        asker: what is asked for, in words.
    """
    if vehicle.passive is not vehicle:
        remedy = "Pass `vehicle.passive`, whose dampers have fixed commands."
        _checks.refuse("vehicle", f"be without a controller for {asker}", type(vehicle).__name__, remedy)


@functools.lru_cache(maxsize=256)
def _layout_of(structure: object, leaves: tuple[object, ...]) -> Layout:
    """The layout of vehicles of this structure, whose arrays have these shapes: their values do not change it."""
    layouts = []

    def trace(vehicle: AbstractVehicle) -> None:
        frame = vehicle.frame()
        layouts.append(layout_of(frame, channels_of(frame)))

    eqx.filter_eval_shape(trace, jax.tree.unflatten(structure, leaves))  # adds nothing to a program being compiled
    return layouts[0]


@compiled_quickly
def _assembled(vehicle: AbstractVehicle) -> System:
    return assemble(vehicle.frame())


@final
class LumpedVehicle(AbstractVehicle):
    """A vehicle given directly by a list of parts.

    Its parameters are those of the parts, such as `parts.links.0.stiffness`. For parameters with your own names, derive
    a class from `AbstractVehicle` (`docs/vehicles.md` shows both).

    Arguments:
        parts: bodies, links, wheels and places.
        tyre_lifts: whether all tyres can lift off; for a single wheel, set `lifts` of the `Wheel`.

    >>> from jaxdamp.dampers import Linear
    >>> from jaxdamp.vehicles import Body, Element, Link, Wheel
    >>> body, wheel = Body("sprung", 300.0), Body("unsprung", 40.0)
    >>> suspension = Link("", body.at() - wheel.at(), stiffness=20e3, elements=(Element("damper", Linear(1500.0)),))
    >>> car = LumpedVehicle(Frame((body, wheel), (suspension,), (Wheel("", wheel.at(), 180e3),)))
    >>> car.static_wheel_loads().round(2)
    Array([3334.26], dtype=float64)
    """

    parts: Frame
    tyre_lifts: bool = eqx.field(static=True, default=False)

    def frame(self) -> Frame:
        """The parts."""
        return self.parts.lifting(self.tyre_lifts)
