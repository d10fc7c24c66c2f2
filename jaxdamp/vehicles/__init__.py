"""Vehicles in one form: linear masses and springs, damper laws at ports. Published sets are in `vehicles.presets`."""

from jaxdamp.vehicles import presets
from jaxdamp.vehicles.base import AbstractVehicle, Instant, RideMetric
from jaxdamp.vehicles.port_form import Connection, PortForm, assemble
from jaxdamp.vehicles.quarter_car import QuarterCar
from jaxdamp.vehicles.stationary import LinearVehicle, linearise, lyapunov, stationary_rms


__all__ = [
    "AbstractVehicle",
    "Connection",
    "Instant",
    "LinearVehicle",
    "PortForm",
    "QuarterCar",
    "RideMetric",
    "assemble",
    "linearise",
    "lyapunov",
    "presets",
    "stationary_rms",
]
