"""What every vehicle offers: its port form, its elements, its channels and its ride metrics."""

from abc import abstractmethod
from typing import ClassVar, NamedTuple, final

import equinox as eqx
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import check_parameters
from jaxdamp.vehicles.port_form import PortForm


@final
class Instant(eqx.Module):
    """The motion of a vehicle at one instant, SI units."""

    position: Float[Array, " q"]
    velocity: Float[Array, " q"]
    acceleration: Float[Array, " q"]
    road: Float[Array, " wheels"]
    road_rate: Float[Array, " wheels"]
    port_force: Float[Array, " ports"]


class RideMetric(NamedTuple):
    """A number that says how a vehicle rides: a statistic ("rms", "peak", "peak_to_peak") of a channel."""

    name: str
    channel: str
    statistic: str


class AbstractVehicle(eqx.Module):
    """Masses and springs with damper laws at ports."""

    units: ClassVar[dict[str, str]]
    ride_metrics: ClassVar[tuple[RideMetric, ...]]

    def __check_init__(self) -> None:
        check_parameters(self)

    @abstractmethod
    def port_form(self) -> PortForm:
        """The matrices, built from geometry."""

    @abstractmethod
    def elements(self) -> tuple[AbstractDamper, ...]:
        """The law at each port."""

    @abstractmethod
    def channels(self, instant: Instant) -> dict[str, Scalar]:
        """What a test engineer would measure, by name, in the units of `units`; linear in the motion."""
