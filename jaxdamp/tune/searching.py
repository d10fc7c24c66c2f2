"""The search of a tuning: sequential quadratic programming in double precision, whatever that of the vehicle."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._jacobian import Mode, value_and_jacobian
from jaxdamp._types import Scalar
from jaxdamp.parameters import FreeParameters
from jaxdamp.tune.limits import Limit, limit_ends, margin_slopes, margins
from jaxdamp.tune.ranges import SearchRange
from jaxdamp.vehicles import AbstractVehicle


class Tolerance(NamedTuple):
    """Tolerances: the scaled gradient at an optimum, and the relative distance to a limit."""

    slope: float
    limit: float


DOUBLE, SINGLE = Tolerance(1e-4, 1e-6), Tolerance(1e-2, 1e-4)
Measured = Callable[[AbstractVehicle], Mapping[str, Scalar]]
Evaluate = Callable[[np.ndarray], tuple[Array | np.ndarray, Array | np.ndarray]]
OUT_OF_STEPS = 9  # SLSQP's own code
NEAR = 1e-3  # how far around an end gradients are sampled, relative to the unit of each coordinate
RESTARTS = 2  # with a new estimate of the curvature, if the search ends before an optimum


class Ended(NamedTuple):
    """Where and how a search ended."""

    values: np.ndarray
    history: tuple[float, ...]
    out_of_steps: bool
    slope_left: float  # length of the projected scaled gradient, relative to the metric


@final
class Evaluator:
    """Metrics and their derivatives, computed together and cached for the last point."""

    def __init__(self, evaluate: Evaluate, names: Sequence[str], tolerance: Tolerance) -> None:
        self.names, self.tolerance, self._evaluate = list(names), tolerance, evaluate
        self._last: tuple[bytes, dict[str, float], dict[str, np.ndarray]] = (b"", {}, {})

    def at(self, values: Float[np.ndarray, " free"]) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Metrics, and their derivatives with respect to the physical values."""
        if self._last[0] != values.tobytes():
            numbers, slopes = (np.asarray(a, np.float64) for a in self._evaluate(values))
            self._last = (
                values.tobytes(),
                {name: float(x) for name, x in zip(self.names, numbers, strict=True)},
                dict(zip(self.names, slopes, strict=True)),
            )
        return self._last[1], self._last[2]


def tolerance_of(free: FreeParameters) -> Tolerance:
    """The tolerance that the precision of the parameters permits."""
    return DOUBLE if free.values.dtype == np.float64 else SINGLE


def one_at_a_time(measured: Measured, free: FreeParameters, names: Sequence[str]) -> Evaluate:
    """The metrics, shape (names,), and derivatives, shape (names, free), of one vector of values, compiled."""

    @eqx.filter_jit
    def evaluate(free: FreeParameters, values: Array) -> tuple[Array, Array]:
        def stacked(values: Array) -> tuple[Array, Array]:
            values_by_name = measured(free.build(values))
            stacked = jnp.stack([values_by_name[name] for name in names])
            return stacked, stacked

        slopes, numbers = jax.jacfwd(stacked, has_aux=True)(values)
        return numbers, slopes

    return lambda values: evaluate(free, jnp.asarray(values, free.values.dtype))


def many_at_a_time(
    measured: Measured,
    free: FreeParameters,
    names: Sequence[str],
    of: Sequence[str] | None = None,
    mode: Mode = "forward",
) -> Evaluate:
    """The same of several vectors side by side, with a first axis of that many, compiled.

    Arguments:
        measured: the metrics of a vehicle.
        free: its free parameters.
        names: of the metrics to compute.
        of: those among them to differentiate; all if left out.
        mode: of differentiation.
    """
    entries, differentiated = [str(i) for i in range(free.values.size)], list(names if of is None else of)

    @eqx.filter_jit
    def evaluate(free: FreeParameters, values: Array) -> tuple[Array, Array]:
        def one(point: dict[str, Array]) -> dict[str, Array]:
            results = measured(free.build(jnp.stack([point[entry] for entry in entries])))
            return {name: results[name] for name in names}

        point = {entry: values[:, i] for i, entry in enumerate(entries)}
        results, slopes = value_and_jacobian(jax.vmap(one), point, mode, of=differentiated)
        rows = [jnp.stack([slopes[name][entry] for entry in entries], axis=-1) for name in differentiated]
        return jnp.stack([results[name] for name in names], axis=1), jnp.stack(rows, axis=1)

    return lambda values: evaluate(free, jnp.asarray(values, free.values.dtype))


def search(
    evaluator: Evaluator,
    space: SearchRange,
    metric: str,
    limits: Sequence[Limit],
    max_steps: int,
    progress: Callable[[int, float], None],
    start: np.ndarray | None = None,
) -> Ended:
    """SLSQP in coordinates, the objective divided by its start.

    If it ends before an optimum, its estimate of the curvature is wrong or a kink has stopped it: it is started again.
    """
    import scipy.optimize

    unit = space.unit
    start = space.start if start is None else start
    level = abs(evaluator.at(start)[0][metric]) or 1.0
    history: list[float] = []

    def note(u: np.ndarray) -> None:
        history.append(evaluator.at(u * unit)[0][metric])
        progress(len(history), history[-1])

    def attempt(begin: np.ndarray) -> Ended:
        solved = scipy.optimize.minimize(
            lambda u: evaluator.at(u * unit)[0][metric] / level,
            begin,
            jac=lambda u: evaluator.at(u * unit)[1][metric] * unit / level,
            method="SLSQP",
            bounds=scipy.optimize.Bounds(space.lower / unit, space.upper / unit, keep_feasible=True),  # type: ignore[arg-type]
            constraints=_constraints(evaluator, space, limits),
            callback=note,
            options={"ftol": 1e-15, "maxiter": max_steps - len(history)},
        )
        values = np.clip(np.asarray(solved.x, np.float64) * unit, space.lower, space.upper)
        left = _slope_left(evaluator, space, values, metric, limits)
        return Ended(values, tuple(history), solved.status == OUT_OF_STEPS, left)

    ended = attempt(start / unit)
    for _ in range(RESTARTS):
        if ended.slope_left < evaluator.tolerance.slope or len(history) >= max_steps:
            break
        ended = attempt(ended.values / unit)
    if ended.slope_left >= evaluator.tolerance.slope and not ended.out_of_steps:
        left = _slope_left_at_kink(evaluator, space, ended.values, metric, limits)
        ended = ended._replace(slope_left=min(left, ended.slope_left))
    return ended


def reached(limits: Sequence[Limit], values: Mapping[str, float], tolerance: Tolerance) -> list[Limit]:
    """The limits that are met, and hold the search."""
    return [limit for limit in limits if abs(limit.margin(values[limit.name])) <= tolerance.limit]


def missed(limits: Sequence[Limit], values: Mapping[str, float], tolerance: Tolerance) -> list[Limit]:
    """The violated limits."""
    return [limit for limit in limits if not limit.margin(values[limit.name]) >= -tolerance.limit]


def _constraints(evaluator: Evaluator, space: SearchRange, limits: Sequence[Limit]) -> list[dict]:
    """Constraints: numbers inside their limits, and increasing vectors."""
    unit, ends = space.unit, limit_ends(limits)
    inside = {
        "type": "ineq",
        "fun": lambda u: margins(ends, evaluator.at(u * unit)[0]),
        "jac": lambda u: margin_slopes(ends, evaluator.at(u * unit)[1]) * unit,
    }
    rows, gaps = space.coordinates.order()
    ordered = {"type": "ineq", "fun": lambda u: rows @ u - gaps, "jac": lambda u: rows}
    return [inside] * bool(ends) + [ordered] * bool(gaps.size)


def _slope_left(
    evaluator: Evaluator, space: SearchRange, values: np.ndarray, metric: str, limits: Sequence[Limit]
) -> float:
    """Length of the scaled gradient after projection on bounds and active limits, relative to the metric."""
    metrics, slopes = evaluator.at(values)
    unbound = np.array([not side for side in space.side(values)])
    gradient = (slopes[metric] * space.unit)[unbound]
    tight = [limit for limit in limits if limit.margin(metrics[limit.name]) < evaluator.tolerance.limit]
    if tight and gradient.size:
        walls = np.stack([(slopes[limit.name] * space.unit)[unbound] for limit in tight], axis=1)
        gradient = gradient - walls @ np.linalg.lstsq(walls, gradient, rcond=None)[0]
    return float(np.linalg.norm(gradient)) / max(abs(metrics[metric]), 1e-300)


def _slope_left_at_kink(
    evaluator: Evaluator, space: SearchRange, values: np.ndarray, metric: str, limits: Sequence[Limit]
) -> float:
    """The slope that is left where the metric or a limit has a kink, relative to the metric.

    The length of the shortest convex combination of gradients sampled around the end, balanced by those of active
    limits and bounds: zero at a minimum, also of a function whose gradient jumps there. Away from one all sampled
    gradients point in similar directions, and no combination is short.

    Source: Burke, Lewis, Overton, A robust gradient sampling algorithm for nonsmooth, nonconvex optimization, SIAM J.
    Optim. 15 (2005).
    """
    import scipy.optimize

    free, size = len(values), max(abs(evaluator.at(values)[0][metric]), 1e-300)
    near = NEAR * space.unit * np.random.default_rng(0).uniform(-1.0, 1.0, (4 * free + 4, free))
    at_end, _ = evaluator.at(values)
    tight = [end for end in limit_ends(limits) if margins([end], at_end)[0] < evaluator.tolerance.limit]
    gradients, walls = [], []
    for point in (values, *np.clip(values + near, space.lower, space.upper)):
        slopes = evaluator.at(point)[1]
        gradients.append(slopes[metric] * space.unit / size)
        walls += [end.sign * slopes[end.name] * space.unit for end in tight]
    sides = {"lower": -1.0, "upper": 1.0}
    walls += [sides[side] * row for side, row in zip(space.side(values), np.eye(free), strict=True) if side]
    walls = [wall / length for wall in walls if (length := np.linalg.norm(wall)) > 0.0]
    heavy = 1e3 * max(float(np.linalg.norm(gradient)) for gradient in gradients)  # weights add up to one
    columns = [np.append(gradient, heavy) for gradient in gradients] + [np.append(wall, 0.0) for wall in walls]
    weights, _ = scipy.optimize.nnls(np.stack(columns, axis=1), np.append(np.zeros(free), heavy))
    return float(np.linalg.norm(np.stack(columns, axis=1)[:-1] @ weights))
