"""Results of fits: the law, its parameters with uncertainty, and its errors."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Sequence
from typing import overload

import numpy as np
from jaxtyping import Float, PyTree

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, plotted
from jaxdamp._status import Status
from jaxdamp._tables import Contents, Table, plain, with_unit
from jaxdamp._types import Figure, VectorLike
from jaxdamp.bench import BenchRun, as_runs, initial_temperature
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify.estimates import parameter_table
from jaxdamp.identify.left_out import LeftOut
from jaxdamp.identify.model import Model, RecordStart, of_record, on_rig
from jaxdamp.identify.predicting import ErrorShares, Score, error_shares, predict_by_record, score
from jaxdamp.identify.propagation import Band, band
from jaxdamp.identify.record_sensitivity import RecordSensitivity, sensitivity_to_records
from jaxdamp.identify.record_starts import unknown_starts, warmed
from jaxdamp.identify.result import Fit
from jaxdamp.rig import Rig


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class AbstractFitted(AbstractResult):
    """A law fitted to records or trained on them, and how good it is.

    Attributes:
        law: the fitted law.
        runs: the records given; those with an infinite weighting were not fitted.
        fit_percent: 100 (1 − ‖y − ŷ‖/‖y − mean y‖) over all records fitted.
        rmse: root of the mean squared error over all records fitted [N].
        scores: the same for each record given.
        warnings: doubts about the result, in words.
        status: how the search ended.
        rig: the fitted test machine, if one was fitted.
        initial_state: how records start, as in `fit`.
        record_starts: the states at the first sample of each record if they were estimated, None for one left out.
    """

    law: AbstractDamper
    runs: tuple[BenchRun, ...]
    fit_percent: float
    rmse: float
    scores: tuple[Score, ...]
    warnings: tuple[str, ...]
    status: Status
    rig: Rig | None = dataclasses.field(default=None, kw_only=True)
    initial_state: str = dataclasses.field(default="warm_up", kw_only=True)
    record_starts: tuple[RecordStart | None, ...] = dataclasses.field(default=(), kw_only=True)

    @property
    def summary(self) -> str:
        """Law, number of records and errors."""
        percent, several = f"{self.fit_percent:.1f} %", "s" * (len(self.runs) > 1)
        return f"{type(self.law).__name__} on {len(self.runs)} record{several}: {percent}, RMSE {self.rmse:.4g} N"

    @property
    def model(self) -> Model:
        """What was fitted to the records: the law, on a machine if that was fitted too."""
        return on_rig(self.law, self.rig)

    def models_of(self, runs: Sequence[BenchRun]) -> tuple[Model | list[Model], list[int]]:
        """What predicts these records, one or one for each, and how many of the first samples of each told it."""
        return self._model_of(runs), [0] * len(runs)

    def _model_of(self, runs: Sequence[BenchRun]) -> Model:
        """`model`, with the estimated states at the beginning of those of these records that were fitted."""
        by_record = {run.fingerprint: start for run, start in zip(self.runs, self.record_starts, strict=False)}
        starts = [by_record.get(run.fingerprint) for run in runs] if by_record else ()
        return on_rig(self.law, self.rig, starts)

    @overload
    def respond(self, runs: BenchRun) -> np.ndarray: ...
    @overload
    def respond(self, runs: Iterable[BenchRun]) -> list[np.ndarray]: ...
    def respond(self, runs: BenchRun | Iterable[BenchRun]) -> np.ndarray | list[np.ndarray]:
        """Force [N] that the fit expects at every sample of a record, old or new, of the same machine.

        It is the force of the law with what the fit found beside it: gas force and zero error of the load cell
        (`rig`), and the states at the beginning (`initial_state`). `jaxdamp.respond(result.law, ...)` is the damper
        alone, started at rest.

        Arguments:
            runs: one record, or several for a list of forces.
        """
        records = as_runs(runs)
        if not records:
            return []
        forces = predict_by_record(self.models_of(records)[0], records, self.initial_state)[1]
        return forces[0] if isinstance(runs, BenchRun) else forces

    def score(self, runs: BenchRun | Iterable[BenchRun]) -> tuple[float, float, tuple[Score, ...]]:
        """Fit percent, RMSE [N] and the scores by record, on records old or new, as `respond` predicts them."""
        runs = as_runs(runs)
        if not runs:
            _checks.refuse("runs", "hold at least one record", "empty")
        models, told = self.models_of(runs)
        return score(models, runs, initial_state=self.initial_state, told=told)

    def content(self) -> Contents:
        """Law, errors and scores as plain data.

        The law itself is written by `export.to_json`.
        """
        return {
            "law": repr(self.law),
            **({} if self.rig is None else {"rig": repr(self.rig)}),
            "fit": with_unit(self.fit_percent, "%"),
            "rmse": with_unit(self.rmse, "N"),
            "scores": [score.to_dict() for score in self.scores],
        }


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FitResult(AbstractFitted, Fit):
    """A fitted law with its parameters, their uncertainty and its errors: a `Fit` of bench records.

    Attributes:
        record_laws: the law of each record, if parameters have a value for each record; `law` then has their means.
        record_rigs: the test machine of each record, as `record_laws`.
        left_out: what the residual shows that the fit left out.
    """

    record_laws: tuple[AbstractDamper, ...] = dataclasses.field(default=(), kw_only=True)
    record_rigs: tuple[Rig, ...] = dataclasses.field(default=(), kw_only=True)
    left_out: LeftOut = dataclasses.field(default=LeftOut(()), kw_only=True)

    @property
    def static_force(self) -> float:
        """Gas force and zero error of the test machine [N], which the law does not hold; zero without a machine."""
        return 0.0 if self.rig is None else float(self.rig.force_offset) + float(self.rig.gas_force)

    @property
    def initial_states(self) -> tuple[Float[np.ndarray, " states"] | None, ...]:
        """The states at the first sample of each record, if they were estimated; None for records left out."""
        return tuple(None if start is None else np.asarray(start.initial_state) for start in self.record_starts)

    @functools.cached_property
    def error_shares(self) -> ErrorShares:
        """Shares of the squared error over the records: shape, hysteresis, rest (`identify.error_shares`)."""
        return error_shares(self.models_of(self.runs)[0], self.runs, self.initial_state)

    @property
    def own_starts(self) -> list[str]:
        """Paths of the temperatures at the start of a record, where each of the fitted ones had a value of its own."""
        return unknown_starts(self.model, self.runs, () if self.evidence is None else self.evidence.problem.per_record)

    def models_of(self, runs: Sequence[BenchRun]) -> tuple[Model | list[Model], list[int]]:
        """The model of each record: a fitted one has its own values, a new one begins as warm as its cycles show."""
        common, told = self._model_of(runs), [0] * len(runs)
        rigs = self.record_rigs or (None,) * len(self.record_laws)
        starts = [(start,) for start in self.record_starts] or [()] * len(self.record_laws)
        each = map(on_rig, self.record_laws, rigs, starts)
        own = {run.fingerprint: model for run, model in zip(self.runs, each, strict=False)}
        fitted, paths = {run.fingerprint for run in self.runs}, self.own_starts
        others = [i for i, run in enumerate(runs) if run.fingerprint not in fitted]
        new = [i for i in others if paths and initial_temperature(runs[i]) is None]
        if not own and not new:
            return common, told
        models = [own.get(run.fingerprint, of_record(common, i)) for i, run in enumerate(runs)]
        for i in new:
            models[i], told[i] = warmed(models[i], runs[i], paths, self.rmse * self.inflation, self.initial_state)
        return models, told

    def table(self, truth: AbstractDamper | None = None, *, true_rig: Rig | None = None, title: str = "") -> Table:
        """The parameters with units, standard errors and meanings, compared with a true law if one is given.

        Arguments:
            truth: the true law.
            true_rig: the true test machine, if one was fitted.
            title: of the table.
        """
        title = title or f"Parameters of {type(self.law).__name__}"
        title += f" ({self.criterion})" if self.criterion else ""
        true = None if truth is None else on_rig(truth, None if self.rig is None else true_rig or Rig())
        return parameter_table(title, self.parameters, true)

    def sensitivity_to_records(self, function: Callable[[PyTree], PyTree]) -> RecordSensitivity:
        """Exact derivatives of a function of the law by the measured forces, through the fit itself.

        What would a ride metric, or the difference from another damper, be if the force of a record were 1 % larger, or
        10 N higher, and the law were fitted again? Parameters at bounds stay there.

        Arguments:
            function: of the law, computed by JAX: a number, or a dictionary of numbers such as the metrics of a `Ride`,
                as in `lambda law: ride.of_vehicle(quarter_car(law))()`.

        Raises:
            ValueError: a fit with a robust loss or priors; a minimum that the records do not determine.
        """
        return sensitivity_to_records(self._evidence, function, self.runs, self.criterion)

    def band(self, velocities: VectorLike) -> Band:
        """95 % intervals of the force [N] at constant velocities [m/s]; `result.band(velocities).plot()`.

        The states of a law with states are settled, for the derivatives over two seconds at each velocity.
        """
        return band(self._evidence, self.law, np.asarray(velocities, float))

    def content(self) -> Contents:
        """Law, errors, scores and parameters as plain data."""
        return AbstractFitted.content(self) | Fit.content(self) | {"error_shares": plain(self.error_shares._asdict())}

    def plot(self, kind: str = "loops", **options: object) -> Figure:
        """Loops of force over velocity and over stroke, measured and fitted, with residuals; or the damper's sheet.

        Arguments:
            kind: "loops" (`plots.fit_loops`), or "sheet" for one A4 page (`plots.damper_sheet`).
            options: of that function, such as `runs`, the records to show.
        """
        from jaxdamp.plots import damper_sheet, fit_loops

        return plotted(kind, {"loops": fit_loops, "sheet": damper_sheet}, self, **options)
