"""`rescore`: what a tuning is worth on roads that it has not seen."""

import dataclasses
from collections.abc import Sequence
from typing import Any, final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Ride
from jaxdamp.tune.result import TuneResult


@final
@dataclasses.dataclass(frozen=True, repr=False)
class Rescore:
    """The ride metrics of a vehicle before and after its tuning, on each of several roads.

    Attributes:
        before: all ride metrics of the start, one number for each road.
        after: the same of the tuned vehicle.
        units: unit of each metric.
        metric: name of the metric that was minimised.
    """

    before: dict[str, Float[np.ndarray, " roads"]]
    after: dict[str, Float[np.ndarray, " roads"]]
    units: dict[str, str]
    metric: str

    @property
    def roads(self) -> int:
        """Number of roads."""
        return len(self.before[self.metric])

    def change(self, name: str) -> Float[np.ndarray, " roads"]:
        """Relative change of a metric on each road; NaN where it was zero."""
        before, after = self.before[name], self.after[name]
        return np.divide(after, before, out=np.full(len(before), np.nan), where=before != 0.0) - 1.0

    def __repr__(self) -> str:
        labels = {name: f"{name} [{unit or '-'}]" for name, unit in self.units.items()}
        width = max(map(len, labels.values()))
        head = f"{f'mean of {self.roads} roads':<{width}}{'before':>12}{'after':>12}{'change':>9}   smallest to largest"
        lines = [head]
        for name, before in self.before.items():
            change = 100.0 * self.change(name)
            numbers = f"{before.mean():>12.5g}{self.after[name].mean():>12.5g}"
            spread = f"{change.mean():+8.1f}%   {change.min():+.1f}% to {change.max():+.1f}%"
            mark = "  <- minimised" if name == self.metric else ""
            lines.append(f"{labels[name]:<{width}}{numbers}{spread if before.any() else ''}{mark}")
        return "\n".join(lines)


def rescore(
    result: TuneResult[Any], roads: Sequence[AbstractRoad], *, duration: float | None = None, dt: float = 1e-3
) -> Rescore:
    """Drive the start and the tuned vehicle over other roads, and gather all ride metrics.

    A tuning knows one road. What it gains there and loses elsewhere shows on others, such as the same class with
    another seed. Runs of a few seconds hold few waves of the body's slow motion, and scatter accordingly.

    Arguments:
        result: of `minimise`.
        roads: one or more.
        duration: length of each run [s], as in `simulate`.
        dt: step [s], as in `simulate`.

    Raises:
        ValueError: no road; what `simulate` refuses.

    >>> from jaxdamp import tune, vehicles
    >>> from jaxdamp.roads import iso8608, white
    >>> result = tune.minimise("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), white("C", 20.0))
    >>> fresh = rescore(result, [iso8608("C", speed=20.0, seed=seed) for seed in (1, 2)], duration=30.0)
    >>> bool(np.all(fresh.change("rms_dynamic_tyre_load") < -0.1))
    True
    """
    if not roads:
        _checks.refuse("roads", "hold one or more", roads)
    rides = [[Ride(car, road, duration=duration, dt=dt)() for road in roads] for car in (result.start, result.vehicle)]
    before, after = (
        {m.name: np.array([float(found[m.name]) for found in runs]) for m in result.start.ride_metrics}
        for runs in rides
    )
    units = {m.name: m.unit(result.start.units) for m in result.start.ride_metrics}
    return Rescore(before, after, units, result.metric)
