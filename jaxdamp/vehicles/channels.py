"""What a test engineer would measure on a vehicle, by name: channels, their units and the ride metrics made of them."""

from collections.abc import Mapping
from typing import NamedTuple, final

import equinox as eqx
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.metrics import STATISTICS
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.parts import Link, Wheel, prefixed


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

    def is_stationary(self, units: Mapping[str, str]) -> bool:
        """Whether the RMS of its channel on a white road gives it; a height wanders with the road and has none."""
        return STATISTICS[self.statistic].of_rms is not None and not (self.from_rest and units[self.channel] == "m")


def _acceleration(coordinate: str) -> str:
    return f"{coordinate.removeprefix('z_')}_acceleration"


def units_of(frame: Frame) -> dict[str, str]:
    """Unit of each channel, by name."""
    units: dict[str, str] = {}
    for name in frame.coordinates:
        unit = "m" if name.startswith("z_") else "rad"
        units |= {name: unit, _acceleration(name): f"{unit}/s^2"}
    for place in frame.places:
        units |= {f"z_{place.name}": "m", f"{place.name}_acceleration": "m/s^2"}
    parts: list[Link | Wheel] = [*frame.links, *frame.wheels]
    for part in parts:
        if part.elements:
            units |= {prefixed(part.name, "stroke"): "m", prefixed(part.name, "damper_velocity"): "m/s"}
            units |= {prefixed(part.name, f"{element.name}_force"): "N" for element in part.elements}
    for wheel in frame.wheels:
        units |= {f"z_{prefixed(wheel.name, 'road')}": "m", prefixed(wheel.name, "dynamic_tyre_load"): "N"}
        units |= {prefixed(wheel.name, "relative_tyre_load"): ""}
    return units


def channels_of(frame: Frame, instant: Instant) -> dict[str, Scalar]:
    """Value of each channel at an instant; linear in the motion, the road and the forces of the elements.

    Heights and angles, their accelerations, stroke, velocity and forces of the links with laws, road heights, tyre
    loads beyond the static ones (positive: more load).
    """
    names = frame.coordinates
    position, velocity, acceleration = (
        dict(zip(names, values, strict=True)) for values in (instant.position, instant.velocity, instant.acceleration)
    )
    found: dict[str, Scalar] = {}
    for name in names:
        found |= {name: position[name], _acceleration(name): acceleration[name]}
    for place in frame.places:
        point = frame.place(place)
        found[f"z_{place.name}"] = point.of(position)
        found[f"{place.name}_acceleration"] = point.of(acceleration)
    forces = dict(zip(frame.element_names, instant.port_force, strict=True))
    for link in frame.links:
        if link.elements:
            found[prefixed(link.name, "stroke")] = link.extension.of(position)
            found[prefixed(link.name, "damper_velocity")] = link.extension.of(velocity)
    loads = frame.static_wheel_loads()
    for i, wheel in enumerate(frame.wheels):
        stretch = wheel.point.of(position) - instant.road[i]
        rate = wheel.point.of(velocity) - instant.road_rate[i]
        own = [prefixed(wheel.name, element.name) for element in wheel.elements]
        pull = wheel.stiffness * stretch + wheel.damping * rate
        for name in own + [prefixed(wheel.name, "lift_off")] * wheel.lifts:
            pull = pull + forces[name]
        if wheel.elements:
            found |= {prefixed(wheel.name, "stroke"): stretch, prefixed(wheel.name, "damper_velocity"): rate}
        found[f"z_{prefixed(wheel.name, 'road')}"] = instant.road[i]
        found[prefixed(wheel.name, "dynamic_tyre_load")] = -pull
        found[prefixed(wheel.name, "relative_tyre_load")] = -pull / loads[i]
    for part in [*frame.links, *frame.wheels]:
        for element in part.elements:  # several that act together: the force of one
            name = prefixed(part.name, element.name)
            found[f"{name}_force"] = forces[name] if element.count == 1 else forces[name] / element.count
    return found


def ride_metrics_of(frame: Frame) -> tuple[RideMetric, ...]:
    """What a ride is judged by, in groups: bodies and places, suspensions, tyres."""
    return (*_of_bodies(frame), *_of_elements(frame), *_of_tyres(frame))


def _of_bodies(frame: Frame) -> list[RideMetric]:
    """Accelerations of the bodies that are not wheels and of the places, as they are and as people feel them.

    Displacements and angles of these bodies, from the static equilibrium.
    """
    on_wheels = {name for wheel in frame.wheels for name in wheel.point.terms}
    riding = [b for b in frame.bodies if b.name == frame.main_body.name or on_wheels.isdisjoint(b.masses)]
    coordinates = [name for body in riding for name in body.masses]
    channels = [_acceleration(name) for name in coordinates] + [f"{place.name}_acceleration" for place in frame.places]
    of_acceleration = ("rms", "peak", "weighted_rms", "vibration_dose_value")
    metrics = [RideMetric(f"{statistic}_{c}", c, statistic) for c in channels for statistic in of_acceleration]
    for name in coordinates:
        word = f"{name[2:]}_displacement" if name.startswith("z_") else f"{name}_angle"
        metrics += [RideMetric(f"{statistic}_{word}", name, statistic, from_rest=True) for statistic in ("rms", "peak")]
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
