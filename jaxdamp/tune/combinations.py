"""Combinations of choices that a tuning has driven: the best of them, and the next best beside it."""

import dataclasses
from collections.abc import Mapping
from typing import final

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._tables import Column, Contents, Table, percentage, plain, typeset_unit
from jaxdamp.tune.limits import amount
from jaxdamp.tune.rescoring import Rescore
from jaxdamp.tune.verdict import relative_change


@final
@dataclasses.dataclass(frozen=True)
class Combinations:
    """All combinations of choices, the best first: those within the limits, then those least beyond them."""

    choices: dict[str, Float[np.ndarray, " combinations"]]  # the values of each number, in its unit, by its name
    metrics: dict[str, Float[np.ndarray, " combinations"]]  # of each combination, by name
    met: Bool[np.ndarray, " combinations"]  # which combinations meet all limits
    units: Mapping[str, str]  # of numbers and metrics
    impossible: int = 0  # number of further combinations, which the vehicle cannot have: the law refuses them
    beside_next: str = ""  # by how much the best differs from the next best, in words; empty where there is none

    @property
    def sentence(self) -> str:
        """The best combination, of how many, and how it stands beside the next."""
        count, met = len(self.met), int(np.count_nonzero(self.met))
        missing = int(np.count_nonzero(self._without_number))
        within = [f"{met} within the limits"] * (met < count - missing)
        within += [f"{missing} without a number"] * (missing > 0)
        without = f" ({self.impossible} more are impossible)" * bool(self.impossible)
        first = f"{self.at(0)} is the best of {count} combination{'s' * (count > 1)}{without}"
        first += f", of which {' and '.join(within)}" * bool(within)
        none = f"{self.at(0)} is the nearest to the limits of {count}"
        return ", ".join(filter(None, (first if met else none, self.beside_next)))

    @property
    def _without_number(self) -> Bool[np.ndarray, " combinations"]:
        return np.any(np.isnan(np.stack([*self.metrics.values()])), axis=0)

    def at(self, place: int) -> str:
        """One combination in words, the best being the first."""
        numbers = ((name, amount(values[place], self.units[name], digits=6)) for name, values in self.choices.items())
        return ", ".join(f"{name} = {number}" for name, number in numbers)

    def table(self) -> Table:
        """A row for each combination: its numbers, its metrics, and whether it meets the limits."""
        columns = [Column(name, typeset_unit(self.units[name])) for name in (*self.choices, *self.metrics)]
        words = np.where(self.met, "met", np.where(self._without_number, "no number", "not met"))
        rows = zip(*self.choices.values(), *self.metrics.values(), words.tolist(), strict=True)
        return Table("All combinations", (*columns, Column("limits")), tuple(rows))

    def to_dict(self) -> Contents:
        """The rows as plain data, ready for JSON."""
        return {"sentence": self.sentence, "rows": plain(self.table().records())}


def beside_next(combinations: Combinations, metric: str, fresh: Rescore | None) -> str:
    """By how much the best combination differs from the next best in the minimised metric, in words."""
    if fresh is None:
        values = combinations.metrics[metric]
        change = relative_change(values[1], values[0])
        words = "" if change is None else percentage(change)
    else:
        half, mean = 100.0 * fresh.half_width(metric), 100.0 * float(np.mean(fresh.change(metric)))
        unsure = "" if mean < -half else ", so that roads do not tell them apart"
        words = f"{percentage(mean, half)} on {fresh.roads} fresh roads{unsure}"
    return f"beside the next, {combinations.at(1)}: {words}"
