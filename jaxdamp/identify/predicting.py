"""Predicted forces of a model at the samples of records."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import require_finite_force
from jaxdamp.identify.estimated_states import with_first_states
from jaxdamp.identify.initial_states import DRIFT, rest_window, start_of
from jaxdamp.identify.model import Model, blind_end, initial_state_for, is_memoryless, law_of, of_record, starts_in
from jaxdamp.identify.rows import samples_in_block, settling_time
from jaxdamp.identify.traces import Batch, batches


PREDICTED_PER_CYCLE = 1000  # samples at which a law with states is evaluated; straight lines between them: error 5e-6


@eqx.filter_jit
def _predict(batch: Batch, model: Model) -> tuple[Array, Array]:
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
    predicted = [tuple(map(np.asarray, _predict(batch, model))) for batch in made]
    forces = []
    for run, at in zip(runs, ranges, strict=True):
        force, change = (values[at.row] for values in predicted[at.batch])
        _refuse_drift(model, run, float(change))
        forces.append(_spread(force[at.start : at.stop], at.block, len(run)))
        used = used_samples(model, run, memoryless, initial_state)
        require_finite_force(law_of(model), forces[-1][used], f"over the record {run.name!r}")
    return forces


def _refuse_drift(model: Model, run: BenchRun, change: float) -> None:
    """Refuse states that have not settled in the periodic solution."""
    if change > DRIFT:
        must = "be one that the law has"
        value = f"'periodic': over a cycle of {run.name!r} the states of {law_of(model)} still change by {change:.2g}"
        _checks.refuse("initial_state", must, value, "Pass 'warm_up', or freeze what drifts, such as heat.")


def predict_by_record(
    model: Model | Sequence[Model], runs: Sequence[BenchRun], initial_state: str = "warm_up"
) -> tuple[list[Model], list[np.ndarray]]:
    """The model of each record and its force [N] there, of one model for all records or of one for each."""
    if isinstance(model, Sequence):
        pairs = zip(model, runs, strict=True)
        return list(model), [predict_runs(own, [run], initial_state)[0] for own, run in pairs]
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
    return int(np.ceil(settling_time(run) * run.sampling_rate)) if start == "warm_up" else 0
