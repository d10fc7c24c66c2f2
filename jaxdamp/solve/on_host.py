"""The loop of a search on the host: residuals and Jacobians come from programs that are compiled elsewhere."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.tree_util as jtu
import numpy as np
from jaxtyping import Float, Int

from jaxdamp._status import Status
from jaxdamp.solve.damped_steps import Linearisation, at_edges
from jaxdamp.solve.least_squares import BoundedLevenbergMarquardt, rules_of


Linearise = Callable[[Float[np.ndarray, "some unknowns"], Int[np.ndarray, " some"]], tuple[Linearisation, Any]]


class SearchLanes(NamedTuple):
    """Where and how the searches of all lanes ended.

    Attributes:
        y: the unknowns, shape (lanes, unknowns).
        aux: what the linearisation gave beside itself at these points, arrays with the lanes as first axis.
        status: how each ended.
        steps: points tried in each, the start among them.
    """

    y: Float[np.ndarray, "lanes unknowns"]
    aux: Any
    status: list[Status]
    steps: Int[np.ndarray, " lanes"]

    def of(self, lanes: Int[np.ndarray, " some"]) -> "SearchLanes":
        """Those of some lanes."""
        aux = jtu.tree_map(lambda leaf: leaf[lanes], self.aux)
        return SearchLanes(self.y[lanes], aux, [self.status[i] for i in lanes], self.steps[lanes])


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # points without finite residuals are refused as steps
def least_squares_on_host(
    linearise: Linearise,
    solver: BoundedLevenbergMarquardt,
    start: Float[np.ndarray, "lanes unknowns"],
    max_steps: int,
) -> SearchLanes:
    """Minimise the sums of squares of one or many problems side by side; each ends by itself.

    Lanes that have ended are not computed any more. An interrupt ends the loop between two evaluations.

    Arguments:
        linearise: `(points, lanes) -> (linearisation, aux)` of some lanes at these points, arrays of NumPy with the
            lanes as first axis; rows relative to the size of the data of each lane.
        solver: with bounds common to all lanes, and the precision of the residuals.
        start: unknowns to start from.
        max_steps: largest number of points tried in each lane, including the start.
    """
    options, none = {"linearise": linearise}, frozenset[object]()
    y = np.array(start, np.float64)
    state = solver.init(None, y, None, options, None, None, none)
    y = state.trial
    while True:
        ended, _ = solver.terminate(None, y, None, options, state, none)
        lanes = np.flatnonzero(~ended & (state.steps < max_steps))
        if not lanes.size:
            break
        if lanes.size == len(y):
            y, state, _ = solver.step(None, y, lanes, options, state, none)
            continue
        some = jtu.tree_map(lambda leaf: leaf[lanes], state)  # noqa: B023
        some_y, some, _ = solver.step(None, y[lanes], lanes, options, some, none)
        y, state = _put(lanes, (some_y, some), (y, state))
    edged = at_edges(y, rules_of(solver, np, y))
    lanes = np.flatnonzero(np.any(edged != y, axis=1))
    aux = state.aux
    if lanes.size:
        y, aux = edged, _put(lanes, linearise(edged[lanes], lanes)[1], aux)
    status = map(_status, state.converged, state.stuck)
    return SearchLanes(y, aux, list(status), state.steps)


def _put(lanes: Int[np.ndarray, " some"], some: Any, tree: Any) -> Any:
    """A tree with the leaves of some lanes replaced."""

    def replaced(part: np.ndarray, leaf: np.ndarray) -> np.ndarray:
        leaf = leaf.copy()
        leaf[lanes] = part
        return leaf

    return jtu.tree_map(replaced, some, tree)


def _status(converged: bool | np.bool_, stuck: bool | np.bool_) -> Status:
    return Status.CONVERGED if converged else Status.NO_STEP if stuck else Status.STEP_LIMIT
