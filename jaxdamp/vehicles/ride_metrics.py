"""The numbers that say how a vehicle rides."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from jaxdamp.metrics import STATISTICS
from jaxdamp.vehicles.channels import Channel, ChannelKind
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Link, Wheel, prefixed


class RideMetric(NamedTuple):
    """A number that says how a vehicle rides.

    Arguments:
        name: what it is called.
        channel: what it is made of.
        statistic: how, one of `metrics.STATISTICS`.
        by: a second channel, which the first is multiplied with.
        from_rest: whether the channel is counted from its value in the static equilibrium on the road's first heights.
    """

    name: str
    channel: str
    statistic: str
    by: str = ""
    from_rest: bool = False

    def unit(self, units: Mapping[str, str]) -> str:
        """Its unit, from those of the channels."""
        return STATISTICS[self.statistic].unit(units[self.channel])

    def is_stationary(self, channels: Mapping[str, Channel]) -> bool:
        """Whether the RMS of its channel on a white road gives it; a height wanders with the road and has none."""
        wanders = self.from_rest and channels[self.channel].kind is ChannelKind.HEIGHT
        return STATISTICS[self.statistic].of_rms is not None and not wanders


def ride_metrics_of(frame: Frame, channels: Sequence[Channel]) -> tuple[RideMetric, ...]:
    """What a ride is judged by, in groups: bodies and places, suspensions, tyres."""
    return (*_of_bodies(frame, channels), *_of_elements(frame), *_of_tyres(frame))


def _of_bodies(frame: Frame, channels: Sequence[Channel]) -> list[RideMetric]:
    """Accelerations of the bodies that are not wheels and of the places, unweighted and weighted by ISO 2631-1.

    Displacements and angles of these bodies, from the static equilibrium.
    """
    on_wheels = {name for wheel in frame.wheels for name in wheel.point.terms}
    main = frame.main_body.name
    bodies = {body.name for body in frame.bodies if body.name == main or on_wheels.isdisjoint(body.masses)}
    places = bodies | {place.name for place in frame.places}
    felt = [c.name for c in channels if c.kind.weighting is not None and c.place in places]
    of_acceleration = ("rms", "peak", "weighted_rms", "vibration_dose_value")
    metrics = [RideMetric(f"{statistic}_{name}", name, statistic) for name in felt for statistic in of_acceleration]
    for c in channels:
        if c.place in bodies and c.kind in (ChannelKind.HEIGHT, ChannelKind.ANGLE):
            word = f"{c.place}_displacement" if c.kind is ChannelKind.HEIGHT else f"{c.name}_angle"
            metrics += [RideMetric(f"{s}_{word}", c.name, s, from_rest=True) for s in ("rms", "peak")]
    return metrics


def _of_elements(frame: Frame) -> list[RideMetric]:
    """Working space and velocity of every link with laws, and the power that each law takes."""
    metrics: list[RideMetric] = []
    parts: list[Link | Wheel] = [*frame.links, *frame.wheels]
    for part in parts:
        stroke, velocity = prefixed(part.name, "stroke"), prefixed(part.name, "damper_velocity")
        if part.elements:
            space = prefixed(part.name, "working_space")
            metrics += [
                RideMetric(f"{space}_rms", stroke, "standard_deviation"),
                RideMetric(f"{space}_mean", stroke, "mean", from_rest=True),
                RideMetric(f"{space}_peak_to_peak", stroke, "peak_to_peak"),
                RideMetric(f"peak_{velocity}", velocity, "peak"),
            ]
        for element in part.elements:
            name = prefixed(part.name, element.name)
            metrics.append(RideMetric(f"{name}_dissipated_power", f"{name}_force", "dissipated_power", velocity))
    return metrics


def _of_tyres(frame: Frame) -> list[RideMetric]:
    """Variation of the tyre loads, and how often a wheel lifts off."""
    metrics: list[RideMetric] = []
    for wheel in frame.wheels:
        load, relative = prefixed(wheel.name, "dynamic_tyre_load"), prefixed(wheel.name, "relative_tyre_load")
        coefficient = prefixed(wheel.name, "dynamic_load_coefficient")
        metrics += [RideMetric(f"rms_{load}", load, "rms"), RideMetric(coefficient, relative, "standard_deviation")]
        of_load = ("road_stress_factor", "lift_off_fraction")
        metrics += [RideMetric(prefixed(wheel.name, statistic), relative, statistic) for statistic in of_load]
    return metrics
