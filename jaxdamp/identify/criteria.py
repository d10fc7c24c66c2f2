"""Criteria beside plain least squares: losses that spikes hardly move, and prior knowledge of parameters.

A robust loss is minimised by repeated least squares, in which samples far from the model get less weight. A prior is
one more residual, (value − mean)/standard deviation, in units of the noise, which is estimated between the rounds.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxdamp import _checks
from jaxdamp.identify.losses import LOSSES, robust_of, unit_of
from jaxdamp.identify.noise import Noise
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.residuals import AbstractResiduals
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.several import PROMISING, Solution, distinct_ends
from jaxdamp.parameters import FreeParameters, get, match_paths, matching, parameters


ROUNDS = 20  # of least squares with new weights, at most
SETTLED = 0.01  # standard errors that a last round moves
CONTRADICTED = 5.0  # standard deviations from a prior that it does not allow
NEXT_TO_NOTHING = 1e-6  # of the noise
QUIETER = 0.8  # noise of a fit without priors, relative to that with them, below which these are wrong
FIRST_NOISE = 0.01  # of the RMS force, before a fit says more
HALF = 0.5  # weight below which a sample is counted as left out


@final
class Priors(AbstractResiduals):
    """Prior knowledge of parameters as residuals."""

    paths: tuple[str, ...] = eqx.field(static=True)
    mean: Float[Array, " priors *numbers"]
    deviation: Float[Array, " priors *numbers"]
    size: int = eqx.field(static=True)  # numbers of all parameters together
    noise: Float[Array, ""]  # standard deviation of the noise of a weighted sample
    weak: bool = eqx.field(static=True, default=False)  # whether they only determine what the records do not

    def __call__(self, model: PyTree) -> Float[Array, " samples"]:
        """Distance of the values from their means, in standard deviations, times that of the noise."""
        values = zip(self.paths, self.mean, self.deviation, strict=True)
        return self.noise * jnp.concatenate([jnp.ravel((get(model, path) - m) / d) for path, m, d in values])

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "Priors":
        """The same: no weight of samples changes what is known beforehand."""
        del factor
        return self

    @property
    def relative(self) -> bool:
        """Whether they count beside what the records show."""
        return not self.weak

    def at_noise(self, noise: float) -> "Priors":
        """The same beside samples with noise of this standard deviation."""
        return eqx.tree_at(lambda p: p.noise, self, jnp.asarray(noise))

    def used(self) -> Bool[np.ndarray, " samples"]:
        """They are no samples of the records."""
        return np.zeros(self.size, bool)

    def linear_rows(self, free: FreeParameters) -> Float[np.ndarray, "rows columns"]:
        """Weights and means of the numbers."""
        columns = dict(zip((p.path for p in free.chosen), free.split(np.arange(free.values.size)), strict=True))
        taken = [np.ravel(columns[path]) for path in self.paths]
        weights = float(self.noise) / np.asarray(self.deviation)
        mean, weight = (
            np.concatenate([np.broadcast_to(np.ravel(a), at.size) for a, at in zip(each, taken, strict=True)])
            for each in (np.asarray(self.mean), weights)
        )
        rows = np.zeros((self.size, free.values.size + 1))
        rows[np.arange(self.size), np.concatenate(taken)], rows[:, -1] = weight, -weight * mean
        return rows


def priors_on(free: FreeParameters, priors: Mapping[str, tuple[float, float]]) -> tuple[Priors, ...]:
    """The residuals of stated priors `{name: (mean, standard deviation)}`, for weighted samples with the noise 1."""
    chosen: dict[str, tuple[float, float]] = {}
    named: dict[str, str] = {}
    paths = [p.path for p in free.chosen]
    for name, pair in priors.items():
        numbers = np.asarray(pair)
        plain = numbers.shape == (2,) and numbers.dtype.kind in "iuf" and np.all(np.isfinite(numbers))
        if not plain or not numbers[1] > 0:
            must = "be a mean and a positive standard deviation"
            _checks.refuse(f"priors[{name!r}]", must, pair, "Write {'rebound_rate': (2500.0, 200.0)}.")
        if not matching(paths, name):
            _refuse_held(free, name)
        for path in match_paths(paths, [name]):
            if path in named:
                both, remedy = f"two, of {named[path]!r} and {name!r}", "Write names in place of patterns that overlap."
                _checks.refuse("priors", f"give {path} one prior", both, remedy)
            named[path], chosen[path] = name, (float(pair[0]), float(pair[1]))
    if not chosen:
        return ()
    mean, deviation = (jnp.asarray(np.array(side)) for side in zip(*chosen.values(), strict=True))
    size = sum(p.value.size for p in free.chosen if p.path in chosen)
    return (Priors(tuple(chosen), mean, deviation, size, jnp.asarray(1.0)),)


def _refuse_held(free: FreeParameters, name: str) -> None:
    """Refuse the prior of a parameter that is tied or frozen; one that does not exist is refused with other names."""
    argument, must, leaders = f"priors[{name!r}]", "be of a parameter that is free", dict(free.ties)
    for path in matching(list(leaders), name):
        remedy = f"Give the prior of {leaders[path]!r}."
        _checks.refuse(argument, must, f"of {path}, which is tied to {leaders[path]}", remedy)
    paths = list(free.tree) if isinstance(free.tree, dict) else [p.path for p in parameters(free.tree, commands=True)]
    for path in matching(paths, name):
        remedy = "Leave its prior out, or free it by `freeze`, `over` or `rig`."
        _checks.refuse(argument, must, f"of {path}, which is frozen", remedy)


class Round(NamedTuple):
    """A round of least squares with weights by a loss."""

    problem: Problem  # with these weights
    root: Float[np.ndarray, " samples"] | float = 1.0  # of the weight of each sample

    def after(
        self,
        plain: Problem,
        residual: Float[np.ndarray, " samples"],
        noise: float,
        loss: str,
        spread: float | None = None,
    ) -> "Round | None":
        """The next round; None where nothing is missed.

        Arguments:
            plain: the problem without weights by the loss.
            residual: weighted, at the end of this round.
            noise: standard deviation of the noise of a weighted sample, for priors.
            loss: of `LOSSES`.
            spread: robust standard deviation of the residual without these weights, if it is known.
        """
        missed, used = residual / self.root, plain.used
        unit = unit_of(missed, plain, loss, spread)
        if not np.all(unit > 0):
            return None
        relative = missed / unit
        weight = np.where(used, LOSSES[loss].weight(relative), 1.0)
        problem = (
            plain.reweighted(np.sqrt(weight))
            .at_noise(noise)
            ._replace(
                robust=None if loss == "squares" else robust_of(LOSSES[loss], relative, used, plain.owner),
                share_left_out=float(np.mean(weight[used] < HALF)),
            )
        )
        return Round(problem, np.sqrt(weight))


def solve_by(
    problem: Problem,
    solve: Callable[[Problem, int | None], Solution],
    *,
    loss: str,
    noise: Callable[[Problem, SearchEnd], Noise],
    starts: int | None,
    spread: float | None = None,
) -> tuple[Problem, Solution]:
    """Minimise a loss, with priors if the problem has any: least squares again and again, with new weights.

    Returns:
        The problem of the last round, with its weights, and its solution, with the noise that priors are relative to.
    """
    solution = solve(problem, starts)
    priors = [part for part in problem.residuals if isinstance(part, Priors)]
    if loss == "squares" and not priors:
        return problem, solution
    if priors:
        solution = solution._replace(noise=float(priors[0].noise))  # which stays where nothing is left to explain
    rounds = 1 if loss == "squares" and not any(part.relative for part in priors) else ROUNDS
    result = _in_rounds(_Rounds(problem, solve, loss, noise, spread, rounds), solution)
    if loss != "squares" or rounds == 1:
        return result
    return _without_its_own_noise(result, solve, noise, starts)


def _without_its_own_noise(
    fitted: tuple[Problem, Solution],
    solve: Callable[[Problem, int | None], Solution],
    noise: Callable[[Problem, SearchEnd], Noise],
    starts: int | None,
) -> tuple[Problem, Solution]:
    """The fit with priors beside the noise of one without them, where that is less.

    What a wrong prior makes a fit miss counts as noise, beside which it weighs the more.
    """
    problem, noise_of_records = fitted[0], fitted[1].noise or 0.0
    alone = solve(problem.at_noise(NEXT_TO_NOTHING * noise_of_records), starts).best
    level = noise(problem, alone).level if alone.finite else np.inf
    if not level < QUIETER * noise_of_records or problem.is_rounding(alone.squares):
        return fitted
    weighed = problem.at_noise(level)
    return weighed, solve(weighed.started_at(alone.values), starts)._replace(noise=level)


class _Rounds(NamedTuple):
    """Rounds of least squares, each with the weights and the noise of the one before."""

    problem: Problem  # without weights by the loss
    solve: Callable[[Problem, int | None], Solution]
    loss: str
    noise: Callable[[Problem, SearchEnd], Noise]
    spread: float | None
    most: int

    def settled(self, now: Round, solution: Solution) -> tuple[Round, Solution]:
        """The last round and its solution, from one round and its solution on."""
        for _ in range(self.most):
            best = solution.best
            if not best.finite or self.problem.is_rounding(best.squares):
                break
            level = self.noise(now.problem, best).level
            after = now.after(self.problem, best.residual, level, self.loss, self.spread)
            if after is None:
                break
            now, solution = after, self.searched(after, best)._replace(noise=level)
            length = np.linalg.norm(solution.best.jacobian, axis=0)
            moved = np.abs(solution.best.values - best.values) * length
            if np.all(moved < SETTLED * level):
                break
        return now, solution

    def searched(self, now: Round, end: SearchEnd) -> Solution:
        """The solution of a round, searched from the end of another one."""
        return self.solve(now.problem.started_at(end.values), 1)

    def better(self, other: tuple[Round, Solution], than: tuple[Round, Solution]) -> bool:
        """Whether one solution has less of the loss than another, whose robust standard deviation is taken."""
        used = self.problem.used
        missed = [solution.best.residual / now.root for now, solution in (other, than)]
        unit, value = unit_of(missed[1], self.problem, self.loss, self.spread), LOSSES[self.loss].value
        robust = [unit**2 * value(each / unit) for each in missed]
        costs = [np.sum(np.where(used, cost, each**2)) for cost, each in zip(robust, missed, strict=True)]
        return bool(costs[0] < costs[1])


def _in_rounds(by: _Rounds, first: Solution) -> tuple[Problem, Solution]:
    """The last round, and its solution with the other minima of the first one, searched on with the last weights.

    As weights of one minimum make others look worse, those nearly as good have own rounds; the least loss is the best.
    """
    best = by.settled(Round(by.problem), first)
    if best[1] is first:
        return by.problem, first
    groups, chosen = distinct_ends(first, (best[1].noise or 0.0) ** 2), 0
    others = [by.searched(best[0], end) for end, _ in groups[1:]]
    for i, other in enumerate(others, 1):
        if other.best.squares < PROMISING * best[1].best.squares:
            followed = by.settled(best[0], other)
            best, chosen = (followed, i) if by.better(followed, best) else (best, chosen)
    now, solution = best
    if chosen:
        groups.insert(0, groups.pop(chosen))
        others = [by.searched(now, end) for end, _ in groups[1:]]
    counted = zip([solution, *others], (count for _, count in groups), strict=True)
    return now.problem, solution._replace(ends=_as_often(counted, solution.best), starts=first.starts)


def _as_often(counted: Iterable[tuple[Solution, int]], best: SearchEnd) -> tuple[SearchEnd, ...]:
    """Each end as often as searches ended in its minimum; beside the best none that did not converge."""
    ends = (end for one, count in counted for end in [one.best] * count)
    return tuple(end for end in ends if end.finite and (end.converged or end is best))


def against_priors(
    free: FreeParameters, residuals: Sequence[AbstractResiduals], values: Float[np.ndarray, " free"]
) -> list[str]:
    """How the records contradict what was known beforehand of each number of the law or machine, after "they"."""
    said = []
    for part in (part for part in residuals if isinstance(part, Priors) and part.relative):
        for row in part.linear_rows(free):
            i = int(np.argmax(row[:-1]))
            deviation, mean = float(part.noise) / row[i], -row[-1] / row[i]
            off, unit = abs(values[i] - mean) / deviation, f" {free.owners[i].unit}".rstrip()
            if off > CONTRADICTED:
                said.append(
                    f"contradict the prior of {free.names[i]}, {mean:.5g} ± {deviation:.2g}{unit}: "
                    f"{values[i]:.5g} is {off:.2g} standard deviations away"
                )
    return said


def criterion_in_words(problem: Problem, loss: str, priors: Mapping[str, Sequence[float]]) -> str:
    """What was minimised; empty for plain least squares."""
    parts = []
    if loss != "squares":
        parts.append(f"loss {loss}: {100 * problem.share_left_out:.2g} % of the samples have less than half weight")
    expected = [f"{name} {mean:.5g} ± {deviation:.2g}" for name, (mean, deviation) in priors.items()]
    return "; ".join([*parts, *[f"priors {', '.join(expected)}"] * bool(expected)])
