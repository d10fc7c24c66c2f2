"""A measured quantity with its scatter."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxdamp._tables import Cell, Shown


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
        spread = "" if width is None else f" ± {width:.2g}"
        return Shown(self.value, f"{self.value:.4g}{spread}")


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
