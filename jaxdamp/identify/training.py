"""`train`: gradient descent for laws with many weights, with early stopping on held-out records."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol, TypedDict, Unpack, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._guesses import Elsewhere
from jaxdamp._progress import Progress
from jaxdamp._results import drawn_by
from jaxdamp._settings import with_defaults
from jaxdamp._status import Status
from jaxdamp._tables import Column, Contents, Table, with_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, as_runs, usable
from jaxdamp.identify.contradicting import contradicting, refuse_contradicting
from jaxdamp.identify.covered import covered_range
from jaxdamp.identify.judging import notes_on
from jaxdamp.identify.law_result import AbstractFitted
from jaxdamp.identify.machine import Machine
from jaxdamp.identify.model import Model, law_of, rig_of, with_range
from jaxdamp.identify.predicting import score
from jaxdamp.identify.preparing import prepare, weighting_of
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.settings import check_keywords
from jaxdamp.identify.starting import Start
from jaxdamp.identify.traces import Batch, batches
from jaxdamp.parameters import Coordinates, listed


@runtime_checkable
class Optimiser(Protocol):
    """The rules of an optimiser of optax, which is loaded only for training."""

    @property
    def init(self) -> Callable[[PyTree], PyTree]:
        """The state before the first step, from the numbers."""
        ...

    @property
    def update(self) -> Callable[[PyTree, PyTree, PyTree], tuple[PyTree, PyTree]]:
        """The change of the numbers and the next state, from the gradient, the state and the numbers."""
        ...


class TrainSettings(TypedDict, total=False):
    """The keywords that `train` has from `fit`.

    Arguments:
        freeze: parameters to hold at their start, as in `Free`.
        tie: parameters that take the values of others, as in `Free`.
        weighting: of `runs`, as in `ProblemSettings`.
        samples_per_cycle: slow records are averaged in blocks down to this number.
        bad_records: as in `FitSettings`, of `held_out` too.
    """

    freeze: Sequence[str]
    tie: Mapping[str, str] | None
    weighting: str | Sequence[float] | np.ndarray
    samples_per_cycle: int
    bad_records: str


TRAIN: TrainSettings = {
    "freeze": (), "tie": None, "weighting": "samples", "samples_per_cycle": 200, "bad_records": "refuse",
}  # fmt: skip
CHUNK = 25  # steps in one compiled call, after which the held-out records are evaluated


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Training(AbstractFitted):
    """A law trained by gradient descent, from the step where its error on the held-out records was smallest.

    It has no standard errors: `fit(training.law, training.runs, freeze=[...])` gives those of the numbers that are not
    held, such as all but the weights of a network.

    Attributes:
        held_out: the records that decided when to stop.
        held_out_fit_percent: over the held-out records together.
        held_out_rmse: over the held-out records together [N].
        steps: number of steps at each entry of the histories.
        history: RMSE [N] over the training records as trained on (averaged samples), for each entry.
        held_out_history: the same over the held-out records.
        best_step: the step that the law comes from.
        stopped: reason for the end of the training, in words.
        scored_only: names of the records with an infinite weighting, which were not trained on.
    """

    held_out: tuple[BenchRun, ...]
    held_out_fit_percent: float
    held_out_rmse: float
    steps: Float[np.ndarray, " entries"]
    history: Float[np.ndarray, " entries"]
    held_out_history: Float[np.ndarray, " entries"]
    best_step: int
    stopped: str
    scored_only: tuple[str, ...] = ()

    def table(self) -> Table:
        """The errors on each record, trained on or held out."""
        columns = Column("record"), Column("use"), Column("fit", "%", ".1f")
        uses = ["scored only" if run.name in self.scored_only else "training" for run in self.runs]
        uses += ["held out"] * len(self.held_out)
        rows = tuple((s.name, use, *s[2:0:-1], s.largest_error) for s, use in zip(self.scores, uses, strict=True))
        return Table(
            f"{type(self.law).__name__} after training",
            (*columns, Column("RMSE", "N", ".1f"), Column("largest error", "N", ".1f")),
            rows,
        )

    def content(self) -> Contents:
        """Law, errors and the course of the training as plain data."""
        return super().content() | {
            "held_out": [run.name for run in self.held_out],
            "held_out_fit": with_unit(self.held_out_fit_percent, "%"),
            **self._data("steps", "best_step", "stopped", held_out_rmse="N", history="N", held_out_history="N"),
        }

    estimate, propagate, profile, posterior, band = (
        Elsewhere(
            "that of `identify.fit(training.law, training.runs, freeze=[...])`, as `train` has no standard errors"
        )
        for _ in range(5)
    )

    plot = drawn_by("training_history", "The errors over the steps of the training.")

    @property
    def summary(self) -> str:
        """Law, number of records, errors, and how the training ended."""
        count = len(self.runs) - len(self.scored_only)
        return (
            f"{type(self.law).__name__} trained on {count} record{'s' * (count > 1)}: {self.fit_percent:.1f} %, RMSE "
            f"{self.rmse:.4g} N; on {len(self.held_out)} held out: {self.held_out_fit_percent:.1f} %, RMSE "
            f"{self.held_out_rmse:.4g} N; best at step {self.best_step}, {self.stopped}"
        )

    def __repr__(self) -> str:
        return self.summary


@of_known_numbers
@with_defaults(TRAIN, check=check_keywords)
def train(
    law: Start,
    runs: BenchRun | Iterable[BenchRun],
    *,
    held_out: BenchRun | Iterable[BenchRun],
    rig: Machine = None,
    steps: int = 2000,
    patience: int = 400,
    learning_rate: float = 0.02,
    optimiser: Optimiser | None = None,
    **settings: Unpack[TrainSettings],
) -> Training:
    """Train a law with many weights, such as `Hybrid`, by gradient descent with early stopping.

    Minimises the mean squared error of the force over all samples of `runs` with the whole gradient in every step
    (reverse mode through the law and its states). Every 25 steps the error on `held_out` is evaluated; the result is
    the law with the smallest one. Nothing is random here: the same law and the same records give the same result.
    Smooth maps keep parameters in their domains.

    For laws with few parameters use `fit`, which also computes their standard errors.

    Arguments:
        law: a start as in `fit`: a law, a law class, or a function that returns a law.
        runs: records to train on. A few steady cycles of each are enough: `run.last_cycles(3)`.
        held_out: records that decide when to stop; they are not trained on. To assess the law, use further records.
        rig: the test machine as in `fit`, trained together with the law.
        steps: largest number of steps.
        patience: number of steps without a decrease of the held-out error after which the training stops.
        learning_rate: initial learning rate of Adam; it decreases to a hundredth along a cosine over `steps`.
        optimiser: any optax optimiser instead.
        settings: keywords of `fit`, all optional: `freeze`, `tie`, `weighting`, `bad_records`, and `samples_per_cycle`,
            200 if left out (see `TrainSettings`).

    Raises:
        ValueError: no records on either side, a record on both; a record with an error; records that contradict each
            other; a law without finite forces; names that fit no parameter.

    >>> from jaxdamp import bench, dampers
    >>> dyno = bench.VirtualDyno(dampers.Lag(dampers.Linear(2000.0), 0.004), force_noise=5.0)
    >>> runs = dyno.run([bench.SineTest(0.01, f) for f in (2.0, 4.0)])
    >>> start = dampers.Lag(dampers.Linear(1500.0), 0.002)
    >>> trained = train(start, runs[0], held_out=runs[1], steps=200)
    >>> trained.held_out_fit_percent > 90.0
    True
    """
    records, held_out = as_runs(runs, call="train(law, runs, held_out=...)"), as_runs(held_out, "held_out")
    _check(records, held_out, steps, patience)
    _checks.positive("learning_rate", learning_rate)
    bad_records = settings.pop("bad_records")
    runs, held_out = usable(records, bad_records), usable(held_out, bad_records, argument="held_out")
    settings["weighting"] = weighting_of(runs, records, settings["weighting"])
    problem = prepare(law, runs, rig=rig, **settings)
    if bad_records != "keep":
        refuse_contradicting(contradicting(problem.free.tree, problem.fitted_to))
    coordinates = Coordinates(problem.free, smooth="all")
    checked = batches(problem.free.tree, held_out, [1.0] * len(held_out), settings["samples_per_cycle"])[0]
    rule = _adam(learning_rate, steps) if optimiser is None else optimiser
    course = _course(coordinates, problem, checked, rule, steps, patience)
    fitted = np.isfinite(problem.sigma)
    trained = _model(coordinates, course.best)
    trained = with_range(trained, covered_range(problem.fitted_to, trained))
    percent, rmse, scores = score(trained, runs, fitted)
    held_percent, held_rmse, held_scores = score(trained, held_out)
    rate = f"`learning_rate` ({learning_rate:g})" if optimiser is None else "the learning rate of `optimiser`"
    unmoved = [f"No step was better on `held_out` than the start, which is the result: lower {rate}, if it is no fit."]
    return Training(
        law=law_of(trained),
        rig=rig_of(trained),
        runs=runs,
        held_out=held_out,
        fit_percent=percent,
        rmse=rmse,
        held_out_fit_percent=held_percent,
        held_out_rmse=held_rmse,
        scores=scores + held_scores,
        warnings=(*unmoved * (course.best_step == 0), *notes_on(trained, problem.fitted_to)),
        status=Status.STOPPED_EARLY if course.taken[-1] < steps else Status.ALL_STEPS,
        steps=np.array(course.taken, dtype=float),
        history=np.array(course.history),
        held_out_history=np.array(course.tested),
        best_step=course.best_step,
        stopped=course.stopped,
        scored_only=tuple(run.name for run, counts in zip(runs, fitted, strict=True) if not counts),
    )


def _check(runs: Sequence[BenchRun], held_out: Sequence[BenchRun], steps: int, patience: int) -> None:
    """Refuse an empty side, and a record that is on both, under another name too."""
    for name, some in (("runs", runs), ("held_out", held_out)):
        if not some:
            remedy = "Take for example `runs=records[:-1], held_out=records[-1]`."
            _checks.refuse(name, "hold at least one record", "empty", remedy)
    trained_on = {run.fingerprint: run.name for run in runs}
    both = [run for run in held_out if run.fingerprint in trained_on]
    if both:
        named = [f"{run.name} (the same as {trained_on[run.fingerprint]} of `runs`)" for run in both]
        remedy = "Leave them out of one of the two: a record that is trained on cannot say when to stop."
        _checks.refuse("held_out", "hold records that are not trained on", listed(named), remedy)
    _checks.counts(steps=steps, patience=patience)


class _Course(NamedTuple):
    """How a training went, with an entry every `CHUNK` steps."""

    best: Array  # coordinates with the smallest error on the records held out
    best_step: int
    taken: list[int]  # steps
    history: list[float]  # RMSE [N] over the training records
    tested: list[float]  # over those held out
    stopped: str


def _course(
    coordinates: Coordinates,
    problem: Problem,
    checked: Sequence[Batch],
    rule: Optimiser,
    steps: int,
    patience: int,
) -> _Course:
    """Descend until the steps are taken, or the error on the records held out no longer falls."""
    used = [part for part in problem.residuals if isinstance(part, Batch)]  # all of them: there are no priors
    level = float(np.sqrt(np.mean(np.concatenate([run.force for run in problem.fitted_to]) ** 2)))
    raw = jnp.asarray(coordinates.start, problem.free.values.dtype)
    state = rule.init(raw)
    best, best_step, reached = raw, 0, float(_error(coordinates, raw, checked))
    if not np.isfinite(reached):
        _checks.refuse(
            "law", "give finite forces over the records", f"{problem.law}, which does not", "Start from another."
        )
    taken, history, tested = [0], [float(_error(coordinates, raw, used))], [reached]
    stopped = f"after all {steps} steps"
    with Progress("Training") as shown:
        for done in range(CHUNK, steps + CHUNK, CHUNK):
            done = min(done, steps)
            raw, state = _descend(coordinates, raw, state, used, rule, level, jnp.asarray(done - taken[-1]))
            taken.append(done)
            history.append(float(_error(coordinates, raw, used)))
            tested.append(float(_error(coordinates, raw, checked)))
            shown(f"step {done} of {steps}, RMSE {history[-1]:.4g} N, held out {tested[-1]:.4g} N")
            if tested[-1] < reached:
                best, best_step, reached = raw, done, tested[-1]
            if not np.isfinite(history[-1]):
                stopped = f"stopped at step {done}, where the error was no longer finite: take a smaller learning rate"
                break
            if done - best_step >= patience:
                stopped = f"stopped at step {done}, {patience} steps after the held-out error last fell"
                break
    return _Course(best, best_step, taken, history, tested, stopped)


@functools.lru_cache
def _adam(learning_rate: float, steps: int) -> Optimiser:
    """Adam with clipped gradients; one object for each choice, so that the compiled step is reused."""
    import optax

    schedule = optax.cosine_decay_schedule(learning_rate, steps, alpha=0.01)
    return optax.chain(optax.clip_by_global_norm(1.0), optax.adam(schedule))


def _model(coordinates: Coordinates, raw: Array) -> Model:
    """The law at these coordinates, on its machine."""
    return coordinates.free.build(coordinates.to_physical(raw))


def _mean_square(coordinates: Coordinates, raw: Array, residuals: Sequence[Batch]) -> Array:
    """Mean squared error [N²] of the law over the samples that count, each as often as it was measured."""
    model = _model(coordinates, raw)
    squares = jnp.stack([jnp.sum(jnp.square(part(model))) for part in residuals])
    return jnp.sum(squares) / jnp.sum(jnp.stack([jnp.sum(jnp.square(part.weight)) for part in residuals]))


@eqx.filter_jit
def _error(coordinates: Coordinates, raw: Array, residuals: Sequence[Batch]) -> Array:
    return jnp.sqrt(_mean_square(coordinates, raw, residuals))


@eqx.filter_jit
def _descend(
    coordinates: Coordinates,
    raw: Array,
    state: PyTree,
    residuals: Sequence[Batch],
    rule: Optimiser,
    level: float,
    count: Array,
) -> tuple[Array, PyTree]:
    """So many steps of the optimiser on the mean square relative to the level of the force."""

    def step(_: Array, now: tuple[Array, PyTree]) -> tuple[Array, PyTree]:
        raw, state = now
        slope = jax.grad(lambda raw: _mean_square(coordinates, raw, residuals) / level**2)(raw)
        with jax.numpy_dtype_promotion("standard"):  # optax mixes its integer count with floats
            change, state = rule.update(slope, state, raw)
        return raw + change, state

    return jax.lax.fori_loop(0, count, step, (raw, state))
