"""`prepare`: a law and bench records as a least-squares problem."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple, Unpack

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._settings import with_defaults
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.dampers import AbstractDamper, Reach
from jaxdamp.identify.criteria import FIRST_NOISE, Priors, priors_on
from jaxdamp.identify.initial_states import INITIAL_STATES, moving_samples, starts_in_words
from jaxdamp.identify.machine import Machine, absent_paths, started_on
from jaxdamp.identify.model import (
    START_PATH,
    STARTS,
    Model,
    RecordStart,
    VehicleTest,
    can_rest,
    initial_state_for,
    is_memoryless,
    law_of,
    on_rig,
    own_names,
    rig_of,
    spread,
    with_means,
)
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.record_starts import first_states
from jaxdamp.identify.settings import PROBLEM, ProblemSettings, check_keywords
from jaxdamp.identify.starting import Start, frozen_by
from jaxdamp.identify.stated import stated_parameters, stated_values, with_stated
from jaxdamp.identify.traces import batches_of_each, places
from jaxdamp.parameters import FreeParameters, free_parameters, match_paths, name_patterns, parameters


FIT_OUTSIDE = "Call it outside `jax.jit`, `jax.grad` and `jax.vmap`; the residuals of a `Problem` can be traced."


@of_known_numbers
@with_defaults(PROBLEM, check=check_keywords)
def prepare(
    law: Start, runs: BenchRun | Iterable[BenchRun], *, rig: Machine = None, **settings: Unpack[ProblemSettings]
) -> Problem:
    """The first of the three steps of `fit`, whose arguments these are: `prepare`, `solve`, `judge`.

    Arguments:
        law: as in `fit`.
        runs: as in `fit`.
        rig: as in `fit`.
        settings: keywords of `fit`, all optional: those of `Free`, `Records`, and `per_record` and `weighting` (see
            `ProblemSettings`).

    Returns:
        The residuals of the records, and the free parameters with their start.

    Raises:
        ValueError: no records; names that fit no parameter; a start outside its bounds; a constant force.

    >>> from jaxdamp import bench, dampers
    >>> from jaxdamp.identify import judge, solve
    >>> runs = bench.VirtualDyno(dampers.Linear(1500.0)).run([bench.SineTest(amplitude=0.02, frequency=2.0)])
    >>> problem = prepare(dampers.Linear(1000.0), runs)
    >>> round(float(judge(problem, solve(problem)).law.rate), 3)
    1500.0
    """
    _checks.one_of("initial_state", settings["initial_state"], INITIAL_STATES)
    _checks.untraced("law", law, FIT_OUTSIDE)
    runs = _records(runs)
    weighting = settings["weighting"]
    sigma = weights(weighting, runs)
    begin = begun(law, runs, sigma, rig, settings)
    each = isinstance(weighting, str) and weighting == "runs"  # numbers may be an array
    return begin.problems([runs], [sigma], settings["samples_per_cycle"], each=each)[0]


class Beginning(NamedTuple):
    """Where fits start."""

    law: AbstractDamper
    model: Model  # with the machine
    free: FreeParameters
    per_record: tuple[str, ...]  # paths of the parameters with a value for each record
    initial_state: str  # of the records
    priors: tuple[Priors, ...]  # what is known beforehand, in units of a noise that the records give

    def problems(
        self,
        dampers: Sequence[tuple[BenchRun, ...]],
        sigma: Sequence[Sequence[float]],
        samples_per_cycle: int | None,
        *,
        each: bool,
    ) -> tuple[Problem, ...]:
        """The problem of the records of each damper with these `weights`, each with a noise level if so stated."""
        how, problems = (samples_per_cycle, self.per_record, self.initial_state), []
        made = batches_of_each(self.model, dampers, sigma, *how)
        for runs, deviations, (residuals, ranges) in zip(dampers, sigma, made, strict=True):
            weighted = (np.asarray(part.force) * np.asarray(part.weight) for part in residuals)
            level = float(np.sqrt(sum(np.sum(np.square(force)) for force in weighted)))
            fitted = [run for run, s in zip(runs, deviations, strict=True) if np.isfinite(s)]
            reach = Reach(0.5 * max(float(np.ptp(r.stroke)) for r in fitted), max(r.peak_velocity for r in fitted))
            count = sum(np.count_nonzero(part.used()) for part in residuals) if self.priors else 1
            noise = FIRST_NOISE * level / np.sqrt(max(count, 1))
            priors = tuple(replace(prior, noise=jnp.asarray(noise)) for prior in self.priors)
            where, owner = places(residuals, ranges), np.zeros(sum(p.used().size for p in (*residuals, *priors)), int)
            for number, place in enumerate(where):
                owner[place] = number
            steps = tuple(at.block / run.sampling_rate for at, run in zip(ranges, runs, strict=True))
            of_records = (level, runs, tuple(deviations), owner, reach, self.law, self.per_record, each, steps, where)
            problem = Problem(self.free, (*residuals, *priors), *of_records, self.initial_state)
            problems.append(problem._replace(noise_known=not priors))
        return tuple(problems)


def begun(
    law: Start,
    runs: Sequence[BenchRun],
    sigma: Sequence[float],
    rig: Machine,
    asked: ProblemSettings,
    mentioned: Iterable[str] = (),
) -> Beginning:
    """The start that records with these `weights` give, as in `fit`, and what the call mentions besides."""
    bounds, priors, tie, per_record = asked["bounds"], asked["priors"], asked["tie"], asked["per_record"]
    fitted_to = [run for run, s in zip(runs, sigma, strict=True) if np.isfinite(s)]
    named = [*mentioned, *name_patterns("per_record", per_record), *(bounds or ()), *(priors or ()), *(tie or {})]
    begin, machine, held = started_on(law, fitted_to, rig, named)
    model, absent = on_rig(begin, machine), [*absent_paths(machine), *held]
    initial_state = initial_state_for(model, asked["initial_state"])
    expected: tuple[Priors, ...] = ()
    if initial_state == "estimated":
        model, expected, unfitted = _with_estimated_states(model, runs, sigma)
        absent = [*absent, *unfitted]
    names = own_names(model)
    stated = stated_values(model, runs)
    model = with_stated(model, stated_parameters(model, fitted_to))
    frozen = [*names.find("freeze", asked["freeze"]), *names.find("freeze", frozen_by(law))]
    frozen += not_chosen(model, asked["over"], "rig.", STARTS)
    by_record = _per_record(model, names.find("per_record", per_record), sigma, absent, stated)
    by_record = free_by_record(by_record, match_paths([p.path for p in parameters(model)], frozen))
    frozen += [*absent, *(p.path for p in parameters(model) if p.path in stated)]
    limits, tied = names.find_keys("bounds", bounds), names.find_keys("tie", tie)
    free = free_parameters(spread(model, by_record, len(runs)), freeze=frozen, bounds=limits, tie=tied, move=True)
    _checks.finite("law", free.values)
    on_parameters = priors_on(free, names.find_keys("priors", priors))
    return Beginning(begin, model, free, by_record, initial_state, (*on_parameters, *expected))


def _records(runs: BenchRun | Iterable[BenchRun]) -> tuple[BenchRun, ...]:
    """The records, at least one, whose forces are not all constant."""
    runs = as_runs(runs, call="fit(law, runs)")
    if not runs:
        _checks.refuse("runs", "hold at least one record", "empty", "Read some with `bench.read`.")
    if not any(np.ptp(run.force) > 0 for run in runs):
        _checks.refuse("runs", "hold a force that varies", "records of a constant force", "Check the force channel.")
    return runs


def _with_estimated_states(
    model: Model, runs: Sequence[BenchRun], sigma: Sequence[float]
) -> tuple[Model, tuple[Priors, ...], list[str]]:
    """The model with a start of the states of each record, what is expected of them, and those that are not fitted.

    A state is expected where the motion alone would put it, with a standard deviation as large as it becomes in the
    motion: weak knowledge, which determines only what the records do not.
    """
    states = first_states(model, runs)
    starts = [RecordStart(jnp.asarray(state)) for state in states.at_rest]
    fitted = np.isfinite(sigma)
    paths = np.array([START_PATH.format(i) for i in range(len(runs))])
    mean, deviation = (jnp.asarray(a[fitted]) for a in (states.expected, states.size))
    prior = Priors(tuple(map(str, paths[fitted])), mean, deviation, mean.size, jnp.ones(()), weak=True)
    return on_rig(law_of(model), rig_of(model), starts), (prior,), [str(path) for path in paths[~fitted]]


def not_chosen(model: Model | VehicleTest, over: Sequence[str] | None, *prefixes: str) -> list[str]:
    """Paths of the law or the vehicle that `over` leaves out; all others, which begin with these words, stay free."""
    paths = [p.path for p in parameters(model) if not p.path.startswith(prefixes)]
    if over is None:
        return []
    chosen = match_paths(paths, own_names(model).find("over", over))
    return [path for path in paths if path not in chosen]


def records_in_words(problem: Problem) -> str:
    """What of the records is left out, and how they start, where that differs from the usual; else empty."""
    model, runs = with_means(problem.free.tree, problem.per_record), problem.fitted_to
    stated = stated_parameters(model, runs).items()
    spans = [f"{path} {np.min(values):.4g} to {np.max(values):.4g}" for path, values in stated]
    parts = [f"stated by the records: {', '.join(spans)}"] * bool(spans)
    parts += [] if is_memoryless(model) else [starts_in_words(runs, problem.initial_state)]
    if not can_rest(model):
        resting = [(run, moving_samples(run)) for run in runs]
        resting = [(run, moving) for run, moving in resting if moving.stop - moving.start < len(run)]
        before = sum(moving.start / run.sampling_rate for run, moving in resting)
        after = sum((len(run) - moving.stop) / run.sampling_rate for run, moving in resting)
        names = ", ".join(run.name for run, _ in resting)
        parts += [f"rest left out: {before:.3g} s before and {after:.3g} s after the motion of {names}"] * bool(names)
    return "; ".join(filter(None, parts))


def _per_record(
    model: Model, names: Sequence[str], sigma: Sequence[float], absent: Sequence[str], stated: Collection[str]
) -> tuple[str, ...]:
    """Paths of the parameters that have a value for each record."""
    by_path = {p.path: p for p in parameters(model)}
    paths = match_paths(list(by_path), name_patterns("per_record", names))
    paths = [path for path in paths if path not in absent] or paths
    for path in set(paths) & set(absent):
        remedy = f"Give it a start: `rig=Rig({path.removeprefix('rig.')}=...)`."
        _checks.refuse("per_record", "name parameters that are free", f"{path}, which the rig leaves out", remedy)
    for path in set(paths) & set(stated):
        remedy = "Leave it out, or their temperature: they would be two values of one number."
        _checks.refuse("per_record", "name numbers that the records do not state", path, remedy)
    for path in paths:
        if by_path[path].value.ndim:
            remedy = "Only single numbers can differ from record to record."
            _checks.refuse("per_record", "name parameters that are one number", f"{path}, a vector", remedy)
    if paths and not np.all(np.isfinite(sigma)):
        remedy = "The value of a record that is not fitted is undetermined: leave this record out of `runs`."
        _checks.refuse("weighting", "be finite with `per_record`", "infinite for some records", remedy)
    return tuple(paths)


def free_by_record(paths: Sequence[str], held: Collection[str]) -> tuple[str, ...]:
    """Those with a value for each record that are not held at their start, at least one if there are any."""
    free = tuple(path for path in paths if path not in held)
    if paths and not free:
        remedy = "Remove it from `freeze`, or name it in `over`."
        _checks.refuse("per_record", "name parameters that are free", f"{paths[0]}, which is held at its start", remedy)
    return free


def weights(weighting: str | Sequence[float] | np.ndarray, runs: Sequence[BenchRun]) -> list[float]:
    """Standard deviation [N] that the residuals of each record are divided by; infinite for a record to be left out."""
    if isinstance(weighting, str):
        _checks.one_of("weighting", weighting, ["samples", "runs"])
        if weighting == "samples":
            return [1.0] * len(runs)
        sigma = [float(np.sqrt(np.mean(run.force**2) * len(run))) for run in runs]
        _checks.positive("runs", np.array(sigma), "A record without force has no RMS force to be weighted by.")
        return sigma
    remedy = "Give 'samples', 'runs', or the standard deviation of the force of each record [N]."
    if np.ndim(weighting) != 1 or np.asarray(weighting).dtype.kind not in "iuf":
        _checks.refuse("weighting", "be a word or a number for each record", weighting, remedy)
    sigma = [float(s) for s in weighting]
    if len(sigma) != len(runs):
        _checks.refuse("weighting", f"give one number for each of {len(runs)} records", f"{len(sigma)} numbers")
    finite = np.array([s for s in sigma if s != np.inf])
    _checks.positive("weighting", finite)
    if not finite.size:
        _checks.refuse("weighting", "leave at least one record", "infinite for all")
    return sigma


def weighting_of(
    runs: Sequence[BenchRun], records: Sequence[BenchRun], weighting: str | Sequence[float] | np.ndarray
) -> str | Sequence[float] | np.ndarray:
    """The weighting of those of the records that are kept, where it is a number for each record."""
    if isinstance(weighting, str) or len(runs) == len(records):
        return weighting
    return [sigma for run, sigma in zip(records, weights(weighting, records), strict=True) if run in runs]
