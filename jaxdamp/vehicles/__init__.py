"""Vehicle models: linear masses and springs, with force laws at ports.

- Ready-made: `QuarterCar`, `HalfCar`, `RollCar`, `FullCar`, `TandemTruck`, `TrackedHull`, built from `Corner`, `Axle`,
  `WalkingBeam` or `IndependentTandem`, `Cab`, `Seat`, `Place`; published sets are in `vehicles.presets`.
- Your own: a `LumpedVehicle` from a `Frame` of `Body`, `Link` and `Wheel` parts (`docs/vehicles.md`).
- Analysis: `static_equilibrium`, `modes`, `linearise`, `frequency_response`, `stationary_rms`,
  `spectral_rms`; in time, `jaxdamp.simulate`.

z is up, pitch positive nose up, roll positive left side up.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp.vehicles import presets
from jaxdamp.vehicles.axle import Axle
from jaxdamp.vehicles.base import AbstractVehicle, LumpedVehicle
from jaxdamp.vehicles.cab import Cab
from jaxdamp.vehicles.channels import Channel as Channel, ChannelKind as ChannelKind
from jaxdamp.vehicles.corner import Corner
from jaxdamp.vehicles.cubic_spring import CubicSpring
from jaxdamp.vehicles.equilibrium import (
    refuse_restless as refuse_restless,
    rest_position as rest_position,
    static_equilibrium,
)
from jaxdamp.vehicles.force_driven import ForceDriven
from jaxdamp.vehicles.frame import Frame
from jaxdamp.vehicles.frequency_response import frequency_response, spectral_rms
from jaxdamp.vehicles.full_car import FullCar
from jaxdamp.vehicles.guided import Guide, Guided
from jaxdamp.vehicles.half_car import HalfCar
from jaxdamp.vehicles.linear import LinearVehicle as LinearVehicle, delays_of as delays_of, linearise
from jaxdamp.vehicles.modes import Modes as Modes, modes
from jaxdamp.vehicles.oscillations import Oscillations as Oscillations, oscillations
from jaxdamp.vehicles.parts import Body, Element, Link, Place, Wheel, prefixed as prefixed
from jaxdamp.vehicles.points import Point
from jaxdamp.vehicles.port_form import LinearMap as LinearMap, PortForm as PortForm
from jaxdamp.vehicles.ports import Earlier as Earlier, Ports as Ports, States as States
from jaxdamp.vehicles.quarter_car import QuarterCar
from jaxdamp.vehicles.ride_metrics import is_stationary as is_stationary
from jaxdamp.vehicles.roll_car import RollCar
from jaxdamp.vehicles.seat import Seat, SeatMass
from jaxdamp.vehicles.stationary import EquivalentDamper as EquivalentDamper, equivalent_dampers, stationary_rms
from jaxdamp.vehicles.statistical import nonlinear_variables as nonlinear_variables
from jaxdamp.vehicles.suspension import Suspension
from jaxdamp.vehicles.system import Layout as Layout, System as System
from jaxdamp.vehicles.tandem import IndependentTandem, WalkingBeam
from jaxdamp.vehicles.tandem_truck import TandemTruck
from jaxdamp.vehicles.tracked_hull import PitchDecay as PitchDecay, TrackedHull
from jaxdamp.vehicles.weighted import with_weightings as with_weightings


__all__ = [
    "AbstractVehicle",
    "Axle",
    "Body",
    "Cab",
    "Corner",
    "CubicSpring",
    "Element",
    "ForceDriven",
    "Frame",
    "FullCar",
    "Guide",
    "Guided",
    "HalfCar",
    "IndependentTandem",
    "Link",
    "LumpedVehicle",
    "Place",
    "Point",
    "QuarterCar",
    "RollCar",
    "Seat",
    "SeatMass",
    "Suspension",
    "TandemTruck",
    "TrackedHull",
    "WalkingBeam",
    "Wheel",
    "equivalent_dampers",
    "frequency_response",
    "linearise",
    "modes",
    "oscillations",
    "presets",
    "spectral_rms",
    "static_equilibrium",
    "stationary_rms",
]
# What the other packages of the library import, and what is only returned: a user writes none of these.
__shared__ = [
    "Channel",
    "ChannelKind",
    "Earlier",
    "EquivalentDamper",
    "Layout",
    "LinearMap",
    "LinearVehicle",
    "Modes",
    "Oscillations",
    "PitchDecay",
    "PortForm",
    "Ports",
    "States",
    "System",
    "delays_of",
    "is_stationary",
    "nonlinear_variables",
    "prefixed",
    "refuse_restless",
    "rest_position",
    "with_weightings",
]

answer_guesses(__name__, __all__)
