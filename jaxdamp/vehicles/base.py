"""What every vehicle offers, all from its frame of parts."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper, without_fitted_ranges
from jaxdamp.metrics import Metric
from jaxdamp.parameters import Module, check_parameters, readable
from jaxdamp.vehicles.channels import channels_of
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.port_form import PortForm
from jaxdamp.vehicles.ride_metrics import chosen_metrics
from jaxdamp.vehicles.system import Layout, System, assemble, layout_of


_LAYOUTS: dict[Any, Layout] = {}  # by all of a vehicle but the values of its arrays, which do not change its layout


class AbstractVehicle(Module):
    """Masses and springs with damper laws at ports.

    A vehicle names its parameters and has one method, `frame`, which says what it is made of; the `layout` and the
    assembled `system` follow from it. `docs/vehicles.md` builds one.
    """

    def __check_init__(self) -> None:
        check_parameters(self)

    def __repr__(self) -> str:
        return readable(self)

    @abstractmethod
    def frame(self) -> Frame:
        """The parts, from the geometry."""

    def system(self) -> System:
        """The vehicle assembled: matrices, laws, outputs. Compiled once for all vehicles of one layout."""
        return _assembled(without_fitted_ranges(self))  # vehicles with laws fitted to other records share one program

    @property
    def layout(self) -> Layout:
        """Names of coordinates, ports, wheels, channels and metrics: what depends on no number."""
        leaves, structure = jax.tree.flatten(without_fitted_ranges(self))
        key = structure, tuple(leaf.shape if eqx.is_array(leaf) else leaf for leaf in leaves)
        if key not in _LAYOUTS:
            eqx.filter_eval_shape(lambda vehicle: _remember_layout(key, vehicle), self)  # leaves no trace in a program
        return _LAYOUTS[key]

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
        """What each channel is, its positive direction, and of how many dampers or wheels it is."""
        return {channel.name: channel.description for channel in self.layout.channels}

    @property
    def ride_metrics(self) -> tuple[Metric, ...]:
        """The numbers that say how the vehicle rides."""
        return self.layout.metrics

    def chosen_metrics(self, wanted: Sequence[str | Metric] | None, argument: str = "metrics") -> list[Metric]:
        """These metrics, by the names of ride metrics or as a `Metric` of any channel; all ride metrics if None.

        Raises:
            ValueError: an unknown name or channel, with the nearest one; `argument` is what the error calls them.
        """
        return chosen_metrics(self.layout.metrics, self.layout.by_name, wanted, argument)

    def static_wheel_loads(self) -> Float[Array, " wheels"]:
        """Load of each wheel at rest on level ground [N] (see `Frame.static_wheel_loads`)."""
        return self.frame().static_wheel_loads()

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of the wheels, in the order of the columns that motions given wheel by wheel must have."""
        return self.layout.wheels

    @property
    def axle_positions(self) -> Float[Array, " axles"]:
        """Distance of each axle behind the front axle [m], by which it meets the road later."""
        return jnp.stack([wheel.behind for wheel in self.frame().wheels if not wheel.beside])

    @property
    def track_width(self) -> Scalar:
        """Largest distance between left and right wheels [m]; zero where a wheel stands for both sides."""
        offsets = jnp.stack([wheel.left for wheel in self.frame().wheels])
        return jnp.max(offsets) - jnp.min(offsets)


def _remember_layout(key: Any, vehicle: AbstractVehicle) -> None:
    frame = vehicle.frame()
    _LAYOUTS[key] = layout_of(frame, channels_of(frame))


@eqx.filter_jit
def _assembled(vehicle: AbstractVehicle) -> System:
    return assemble(vehicle.frame())


@final
class LumpedVehicle(AbstractVehicle):
    """A vehicle that is a list of parts and nothing else, for one of its own kind.

    Its parameters are those of the parts, such as `parts.links.0.stiffness`. To give parameters names of your own,
    derive a class from `AbstractVehicle` (`docs/vehicles.md` shows both).

    Arguments:
        parts: bodies, links, wheels and places.
        tyre_lifts: whether all wheels can leave the road; a single `Wheel` can say so itself (`lifts`).

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
