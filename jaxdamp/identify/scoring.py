"""Errors of predicted forces."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxdamp._tables import with_unit
from jaxdamp.bench import BenchRun
from jaxdamp.identify.model import Model, is_memoryless
from jaxdamp.identify.predicting import predict_by_record, used_samples


class Score(NamedTuple):
    """Errors of the force of a law on one record, after settling.

    Attributes:
        name: of the record.
        rmse: root of the mean squared error [N].
        fit_percent: 100 is perfect, 0 no better than a constant [%].
        largest_error: largest magnitude of the error [N].
    """

    name: str
    rmse: float  # N
    fit_percent: float
    largest_error: float  # N

    def to_dict(self) -> dict[str, Any]:
        """The errors with units, ready for JSON."""
        return {
            "record": self.name,
            "fit": with_unit(self.fit_percent, "%"),
            "rmse": with_unit(self.rmse, "N"),
            "largest_error": with_unit(self.largest_error, "N"),
        }


def fit_percent(measured: Sequence[np.ndarray], predicted: Sequence[np.ndarray]) -> float:
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖) over all samples: 100 is perfect, 0 no better than a constant.

    −∞ for a constant measured force that is not matched exactly.

    Arguments:
        measured: measured force of each record [N].
        predicted: force of the law at the same samples [N].
    """
    y, p = np.concatenate(list(measured)), np.concatenate(list(predicted))
    missed, spread = (float(np.sqrt(np.sum(a * a))) for a in (y - p, y - y.mean()))
    if missed == 0.0:
        return 100.0
    return 100.0 * (1.0 - missed / spread) if spread > 0.0 else -np.inf


def score_of(name: str, measured: np.ndarray, predicted: np.ndarray) -> Score:
    """Errors of a predicted force [N] from a measured one."""
    error = predicted - measured
    rmse, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
    return Score(name, rmse, fit_percent([measured], [predicted]), largest)


def score(
    model: Model | Sequence[Model],
    runs: Sequence[BenchRun],
    counted: Sequence[bool] | np.ndarray | None = None,
    initial_state: str = "warm_up",
) -> tuple[float, float, tuple[Score, ...]]:
    """Fit percent and RMSE [N] of a model, or of one for each record, over the records that count, and for each."""
    models, forces = predict_by_record(model, runs, initial_state)
    memoryless = {
        id(own): is_memoryless(own) for own in {id(own): own for own in models}.values()
    }  # most often one model for all records
    pairs = zip(models, runs, strict=True)
    used = [used_samples(own, run, memoryless[id(own)], initial_state) for own, run in pairs]
    measured = [run.force[k] for run, k in zip(runs, used, strict=True)]
    predicted = [force[k] for force, k in zip(forces, used, strict=True)]
    rows = [score_of(run.name, y, p) for run, y, p in zip(runs, measured, predicted, strict=True)]
    chosen = [i for i in range(len(runs)) if counted is None or counted[i]]
    y, p = [measured[i] for i in chosen], [predicted[i] for i in chosen]
    errors = np.concatenate(p) - np.concatenate(y)
    return fit_percent(y, p), float(np.sqrt(np.mean(errors**2))), tuple(rows)
