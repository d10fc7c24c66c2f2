"""Predicted forces of records, their errors, and the shares of the errors: shape, hysteresis, rest."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp import _checks
from jaxdamp._one_thread import one_thread
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._tables import Contents, with_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.dampers import require_finite_force
from jaxdamp.identify.initial_states import DRIFT, rest_window, start_of
from jaxdamp.identify.model import (
    Model,
    blind_end,
    count_states,
    initial_state_for,
    is_memoryless,
    law_of,
    memory_of_machine,
    of_record,
    starts_in,
)
from jaxdamp.identify.printed import predicted as predicted_by_c
from jaxdamp.identify.record_starts import with_first_states
from jaxdamp.identify.rows import samples_in_block, settling_samples
from jaxdamp.identify.traces import Batch, batches


PREDICTED_PER_CYCLE = 1000  # samples at which a law with states is evaluated; straight lines between them: error 5e-6


def _predict(batch: Batch, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Forces [N], and the change of the states over the cycle before a record that starts periodically."""
    forces = predicted_by_c(batch, model)
    if forces is not None:
        return forces, np.zeros(len(forces))
    forces, change = _predicted_by_xla(batch, model)
    return np.asarray(forces), np.asarray(change)


@compiled_for_loops
def _predicted_by_xla(batch: Batch, model: Model) -> tuple[Array, Array]:
    return batch.settled_forces(model)


def _spread(values: np.ndarray, block: int, count: int) -> np.ndarray:
    """Values at every sample from the means of blocks, by straight lines between the centres and beyond the ends."""
    if block == 1:
        return values
    places = (np.arange(count) - 0.5 * (block - 1)) / block
    left = np.clip(np.floor(places).astype(int), 0, len(values) - 2)
    return values[left] + (places - left) * (values[left + 1] - values[left])


@of_known_numbers
def predict_runs(model: Model, runs: Sequence[BenchRun], initial_state: str = "warm_up") -> list[np.ndarray]:
    """Force [N] of the model at every sample of every record.

    Arguments:
        model: a law, or a law on a test machine.
        runs: the records, whose motion is prescribed.
        initial_state: of the law at the first sample, as in `fit`.

    Raises:
        ValueError: forces that are not finite; states that drift in a motion that is said to be periodic.
    """
    if initial_state == "estimated":
        model = with_first_states(model, runs)
    memoryless = is_memoryless(model)
    per_cycle = None if memoryless else PREDICTED_PER_CYCLE
    made, ranges = batches(model, runs, [1.0] * len(runs), per_cycle, (), initial_state)
    predicted = [_predict(batch, model) for batch in made]
    forces = []
    for run, at in zip(runs, ranges, strict=True):
        force, change = (values[at.row] for values in predicted[at.batch])
        if change > DRIFT:
            law, must = law_of(model), "be one that the law has"
            value = f"'periodic': over a cycle of {run.name!r} the states of {law} still change by {float(change):.2g}"
            _checks.refuse("initial_state", must, value, "Pass 'warm_up', or freeze what drifts, such as heat.")
        forces.append(_spread(force[at.start : at.stop], at.block, len(run)))
        used = used_samples(model, run, memoryless, initial_state)
        require_finite_force(law_of(model), forces[-1][used], f"over the record {run.name!r}")
    return forces


def predict_by_record(
    model: Model | Sequence[Model], runs: Sequence[BenchRun], initial_state: str = "warm_up"
) -> tuple[list[Model], list[np.ndarray]]:
    """The model of each record and its force [N] there, of one model for all records or of one for each."""
    if isinstance(model, Sequence):
        pairs = zip(model, runs, strict=True)
        return list(model), [predict_runs(one, [run], initial_state)[0] for one, run in pairs]
    return [of_record(model, i) for i in range(len(runs))], predict_runs(model, runs, initial_state)


def used_samples(model: Model, run: BenchRun, memoryless: bool, initial_state: str = "warm_up") -> slice:
    """The samples of a record that are compared with a model: all, or those from settling to a blind end."""
    if memoryless:
        return slice(0, None)
    block = samples_in_block(run, PREDICTED_PER_CYCLE)
    blind = blind_end(model, block / run.sampling_rate) * block
    return slice(_first_used(model, run, initial_state), len(run) - blind)


def _first_used(model: Model, run: BenchRun, initial_state: str) -> int:
    """The first sample of a record that is compared: not those that told the states, nor those of settling."""
    start = start_of(run, initial_state_for(model, initial_state))
    if start == "estimated" and not any(starts_in(model)):
        if rest_window(run):
            return rest_window(run)
        start = "warm_up"
    if start != "warm_up":
        return 0
    settled = settling_samples(run, 1.0 / run.sampling_rate)
    return settled if count_states(model) else min(settled, round(memory_of_machine(model) * run.sampling_rate))


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

    def to_dict(self) -> Contents:
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


class Compared(NamedTuple):
    """The samples of a record, or of a part of one, over which a prediction is compared with the measurement."""

    name: str  # of the record or part
    measured: Float[np.ndarray, " samples"]  # forces [N]
    predicted: Float[np.ndarray, " samples"]  # forces at the same samples [N]


def compared(
    model: Model | Sequence[Model],
    runs: Sequence[BenchRun],
    initial_state: str = "warm_up",
    parts: Iterable[tuple[int, str, Bool[np.ndarray, " _"]]] | None = None,
    told: Sequence[int] = (),
) -> list[Compared]:
    """The samples that a model, or one for each record, is compared over: those that count, of records or their parts.

    `parts` are the number of the record, the name and the samples of each part, None for all records; those without a
    sample that counts are left out. `told` samples at the beginning of each record told something of the model, and are
    not compared.
    """
    models, forces = predict_by_record(model, runs, initial_state)
    distinct = {id(each): each for each in models}.values()  # most often one model for all records
    memoryless = {id(each): is_memoryless(each) for each in distinct}
    used = [used_samples(law, run, memoryless[id(law)], initial_state) for law, run in zip(models, runs, strict=True)]
    if any(told):
        used = [slice(max(k.start or 0, n), k.stop) for k, n in zip(used, told, strict=True)]
    if parts is None:
        return [Compared(run.name, run.force[k], f[k]) for run, f, k in zip(runs, forces, used, strict=True)]
    chosen = [(i, name, np.flatnonzero(part[used[i]]) + (used[i].start or 0)) for i, name, part in parts]
    return [Compared(name, runs[i].force[k], forces[i][k]) for i, name, k in chosen if k.size]


def errors(samples: Sequence[Compared]) -> tuple[float, float, tuple[Score, ...]]:
    """Fit percent and RMSE [N] over all samples together, and the errors of each record or part."""
    rows = []
    for name, measured, predicted in samples:
        error = predicted - measured
        rmse, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        rows.append(Score(name, rmse, fit_percent([measured], [predicted]), largest))
    y, p = [each.measured for each in samples], [each.predicted for each in samples]
    rmse = float(np.sqrt(np.mean((np.concatenate(p) - np.concatenate(y)) ** 2)))
    return fit_percent(y, p), rmse, tuple(rows)


def score(
    model: Model | Sequence[Model],
    runs: Sequence[BenchRun],
    counted: Sequence[bool] | np.ndarray | None = None,
    initial_state: str = "warm_up",
    told: Sequence[int] = (),
) -> tuple[float, float, tuple[Score, ...]]:
    """Fit percent and RMSE [N] of a model, or of one for each record, over the records that count, and for each."""
    samples = compared(model, runs, initial_state, told=told)
    percent, rmse, rows = errors(samples)
    if counted is not None:
        percent, rmse, _ = errors([each for each, counts in zip(samples, counted, strict=True) if counts])
    return percent, rmse, rows


class ErrorShares(NamedTuple):
    """Shares of the mean squared error; their sum is 1.

    Attributes:
        shape: share that another curve of force over velocity would remove [-].
        hysteresis: share by which the force differs between the two passes through the same velocity [-].
        rest: noise, and changes from cycle to cycle [-].
    """

    shape: float  # another curve of force over velocity would remove it
    hysteresis: float  # the force differs between the two passes through the same velocity
    rest: float  # noise, and changes from cycle to cycle


@of_known_numbers
@one_thread()  # sums of many products differ in their last bits with the number of threads
def error_shares(
    law: Model | Sequence[Model], runs: BenchRun | Iterable[BenchRun], initial_state: str = "warm_up"
) -> ErrorShares:
    """Split the squared force error of a law over records, record by record, by an analysis of variance.

    The samples of a record are sorted by velocity into bins, and each bin is divided by the half of the stroke: a cycle
    passes every velocity twice, once above and once below mid-stroke. The mean of a bin is the error that another curve
    over velocity could remove (*shape*), the difference of the two halves from it is *hysteresis* (or a dependence on
    the stroke), and the scatter about them is the *rest*. The contribution of the scatter to the means is subtracted.
    Points of a force-velocity table stand alone: their error is all rest.

    `FitResult.error_shares` gives the shares of a fit over its own records.

    Arguments:
        law: a law, fitted or not, or the `model` of a fit; or one for each record.
        runs: one record or several.
        initial_state: how they start, as in `fit`.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear, Linear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.01, 2.0))
    >>> error_shares(Linear(1900.0), runs).shape > 0.9
    True
    """
    runs = as_runs(runs, call="error_shares(law, runs)")
    sums = np.zeros(3)
    laws, forces = predict_by_record(law, runs, initial_state)
    for own, run, force in zip(laws, runs, forces, strict=True):
        part = used_samples(own, run, is_memoryless(own), initial_state)
        error = force[part] - run.force[part]
        sums += [0.0, 0.0, error @ error] if run.of_points else _sums(run.velocity[part], run.stroke[part], error)
    shape, hysteresis, rest = sums / max(sums.sum(), np.finfo(float).tiny)
    return ErrorShares(float(shape), float(hysteresis), float(rest))


def _sums(
    velocity: Float[np.ndarray, " samples"], stroke: Float[np.ndarray, " samples"], error: Float[np.ndarray, " samples"]
) -> Float[np.ndarray, "3"]:
    """Sums of squares of one record: shape, hysteresis, rest."""
    count = len(error)
    bins = int(np.clip(count // 16, 1, 30))
    number = np.empty(count, dtype=int)
    number[np.argsort(velocity, kind="stable")] = np.arange(count) * bins // count
    above = stroke > 0.5 * (stroke.max() + stroke.min())
    cells = 2 * number + above
    by_bin = _group_squares(number, error, bins)
    by_cell = _group_squares(cells, error, 2 * bins)
    total = float(error @ error)
    scatter = (total - by_cell) / max(count - 2 * bins, 1)
    shape = max(by_bin - bins * scatter, 0.0)
    hysteresis = max(by_cell - by_bin - bins * scatter, 0.0)
    return np.array([shape, hysteresis, max(total - shape - hysteresis, 0.0)])


def _group_squares(number: np.ndarray, error: np.ndarray, groups: int) -> float:
    """Σ n m² over groups of n samples with mean m."""
    n = np.bincount(number, minlength=groups)
    sums = np.bincount(number, weights=error, minlength=groups)
    return float(np.sum(sums[n > 0] ** 2 / n[n > 0]))
