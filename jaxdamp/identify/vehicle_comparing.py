"""`compare` of vehicles: forms of one vehicle fitted to the same drives, judged on drives left out in turn."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._progress import Progress
from jaxdamp._results import drawn_by
from jaxdamp._tables import Column, Table
from jaxdamp.bench import RideRecord
from jaxdamp.identify.comparison import AbstractComparison, naming_only, side_by_side
from jaxdamp.identify.held_out import PARTS, REFIT_STEPS, anchored_at
from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.rungs import Failure, doubt_of, why
from jaxdamp.identify.search import search
from jaxdamp.identify.vehicle_fitting import fit_vehicle
from jaxdamp.identify.vehicle_preparing import checked_records
from jaxdamp.identify.vehicle_residuals import RideBatch
from jaxdamp.identify.vehicle_result import (
    ChannelScore,
    VehicleFit,
    channel_score,
    fitted_channels,
    table_of_scores,
)
from jaxdamp.parameters import matching, name_patterns, parameters
from jaxdamp.vehicles import AbstractVehicle


EXACT = 1e-4  # of the standard deviation of a channel: smaller errors are all alike
FEWEST_DRIVES = 3  # whose errors show by how much they vary; of fewer, parts are scored one by one


class VehicleRung(NamedTuple):
    """One vehicle of a comparison.

    Errors of all channels are taken together as multiples of the smallest error that any of the vehicles leaves in a
    channel of the fitted drives: 1 is as good as the best.

    Attributes:
        name: of the vehicle.
        result: the fit of all drives.
        scores: of each channel of each drive, or part of a drive, that was left out.
        judged_on: what was left out, in words.
        noise: smallest RMS error of each channel that any of the vehicles leaves, in its unit.
    """

    name: str
    result: VehicleFit
    scores: tuple[ChannelScore, ...]
    judged_on: str
    noise: Mapping[str, float] = {}  # in the unit of each channel

    @property
    def parameters(self) -> int:
        """Number of free parameters."""
        return len(self.result.parameters)

    numbers = parameters

    @property
    def rmse(self) -> float:
        """RMS over channels and drives, on those fitted, as a multiple of the noise of each channel."""
        return self._level(score for score in self.result.scores if score.channel in self.noise)

    @property
    def held_out_rmse(self) -> float:
        """The same on drives, or parts of drives, left out."""
        return self._level(self.scores)

    error = held_out_rmse
    floor = 0.0  # that of `EXACT` is in the noise

    @property
    def errors(self) -> tuple[float, ...]:
        """The same on each drive or part of a drive that was left out."""
        names = dict.fromkeys(score.record for score in self.scores)
        return tuple(self._level(score for score in self.scores if score.record == name) for name in names)

    @property
    def fit_percent(self) -> float:
        """Mean over channels and drives, on those fitted [%]."""
        return float(np.mean([score.fit_percent for score in self.result.scores if score.channel in self.noise]))

    @property
    def held_out_fit_percent(self) -> float:
        """The same on drives, or parts of drives, left out [%]."""
        return float(np.mean([score.fit_percent for score in self.scores]))

    @property
    def doubt(self) -> str:
        """Why its numbers cannot be believed, in words; empty for a converged fit that determines every number."""
        return doubt_of(self.result)

    def _level(self, scores: Iterable[ChannelScore]) -> float:
        return float(np.sqrt(np.mean([max(score.rmse / self.noise[score.channel], EXACT) ** 2 for score in scores])))

    def scores_table(self) -> Table:
        """The error of each channel of each drive, or part of a drive, that was left out."""
        return table_of_scores(f"Errors of {self.name}: {self.judged_on}", "left out", self.scores)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class VehicleComparison(AbstractComparison[VehicleRung, RideRecord]):
    """Vehicles fitted to the same drives, in the order given."""

    kind: ClassVar[str] = "vehicle"
    _title: ClassVar[str] = (
        "Vehicles (errors as multiples of the smallest that any of them leaves in the fitted drives)"
    )
    _error: ClassVar[Column] = Column("error", spec=".3g")

    @classmethod
    def of(cls, outcomes: Iterable[VehicleRung | Failure], held_out: Iterable[RideRecord] = ()) -> "VehicleComparison":
        """The comparison of the outcomes of `fit_each_vehicle`, each with the noise that the best of them leaves.

        Raises:
            ValueError: no vehicle could be fitted.
        """
        outcomes = tuple(outcomes)
        noise = _smallest([one for one in outcomes if isinstance(one, VehicleRung)])
        with_noise = [one._replace(noise=noise) if isinstance(one, VehicleRung) else one for one in outcomes]
        return super().of(with_noise, held_out)

    def __getitem__(self, name: str) -> VehicleFit:
        """The fit of the vehicle of that name."""
        return self.rung(name).result

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences on the recommended vehicle and why it is this one."""
        best = self.best
        lead = f"Recommended: {best.name}" if len(self.rungs) > 1 else f"Error of {best.name}"
        text = (
            f"{lead}, held-out fit {best.held_out_fit_percent:.1f} %, RMS error {best.error:.3g} times the smallest"
            f" that any vehicle leaves in the fitted drives ({best.judged_on})."
        )
        return (text, *why(self.recommendation, self.rungs, self.kind))

    plot = drawn_by("ladder", "The errors of the vehicles side by side.")

    def __repr__(self) -> str:
        lines = [f"{'vehicle':<24}{'free':>5}{'fit %':>8}{'error':>9}{'held-out %':>12}{'error':>9}"]
        for r in self.rungs:
            line = f"{r.name:<24}{r.parameters:>5}{r.fit_percent:>8.1f}{r.rmse:>9.3g}"
            lines.append(f"{line}{r.held_out_fit_percent:>12.1f}{r.held_out_rmse:>9.3g}  {r.doubt}".rstrip())
        lines += [f"{failure.name:<24} failed: {failure.reason}" for failure in self.failed]
        return "\n".join([*lines, " ".join(self.verdict), f"best: {self.best.name}"])


def _smallest(rungs: Sequence[VehicleRung]) -> dict[str, float]:
    """The smallest RMS error of each channel of the fitted drives that any of the vehicles leaves, in its unit."""
    errors: dict[str, list[float]] = {}
    for rung in rungs:
        for channel in dict.fromkeys(c for ride in rung.result.records for c in ride.channels):
            rmse = [score.rmse for score in rung.result.scores if score.channel == channel]
            errors.setdefault(channel, []).append(float(np.sqrt(np.mean(np.square(rmse)))))
    level = {c: np.std(np.concatenate([r[c] for r in rungs[0].result.records if c in r.channels])) for c in errors}
    return {channel: max(min(rmse), EXACT * float(level[channel])) for channel, rmse in errors.items()}


def compare_vehicles(
    vehicles: Mapping[str, AbstractVehicle],
    records: RideRecord | Iterable[RideRecord],
    *,
    held_out: RideRecord | Iterable[RideRecord] = (),
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> VehicleComparison:
    """`compare` of vehicles on records of their motion; `options` are those of `fit_vehicle`."""
    held = (held_out,) if isinstance(held_out, RideRecord) else tuple(held_out)
    with Progress("Fitting") as shown:
        outcomes = fit_each_vehicle(vehicles, records, held, progress=progress or shown, **options)
        return VehicleComparison.of(outcomes, held)


def fit_each_vehicle(
    vehicles: Mapping[str, AbstractVehicle],
    records: RideRecord | Iterable[RideRecord],
    held_out: Sequence[RideRecord] = (),
    *,
    progress: Callable[[str], None] = lambda name: None,
    **options: Any,
) -> Iterator[VehicleRung | Failure]:
    """Fit the vehicles of a comparison; yields each result or failure in their order, as soon as it is available.

    Arguments:
        vehicles: starts by name.
        records: drives to fit.
        held_out: drives to judge on, as in `compare`.
        progress: called with each name before its result is waited for.
        options: passed on to `fit_vehicle`.
    """
    rides = (records,) if isinstance(records, RideRecord) else tuple(records)
    for name, vehicle in vehicles.items():
        must = "be a vehicle, as the others are"
        _checks.instance(f"laws[{name!r}]", vehicle, AbstractVehicle, must, "Laws are compared on bench records.")
        checked_records(vehicle, (*rides, *held_out))
    sensors = dict(options.get("sensors") or {})
    tests = {name: VehicleTest(vehicle, sensors) for name, vehicle in vehicles.items()}
    by_vehicle = {name: [p.path for p in parameters(test)] for name, test in tests.items()}
    of_drives = name_patterns("per_record", options.get("per_record") or ())
    in_time = any(matching(paths, name) for paths in by_vehicle.values() for name in of_drives)

    def fitted(name: str, vehicle: AbstractVehicle) -> VehicleRung | Failure:
        named = naming_only(options, by_vehicle[name], by_vehicle.values())
        try:
            result = fit_vehicle(vehicle, rides, **named)
            judged = on_drives(result, held_out) if held_out else without_drives(result, in_time=in_time)
        except (ValueError, ArithmeticError) as error:
            return Failure(name, str(error))
        return VehicleRung(name, result, *judged)

    yield from side_by_side(fitted, vehicles, progress)


def without_drives(result: VehicleFit, *, in_time: bool = False) -> tuple[tuple[ChannelScore, ...], str]:
    """The errors of a fit on its own drives, each predicted by a fit to the others, and in words what was left out.

    The fits start at the minimum of all. Of two drives or more, each is left out (in up to four groups). The quarters
    in time are left out instead if there is one drive, or if initial motions of single drives are fitted, which no
    other drive determines, or with `in_time`, for numbers of single drives of this vehicle or of one that it is
    compared with; the vehicle is driven through the part left out. Weights stay those of the fit of all drives.
    """
    evidence = result.evidence
    assert evidence is not None
    problem, rides = anchored_at(evidence), result.records
    whole = len(rides) > 1 and not in_time and not problem.free.tree.starts
    scores = list[ChannelScore]()
    for number in range(min(PARTS, len(rides)) if whole else PARTS):
        if whole:
            left = [np.full(len(ride), i % PARTS == number) for i, ride in enumerate(rides)]
        else:
            left = [part == number for part in map(_quarter, rides)]
        model = _refitted(problem, left)
        for i, ride in enumerate(rides):
            if left[i].any():
                shown, counts = fitted_channels(problem, model, i)
                alone = not whole or len(rides) >= FEWEST_DRIVES
                scores += _scores(result, ride, shown, counts & left[i], alone=alone, number=None if whole else number)
    how = f"each of {len(rides)} drives" if whole else f"each quarter of the drive{'s' * (len(rides) > 1)}"
    return tuple(scores), f"{how} predicted by fits without it"


def on_drives(result: VehicleFit, rides: Sequence[RideRecord]) -> tuple[tuple[ChannelScore, ...], str]:
    """The errors of a fit on other drives, and these in words; in four parts of each if they are fewer than three."""
    scores = list[ChannelScore]()
    for ride in rides:
        counts = ride.time - ride.time[0] >= result.settling
        scores += _scores(result, ride, result.respond(ride), counts, alone=len(rides) >= FEWEST_DRIVES)
    return tuple(scores), f"{len(rides)} drive{'s' * (len(rides) > 1)} held out"


def _scores(
    result: VehicleFit,
    ride: RideRecord,
    shown: dict[str, Float[np.ndarray, " time"]],
    counts: Bool[np.ndarray, " time"],
    *,
    alone: bool,
    number: int | None = None,
) -> list[ChannelScore]:
    """The errors of each channel of a drive: as a whole, in quarters, or of the quarter that was left out."""
    parts = {ride.name if number is None else f"{ride.name}, part {number + 1} of {PARTS}": counts}
    if not alone:
        quarter = _quarter(ride)
        parts = {f"{ride.name}, part {k + 1} of {PARTS}": counts & (quarter == k) for k in range(PARTS)}
    return [
        channel_score(
            name, channel, result.vehicle.units[channel], ride[channel][part], values[part] - ride[channel][part]
        )
        for name, part in parts.items()
        for channel, values in shown.items()
        if part.any()
    ]


def _quarter(ride: RideRecord) -> np.ndarray:
    """The number of the quarter in time of each sample."""
    return np.arange(len(ride)) * PARTS // len(ride)


@one_thread()
def _refitted(problem: Problem, left: Sequence[Bool[np.ndarray, " _"]]) -> VehicleTest:
    """The model fitted to the samples that are not left out."""
    factor = np.ones(problem.used.size)
    for part, weights in problem.by_part(factor):
        if isinstance(part, RideBatch):
            shaped = weights.reshape(part.weight.shape)
            for row, number in enumerate(np.asarray(part.number)):
                shaped[row, :, left[number]] = 0.0
    end = search(problem.reweighted(factor), REFIT_STEPS)
    return problem.free.started_at(end.values).tree
