"""The ride on a white road: metrics and reach of the linearised vehicle in its stationary motion."""

from collections.abc import Sequence

import numpy as np

from jaxdamp._types import Scalar
from jaxdamp.dampers import Motion, RangeUse, range_use
from jaxdamp.metrics import Metric
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation.range_notes import named_laws
from jaxdamp.vehicles import AbstractVehicle, linearise, stationary_rms, with_weightings


DEVIATIONS = 3.0  # standard deviations of a stationary velocity that count as its reach
_POINTS = 2001


def stationary_metrics(vehicle: AbstractVehicle, road: WhiteRoad, metrics: Sequence[Metric]) -> dict[str, Scalar]:
    """Metrics that follow from the RMS of their channels, of the vehicle linearised about its equilibrium."""
    linear, wanted = linearise(vehicle), dict[str, list[str]]()
    for m in metrics:
        if m.weighting is not None:
            wanted.setdefault(m.weighting, []).append(m.channel)
    rms: dict[str | None, dict[str, Scalar]] = {None: stationary_rms(linear, road.velocity_psd, speed=road.speed)}
    for weighting, channels in wanted.items():
        weighted = with_weightings(linear, [(name, weighting) for name in dict.fromkeys(channels)])
        rms[weighting] = stationary_rms(weighted, road.velocity_psd, speed=road.speed)
    values = {}
    for m in metrics:
        assert m.statistic.of_rms is not None
        channel = m.channel if m.weighting is None else f"weighted_{m.channel}"
        values[m.name] = m.statistic.of_rms(rms[m.weighting][channel])
    return values


def stationary_range_use(vehicle: AbstractVehicle, road: WhiteRoad) -> dict[str, list[RangeUse]]:
    """The use of each law whose velocity is a channel of the linearised vehicle: normally distributed, to ±3 σ."""
    import scipy.special

    rms = stationary_rms(linearise(vehicle), road.velocity_psd, speed=road.speed)
    tail = float(scipy.special.ndtr(-DEVIATIONS))
    normal = scipy.special.ndtri(np.linspace(tail, 1.0 - tail, _POINTS))
    laws = {name: law for name, law in named_laws(vehicle).items() if f"{name}_velocity" in rms}
    velocities = {name: float(rms[f"{name}_velocity"]) * normal for name in laws}
    return {name: range_use(law, Motion(velocity=velocities[name])) for name, law in laws.items()}
