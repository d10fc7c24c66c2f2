"""Starting values of a mono-tube damper from records and its geometry."""

from typing import NamedTuple

import numpy as np

from jaxdamp.dampers._guesses import knee_scan


NEAR_REST = 0.1  # velocity, relative to its peak, below which the force shows gas, friction and bleed
KNEES = np.linspace(0.04, 1.0, 49)  # opening velocities of a valve to try, relative to the peak velocity
LEAST_CHARGE = 3e5  # Pa, absolute
GAS_TO_ROD = (1.5, 20.0)  # limits of the gas volume relative to that of the rod over the stroke
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
