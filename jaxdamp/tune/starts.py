"""Searches from several starts, whose simulations run side by side."""

import math
import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple, final

import numpy as np

from jaxdamp.tune.limits import Limit
from jaxdamp.tune.ranges import FACTOR, SearchRange
from jaxdamp.tune.searching import Ended, Evaluate, Evaluator, missed, search


class Attempt(NamedTuple):
    """The search from one start.

    Attributes:
        start: the free numbers at its start.
        end: the free numbers at its end.
        metric: the metric at its end.
        meets_limits: whether all limits are met there.
        converged: whether it ended at an optimum.
    """

    start: np.ndarray
    end: np.ndarray
    metric: float
    meets_limits: bool
    converged: bool


def start_points(space: SearchRange, count: int, seed: int) -> np.ndarray:
    """So many starts, shape (count, free): the given one, and a Sobol sequence inside the bounds.

    Numbers between positive bounds are uniform in their logarithm. Without a bound, numbers are within three times
    their unit. The numbers of ordered vectors are sorted.
    """
    from scipy.stats import qmc

    lower = np.where(np.isfinite(space.lower), space.lower, space.start - FACTOR * space.unit)
    upper = np.where(np.isfinite(space.upper), space.upper, space.start + FACTOR * space.unit)
    options: dict = {"seed": np.random.default_rng(seed)}  # SciPy 1.15 calls it `rng`, and still takes this name
    unit = qmc.Sobol(len(lower), **options).random_base2(max(count - 2, 0).bit_length())[: count - 1]
    points = lower + (upper - lower) * unit
    logarithmic = lower > 0
    ratio = upper[logarithmic] / lower[logarithmic]
    points[:, logarithmic] = lower[logarithmic] * ratio ** unit[:, logarithmic]
    end = 0
    for p in space.free.chosen:
        begin, end = end, end + p.value.size
        if p.domain.ordered:
            points[:, begin:end] = np.sort(points[:, begin:end], axis=1)
    return np.concatenate([space.start[None], points])


def search_together(
    desk: "Desk",
    alone: Evaluator,
    starts: np.ndarray,
    space: SearchRange,
    metric: str,
    limits: Sequence[Limit],
    max_steps: int,
    progress: Callable[[int, float], None],
) -> list[Ended]:
    """One search from each start.

    Each search has a thread of its own that waits for its values; this thread computes those of all searches together.
    """
    evaluators = [
        Evaluator(lambda values, i=i: desk.ask(i, values), alone.names, alone.tolerance) for i in range(len(starts))
    ]
    ended: list[Ended | None] = [None] * len(starts)
    best = math.inf

    def note(_: int, value: float) -> None:
        nonlocal best
        best = min(best, value)

    def run(i: int) -> None:
        try:
            ended[i] = search(evaluators[i], space, metric, limits, max_steps, note, starts[i])
        except BaseException as error:  # raised again by the thread that waits
            desk.fail(error)
        finally:
            desk.leave(i)

    threads = [threading.Thread(target=run, args=(i,), daemon=True) for i in range(len(starts))]
    for thread in threads:
        thread.start()
    desk.serve(lambda rounds: progress(rounds, best))
    for thread in threads:
        thread.join()
    return [one for one in ended if one is not None]


def best_of(
    ended: Sequence[Ended], evaluator: Evaluator, metric: str, limits: Sequence[Limit]
) -> tuple[int, list[float]]:
    """The search that ended best, with all limits met if any did so, and the metric at the end of each."""
    values = [evaluator.at(one.values)[0] for one in ended]
    short = [
        sum(max(-limit.margin(v[limit.name]), 0.0) for limit in missed(limits, v, evaluator.tolerance)) for v in values
    ]
    order = sorted(range(len(ended)), key=lambda i: (short[i], values[i][metric]))
    return order[0], [v[metric] for v in values]


@final
class Desk:
    """Collects the points that all searches wait for, and gives them their values."""

    def __init__(self, evaluate: Evaluate, count: int) -> None:
        self._evaluate, self._count = evaluate, count
        self._active, self._requests = set(range(count)), dict[int, np.ndarray]()
        self._results: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._error: BaseException | None = None
        self._changed = threading.Condition()

    def ask(self, index: int, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The numbers and slopes of a point, computed with those of the other searches."""
        with self._changed:
            self._requests[index] = values.copy()
            self._changed.notify_all()
            self._changed.wait_for(lambda: index in self._results or self._error is not None)
            if self._error is not None:
                raise self._error
            return self._results.pop(index)

    def leave(self, index: int) -> None:
        """A search is at its end."""
        with self._changed:
            self._active.discard(index)
            self._changed.notify_all()

    def fail(self, error: BaseException) -> None:
        """A search raised."""
        with self._changed:
            self._error = self._error or error
            self._changed.notify_all()

    def serve(self, progress: Callable[[int], None]) -> None:
        """Compute batches until all searches have left; raises what one of them raised."""
        rounds = 0
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._error is not None or self._active <= set(self._requests))
                    if self._error is not None:
                        raise self._error
                    if not self._active:
                        return
                    requests, self._requests = self._requests, {}
                values, slopes = self._batch(list(requests.values()))
                rounds += 1
                progress(rounds)
                with self._changed:
                    self._results |= {i: (values[k], slopes[k]) for k, i in enumerate(requests)}
                    self._changed.notify_all()
        except BaseException as error:
            self.fail(error)
            raise

    def alone(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The numbers and slopes of one point, by the same program."""
        values, slopes = self._batch([values])
        return values[0], slopes[0]

    def _batch(self, points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Points in a batch of always the same size."""
        padded = np.stack(points + [points[0]] * (self._count - len(points)))
        values, slopes = self._evaluate(padded)
        return np.asarray(values, np.float64), np.asarray(slopes, np.float64)
