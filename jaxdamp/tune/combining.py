"""Every combination of choices, driven: the best of them, and the next best beside it."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp.parameters import checked
from jaxdamp.tune.combinations import Combinations
from jaxdamp.tune.descending import Ended, missed
from jaxdamp.tune.limits import Limit
from jaxdamp.tune.measuring import LANES
from jaxdamp.tune.ranges import MOST_COMBINATIONS
from jaxdamp.tune.scenario_ride import smooth_in_scenarios
from jaxdamp.tune.task import DesignTask, Evaluator
from jaxdamp.vehicles import AbstractVehicle


@final
class Driven:
    """All combinations of the choices of a tuning, in place of a descent: a search that ends at each of them."""

    def __init__(
        self, evaluator: Evaluator, points: np.ndarray, impossible: int, progress: Callable[[int, float], None]
    ) -> None:
        self.task, self.ends, self._impossible, least = evaluator.task, list[Ended](), impossible, math.inf
        for part in np.array_split(points, math.ceil(len(points) / LANES)):
            evaluations = evaluator.at(part / self.task.space.unit)
            least = min(least, *(float(one.rows[0]) for one in evaluations))
            pairs = zip(part, evaluations, strict=True)
            self.ends += [Ended(point, one, (), out_of_steps=False, slope_left=lambda: 0.0) for point, one in pairs]
            progress(len(self.ends), least)

    def search(self, starts: object, evaluations: object, limits: Sequence[Limit]) -> list[Ended]:
        """The end of a search, wherever it would start: the best combination."""
        return [min(self.ends, key=lambda one: rank(self.task, one, limits))]

    def choose(self, ended: Ended, limits: object) -> list[Ended]:
        """That combination: there is none beside it to be tried."""
        return [ended]

    def combinations(self, limits: Sequence[Limit]) -> Combinations:
        """All of them for the result, with the minimised and the limited metrics."""
        task, ranks = self.task, [rank(self.task, one, limits) for one in self.ends]
        order = sorted(range(len(ranks)), key=lambda i: ranks[i])
        ends = [self.ends[i] for i in order]
        each = [printed_numbers(task, one) for one in ends]
        names = dict.fromkeys([task.objective.name, *task.allowed])
        owners = zip(task.space.free.names, task.space.free.owners, strict=True)
        return Combinations(
            dict(zip(task.space.free.names, np.transpose([one.values for one in ends]), strict=True)),
            {name: np.array([numbers[name] for numbers in each]) for name in names},
            np.array([ranks[i][0] == 0.0 for i in order]),
            {name: task.units[name] for name in names} | {name: p.unit for name, p in owners},
            self._impossible,
        )


def every_combination(evaluator: Evaluator, progress: Callable[[int, float], None]) -> Driven | None:
    """All combinations that the vehicle can have, driven, if choices are all that is free and not too many."""
    space = evaluator.task.space
    choices = [choice.values for choice in space.choices if choice is not None]
    if len(choices) < len(space.choices) or math.prod(map(len, choices)) > MOST_COMBINATIONS:
        return None
    every = list(itertools.product(*choices))
    points = np.array([point for point in every if _is_allowed(evaluator.task, point)])
    if not len(points):
        names = ", ".join(space.free.names)
        _checks.refuse("over", f"have a combination of {names} that the vehicle can have", f"none of {choices}")
    return Driven(evaluator, points, len(every) - len(points), progress)


def _is_allowed(task: DesignTask[AbstractVehicle], point: Sequence[float]) -> bool:
    """Whether a vehicle can have these numbers."""
    try:
        checked(task.space.free.build(jnp.asarray(point, task.space.free.values.dtype)))
    except ValueError:
        return False
    return True


def printed_numbers(task: DesignTask[AbstractVehicle], ended: Ended) -> dict[str, float]:
    """The numbers at the end of a search: of scenarios by the true risk, where the search has a smooth one."""
    numbers = task.numbers(ended.evaluation.values)
    if not smooth_in_scenarios(task.measured.ride):
        return numbers
    vehicle = task.space.free.build(jnp.asarray(ended.values, task.space.free.values.dtype))
    return numbers | task.measured.reported(task.measured.each(vehicle))


def rank(task: DesignTask[AbstractVehicle], ended: Ended, limits: Sequence[Limit]) -> tuple[float, float]:
    """By how much limits are violated at the end of a search, and the metric there; infinite if it has none."""
    numbers = printed_numbers(task, ended)
    beyond = [max(-limit.margin(numbers[limit.name]), 0.0) for limit in missed(limits, numbers, task.tolerance)]
    pair = float(sum(beyond)), numbers[task.objective.name]
    return (math.inf, math.inf) if any(map(math.isnan, pair)) else pair
