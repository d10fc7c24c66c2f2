"""The result of a fit of a vehicle."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._results import Derived, drawn_by
from jaxdamp._tables import Column, Contents, Table, with_unit
from jaxdamp.bench import BenchRun, RideRecord
from jaxdamp.identify.estimates import parameter_table
from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.predicting import fit_percent
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.result import Fit
from jaxdamp.identify.vehicle_preparing import checked_records, drives_of
from jaxdamp.identify.vehicle_residuals import DamperOnBench, RideBatch, ride_batches
from jaxdamp.rig import Rig, Sensor
from jaxdamp.vehicles import AbstractVehicle


class ChannelScore(NamedTuple):
    """How well the vehicle predicts a channel of a record, or the force of a law on the bench.

    Attributes:
        record: name of the record.
        channel: name of the channel.
        unit: of the channel.
        rmse: root of the mean squared error, in the unit.
        fit_percent: 100 is perfect, 0 no better than a constant [%].
        largest_error: largest magnitude of the error, in the unit.
        correlation: of the measured and the computed channel.
        size: of the measured channel, as a multiple of the computed one (standard deviations).
    """

    record: str
    channel: str
    unit: str
    rmse: float  # in the unit
    fit_percent: float
    largest_error: float  # in the unit
    correlation: float  # of the predicted with the measured values
    size: float = 1.0  # standard deviation of the measured values by that of the predicted ones


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class VehicleFit(Fit):
    """A vehicle fitted to records of its motion, with the uncertainty of its parameters: a `Fit` of ride records.

    Attributes:
        vehicle: the fitted vehicle; parameters with a value for each record have their mean.
        records: the records given.
        bench: the bench records given, by the path of their law.
        scores: errors of each channel of each record, and of the force of each law over its bench records.
        sensors: the fitted sensors, by channel.
        held: parameters that were held because the records do not show the scale.
        scale_free: the parameters that may all be larger by one factor, which the records do not show.
        rig: the fitted test machine of the bench records, if one was fitted.
    """

    vehicle: AbstractVehicle
    records: tuple[RideRecord, ...]
    bench: dict[str, tuple[BenchRun, ...]]
    scores: tuple[ChannelScore, ...]
    sensors: dict[str, Sensor]
    held: tuple[str, ...]
    scale_free: tuple[str, ...]
    rig: Rig | None

    @property
    def summary(self) -> str:
        """Vehicle, number of records, and the channel that is predicted worst."""
        drives = f"{len(self.records)} drive{'s' * (len(self.records) > 1)}"
        return f"{type(self.vehicle).__name__} fitted to {drives}: {self.worst}"

    @property
    def worst(self) -> str:
        """The channel that is predicted worst, in words."""
        least = min(self.scores, key=lambda score: score.fit_percent)
        return f"the least fit is {least.fit_percent:.1f} %, of {least.channel} in {least.record}"

    model = Derived(lambda self: self.vehicle)

    @property
    def problem(self) -> Problem:
        """The least squares at the result."""
        return self._evidence.problem

    def respond(self, record: RideRecord) -> dict[str, Float[np.ndarray, " time"]]:
        """What the sensors would show in a record without noise, by channel, in SI.

        A record that was fitted has its own values of the parameters per record and its initial motion. Another record
        has the means of such parameters and begins at rest.

        Arguments:
            record: old or new, of the same vehicle, whose road or platform motion is prescribed.

        Raises:
            ValueError: a channel that the vehicle does not have, or of another unit; a road of other wheels.
        """
        fitted = [own.fingerprint for own in self.records]
        if record.fingerprint in fitted:
            return fitted_channels(self.problem, self.problem.free.tree, fitted.index(record.fingerprint))[0]
        rides = checked_records(self.vehicle, record)
        longest = max(part.dt for part in _driven(self.problem))
        (part,) = ride_batches(rides, drives_of(self.vehicle, rides, longest), dict.fromkeys(record.channels, 1.0))
        shown = np.asarray(predicted(part, VehicleTest(self.vehicle, self.sensors)))[0]
        return dict(zip(part.channels, shown, strict=True))

    def score(self, records: RideRecord | Iterable[RideRecord]) -> tuple[ChannelScore, ...]:
        """Errors of each channel of records, old or new, after the settling time of the fit.

        Arguments:
            records: as in `respond`.
        """
        rides = (records,) if isinstance(records, RideRecord) else tuple(records)
        scores = []
        for ride in rides:
            begin = int(np.ceil(self.settling / ride.dt))
            for channel, values in self.respond(ride).items():
                measured = ride[channel][begin:]
                unit = self.vehicle.units[channel]
                scores.append(channel_score(ride.name, channel, unit, measured, values[begin:] - measured))
        return tuple(scores)

    @property
    def settling(self) -> float:
        """Time at the beginning of each record that was not compared [s]."""
        part = _driven(self.problem)[0]
        return int(np.argmax(np.asarray(part.weight)[0, 0] > 0)) * part.dt * part.finer

    def table(
        self,
        truth: AbstractVehicle | None = None,
        *,
        sensors: dict[str, Sensor] | None = None,
        true_rig: Rig | None = None,
    ) -> Table:
        """The parameters with units, standard errors and meanings, compared with a true vehicle if one is given.

        Arguments:
            truth: the true vehicle.
            sensors: its true sensors.
            true_rig: the true test machine of the bench records, if one was fitted.
        """
        true = None if truth is None else VehicleTest(truth, sensors or {}, (), true_rig)
        return parameter_table(f"Parameters of {type(self.vehicle).__name__}", self.parameters, true)

    def scores_table(self) -> Table:
        """The errors of each channel of each record."""
        return table_of_scores("Channels", "record", self.scores)

    def tables(self) -> dict[str, Table]:
        """Parameters, and the errors of the channels."""
        return {"parameters": self.table(), "scores": self.scores_table()}

    def content(self) -> Contents:
        """The fit as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        return super().content() | {
            "vehicle": repr(self.vehicle),
            "sensors": {name: repr(sensor) for name, sensor in self.sensors.items()},
            **({} if self.rig is None else {"rig": repr(self.rig)}),
            "held": list(self.held),
            "scale_free": list(self.scale_free),
            "scores": [
                {
                    "record": s.record,
                    "channel": s.channel,
                    "rmse": with_unit(s.rmse, s.unit),
                    "fit": with_unit(s.fit_percent, "%"),
                    "largest_error": with_unit(s.largest_error, s.unit),
                }
                for s in self.scores
            ],
        }

    plot = drawn_by("vehicle_fit", "Measured and fitted channels of a record over time, with residuals.")


@compiled_for_loops
def predicted(batch: RideBatch, model: VehicleTest) -> Array:
    """What the sensors of a model show, in one program."""
    return batch.predict(model)


def _driven(problem: Problem) -> list[RideBatch]:
    """The drives of the fit, in batches."""
    return [part for part in problem.residuals if isinstance(part, RideBatch)]


def fitted_channels(
    problem: Problem, model: VehicleTest, number: int
) -> tuple[dict[str, Float[np.ndarray, " time"]], Bool[np.ndarray, " time"]]:
    """The channels of a fitted drive with this model, and which samples were compared."""
    ((part, row),) = [(b, int(at)) for b in _driven(problem) for at in np.flatnonzero(np.asarray(b.number) == number)]
    values = np.asarray(predicted(part, model))[row]
    return dict(zip(part.channels, values, strict=True)), np.asarray(part.weight)[row, 0] > 0


def channel_scores(
    problem: Problem, residual: Float[np.ndarray, " samples"], records: Sequence[RideRecord]
) -> tuple[ChannelScore, ...]:
    """Errors of each channel of each record over the samples that are compared."""
    scores, units = {}, problem.law.units
    forces: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for part, missed in problem.by_part(residual):
        if not isinstance(part, RideBatch | DamperOnBench):
            continue
        weight = np.asarray(part.weight if isinstance(part, RideBatch) else part.batch.weight)
        used, errors = weight > 0, missed.reshape(weight.shape)
        if isinstance(part, DamperOnBench):
            pair = np.asarray(part.batch.force)[used], errors[used] / weight[used]
            forces.setdefault(part.path, []).append(pair)
            continue
        for i, number in enumerate(np.asarray(part.number)):
            for k, channel in enumerate(part.channels):
                chosen = used[i, k]
                error = errors[i, k][chosen] / weight[i, k][chosen]
                record, unit = records[number], units[channel]
                scores[number, k] = channel_score(record.name, channel, unit, record[channel][chosen], error)
    on_bench = [
        channel_score("bench", f"{path} force", "N", *map(np.concatenate, zip(*pairs, strict=True)))
        for path, pairs in forces.items()
    ]
    return (*[scores[key] for key in sorted(scores)], *on_bench)


def channel_score(record: str, channel: str, unit: str, measured: np.ndarray, error: np.ndarray) -> ChannelScore:
    """How well a channel is predicted, by its measured values and the errors of the predicted ones."""
    percent = fit_percent([measured], [measured + error])
    spread, predicted = float(np.std(measured)), float(np.std(measured + error))
    product = np.mean((measured - measured.mean()) * (measured + error))
    alike, size = (float(product / (spread * predicted)), spread / predicted) if spread * predicted > 0 else (0.0, 1.0)
    rmse, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
    return ChannelScore(record, channel, unit, rmse, percent, largest, alike, size)


def table_of_scores(title: str, first: str, scores: Iterable[ChannelScore]) -> Table:
    """The errors of channels; the first column, of the records, has this name."""
    columns = [Column(first), Column("channel"), Column("unit"), Column("RMSE", spec=".3g")]
    columns += [Column("fit", "%", ".1f"), Column("largest error", spec=".3g")]
    return Table(title, tuple(columns), tuple(tuple(score)[: len(columns)] for score in scores))
