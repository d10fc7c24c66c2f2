"""Several starts of a search: the best end is the result, the others show further minima.

All starts use the same compiled program, one after the other. The first is searched to its end, or until it creeps;
others for a few steps, which see the first part of long records, and the most promising ones as far as the first. What
is best then is continued to its end.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp import _checks
from jaxdamp._status import Status
from jaxdamp.dampers import Reach, keeps_conditions, laws_inside
from jaxdamp.identify.estimates import Minimum
from jaxdamp.identify.printed import evaluator
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd, Searches, Solver, search
from jaxdamp.identify.traces import signals
from jaxdamp.parameters import FreeParameters


FIRST_LOOK = 10  # steps after which starts are compared
FOLLOWED = 2  # starts that are continued to their end, besides the first
FOLLOWED_STEPS = 80  # of each of them and of the first at most, before the best is continued
PROMISING = 1.5  # sum of squares, relative to the best, up to which a start is continued
INSIDE = 0.02  # distance of a start from the ends of a range, relative to its width
ROUNDS = 3  # rounds of proposals, each from the best end of the previous round
ALIKE = 1e-2  # difference of sums of squares, relative to them, of ends that count as equally good
ELSEWHERE = 50.0  # squares of the change of force, relative to what they gain, of a look that left a minimum
SAME = 1.0  # largest difference in chi-square of two ends of the same minimum
WORTH_A_ROUND = 1e-3  # relative decrease of the sum of squares after which there is another round
BETTER = 1e-9  # relative decrease of the sum of squares that counts as one
# of the first part of long records, on which starts are compared: the whole motion in a fraction of the samples
SHARE = 0.25  # of the samples of a record, at least
REACHED = 0.95  # of the range of stroke and velocity, which it covers
MOVING = 0.1  # of its largest velocity, at which its motion begins
MOST = 0.5  # share of all samples, above which it is not worthwhile
LEAST = 4000  # samples, below which a search is short anyway


class Solution(NamedTuple):
    """The ends of searches from several starts."""

    best: SearchEnd
    ends: tuple[SearchEnd, ...]  # those that converged, the best among them, in the order of their starts
    starts: int
    closed_form: bool = False  # there is one minimum, which was computed
    noise: float | None = None  # of a weighted sample, relative to which priors count; None of plain least squares


def other_starts(free: FreeParameters, reach: Reach) -> list[Float[np.ndarray, " free"]]:
    """Further starting values of the free parameters, as proposed by the law and the laws inside.

    Proposals for frozen parameters and those that violate a condition between parameters are left out; those outside
    the limits are moved inside.
    """
    start, (lower, upper) = np.asarray(free.values), free.limits()
    width = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    starts = []
    for path, part in laws_inside(free.tree):
        for proposal in part.other_starts(reach):
            values = start.copy()
            for i, name in enumerate(free.names):
                field = name.removeprefix(path)
                if name.startswith(path) and field in proposal:
                    low, high = lower[i] + INSIDE * width[i], upper[i] - INSIDE * width[i]
                    values[i] = np.clip(proposal[field], low, high)
            if _not_among([start, *starts], [values]) and keeps_conditions(free.started_at(values).tree):
                starts.append(values)
    return starts


def first_part(problem: Problem) -> Problem | None:
    """The problem on the first part of each record, or None where that is hardly shorter.

    What is left of a record weighs as much as the whole record, so that sums of squares and priors stay comparable.
    """
    used, factor = problem.used, np.ones(problem.used.size)
    stroke, velocity = signals(problem.residuals, "stroke", "velocity")
    for place in problem.places:
        factor[place] = _of_record(used[place], stroke[place], velocity[place])
    count, counted = np.count_nonzero(used), np.count_nonzero(used & (factor > 0))
    return problem.reweighted(factor) if count >= LEAST and counted <= MOST * count else None


def _of_record(
    used: Bool[np.ndarray, " time"], stroke: Float[np.ndarray, " time"], velocity: Float[np.ndarray, " time"]
) -> Float[np.ndarray, " time"]:
    """Factor on the weights: zero after the first part."""
    if not np.any(used):
        return np.ones(used.size)
    samples, moving = np.flatnonzero(used), used & (np.abs(velocity) > MOVING * np.abs(velocity[used]).max())
    pause = np.count_nonzero(samples < np.argmax(moving))
    last = samples[pause + int(SHARE * (samples.size - pause - 1))]
    for signal in (stroke, velocity):
        for way in (signal, -signal):
            low, high = way[used].min(), way[used].max()
            last = max(last, samples[np.argmax(way[used] >= low + REACHED * (high - low))])
    part = np.arange(used.size) <= last
    return np.where(part, np.sqrt(samples.size / np.count_nonzero(used & part)), 0.0)


class _Searcher:
    """Searches from several starts: whole ones on all samples, first looks on the first part of long records."""

    def __init__(self, problem: Problem, solver: Solver | None, starts: int | None) -> None:
        self.problem, self.whole, self.part = problem, Searches(problem, solver), None
        if starts != 1 and self.whole.is_printed and (part := first_part(problem)):
            self.part = self.whole.of(part, evaluator(part.free, part.residuals))

    def look(self, values: Float[np.ndarray, " free"], steps: int) -> SearchEnd:
        """The end of a few steps, to be compared with those of other looks; none on a part of the samples is final."""
        if self.part is None:
            return self.whole.end(values, steps)
        return self.part.end(values, steps)._replace(status=Status.STEP_LIMIT)

    def to_its_end(self, end: SearchEnd, max_steps: int) -> SearchEnd:
        """The end of a search on all samples that went fewer steps than it may take."""
        left = max_steps - end.steps
        if end.converged or left < 1:
            return end
        on = self.whole.end(end.values, left)
        return on._replace(steps=end.steps + on.steps)


def search_from(problem: Problem, *, starts: int | None, max_steps: int, solver: Solver | None = None) -> Solution:
    """Search from the start of the problem and from the further starts that its laws propose.

    If another start leads to a better end, new proposals are made from there, so that more than one parameter can be
    wrong at the start.
    """
    searcher, begin = _Searcher(problem, solver, starts), np.asarray(problem.free.values)
    best = searcher.whole.end(begin, max_steps if starts == 1 else min(FOLLOWED_STEPS, max_steps))
    ends, tried = [best], [begin]
    for _ in range(ROUNDS):
        if len(tried) == starts or (best.converged and problem.is_rounding(best.squares)):
            break
        others = _not_among(tried, other_starts(problem.free, problem.reach))
        others = others[: None if starts is None else starts - len(tried)]
        tried, ends = [*tried, *others], [*ends, *_follow(searcher, others, best, max_steps)]
        before, end = best, _least(ends, best)
        best = searcher.to_its_end(end, max_steps)
        ends = [best if one is end else one for one in ends]
        if before.finite and best.squares >= (1.0 - WORTH_A_ROUND) * before.squares:
            break
        problem = problem.started_at(best.values)
    return Solution(best, tuple(end for end in ends if end.finite and (end.converged or end is best)), len(tried))


def _least(ends: Sequence[SearchEnd], before: SearchEnd) -> SearchEnd:
    """The end with the least sum of squares; the one before where no other is better."""
    finite = (end for end in ends if end.finite)
    return min(finite, key=lambda end: (1.0 + BETTER * (end is not before)) * end.squares, default=before)


def _not_among(tried: Sequence[np.ndarray], others: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Those starts that are not among others."""
    return [values for values in others if not any(np.array_equal(values, one) for one in tried)]


def scattered_starts(problem: Problem, first: SearchEnd, count: int, seed: int) -> list[Float[np.ndarray, " free"]]:
    """Starts beside that of the problem: each parameter times a factor between a half and two, where limits allow it.

    No factor moves a number from zero, where functions of several numbers are often symmetric: one is drawn at random,
    as large as changes the residuals by the size of the data, by the derivatives at the end of the first search.
    """
    _checks.seed(seed)
    random, free = np.random.default_rng(seed), problem.free
    values, (lower, upper) = np.asarray(free.values, float), free.limits()
    sensitivity = np.linalg.norm(first.jacobian, axis=0)
    units = np.concatenate([np.ravel(np.asarray(unit, float)) for unit in problem.coordinates.units])
    size = np.divide(problem.level, sensitivity, out=units, where=np.isfinite(sensitivity) & (sensitivity > 0))
    zero = (values == 0) & ~problem.coordinates.ordered
    low, high = np.maximum(lower, -size)[zero], np.minimum(upper, size)[zero]
    starts = []
    for _ in range(count):
        factors = [np.full(p.value.size, 2.0 ** random.uniform(-1.0, 1.0)) for p in free.chosen]
        moved = values * np.concatenate(factors)
        moved[zero] = random.uniform(low, high)
        starts.append(np.where((moved > lower) & (moved < upper), moved, values))
    return starts


def search_scattered(
    problem: Problem, starts: int | None, *, seed: int, max_steps: int, solver: Solver | None = None
) -> Solution:
    """Search from scattered starts to their ends; the first of those that count as equally good is the best."""
    ends = [search(problem, max_steps, solver=solver)]
    for values in scattered_starts(problem, ends[0], (starts or 1) - 1, seed):
        if keeps_conditions((moved := problem.started_at(values)).free.tree):
            ends.append(search(moved, max_steps, solver=solver))
    squares = np.array([end.squares if end.finite else np.inf for end in ends])
    best = ends[int(np.argmax(squares <= squares.min() + equally_good(squares.min())))]
    return Solution(best, tuple(end for end in ends if end.finite and (end.converged or end is best)), len(ends))


def equally_good(squares: float) -> float:
    """Difference of sums of squares, in units of the noise, of ends that count as equally good."""
    return ALIKE * max(squares, 1.0)


def _follow(searcher: _Searcher, others: Sequence[np.ndarray], best: SearchEnd, max_steps: int) -> list[SearchEnd]:
    """The ends of a few steps from each of several starts, and of the whole search from the most promising."""
    if not others:
        return []
    steps, partly = min(FIRST_LOOK, max_steps), searcher.part is not None
    here = searcher.look(best.values, steps) if partly else best
    looks, followed = [searcher.look(values, steps) for values in others], [(here, best)]
    variance = here.squares / np.count_nonzero(searcher.problem.used)
    if partly and _left(best, here, searcher.look(best.values, 1).squares, variance):
        looks, followed = [here, *looks], []
    ends = [end for end in looks if end.converged]
    for look in _promising(here, looks)[:FOLLOWED]:
        end = next((end for seen, end in followed if seen.finite and _apart(look, seen) < SAME * variance), None)
        if end is None:
            # at least one point on all samples
            most = np.clip(max_steps, look.steps + partly, look.steps + FOLLOWED_STEPS)
            end = searcher.to_its_end(look, int(most))
            followed.append((look, end))
        ends.append(end)
    return ends


def _promising(here: SearchEnd, looks: Sequence[SearchEnd]) -> list[SearchEnd]:
    """The looks that are worth being continued, beside that of the best end, the most promising first."""
    most = PROMISING * min([end.squares for end in (here, *looks) if end.finite], default=np.inf)
    open_ended = (end for end in looks if not end.converged and end.finite and end.squares < most)
    return sorted(open_ended, key=lambda end: end.squares)


def _left(best: SearchEnd, here: SearchEnd, before: float, variance: float) -> bool:
    """Whether the look from an end, on a part of the samples, has left its minimum, within which both are alike."""
    if not (best.finite and here.finite):
        return False
    change = best.jacobian @ (here.values - best.values)
    return bool(change @ change > ELSEWHERE * max(before - here.squares, variance))


def _apart(end: SearchEnd, other: SearchEnd) -> float:
    """How far apart two ends are: by their sums of squares, and by the force that their parameters differ by."""
    change = other.jacobian @ (end.values - other.values)
    return max(end.squares - other.squares, float(change @ change))


def minima_of(solution: Solution, names: Sequence[str], variance: float) -> tuple[Minimum, ...]:
    """The minima in which the searches ended, the best first."""
    best = solution.best
    return tuple(
        Minimum(
            dict(zip(names, map(float, end.values), strict=True)),
            max(end.squares - best.squares, 0.0) / variance if variance > 0 else 0.0,
            count,
        )
        for end, count in distinct_ends(solution, variance)
    )


def distinct_ends(solution: Solution, variance: float) -> list[tuple[SearchEnd, int]]:
    """One end of each minimum, the best first, and how many searches ended there.

    Two ends are the same minimum if their sums of squares differ by less than the noise, and if by the Jacobian of the
    better one their parameters give almost the same force.
    """
    best = solution.best
    groups: list[tuple[SearchEnd, int]] = []
    for end in sorted(solution.ends, key=lambda end: (end is not best, end.squares)):
        for i, (other, count) in enumerate(groups):
            if _apart(end, other) < SAME * variance:
                groups[i] = (other, count + 1)
                break
        else:
            groups.append((end, 1))
    return groups
