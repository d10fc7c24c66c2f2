"""Starting values of a tube from records and its geometry."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp.dampers._guesses import knee_scan
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.gas_spring import GasSpring
from jaxdamp.dampers.piston_flow import flow_per_area


NEAR_REST = 0.1  # velocity, relative to its peak, below which the force shows gas, friction and bleed
KNEES = np.linspace(0.04, 1.0, 49)  # opening velocities of a valve to try, relative to the peak velocity
LEAST_CHARGE = 3e5  # Pa, absolute
GAS_TO_ROD = (1.5, 20.0)  # limits of the gas volume relative to that of the rod over the stroke
EXPONENT, ATMOSPHERE, BULK_MODULUS = 1.3, 101_325.0, 1e9  # n, Pa and Pa where nothing is known
LEAK_SHARE = 0.01  # of the flow through the bleed when a valve opens
CHECK_OPENING = 1e4  # Pa, of a check valve, which is about half open at twice that
FULLY_OPEN = 4.0  # largest area of a valve relative to that which it opens in the records


class ChargeStart(NamedTuple):
    """Gas pressure at stroke zero [Pa, absolute] and gas volume [m³]."""

    pressure: float
    volume: float


class ValveStart(NamedTuple):
    """Numbers of one direction: bleed [m²], valve opening [Pa], stiffness [Pa/m²] and area [m²], friction [N]."""

    bleed_area: float
    opening_pressure: float
    stiffness: float
    largest_area: float
    friction: float

    @property
    def leak(self) -> float:
        """A laminar leak [m³/s/Pa] of a small share of the flow through the bleed when the valve opens."""
        return LEAK_SHARE * float(flow_per_area()) * self.bleed_area / float(np.sqrt(self.opening_pressure))

    def share(self, part: float) -> "ValveStart":
        """The valve for this part of the flow at the same pressure drop."""
        return self._replace(
            bleed_area=part * self.bleed_area, stiffness=self.stiffness / part, largest_area=part * self.largest_area
        )


def static_force(velocity: np.ndarray, force: np.ndarray, stroke: np.ndarray) -> tuple[float, float, float]:
    """Force at rest at stroke zero [N], stiffness [N/m] and friction [N], from the slow samples.

    There F = f₀ + k x + F_c sgn v + q v |v|, with a factor q of the turbulent bleed for each direction.
    """
    slow = np.abs(velocity) < NEAR_REST * np.max(np.abs(velocity))
    v, x = velocity[slow], stroke[slow]
    columns = [np.ones_like(v), x, np.sign(v), np.maximum(v, 0.0) ** 2, -(np.minimum(v, 0.0) ** 2)]
    scale = [1.0, max(float(np.ptp(x)), 1e-9), 1.0, *[max(float(np.max(v**2)), 1e-12)] * 2]
    level, slope, friction, *_ = np.linalg.lstsq(np.stack(columns, axis=1) / scale, force[slow])[0] / scale
    return float(level), float(slope), float(friction)


def charge_start(
    level: float, stiffness: float, travel: float, rod_area: float, exponent: float, outside: float
) -> ChargeStart:
    """The gas from the static force −(p₀ − p_atm) A_r and the stiffness n p₀ A_r²/V₀."""
    pressure = max(outside - level / rod_area, LEAST_CHARGE)
    least, most = (share * rod_area * travel for share in GAS_TO_ROD)
    return ChargeStart(pressure, float(np.clip(exponent * pressure * rod_area**2 / max(stiffness, 1e-9), least, most)))


def valve_start(velocity: np.ndarray, force: np.ndarray, side: int, area: float, per_area: float) -> ValveStart:
    """One direction, from the knee of the mean force: |F| = F_c + q v² to the knee, a straight line beyond.

    Arguments:
        velocity: [m/s].
        force: without the static force [N].
        side: +1 rebound, −1 compression.
        area: A of the piston [m²].
        per_area: C_d √(2/ρ), flow per open area and root of the pressure [m/s/√Pa].
    """

    def columns(v: np.ndarray, knee: float) -> list[np.ndarray]:
        return [np.minimum(v, knee) ** 2, np.maximum(v - knee, 0.0), np.ones_like(v)]

    knee, (square, slope, friction) = knee_scan(velocity, force, side, columns, KNEES)
    peak = max(float(np.max(side * velocity)), knee)
    square = max(float(square), 1e-3 * max(float(np.max(np.abs(force))), 1.0) / peak**2)
    opening = square * knee**2 / area
    bleed = area * np.sqrt(area / square) / per_area
    at_peak = opening + slope * (peak - knee) / area
    open_area = max(area * peak / (per_area * np.sqrt(at_peak)) - bleed, 0.05 * bleed)
    stiffness = max(at_peak - opening, 0.05 * opening) / open_area
    return ValveStart(bleed, opening, stiffness, FULLY_OPEN * open_area, float(friction))


class TubeStart(NamedTuple):
    """What records show of a tube whose bore and rod are known."""

    area: float  # of the piston without the rod [m²]
    gas: GasSpring
    friction: float  # from the slow samples [N]
    travel: float  # [m]
    stroke: np.ndarray  # all samples [m]
    velocity: np.ndarray  # [m/s]
    oil: np.ndarray  # force of the oil [N]

    def valve(self, side: int, area: float) -> ValveStart:
        """The valve of one direction, if its flow passes a piston of this area."""
        return valve_start(self.velocity, self.oil, side, area, float(flow_per_area()))

    def check_valve(self, area: float) -> tuple[float, float, float]:
        """Opening pressure [Pa], stiffness [Pa/m²] and area [m²] of a valve that resists little."""
        flow = area * float(np.max(np.abs(self.velocity)))
        half_open = flow / float(flow_per_area() * np.sqrt(2.0 * CHECK_OPENING))
        return CHECK_OPENING, CHECK_OPENING / half_open, half_open

    def seal(self, *valves: ValveStart) -> CoulombFriction:
        """The least friction that anything shows, since hysteresis adds to each."""
        least = min(self.friction, *(valve.friction for valve in valves))
        return CoulombFriction(max(least, 1.0), 0.01 * float(np.max(np.abs(self.velocity))))

    def oil_volume(self, side: int, area: float) -> float:
        """Oil at stroke zero [m³] in a chamber that is emptied at the end of a stroke and one travel more."""
        return area * (max(float(np.max(side * self.stroke)), 0.0) + self.travel)


def tube_start(
    law: str,
    samples: Sequence[np.ndarray],
    piston_diameter: float | None,
    rod_diameter: float | None,
    gas_pressure: float | None,
    gas_volume: float | None,
) -> TubeStart:
    """What records show of a tube whose bore and rod are known.

    Arguments:
        law: name of the class, for messages.
        samples: velocity [m/s], force [N] and stroke [m].
        piston_diameter: of the tube [m].
        rod_diameter: [m].
        gas_pressure: p₀, absolute, at stroke zero [Pa], if it is known.
        gas_volume: V_g at stroke zero [m³], if it is known.

    Raises:
        ValueError: no geometry; a rod as thick as the piston.
    """
    for name, given in (("piston_diameter", piston_diameter), ("rod_diameter", rod_diameter)):
        if given is None:
            example = f"functools.partial({law}.guess, piston_diameter=0.046, rod_diameter=0.011)"
            _checks.refuse(name, "be stated [m]", None, f"Write `fit({example}, runs)`.")
        _checks.positive(name, given)
    assert piston_diameter is not None and rod_diameter is not None
    if not rod_diameter < piston_diameter:
        _checks.refuse("rod_diameter", f"be below the piston's {piston_diameter} m", rod_diameter)
    velocity, force, stroke = (np.asarray(a, dtype=float) for a in samples)
    rod_area = 0.25 * np.pi * rod_diameter**2
    travel = max(float(np.ptp(stroke)), 1e-3)
    level, stiffness, friction = static_force(velocity, force, stroke)
    charge = charge_start(level, stiffness, travel, rod_area, EXPONENT, ATMOSPHERE)
    gas = GasSpring(gas_pressure or charge.pressure, gas_volume or charge.volume, rod_area, EXPONENT)
    area = 0.25 * np.pi * piston_diameter**2 - rod_area
    return TubeStart(area, gas, friction, travel, stroke, velocity, force - level - stiffness * stroke)
