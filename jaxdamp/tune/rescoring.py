"""`rescore`: the result of a tuning on other roads."""

import dataclasses
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, Unpack, final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column, Compared, Contents, Table, comparison_table, percentage, plain
from jaxdamp._types import Scalar
from jaxdamp.metrics import Metric
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Ride, simulate
from jaxdamp.tune.limits import amount, half_interval, in_scenarios
from jaxdamp.tune.objective import Objective
from jaxdamp.tune.scenarios import Road, Scenarios, check_roads
from jaxdamp.tune.settings import RUN, Run
from jaxdamp.vehicles import AbstractVehicle, frequency_response, linearise


if TYPE_CHECKING:
    from jaxdamp.tune.result import TuneResult


LOWEST, HIGHEST = 0.3, 30.0  # Hz


class Spectrum(NamedTuple):
    """A one-sided power spectral density."""

    frequency: Float[np.ndarray, " lines"]  # [Hz]
    density: Float[np.ndarray, " lines"]  # [unit²/Hz]


def spectra(
    vehicle: AbstractVehicle,
    road: AbstractRoad | WhiteRoad,
    channels: Sequence[str],
    run: Run,
) -> dict[str, Spectrum]:
    """The spectrum of each channel between 0.3 and 30 Hz.

    On a white road it is that of the vehicle with equivalent linear laws; otherwise Welch's estimate with
    segments of 4 s, or of the whole run if that is shorter.
    """
    if isinstance(road, WhiteRoad):
        frequency = np.geomspace(LOWEST, HIGHEST, 400)
        linear = linearise(vehicle, velocity_psd=road.velocity_psd, speed=road.speed)
        gains = frequency_response(linear, frequency, speed=road.speed)
        height = 2.0 * float(road.velocity_psd) / (2.0 * np.pi * frequency) ** 2
        return {name: Spectrum(frequency, np.abs(np.asarray(gains[name])) ** 2 * height) for name in channels}
    from scipy.signal import welch  # `power_spectral_density` is compiled anew for each length

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the notes of the tuning say it
        response = simulate(vehicle, road, **run)
    dt = float(np.diff(np.asarray(response.time))[0])
    by_channel = {}
    for name in channels:
        values = np.asarray(response[name])
        segment = min(round(1.2 / (LOWEST * dt)), len(values))
        frequency, density = welch(values, 1.0 / dt, nperseg=segment)
        inside = (frequency >= LOWEST) & (frequency <= HIGHEST)
        by_channel[name] = Spectrum(frequency[inside], density[inside])
    return by_channel


FIRST_SEED = 4711  # of fresh roads, which are thereby others than those of usual small seeds


@final
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Rescore(AbstractResult):
    """The ride metrics of a vehicle before and after its tuning, on each of several roads.

    Attributes:
        before: all ride metrics of the start, one number for each road; of a tuning in scenarios also each limited one
            in every scenario.
        after: the same of the tuned vehicle.
        units: unit of each metric.
        metric: name of the metric that was minimised.
        signed: names of the metrics that may be negative, of which a change in percent says nothing.
    """

    before: dict[str, Float[np.ndarray, " roads"]]
    after: dict[str, Float[np.ndarray, " roads"]]
    units: dict[str, str]
    metric: str
    signed: frozenset[str] = frozenset()

    @property
    def roads(self) -> int:
        """Number of roads."""
        return len(self.before[self.metric])

    def change(self, name: str) -> Float[np.ndarray, " roads"]:
        """Change of a metric on each road, relative to its size before, positive if it rises; NaN where it was zero."""
        before, after = self.before[name], self.after[name]
        return np.divide(after - before, np.abs(before), out=np.full(len(before), np.nan), where=before != 0.0)

    def and_on(self, other: "Rescore") -> "Rescore":
        """The same vehicles on these roads and on those of another rescoring."""
        sides = zip((self.before, self.after), (other.before, other.after), strict=True)
        before, after = ({name: np.append(side[name], more[name]) for name in side} for side, more in sides)
        return dataclasses.replace(self, before=before, after=after)

    def half_width(self, name: str) -> float:
        """Half the 95 % interval of the mean relative change of a metric; infinite for one road."""
        return half_interval(self.change(name))

    def percentile(self, name: str, percent: float) -> tuple[float, float]:
        """The value of a metric that it does not exceed on this share of the roads, before and after.

        Arguments:
            name: of the metric.
            percent: of the roads, 0 to 100; between roads the values are interpolated.

        Raises:
            ValueError: an unknown metric; a share outside 0 to 100.
        """
        _checks.one_of("name", name, self.before)
        if not 0.0 <= percent <= 100.0:
            _checks.refuse("percent", "lie between 0 and 100", percent)
        before, after = (float(np.percentile(side[name], percent)) for side in (self.before, self.after))
        return before, after

    @property
    def summary(self) -> str:
        """Number of roads on which the minimised metric decreases, and by how much, in a sentence."""
        before, after = self.before[self.metric], self.after[self.metric]
        head = f"On {np.count_nonzero(after < before)} of {self.roads} roads {self.metric} decreases"
        if self.metric not in self.in_percent:
            return (
                f"{head}, from {amount(after.mean(), self.units[self.metric], before.mean(), link=' to ')} on average."
            )
        change = 100 * self.change(self.metric)
        mean = percentage(change.mean(), 100 * self.half_width(self.metric))
        return f"{head}; it changes by {mean} on average ({round(change.min()):+.6g} to {round(change.max()):+.6g} %)."

    @property
    def in_percent(self) -> list[str]:
        """The metrics that have a change in percent: positive on each road, by what they are and before the tuning."""
        return [name for name in self.units if name not in self.signed and np.all(self.before[name] > 0)]

    def table(self) -> Table:
        """Means over the roads, the mean of the change, and its smallest and largest value on a road.

        Metrics without a change in percent are left out.
        """
        rows = []
        for name in self.in_percent:
            change, means = 100 * self.change(name), (float(self.before[name].mean()), float(self.after[name].mean()))
            ends = (float(change.min()), float(change.max()))
            rows.append(Compared(name, self.units[name], means, float(change.mean()), ends))
        title = f"Ride metrics on {self.roads} other roads (means, and the change on each road)"
        more = (Column("smallest", "%", "+.1f"), Column("largest", "%", "+.1f"))
        return comparison_table(title, "metric", ("before", "after"), rows, more)

    plot = drawn_by("rescore", "The change of each ride metric on each road.")

    def content(self) -> Contents:
        """All metrics on each road with units, ready for JSON; numbers that are not finite are None."""
        metrics = {
            name: {"before": plain(self.before[name]), "after": plain(self.after[name]), "unit": unit}
            for name, unit in self.units.items()
        }
        return {"metric": self.metric, "roads": self.roads, "metrics": metrics}


@with_defaults(RUN)
def rescore(
    result: "TuneResult[AbstractVehicle]",
    roads: Sequence[AbstractRoad | Scenarios],
    **run: Unpack[Run],
) -> Rescore:
    """Compute all ride metrics of the original and the tuned vehicle on other roads.

    A tuning uses a single road. Other roads, such as the same class with another seed, show whether the improvement is
    general. Runs of a few seconds contain only few periods of the slow body motion, so their results scatter.
    `minimise` does it by itself for random roads (`result.fresh`).

    Arguments:
        result: result of `minimise`.
        roads: one or more roads, or scenarios, whose metrics are then those of their risk.
        run: `duration`, `dt` and `engine` of each run, as in `simulate` (see `Run`).

    Raises:
        ValueError: no road; what `simulate` refuses.

    >>> from jaxdamp import tune, vehicles
    >>> from jaxdamp.roads import iso8608, white
    >>> result = tune.minimise("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), white("C", 20.0))
    >>> fresh = rescore(result, [iso8608("C", speed=20.0, seed=seed) for seed in (1, 2)], duration=30.0)
    >>> bool(np.all(fresh.change("rms_dynamic_tyre_load") < -0.1))
    True
    """
    from jaxdamp.tune.result import TuneResult

    call = "rescore(result, [road, road])"
    remedy = f"The call is `{call}` with the result of `tune.minimise`."
    _checks.instance("result", result, TuneResult, "be the result of a tuning", remedy)
    if isinstance(roads, str) or not isinstance(roads, Sequence) or not roads:
        _checks.refuse("roads", "be a list of one or more", _checks.described(roads), f"The call is `{call}`.")
    check_roads(roads, call, (Scenarios,))
    metrics, objective = list(result.start.ride_metrics), result.objective
    metrics += [m for m in (objective.metrics if objective else ()) if m not in metrics]
    units = {m.name: m.unit(result.start.units) for m in metrics} | (objective.units(result.start) if objective else {})
    cars = (result.start, result.vehicle)
    drive = driver(cars, metrics, objective, run)
    return rescored(drive, roads, units, result.metric, metrics)


Driver: TypeAlias = Callable[
    [Road | Scenarios], Sequence[Mapping[str, Scalar | float]]
]  # on a road, the vehicle before and after


def driver(
    cars: tuple[AbstractVehicle, AbstractVehicle],
    metrics: Sequence[Metric],
    objective: Objective | None,
    run: Run,
    limited: Sequence[str] = (),
) -> Driver:
    """The metrics of two vehicles on a road or in scenarios, of limited ones also the value in each of these."""

    def drive(car: AbstractVehicle, road: Road | Scenarios) -> Mapping[str, Scalar]:
        if isinstance(road, Scenarios):
            ride = road.ride(car, metrics=metrics, **run)
            each = objective.of_each(ride.each()) if objective else ride.each()
            of_scenarios = {
                one: each[name][i] for name in limited for i, one in enumerate(in_scenarios(name, ride.names))
            }
            return {name: ride.risk(values, ride.weights) for name, values in each.items()} | of_scenarios
        values = Ride(car, road, metrics=metrics, **run)()
        return objective.of(values) if objective else values

    return lambda road: [drive(car, road) for car in cars]


def rescored(
    drive: Driver,
    roads: Sequence[Road | Scenarios],
    units: dict[str, str],
    metric: str,
    metrics: Iterable[Metric],
    limited: Iterable[str] = (),
) -> Rescore:
    """The metrics of the vehicle before and after on roads or in scenarios, with the values that are limited."""
    runs, names = [drive(road) for road in roads], dict.fromkeys([*units, *limited])
    before, after = ({name: np.array([float(pair[side][name]) for pair in runs]) for name in names} for side in (0, 1))
    return Rescore(before, after, units, metric, frozenset(m.name for m in metrics if m.statistic.signed))


def other_roads(road: Road | Scenarios, numbers: Sequence[int]) -> list[Road | Scenarios]:
    """Other realisations of a random road, or of scenarios on random roads; none of others."""
    if isinstance(road, Scenarios):
        roads = [road.on_other_roads(FIRST_SEED + i) for i in numbers]
    elif isinstance(road, AbstractRoad):
        roads = [road.reseeded(FIRST_SEED + i) for i in numbers]
    else:
        roads = []
    return [other for other in roads if other is not None]
