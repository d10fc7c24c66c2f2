"""What is measured of a damper: each quantity with its scatter, and the figures of the cycles of one record."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxdamp._display import plus_minus
from jaxdamp._tables import Cell, Shown
from jaxdamp.bench.analysis import NEAR_PEAK, FoldedCycles


@dataclass(frozen=True)
class Measurement:
    """A quantity of a damper, measured so many times.

    Arguments:
        quantity: its name, such as "rebound force".
        unit: in SI.
        value: the mean.
        scatter: standard deviation of the single values (over cycles, or over repeated records); None for a single one.
        count: single values in the mean.
        setting: of the damper, such as "0.5" for a coil current; empty if there is only one.
        record: of which it was measured; empty if several records went into it.
        velocity: at which it was measured [m/s], positive; None where it belongs to no velocity.
        uncertainty: half the width of an interval that should hold the true value, with errors of the method that the
            scatter does not show; None where it is not known.
    """

    quantity: str
    unit: str
    value: float
    scatter: float | None = None
    count: int = 1
    setting: str = ""
    record: str = ""
    velocity: float | None = None
    uncertainty: float | None = None

    @property
    def cell(self) -> Cell:
        """Value and uncertainty, or scatter where that is not known, for a table; nothing where there is no value."""
        if not np.isfinite(self.value):
            return None
        width = self.scatter if self.uncertainty is None else self.uncertainty
        return Shown(self.value, f"{self.value:.4g}" if width is None else plus_minus(self.value, width))


def at_velocity(measurement: Measurement, velocity: float | None) -> bool:
    """Whether it was measured at a velocity [m/s], or at none where that is None."""
    if velocity is None or measurement.velocity is None:
        return velocity is None and measurement.velocity is None
    return bool(np.isclose(measurement.velocity, velocity))


def measured(values: Float[np.ndarray, " values"]) -> tuple[float, float | None, int]:
    """Mean, standard deviation and number of the values that are finite."""
    values = values[np.isfinite(values)]
    if not len(values):
        return float("nan"), None, 0
    return float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else None, len(values)


CENTRAL = 0.1  # share of the stroke range that counts as mid-stroke
TURNING = 0.05  # of the peak velocity, below which samples count as taken at zero velocity

Cycles = Float[np.ndarray, "cycles points"]
Figures = Float[np.ndarray, " cycles"]


def record_measurements(cycles: FoldedCycles, setting: str, record: str) -> list[Measurement]:
    """Every figure of a record, the mean over its steady cycles with the scatter from cycle to cycle."""
    figures = cycle_figures(cycles)
    return [
        Measurement(quantity, unit, *measured(values), setting=setting, record=record)
        for (quantity, unit), values in figures.items()
    ]


def cycle_figures(cycles: FoldedCycles) -> dict[tuple[str, str], Figures]:
    """The figures of each cycle by quantity and unit.

    - force at peak velocity: mean over the samples within 2 % of the largest velocity of that direction;
    - force at mid-stroke: mean over the central 10 % of the stroke range;
    - rebound/compression ratio: of the magnitudes of the forces at peak velocity;
    - static force: at zero velocity, mean of both ends of the stroke;
    - energy: ∮ F v dt; equivalent damping: ∮ F v dt / ∮ v² dt, which is E / (π ω X²) for a sine;
    - hysteresis area: −∮ F dv, positive where the force lags behind the velocity;
    - hysteresis width: force at zero velocity at the rebound end of the stroke less that at the compression end,
      so that a spring (gas) of rate k adds 2 k X.
    """
    stroke, velocity, force = cycles.stroke, cycles.velocity, cycles.force
    rebound, compression = _peak_masks(velocity)
    forces = _mean_where(force, rebound), _mean_where(force, compression)
    span = np.ptp(stroke, axis=1, keepdims=True)
    middle = 0.5 * (stroke.max(axis=1, keepdims=True) + stroke.min(axis=1, keepdims=True))
    central = np.abs(stroke - middle) <= 0.5 * CENTRAL * span
    turning = np.abs(velocity) <= TURNING * np.abs(velocity).max(axis=1, keepdims=True)
    energy = np.mean(force * velocity, axis=1) * cycles.periods
    squared = np.mean(velocity**2, axis=1) * cycles.periods
    ends = [_mean_where(force, turning & side) for side in (stroke > middle, stroke < middle)]
    return {
        ("rebound velocity", "m/s"): _mean_where(velocity, rebound),
        ("rebound force", "N"): forces[0],
        ("compression velocity", "m/s"): _mean_where(velocity, compression),
        ("compression force", "N"): forces[1],
        ("rebound/compression ratio", ""): np.abs(forces[0] / forces[1]),
        ("mid-stroke rebound force", "N"): _mean_where(force, central & (velocity > 0)),
        ("mid-stroke compression force", "N"): _mean_where(force, central & (velocity < 0)),
        ("mean force", "N"): force.mean(axis=1),
        ("static force", "N"): 0.5 * (ends[0] + ends[1]),
        ("energy per cycle", "J"): energy,
        ("equivalent damping", "N s/m"): energy / squared,
        ("hysteresis area", "W"): -_loop_integral(force, velocity),
        ("hysteresis width", "N"): ends[0] - ends[1],
    }


def _peak_masks(velocity: Cycles) -> tuple[np.ndarray, np.ndarray]:
    """The samples of each cycle near the largest velocity of rebound, and of compression."""
    highest, lowest = velocity.max(axis=1, keepdims=True), velocity.min(axis=1, keepdims=True)
    return (velocity >= NEAR_PEAK * highest) & (highest > 0), (velocity <= NEAR_PEAK * lowest) & (lowest < 0)


def _mean_where(values: Cycles, where: np.ndarray) -> Figures:
    """Mean of each cycle over some of its samples; NaN where there is none."""
    count = where.sum(axis=1)
    sums = np.where(where, values, 0.0).sum(axis=1)
    return np.divide(sums, count, out=np.full(len(values), np.nan), where=count > 0)


def _loop_integral(force: Cycles, velocity: Cycles) -> Figures:
    """∮ F dv of each closed cycle, by straight lines between its points."""
    following = np.roll(force, -1, axis=1)
    return np.sum(0.5 * (force + following) * (np.roll(velocity, -1, axis=1) - velocity), axis=1)
