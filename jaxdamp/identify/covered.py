"""The range of the records of a fit, to be stored in the fitted law."""

from collections.abc import Sequence

import numpy as np

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import FittedRange


def covered_range(runs: Sequence[BenchRun]) -> FittedRange:
    """Lowest and highest value of each channel over all records, and of temperature and command if stated.

    Arguments:
        runs: the records that were fitted, one or more.

    >>> from jaxdamp import bench, dampers
    >>> runs = bench.VirtualDyno(dampers.Linear(1500.0)).run([bench.SineTest(0.01, f) for f in (1.0, 3.0)])
    >>> covered_range(tuple(runs)).words()
    'velocity −0.188 to 0.188 m/s, stroke −10 to 10 mm, frequency 1 to 3 Hz, force −283 to 283 N'
    """
    channels = {name: [getattr(run, name) for run in runs] for name in ("velocity", "stroke", "force")}
    channels["frequency"] = [np.array([run.frequency]) for run in runs]
    channels["temperature"] = [run.temperature for run in runs if run.temperature is not None]
    channels["command"] = [np.array([run.command]) for run in runs if run.command is not None]
    limits = {name: _ends(np.concatenate(values)) for name, values in channels.items() if values}
    return FittedRange(**limits)


def _ends(values: np.ndarray) -> tuple[float, float]:
    return float(values.min()), float(values.max())
