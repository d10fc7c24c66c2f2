"""Vehicle models: linear masses and springs, with force laws at ports.

- Ready-made: `QuarterCar`, `HalfCar`, `RollCar`, `FullCar`, `TandemTruck`, `TrackedHull`, built from `Corner`, `Axle`,
  `WalkingBeam` or `IndependentTandem`, `Cab`, `Seat`, `Place`; published sets are in `vehicles.presets`.
- Your own: a `LumpedVehicle` from a `Frame` of `Body`, `Link` and `Wheel` parts (`docs/vehicles.md`).
- Analysis: `static_equilibrium`, `modes`, `critical_damping`, `linearise`, `frequency_response`, `stationary_rms`,
  `spectral_rms`; in time, `jaxdamp.simulate`.

z is up, pitch positive nose up, roll positive left side up.
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp.vehicles import presets
from jaxdamp.vehicles.base import AbstractVehicle, LumpedVehicle, refuse_controller as refuse_controller
from jaxdamp.vehicles.cars import FullCar, HalfCar, QuarterCar, RollCar
from jaxdamp.vehicles.channels import Channel as Channel, ChannelKind as ChannelKind
from jaxdamp.vehicles.chosen_metrics import GOALS as GOALS, is_stationary as is_stationary
from jaxdamp.vehicles.corner import Axle, Corner
from jaxdamp.vehicles.critical import CriticalDamping as CriticalDamping, critical_damping
from jaxdamp.vehicles.drawing import (
    UNKNOWN_SPEED as UNKNOWN_SPEED,
    Drawing as Drawing,
    drawing_script as drawing_script,
)
from jaxdamp.vehicles.equilibrium import (
    refuse_restless as refuse_restless,
    rest_position as rest_position,
    static_equilibrium,
)
from jaxdamp.vehicles.frame import (
    Frame,
    LiftOffWithLaws as LiftOffWithLaws,
    tangent_stiffness as tangent_stiffness,
)
from jaxdamp.vehicles.frequency_response import frequency_response, spectral_rms
from jaxdamp.vehicles.guided import ForceDriven as ForceDriven, Guide, Guided
from jaxdamp.vehicles.linear import (
    LinearVehicle as LinearVehicle,
    delays_of as delays_of,
    linearise,
    with_weightings as with_weightings,
)
from jaxdamp.vehicles.modes import Modes as Modes, Oscillations as Oscillations, modes, oscillations
from jaxdamp.vehicles.parts import (
    Body,
    Element as Element,
    Link,
    Place,
    Point as Point,
    Wheel,
    matrix as matrix,
    prefixed as prefixed,
)
from jaxdamp.vehicles.port_form import (
    Earlier as Earlier,
    LinearMap as LinearMap,
    PortForm as PortForm,
    Ports as Ports,
    States as States,
)
from jaxdamp.vehicles.stationary import EquivalentDamper as EquivalentDamper, equivalent_dampers, stationary_rms
from jaxdamp.vehicles.statistical import nonlinear_variables as nonlinear_variables
from jaxdamp.vehicles.suspension import CubicSpring, Seat, SeatMass, Suspension
from jaxdamp.vehicles.system import Layout as Layout, System as System
from jaxdamp.vehicles.tandem_truck import Cab, IndependentTandem, TandemTruck, WalkingBeam
from jaxdamp.vehicles.tracked_hull import PitchDecay as PitchDecay, TrackedHull


__all__ = [
    "AbstractVehicle",
    "Axle",
    "Body",
    "Cab",
    "Corner",
    "CubicSpring",
    "Frame",
    "FullCar",
    "Guide",
    "Guided",
    "HalfCar",
    "IndependentTandem",
    "Link",
    "LumpedVehicle",
    "Place",
    "QuarterCar",
    "RollCar",
    "Seat",
    "SeatMass",
    "Suspension",
    "TandemTruck",
    "TrackedHull",
    "WalkingBeam",
    "Wheel",
    "critical_damping",
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

answer_guesses(__name__, __all__)
