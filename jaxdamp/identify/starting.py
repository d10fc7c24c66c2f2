"""Starts of a fit: a law, a class of laws, or a function that makes a law from records."""

import dataclasses
import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, final

import equinox as eqx
import jax
import numpy as np

from jaxdamp import _checks, dampers
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, Linear, NeuralHysteresis, Spring, from_samples, without_fitted_ranges


if TYPE_CHECKING:
    from jaxdamp.identify.training import Training


WEIGHTS = ("hidden_weights", "hidden_biases", "output_weights", "output_biases")
KEYS = 3
STEPS, PATIENCE, LEARNING_RATE = 300, 100, 0.05  # of the training
SAMPLES_PER_CYCLE = 100
TRAINED_ON = 0.7  # of a single record, whose rest decides when the training stops

Start = AbstractDamper | type[AbstractDamper] | Callable[..., AbstractDamper]


@final
@dataclasses.dataclass(frozen=True)
class LearntStart:
    """`Linear + NeuralHysteresis + Spring`, trained on the records that a fit gives it, as a start for this fit.

    The record of middle peak velocity decides, as a whole, when to stop the training and which key of the random
    weights is best; the law is trained on all others. Of a single record the last 30 % of its time decide. A fit that
    starts from here changes only the coefficient, the stiffnesses and the spring; the weights stay, since a fit to all
    records would undo the early stopping. The same records and keys give the same law. `cross_validate` trains without
    the record that it holds out.

    Arguments:
        keys: number of random starts, keys 0, 1, ....
        options: passed on to `train`.

    >>> LearntStart(keys=2).freeze[0]
    'hidden_weights'
    """

    keys: int = KEYS
    options: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def freeze(self) -> tuple[str, ...]:
        """The parameters that a fit holds at the values of the training."""
        return WEIGHTS

    def __call__(self, runs: Sequence[BenchRun]) -> AbstractDamper:
        """The law of the key with the smallest error on the record to stop by."""
        return min(self.trainings(runs), key=lambda training: training.held_out_rmse).law

    def trainings(self, runs: Sequence[BenchRun]) -> "list[Training]":
        """The training from each key."""
        from jaxdamp.identify.training import train  # which starts from here

        runs = list({run.fingerprint: run for run in runs}.values())  # a copy would be no record to stop by
        if len(runs) == 1:
            time = runs[0].time
            middle = float(time[round(TRAINED_ON * len(time))])
            runs = [runs[0].between(float(time[0]), middle), runs[0].between(middle, np.inf)]
            stop = 1
        else:
            stop = sorted(range(len(runs)), key=lambda i: runs[i].peak_velocity)[len(runs) // 2]
        trained_on = [run for i, run in enumerate(runs) if i != stop]
        how: dict[str, Any] = {"steps": STEPS, "patience": PATIENCE, "learning_rate": LEARNING_RATE}
        how |= {"weighting": "runs", "samples_per_cycle": SAMPLES_PER_CYCLE, "bad_records": "keep"} | self.options
        return [
            train(self.untrained(trained_on, key), trained_on, held_out=runs[stop], **how) for key in range(self.keys)
        ]

    def untrained(self, runs: Sequence[BenchRun], key: int = 0) -> AbstractDamper:
        """A third of the damping in one coefficient, random weights, and the spring of the records."""
        velocity, force, stroke = (
            np.concatenate([getattr(run, channel) for run in runs]) for channel in ("velocity", "force", "stroke")
        )
        speed, level = (float(np.sqrt(np.mean(values**2))) for values in (velocity, force))
        network = NeuralHysteresis.random(jax.random.key(key), velocity_scale=speed, force_scale=level)
        rate = float(np.asarray(Linear.guess(velocity, force).rate)) / 3.0
        return Linear(rate) + network + Spring.guess(velocity, force, stroke)


def started(law: Start, runs: Sequence[BenchRun]) -> AbstractDamper:
    """An instance to start from, without the ranges of earlier fits.

    A class starts by its `from_runs`. A function with an argument `runs` gets the records; any other function gets the
    samples of all records one after the other: velocity, force, and `stroke` and `time` if it has such arguments.
    """
    check_start("law", law)
    if isinstance(law, AbstractDamper):
        return without_fitted_ranges(law)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", np.exceptions.RankWarning)
        if isinstance(law, type):
            return without_fitted_ranges(law.from_runs(tuple(runs)))
        takes_runs = "runs" in inspect.signature(law).parameters
        return without_fitted_ranges(law(tuple(runs)) if takes_runs else from_samples(law, runs))


def frozen_by(law: Start) -> tuple[str, ...]:
    """The parameters that a start asks a fit to hold."""
    return law.freeze if isinstance(law, LearntStart) else ()


def check_start(argument: str, law: object) -> None:
    """Refuse anything that is not a start of a fit."""
    if isinstance(law, AbstractDamper) or (isinstance(law, type) and issubclass(law, AbstractDamper)):
        return
    if isinstance(law, str):
        laws = [name for name in dampers.__all__ if isinstance(getattr(dampers, name), type(AbstractDamper))]
        similar = next((name for name in laws if name.lower() == law.lower().replace("_", "")), None)
        remedy = f"Write `dampers.{similar}`." if similar else f"Write `default_ladder(runs, [{law!r}])[{law!r}]`."
    elif callable(law) and not isinstance(law, type | BenchRun | eqx.Module):
        return
    else:
        remedy = (
            "The calls are `fit(law, runs)` and `compare(laws, runs)`, with `dampers.Besinger` for instance as law."
        )
    must = "be a law, a class of laws, or a function that makes a law of velocities and forces"
    _checks.refuse(argument, must, _checks.described(law), remedy)


def check_starts(laws: Any, call: str) -> None:
    """Refuse anything that is not laws by name."""
    example = "{'linear': dampers.Linear, 'besinger': dampers.Besinger}"
    if not isinstance(laws, Mapping):
        names = isinstance(laws, list | tuple) and all(isinstance(name, str) for name in laws)
        ladder = f"`default_ladder(runs, {list(laws)})`" if names and laws else "`default_ladder(runs)`"
        remedy = f"The call is `{call}`; write {ladder} or {example}."
        _checks.refuse("laws", "be laws by name", _checks.described(laws), remedy)
    if not laws:
        _checks.refuse("laws", "hold at least one law", "empty", f"Take `default_ladder(runs)` or {example}.")
    for name, law in laws.items():
        check_start(f"laws[{name!r}]", law)
