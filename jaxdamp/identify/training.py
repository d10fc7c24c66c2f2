"""`train`: gradient descent for laws with many weights, stopped when records left out get no better."""

import dataclasses
import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._status import Status
from jaxdamp.bench import BenchRun, as_runs
from jaxdamp.dampers import AbstractDamper, with_fitted_range
from jaxdamp.identify.covered import covered_range
from jaxdamp.identify.judging import notes_on
from jaxdamp.identify.preparing import prepare
from jaxdamp.identify.problem import AbstractResiduals
from jaxdamp.identify.result import AbstractFitted, score
from jaxdamp.identify.starting import Start
from jaxdamp.identify.traces import batches
from jaxdamp.parameters import Coordinates


if TYPE_CHECKING:
    from matplotlib.figure import Figure


CHUNK = 25  # steps in one compiled call, after each of which the records left out are looked at


@dataclasses.dataclass(frozen=True, repr=False)
class Training(AbstractFitted):
    """A law trained by gradient descent, from the step where its error on the held-out records was smallest.

    Attributes:
        held_out: the records that decided when to stop.
        held_out_fit_percent: over the held-out records together.
        held_out_rmse: over the held-out records together [N].
        steps: after how many steps each entry of the histories was taken.
        history: RMSE [N] over the training records as trained on (averaged samples), for each entry.
        held_out_history: the same over the held-out records.
        best_step: the step that the law comes from.
        stopped: why the training ended, in words.
    """

    held_out: tuple[BenchRun, ...]
    held_out_fit_percent: float
    held_out_rmse: float
    steps: Float[np.ndarray, " entries"]
    history: Float[np.ndarray, " entries"]
    held_out_history: Float[np.ndarray, " entries"]
    best_step: int
    stopped: str

    def plot(self, **options: Any) -> "Figure":
        """The errors over the steps of the training."""
        from jaxdamp.plots import training_history

        return training_history(self, **options)

    def __repr__(self) -> str:
        return (
            f"{type(self.law).__name__} trained on {len(self.runs)} records: {self.fit_percent:.1f} %, RMSE "
            f"{self.rmse:.4g} N; on {len(self.held_out)} held out: {self.held_out_fit_percent:.1f} %, RMSE "
            f"{self.held_out_rmse:.4g} N; best at step {self.best_step}, {self.stopped}"
        )


def train(
    law: Start,
    runs: BenchRun | Iterable[BenchRun],
    *,
    held_out: BenchRun | Iterable[BenchRun],
    weighting: str | Sequence[float] = "samples",
    freeze: Sequence[str] = (),
    tie: Mapping[str, str] | None = None,
    steps: int = 2000,
    patience: int = 400,
    learning_rate: float = 0.02,
    optimiser: optax.GradientTransformation | None = None,
    samples_per_cycle: int = 200,
) -> Training:
    """Train a law with many weights, such as `Hybrid`, by gradient descent with early stopping.

    Minimises the mean squared error of the force over all samples of `runs` with the whole gradient in every step
    (reverse mode through the law and its states). Every 25 steps the error on `held_out` is looked at; the law
    returned is the one for which it was smallest. Nothing is random here: the same law, whose weights a key has drawn,
    and the same records give the same result. Parameters stay in their domains by their smooth maps.

    A handful of parameters with a meaning are better served by `fit`, which also knows their errors.

    Arguments:
        law: a start, or as in `fit` a law class or a function that makes one from `runs`.
        runs: records to train on. A few steady cycles of each are enough: `run.last_cycles(3)`.
        held_out: records that decide when to stop; they are not trained on. Judge the law on records that are in
            neither of the two.
        weighting: of `runs`, as in `fit`.
        freeze: parameters to leave alone, by path, last part of a path, or pattern.
        tie: parameters that take the values of others, as in `fit`.
        steps: at most so many.
        patience: stop when the held-out error has not fallen for so many steps.
        learning_rate: of Adam, at the start; it falls to a hundredth along a cosine over `steps`.
        optimiser: any optax optimiser instead.
        samples_per_cycle: slow records are averaged down to it.

    Raises:
        ValueError: no records on either side, a record on both; a law without finite forces; names that fit no
            parameter.

    >>> from jaxdamp import bench, dampers
    >>> dyno = bench.VirtualDyno(dampers.Lag(dampers.Linear(2000.0), 0.004), force_noise=5.0)
    >>> runs = dyno.run([bench.SineTest(0.01, f) for f in (2.0, 4.0)])
    >>> start = dampers.Lag(dampers.Linear(1500.0), 0.002)
    >>> trained = train(start, runs[0], held_out=runs[1], steps=200)
    >>> trained.held_out_fit_percent > 90.0
    True
    """
    runs, held_out = as_runs(runs, call="train(law, runs, held_out=...)"), as_runs(held_out, "held_out")
    _check(runs, held_out, steps, patience)
    _checks.positive("learning_rate", learning_rate)
    problem = prepare(law, runs, freeze=freeze, tie=tie, weighting=weighting, samples_per_cycle=samples_per_cycle)
    coordinates, used, law = Coordinates(problem.free, smooth="all"), problem.residuals, problem.law
    checked = batches(law, held_out, [1.0] * len(held_out), samples_per_cycle)[0]
    level = float(np.sqrt(np.mean(np.concatenate([run.force for run in problem.fitted_to]) ** 2)))
    rule = _adam(learning_rate, steps) if optimiser is None else optimiser

    raw = jnp.asarray(coordinates.start, problem.free.values.dtype)
    state = rule.init(raw)
    best, best_step, reached = raw, 0, float(_error(coordinates, raw, checked))
    if not np.isfinite(reached):
        _checks.refuse("law", "give finite forces over the records", f"{law}, which does not", "Start from another.")
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

    trained = with_fitted_range(_law(coordinates, best), covered_range(problem.fitted_to))
    percent, rmse, scores = score(trained, runs, np.isfinite(problem.sigma))
    held_percent, held_rmse, held_scores = score(trained, held_out)
    return Training(
        law=trained,
        runs=runs,
        held_out=held_out,
        fit_percent=percent,
        rmse=rmse,
        held_out_fit_percent=held_percent,
        held_out_rmse=held_rmse,
        scores=scores + held_scores,
        warnings=tuple(notes_on(trained, problem.fitted_to)),
        status=Status.STOPPED_EARLY if taken[-1] < steps else Status.ALL_STEPS,
        steps=np.array(taken, dtype=float),
        history=np.array(history),
        held_out_history=np.array(tested),
        best_step=best_step,
        stopped=stopped,
    )


def _check(runs: Sequence[BenchRun], held_out: Sequence[BenchRun], steps: int, patience: int) -> None:
    for name, some in (("runs", runs), ("held_out", held_out)):
        if not some:
            remedy = "Take for example `runs=records[:-1], held_out=records[-1]`."
            _checks.refuse(name, "hold at least one record", "empty", remedy)
    both = [run.name for run in held_out if any(run is other for other in runs)]
    if both:
        _checks.refuse("held_out", "hold records that are not trained on", ", ".join(both))
    for name, count in (("steps", steps), ("patience", patience)):
        if count < 1:
            _checks.refuse(name, "be 1 or more", count)


@functools.lru_cache
def _adam(learning_rate: float, steps: int) -> optax.GradientTransformation:
    """Adam with clipped gradients; one object for each choice, so that the compiled step is found again."""
    schedule = optax.cosine_decay_schedule(learning_rate, steps, alpha=0.01)
    return optax.chain(optax.clip_by_global_norm(1.0), optax.adam(schedule))


def _law(coordinates: Coordinates, raw: Array) -> AbstractDamper:
    """The law at these coordinates."""
    return coordinates.free.build(coordinates.to_physical(raw))


def _mean_square(coordinates: Coordinates, raw: Array, made: Sequence[AbstractResiduals]) -> Array:
    """Mean squared error [N²] of the law over the samples that count, each as often as it was measured."""
    law = _law(coordinates, raw)
    squares = jnp.stack([jnp.sum(jnp.square(part(law))) for part in made])
    return jnp.sum(squares) / jnp.sum(jnp.stack([part.total_weight() for part in made]))


@eqx.filter_jit
def _error(coordinates: Coordinates, raw: Array, made: Sequence[AbstractResiduals]) -> Array:
    return jnp.sqrt(_mean_square(coordinates, raw, made))


@eqx.filter_jit
def _descend(
    coordinates: Coordinates,
    raw: Array,
    state: Any,
    made: Sequence[AbstractResiduals],
    rule: optax.GradientTransformation,
    level: float,
    count: Array,
) -> tuple[Array, Any]:
    """So many steps of the optimiser on the mean square relative to the level of the force."""

    def step(_: Any, now: tuple[Array, Any]) -> tuple[Array, Any]:
        raw, state = now
        slope = jax.grad(lambda raw: _mean_square(coordinates, raw, made) / level**2)(raw)
        with jax.numpy_dtype_promotion("standard"):  # optax mixes its integer count with floats
            change, state = rule.update(slope, state, raw)
        return optax.apply_updates(raw, change), state  # type: ignore[return-value]

    return jax.lax.fori_loop(0, count, step, (raw, state))
