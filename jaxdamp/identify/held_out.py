"""How well a fit predicts motion that it was not fitted to: parts of its own records are left out in turn.

The samples left out get weight zero and the others are fitted again from the minimum of all, so that the compiled
programs of the fit are used again: a few steps for each part.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._one_thread import one_thread
from jaxdamp.bench import BenchRun
from jaxdamp.identify.fitting import solve
from jaxdamp.identify.initial_states import moving_samples
from jaxdamp.identify.judging import fitted_models
from jaxdamp.identify.law_result import FitResult
from jaxdamp.identify.model import Model
from jaxdamp.identify.predicting import Compared, Score, compared, errors
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.propagation import Evidence
from jaxdamp.identify.record_starts import warmed
from jaxdamp.parameters import get, with_values


PARTS = 4  # into which records, or the time of each record, are divided
FEWEST_MOTIONS = 3  # that differ, for whole records to be left out
ALIKE = 0.02  # relative difference of frequency and largest velocity of records of the same motion
LEAST_CHANGE = 0.5  # of what changes the force by its RMS: numbers are never held more firmly
LEAST_UNREACHED = 0.05  # of the samples of a record, beyond the velocities of all others, which then count
SLICES = 5  # in which a part of a record of few cycles is spread over it
REFIT_STEPS = 12  # of each refit at most, from the minimum of all records
_WITHOUT = " predicted by fits without it"

Part = tuple[Bool[np.ndarray, " _"], ...]  # the samples of each record that are left out


class HeldOut(NamedTuple):
    """The errors on motion that a fit did not know."""

    fit_percent: float  # over all samples that were predicted [%]
    rmse: float  # over the same [N]
    scores: tuple[Score, ...]  # on each record, or each part of a record, one by one
    words: str  # what was predicted from what


def without_parts(result: FitResult, *, in_time: bool = False) -> HeldOut | None:
    """The errors of a fit on parts of its own records, each predicted by a fit to the others.

    Records of three motions or more are left out in up to four groups, records of the same motion together. Otherwise
    the quarters of the records in time are left out; of records shorter than four cycles, every fourth of 20 slices.

    A part is predicted at velocities that the other parts reach: no law knows its curve beyond. Where 5 % of a record
    or more are beyond the velocities of all others, the fit of all is judged on them, since its error there counts
    too. A number that the other parts do not determine keeps its value of the fit of all records.

    With `in_time` whole records are never left out, for fits with numbers that only one record determines and for those
    that are compared with them. None where no part can be left out, or where the points of a table without a quarter
    are fewer than the numbers, which would keep the values that the whole has told.
    """
    evidence = result.evidence
    assert evidence is not None
    problem, start = evidence.problem, anchored_at(evidence)
    fitted = np.flatnonzero(np.isfinite(problem.sigma))
    runs = [problem.runs[i] for i in fitted]
    if _are_too_few(runs, len(result.parameters)):
        return None
    groups = motions(runs)
    whole = not in_time and len(groups) >= FEWEST_MOTIONS
    samples: list[Compared] = []
    unreached = [np.zeros(len(run), bool) for run in runs]
    left_out = _by_record(runs, groups) if whole else zip(*map(in_time_parts, runs), strict=True)
    for number, part in enumerate(left_out, 1):
        factor = _kept(problem, fitted, part)
        if np.all(factor) or not np.any(problem.used & (factor > 0)):
            continue
        near = _reached(runs, part)
        unreached = [at | (left & ~reached) for at, left, reached in zip(unreached, part, near, strict=True)]
        names = [run.name if whole else f"{run.name}, part {number} of {PARTS}" for run in runs]
        parts = zip(map(int, fitted), names, near, strict=True)
        models, told = _predicting(_refitted(start, factor), fitted, part, result)
        samples += compared(models, problem.runs, problem.initial_state, parts, told)
    if not samples:
        return None
    beyond = _beyond(result, fitted, unreached)
    words = _quarters(runs, alike=len(groups) == 1) if not whole else f"each of {len(runs)} records{_WITHOUT}"
    words += ", velocities that no other reaches by the fit of all" * bool(beyond)
    return HeldOut(*errors([*samples, *beyond]), words)


def _most_numbers(runs: Sequence[BenchRun]) -> int:
    """So many numbers of a law at most as there are points of tables without a quarter of them."""
    points = sum(map(len, runs))
    return points - -(-points // PARTS)


def _are_too_few(runs: Sequence[BenchRun], numbers: int) -> bool:
    """Whether points of tables, without a quarter of them, are fewer than the numbers of a law."""
    return all(run.of_points for run in runs) and numbers > _most_numbers(runs)


def too_few_points(runs: Sequence[BenchRun], numbers: int) -> str:
    """Why a law is not judged on points of tables."""
    remedy = f"measure more points, or take a law with {_most_numbers(runs)} numbers or fewer."
    return f"{sum(map(len, runs))} points are too few for its {numbers} numbers: {remedy}"


def _quarters(runs: Sequence[BenchRun], *, alike: bool) -> str:
    """What was predicted from what, in words, where parts of records of one motion or of several are left out."""
    if all(run.of_points for run in runs):
        return f"each quarter of the points{_WITHOUT}"
    return f"each quarter of the record{'s' * (len(runs) > 1)}{_WITHOUT}" + ", all of one motion" * alike


def _reached(runs: Sequence[BenchRun], part: Part) -> Part:
    """The samples left out whose velocity the others reach."""
    velocities = np.concatenate([run.velocity[~left] for run, left in zip(runs, part, strict=True)])
    reached = [(run.velocity >= velocities.min()) & (run.velocity <= velocities.max()) for run in runs]
    return tuple(left & near for left, near in zip(part, reached, strict=True))


def _beyond(result: FitResult, fitted: np.ndarray, unreached: Sequence[np.ndarray]) -> list[Compared]:
    """The samples of records that reach far beyond the velocities of all others, by the fit of all."""
    names = [f"{result.runs[i].name}, beyond the others" for i in fitted]
    parts = [each for each in zip(map(int, fitted), names, unreached, strict=True) if each[2].mean() >= LEAST_UNREACHED]
    return compared(result.models_of(result.runs)[0], result.runs, result.initial_state, parts) if parts else []


def on_records(result: FitResult, runs: Sequence[BenchRun]) -> HeldOut | None:
    """The errors of a fit on other records, in four parts of each if they are fewer than three."""
    few, parts = len(runs) < FEWEST_MOTIONS, []
    for i, run in enumerate(runs):
        if few:
            parts += [(i, f"{run.name}, part {k} of {PARTS}", part) for k, part in enumerate(in_time_parts(run), 1)]
        else:
            parts.append((i, run.name, np.ones(len(run), bool)))
    models, told = result.models_of(runs)
    samples = compared(models, runs, result.initial_state, parts, told)
    return HeldOut(*errors(samples), f"{len(runs)} record{'s' * (len(runs) > 1)} held out") if samples else None


def motions(runs: Sequence[BenchRun]) -> list[list[int]]:
    """The records in groups of the same motion, by frequency and largest velocity, from slow to fast.

    >>> from jaxdamp import bench, dampers
    >>> tests = [bench.SineTest(amplitude=0.01, frequency=f, name=n) for f, n in ((3.0, "a"), (1.0, "b"), (3.0, "c"))]
    >>> motions(tuple(bench.VirtualDyno(dampers.Linear(1500.0)).run(tests)))
    [[1], [0, 2]]
    """
    groups: list[list[int]] = []
    for i in sorted(range(len(runs)), key=lambda i: runs[i].peak_velocity):
        for group in groups:
            pairs = [(f(runs[i]), f(runs[group[0]])) for f in (lambda r: r.peak_velocity, lambda r: r.frequency)]
            if all(abs(a - b) <= ALIKE * max(abs(a), abs(b)) for a, b in pairs):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def in_time_parts(run: BenchRun) -> Iterator[Bool[np.ndarray, " samples"]]:
    """The samples of each of four parts of a record: its quarters, or slices in turn where it has few cycles.

    Rest before and after the motion belongs to the nearest part. Of the points of a table every fourth is left out.
    """
    if run.of_points:
        return (np.arange(len(run)) % PARTS == part for part in range(PARTS))
    moving = moving_samples(run)
    count = moving.stop - moving.start
    slices = PARTS if count / run.sampling_rate * run.frequency >= PARTS else PARTS * SLICES
    number = ((np.arange(len(run)) - moving.start) * slices // max(count, 1)).clip(0, slices - 1) % PARTS
    return (number == part for part in range(PARTS))


def _by_record(runs: Sequence[BenchRun], groups: Sequence[Sequence[int]]) -> list[Part]:
    """Whole records, so that each part has slow and fast ones."""
    count = min(PARTS, len(groups))
    part_of = {i: k % count for k, group in enumerate(groups) for i in group}
    return [tuple(np.full(len(run), part_of[i] == k) for i, run in enumerate(runs)) for k in range(count)]


def _kept(problem: Problem, fitted: Sequence[int] | np.ndarray, part: Part) -> Float[np.ndarray, " samples"]:
    """Factor on the weight of each sample of the residuals: zero for blocks with a sample that is left out."""
    factor = np.ones(problem.owner.size)
    for i, left in zip(fitted, part, strict=True):
        place, block = problem.places[i], round(problem.sample_steps[i] * problem.runs[i].sampling_rate)
        count = place.stop - place.start
        factor[place] = ~np.any(left[: count * block].reshape(count, block), axis=1)
    return factor


def anchored_at(evidence: Evidence) -> Problem:
    """The problem at its minimum, where numbers are weakly held: a large change counts as one standard deviation.

    It is a change by the value itself, if that is between half and all of what changes the force by its RMS.
    """
    problem, minimum = evidence.problem, evidence.minimum
    sensitivity = np.linalg.norm(minimum.jacobian, axis=0) / problem.level
    by_force = np.divide(1.0, sensitivity, out=np.ones(sensitivity.shape), where=sensitivity > 0)
    large = np.clip(np.abs(minimum.values), LEAST_CHANGE * by_force, by_force)
    weight = np.sqrt(minimum.squares / np.count_nonzero(problem.used)) / large
    return problem.started_at(minimum.values)._replace(anchor=(minimum.values, weight))


def _predicting(
    models: Model | list[Model], fitted: np.ndarray, part: Part, result: FitResult
) -> tuple[Model | list[Model], list[int]]:
    """The models without a value that records left out had for themselves, and the samples that told it instead.

    Such a record begins as warm as its first cycles show, about the mean of the others.
    """
    out = [int(i) for i, left in zip(fitted, part, strict=True) if left.all()]
    if not isinstance(models, list) or not out or not (paths := result.own_starts):
        return models, [0] * len(result.runs)
    others = [model for i, model in enumerate(models) if i not in out]
    mean = {path: np.mean([np.asarray(get(model, path)) for model in others]) for path in paths}
    how = (paths, result.rmse * result.inflation, result.initial_state)
    new = {i: warmed(with_values(models[i], mean), result.runs[i], *how) for i in out}
    told = [new[i].told if i in new else 0 for i in range(len(models))]
    return [new[i].model if i in new else model for i, model in enumerate(models)], told


@one_thread()
def _refitted(problem: Problem, factor: Float[np.ndarray, " samples"]) -> Model | list[Model]:
    """The model, or that of each record, fitted with these weights."""
    solution = solve(problem.reweighted(factor), starts=1, max_steps=REFIT_STEPS)
    models, model = fitted_models(problem, solution.best.values)
    return models or model
