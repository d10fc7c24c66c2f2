"""The search of a tuning: sequential quadratic programming in double precision, whatever that of the vehicle."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.parameters import FreeParameters
from jaxdamp.tune.ranges import SearchRange
from jaxdamp.vehicles import AbstractVehicle


class Tolerance(NamedTuple):
    """Tolerances: the scaled gradient at an optimum, and the relative distance to a limit."""

    slope: float
    limit: float


DOUBLE, SINGLE = Tolerance(1e-4, 1e-6), Tolerance(1e-2, 1e-4)


class Limit(NamedTuple):
    """Largest allowed value of a metric, which may be negative or zero, and the scale of distances to it."""

    top: float
    scale: float

    def margin(self, value: float) -> float:
        """Relative distance to the limit, negative beyond it."""
        return (self.top - value) / self.scale


Limits = Mapping[str, Limit]
Measured = Callable[[AbstractVehicle], dict[str, Scalar]]
Slopes = Mapping[str, np.ndarray]
OUT_OF_STEPS = 9  # SLSQP's own code
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

    def __init__(self, ride: Measured, free: FreeParameters, names: Sequence[str]) -> None:
        self.names = list(names)
        dtype = free.values.dtype
        self.tolerance = DOUBLE if dtype == np.float64 else SINGLE

        @eqx.filter_jit
        def evaluate(free: FreeParameters, values: Array) -> tuple[Array, Array]:
            def measured(values: Array) -> tuple[Array, Array]:
                found = ride(free.build(values))
                stacked = jnp.stack([found[name] for name in self.names])
                return stacked, stacked

            slopes, found = jax.jacfwd(measured, has_aux=True)(values)
            return found, slopes

        self._evaluate = lambda values: evaluate(free, jnp.asarray(values, dtype))
        self._last: tuple[bytes, dict[str, float], dict[str, np.ndarray]] = (b"", {}, {})

    def at(self, values: Float[np.ndarray, " free"]) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Metrics, and their derivatives with respect to the physical values."""
        if self._last[0] != values.tobytes():
            found, slopes = (np.asarray(a, np.float64) for a in self._evaluate(values))
            self._last = (
                values.tobytes(),
                {name: float(x) for name, x in zip(self.names, found, strict=True)},
                dict(zip(self.names, slopes, strict=True)),
            )
        return self._last[1], self._last[2]


def search(
    evaluator: Evaluator,
    space: SearchRange,
    metric: str,
    limits: Limits,
    max_steps: int,
    progress: Callable[[int, float], None],
) -> Ended:
    """SLSQP in coordinates, the objective divided by its start.

    If it ends before an optimum, its estimate of the curvature is wrong or a kink has stopped it: it is started again.
    """
    import scipy.optimize

    unit = space.unit
    level = abs(evaluator.at(space.start)[0][metric]) or 1.0
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

    ended = attempt(space.start / unit)
    for _ in range(RESTARTS):
        if ended.slope_left < evaluator.tolerance.slope or len(history) >= max_steps:
            break
        ended = attempt(ended.values / unit)
    return ended


def active(limits: Limits, values: Mapping[str, float], tolerance: Tolerance) -> tuple[str, ...]:
    """The active or violated limits."""
    return tuple(name for name, limit in limits.items() if limit.margin(values[name]) < tolerance.limit)


def limits_of(tops: Mapping[str, float], start: Mapping[str, float]) -> dict[str, Limit]:
    """The limits with their scales: their own magnitude, or that of the metric at the start if a limit is zero."""
    return {name: Limit(top, abs(top) or abs(start[name]) or 1.0) for name, top in tops.items()}


def _constraints(evaluator: Evaluator, space: SearchRange, limits: Limits) -> list[dict]:
    """Constraints: metrics below their limits, and increasing vectors."""
    unit = space.unit
    below = [
        {
            "type": "ineq",
            "fun": lambda u, n=name, limit=limit: limit.margin(evaluator.at(u * unit)[0][n]),
            "jac": lambda u, n=name, limit=limit: -evaluator.at(u * unit)[1][n] * unit / limit.scale,
        }
        for name, limit in limits.items()
    ]
    rows, gaps = space.coordinates.order()
    return below + [{"type": "ineq", "fun": lambda u: rows @ u - gaps, "jac": lambda u: rows}] * bool(gaps.size)


def _slope_left(evaluator: Evaluator, space: SearchRange, values: np.ndarray, metric: str, limits: Limits) -> float:
    """Length of the scaled gradient after projection on bounds and active limits, relative to the metric."""
    found, slopes = evaluator.at(values)
    unbound = np.array([not side for side in space.side(values)])
    gradient = (slopes[metric] * space.unit)[unbound]
    tight = active(limits, found, evaluator.tolerance)
    if tight and gradient.size:
        walls = np.stack([(slopes[name] * space.unit)[unbound] for name in tight], axis=1)
        gradient = gradient - walls @ np.linalg.lstsq(walls, gradient, rcond=None)[0]
    return float(np.linalg.norm(gradient)) / max(abs(found[metric]), 1e-300)
