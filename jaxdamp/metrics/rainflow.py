"""Cycles of a recorded load."""

import dataclasses
from typing import final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import VectorLike


@final
@dataclasses.dataclass(frozen=True)
class RainflowCycles:
    """The cycles of a load, as found by `rainflow_cycles`: closed ones, and half ones with a count of 1/2.

    Attributes:
        amplitude: half the range of each cycle, in the unit of the load.
        mean: mean of each cycle, in the unit of the load.
        count: 1 or 1/2.
    """

    amplitude: Float[np.ndarray, " cycles"]
    mean: Float[np.ndarray, " cycles"]
    count: Float[np.ndarray, " cycles"]

    def damage(self, exponent: float | int) -> float:
        """Sum of the counts times the amplitudes to the power k [unit^k].

        Divided by the K of a Woehler line N S^k = K it is the damage of the record by Palmgren and Miner; for a
        Gaussian load `spectral_damage` times its length in seconds is the expected value. Means are not counted.

        Arguments:
            exponent: k, the slope of the Woehler line [-], positive.

        Raises:
            ValueError: `exponent` is not positive.
        """
        _checks.positive("exponent", exponent, "It is the slope k of the line N S^k = K.")
        return float(np.sum(self.count * self.amplitude ** float(exponent)))


@of_known_numbers
def rainflow_cycles(signal: VectorLike) -> RainflowCycles:
    """The cycles of a load by rainflow counting: the force of a damper, a spring or a tyre, simulated or measured.

    The counting is that of the package rainflow (`pip install 'jaxdamp[fatigue]'`). It takes about a second for a
    million samples, in NumPy and Python: it can be neither compiled nor differentiated. For a gradient take
    `spectral_damage`.

    Arguments:
        signal: the load at times in a row, shape [time]; turning points alone are enough.

    Raises:
        ValueError: fewer than two samples, or some that are not finite.
        ImportError: rainflow is not installed.

    Source: ASTM E1049-85, section 5.4.4, with half cycles for what does not close.

    >>> cycles = rainflow_cycles([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])  # the example of the standard
    >>> sorted(zip((2 * cycles.amplitude).tolist(), cycles.count.tolist()))
    [(3.0, 0.5), (4.0, 0.5), (4.0, 1.0), (6.0, 0.5), (8.0, 0.5), (8.0, 0.5), (9.0, 0.5)]
    >>> cycles.damage(1)
    11.5
    """
    load = np.asarray(signal, float)
    if load.ndim != 1 or load.size < 2:
        _checks.refuse("signal", "hold two or more samples in a row", f"of shape {load.shape}")
    _checks.finite("signal", load, "Cut the gaps out first.")
    try:
        import rainflow
    except ImportError as error:
        raise ImportError("`rainflow_cycles` needs rainflow: pip install 'jaxdamp[fatigue]'.") from error

    found = np.array([cycle[:3] for cycle in rainflow.extract_cycles(load.tolist())], float).reshape(-1, 3)
    return RainflowCycles(0.5 * found[:, 0], found[:, 1], found[:, 2])
