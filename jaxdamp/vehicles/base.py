"""What every vehicle offers, all from its frame of parts."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper
from jaxdamp.metrics import current_names
from jaxdamp.parameters import Module, check_parameters, readable
from jaxdamp.vehicles.channels import Instant, RideMetric, channels_of, ride_metrics_of, units_of
from jaxdamp.vehicles.descriptions import descriptions_of
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.port_form import PortForm


class AbstractVehicle(Module):
    """Masses and springs with damper laws at ports.

    A vehicle names its parameters and has one method, `frame`, which says what it is made of; matrices, elements,
    channels, units, metrics and static loads follow. `docs/vehicles.md` builds one.
    """

    def __check_init__(self) -> None:
        check_parameters(self)

    def __repr__(self) -> str:
        return readable(self)

    @abstractmethod
    def frame(self) -> Frame:
        """The parts, from the geometry."""

    def port_form(self) -> PortForm:
        """The matrices, built from geometry."""
        return self.frame().port_form()

    def elements(self) -> tuple[AbstractDamper, ...]:
        """The law at each port."""
        return self.frame().elements()

    def channels(self, instant: Instant) -> dict[str, Scalar]:
        """What a test engineer would measure, by name, in the units of `units`; linear in the motion."""
        return channels_of(self.frame(), instant)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates, heights [m] and angles [rad]."""
        return self.frame().coordinates

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel."""
        return units_of(self.frame())

    @property
    def descriptions(self) -> dict[str, str]:
        """What each channel is, its positive direction, and of how many dampers or wheels it is."""
        return descriptions_of(self.frame())

    @property
    def ride_metrics(self) -> tuple[RideMetric, ...]:
        """The numbers that say how the vehicle rides."""
        return ride_metrics_of(self.frame())

    def static_wheel_loads(self) -> Float[Array, " wheels"]:
        """Load of each wheel at rest on level ground [N] (see `Frame.static_wheel_loads`)."""
        return self.frame().static_wheel_loads()

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of the wheels, in the order of the columns that motions given wheel by wheel must have."""
        return tuple(wheel.name for wheel in self.frame().wheels)

    @property
    def axle_positions(self) -> Float[Array, " axles"]:
        """Distance of each axle behind the front axle [m], by which it meets the road later."""
        return jnp.stack([wheel.behind for wheel in self.frame().wheels if not wheel.beside])

    @property
    def track_width(self) -> Scalar:
        """Largest distance between left and right wheels [m]; zero where a wheel stands for both sides."""
        offsets = jnp.stack([wheel.left for wheel in self.frame().wheels])
        return jnp.max(offsets) - jnp.min(offsets)


def chosen_metrics(vehicle: AbstractVehicle, names: Sequence[str] | None, argument: str) -> list[RideMetric]:
    """The ride metrics of these names, all of them if `names` is None; `argument` is what errors call the names.

    Raises:
        ValueError: a name that no ride metric has, with the nearest one; no name.
    """
    known = {m.name: m for m in vehicle.ride_metrics}
    if names is not None and not len(names):
        some = ", ".join(map(repr, list(known)[:3]))
        _checks.refuse(argument, "name one or more", "empty", f"Write [{some}], or leave it out for all.")
    return [known[name] for name in (known if names is None else current_names(argument, names, known))]


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
