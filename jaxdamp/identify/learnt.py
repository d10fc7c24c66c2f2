"""A start that is trained: hysteresis learnt by a network, beside one coefficient and a spring."""

import dataclasses
from collections.abc import Sequence
from typing import Any, final

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, Linear, NeuralHysteresis, Spring
from jaxdamp.identify.starting import AbstractTrainedStart
from jaxdamp.identify.training import Training, train


WEIGHTS = ("hidden_weights", "hidden_biases", "output_weights", "output_biases")
KEYS = 3
STEPS, PATIENCE, LEARNING_RATE = 300, 100, 0.05  # of the training
SAMPLES_PER_CYCLE = 100
FEWEST = 2  # records: one to stop by, the others to train on


@final
@dataclasses.dataclass(frozen=True)
class LearntStart(AbstractTrainedStart):
    """`Linear + NeuralHysteresis + Spring`, trained on the records that a fit gives it, as a start for this fit.

    The record of middle peak velocity decides, as a whole, when to stop the training and which key of the random
    weights is best; the law is trained on all others. A fit that starts from here changes only the coefficient, the
    stiffnesses and the spring; the weights stay, since a fit to all records would undo the early stopping. The same
    records and keys give the same law. `cross_validate` trains without the record that it holds out.

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

    def trainings(self, runs: Sequence[BenchRun]) -> list[Training]:
        """The training from each key.

        Raises:
            ValueError: fewer than two records.
        """
        if len(runs) < FEWEST:
            must = "hold two records or more, as one of them decides when the training stops"
            _checks.refuse("runs", must, f"{len(runs)}", "Take a law with few parameters.")
        stop = sorted(range(len(runs)), key=lambda i: runs[i].peak_velocity)[len(runs) // 2]
        rest = [run for i, run in enumerate(runs) if i != stop]
        how: dict[str, Any] = {"steps": STEPS, "patience": PATIENCE, "learning_rate": LEARNING_RATE}
        how |= {"weighting": "runs", "samples_per_cycle": SAMPLES_PER_CYCLE} | self.options
        return [train(self.untrained(rest, key), rest, held_out=runs[stop], **how) for key in range(self.keys)]

    def untrained(self, runs: Sequence[BenchRun], key: int = 0) -> AbstractDamper:
        """A third of the damping in one coefficient, random weights, and the spring of the records."""
        velocity, force, stroke = (
            np.concatenate([getattr(run, channel) for run in runs]) for channel in ("velocity", "force", "stroke")
        )
        speed, level = (float(np.sqrt(np.mean(values**2))) for values in (velocity, force))
        network = NeuralHysteresis.random(jax.random.key(key), velocity_scale=speed, force_scale=level)
        rate = float(np.asarray(Linear.guess(velocity, force).rate)) / 3.0
        return Linear(rate) + network + Spring.guess(velocity, force, stroke)
