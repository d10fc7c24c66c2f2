"""Two masses over one another: body and wheel of one corner."""

from typing import ClassVar, final

import jax.numpy as jnp

from jaxdamp._types import Number, Scalar
from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import nonnegative, parameter, positive
from jaxdamp.vehicles.base import AbstractVehicle, Instant, RideMetric
from jaxdamp.vehicles.port_form import Connection, PortForm, assemble


STANDARD_GRAVITY = 9.80665  # m/s²


@final
class QuarterCar(AbstractVehicle):
    """A quarter of a car: sprung mass, spring and damper, unsprung mass, tyre.

    m_s z̈_s = −k_s (z_s − z_u) − F,  m_u z̈_u = k_s (z_s − z_u) + F − k_t (z_u − z_r) − c_t (ż_u − ż_r), with the
    damper force F at stroke z_s − z_u. Heights are measured from static equilibrium, z up. The tyre stays on the road
    (its load may become negative on paper: watch `tyre_load`). For any law, at every instant and with c_t = 0,
    m_s z̈_s + m_u z̈_u = −k_t (z_u − z_r).

    >>> from jaxdamp.dampers import Linear
    >>> car = QuarterCar(1200.0, 125.0, 60e3, 220e3, Linear(2500.0))
    >>> round(float(car.static_tyre_load()), 2)
    12993.81
    """

    sprung_mass: Number = parameter("kg", "mass of the body on this corner", positive)
    unsprung_mass: Number = parameter("kg", "mass of wheel and hub", positive)
    spring_rate: Number = parameter("N/m", "suspension spring rate at the wheel", positive)
    tyre_stiffness: Number = parameter("N/m", "vertical tyre stiffness", positive)
    damper: AbstractDamper  # pyright: ignore[reportGeneralTypeIssues]
    tyre_damping: Number = parameter("N s/m", "vertical tyre damping", nonnegative, default=0.0)

    units: ClassVar[dict[str, str]] = {
        "z_sprung": "m",
        "z_unsprung": "m",
        "z_road": "m",
        "sprung_acceleration": "m/s^2",
        "unsprung_acceleration": "m/s^2",
        "stroke": "m",
        "damper_velocity": "m/s",
        "damper_force": "N",
        "dynamic_tyre_load": "N",
        "relative_tyre_load": "",
    }
    ride_metrics: ClassVar[tuple[RideMetric, ...]] = (
        RideMetric("rms_sprung_acceleration", "sprung_acceleration", "rms"),
        RideMetric("peak_sprung_acceleration", "sprung_acceleration", "peak"),
        RideMetric("working_space_rms", "stroke", "rms"),
        RideMetric("working_space_peak", "stroke", "peak_to_peak"),
        RideMetric("rms_dynamic_tyre_load", "dynamic_tyre_load", "rms"),
        RideMetric("dynamic_load_coefficient", "relative_tyre_load", "standard_deviation"),
        RideMetric("peak_damper_velocity", "damper_velocity", "peak"),
    )

    def static_tyre_load(self) -> Scalar:
        """(m_s + m_u) g [N]."""
        return (self.sprung_mass + self.unsprung_mass) * STANDARD_GRAVITY

    def port_form(self) -> PortForm:
        """Coordinates z_s, z_u; one wheel; the damper between body and wheel."""
        body_to_wheel, wheel = jnp.array([1.0, -1.0]), jnp.array([0.0, 1.0])
        spring = Connection(body_to_wheel, jnp.zeros(1), self.spring_rate, jnp.zeros_like(self.spring_rate))
        tyre = Connection(wheel, jnp.ones(1), self.tyre_stiffness, self.tyre_damping)
        mass = jnp.diag(jnp.stack([self.sprung_mass, self.unsprung_mass]))
        return assemble(mass, [spring, tyre], body_to_wheel[None, :])

    def elements(self) -> tuple[AbstractDamper, ...]:
        """The damper."""
        return (self.damper,)

    def channels(self, instant: Instant) -> dict[str, Scalar]:
        """Heights, accelerations, damper motion and force, tyre load beyond the static one (positive: more load)."""
        z_sprung, z_unsprung = instant.position[0], instant.position[1]
        squeeze = instant.road[0] - z_unsprung
        load = self.tyre_stiffness * squeeze + self.tyre_damping * (instant.road_rate[0] - instant.velocity[1])
        return {
            "z_sprung": z_sprung,
            "z_unsprung": z_unsprung,
            "z_road": instant.road[0],
            "sprung_acceleration": instant.acceleration[0],
            "unsprung_acceleration": instant.acceleration[1],
            "stroke": z_sprung - z_unsprung,
            "damper_velocity": instant.velocity[0] - instant.velocity[1],
            "damper_force": instant.port_force[0],
            "dynamic_tyre_load": load,
            "relative_tyre_load": load / self.static_tyre_load(),
        }
