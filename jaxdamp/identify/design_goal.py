"""What a design of an experiment minimises, and the search for the runs that do."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.identify.model import law_of
from jaxdamp.parameters import FreeParameters, match_paths


VAGUE = 1e3  # standard deviation of a parameter without a prior, relative to its value
ROUNDS = 20  # of exchanges at most
WORTH = 1e-9  # relative decrease of a criterion that counts as one


@dataclasses.dataclass(frozen=True)
class Goal:
    """What is minimised, in parameters relative to their values."""

    criterion: str
    scale: Float[np.ndarray, " free"]
    before: Float[np.ndarray, "free free"]  # information of the prior
    slopes: Float[np.ndarray, " free"]  # of the function

    @classmethod
    def of(
        cls,
        free: FreeParameters,
        criterion: str,
        function: Callable[[Any], Any] | None,
        prior: Mapping[str, float] | None,
    ) -> "Goal":
        """The goal of a criterion, with what is known of the parameters before."""
        values = np.abs(np.asarray(free.values, float))
        scale = np.where(values > 0, values, 1.0)
        spread = VAGUE * scale
        paths = [p.path for p in free.owners]
        for name, deviation in (prior or {}).items():
            _checks.positive(f"prior[{name!r}]", deviation)
            spread[np.isin(paths, match_paths(list(dict.fromkeys(paths)), [name]))] = deviation
        slopes = np.zeros(values.size)
        if function is not None:
            slopes = np.asarray(jax.grad(lambda v: jnp.asarray(function(law_of(free.build(v))), float))(free.values))
            if not np.any(slopes):
                _checks.refuse("function", "depend on a free parameter", "one that does not")
        return cls(criterion, scale, np.diag((scale / spread) ** 2), slopes * scale)

    def value(self, matrices: Float[np.ndarray, "*sets free free"]) -> Float[np.ndarray, "*sets"]:
        """The criterion of sums of information, less is better."""
        total = self.before + matrices * np.outer(self.scale, self.scale)
        if self.criterion == "D":
            return np.asarray(-np.linalg.slogdet(total)[1])
        inverse = np.linalg.inv(total)
        if self.criterion == "A":
            return np.asarray(np.trace(inverse, axis1=-2, axis2=-1))
        return np.asarray(np.einsum("i,...ij,j->...", self.slopes, inverse, self.slopes))

    def covariance(self, total: Float[np.ndarray, "free free"]) -> Float[np.ndarray, "free free"]:
        """Of the parameters, in their units."""
        return np.linalg.inv(self.before + total * np.outer(self.scale, self.scale)) * np.outer(self.scale, self.scale)

    def function_error(self, covariance: Float[np.ndarray, "free free"]) -> float | None:
        """Standard error of the function; `None` without one."""
        slopes = self.slopes / self.scale
        return float(np.sqrt(slopes @ covariance @ slopes)) if self.criterion == "c" else None

    def added(self, chosen: Sequence[int], count: int, matrices: np.ndarray) -> list[int]:
        """So many candidates more, each the best beside those before."""
        chosen, total = list(chosen), matrices[list(chosen)].sum(axis=0)
        for _ in range(count):
            best = int(np.argmin(self.value(total + matrices)))
            chosen, total = [*chosen, best], total + matrices[best]
        return chosen

    def exchanged(self, chosen: Sequence[int], matrices: np.ndarray) -> list[int]:
        """Every run replaced by the best candidate, until none is better."""
        chosen = list(chosen)
        now = float(self.value(matrices[chosen].sum(axis=0)))
        for _ in range(ROUNDS):
            before = now
            for place in range(len(chosen)):
                others = matrices[chosen[:place] + chosen[place + 1 :]].sum(axis=0)
                values = self.value(others + matrices)
                best = int(np.argmin(values))
                if values[best] < now - WORTH * abs(now):
                    chosen[place], now = best, float(values[best])
            if now == before:
                break
        return chosen

    def ordered(self, chosen: Sequence[int], matrices: np.ndarray) -> list[int]:
        """The same runs, each the best beside those before."""
        left, order = list(chosen), []
        while left:
            total = matrices[order].sum(axis=0)
            best = left[int(np.argmin(self.value(total + matrices[left])))]
            left.remove(best)
            order.append(best)
        return order
