"""The problems of many dampers side by side: one law with other numbers for each, and the same free numbers."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp._triangles import rows_of_products
from jaxdamp.dampers import laws_inside, margins
from jaxdamp.identify.criteria import ROUNDS, SETTLED, Priors, Round
from jaxdamp.identify.dependence import Dependence, Products
from jaxdamp.identify.noise import CORRELATED, correlation_time
from jaxdamp.identify.printed import Evaluator, evaluators, rows_beside
from jaxdamp.identify.problem import ROUNDING, Problem
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import Coordinates, FreeParameters
from jaxdamp.solve import Linearisation, SearchLanes


class Here(NamedTuple):
    """The problem of a damper at a point."""

    whole: Float[np.ndarray, "samples columns"]  # the Jacobian of the weighted residual, which is the last column
    counted: list[Float[np.ndarray, "rows columns"]]  # of it
    margins: Float[np.ndarray, " conditions"]  # of the conditions between parameters
    slopes: Float[np.ndarray, "conditions free"]
    drift: (
        np.ndarray | float
    )  # largest relative change of the states over the cycle before a record that starts periodically


class ByXla:
    """An `Evaluator` of a problem by XLA: one program for all records of a length, whatever damper they are of."""

    def __init__(self, problem: Problem) -> None:
        self._free, self._beside = problem.free, rows_beside(problem.free, problem.residuals)
        self._rows = [
            _record(batch, k) for batch in problem.residuals if isinstance(batch, Batch) for k in range(len(batch.dt))
        ]

    def here(self, values: Float[np.ndarray, " free"]) -> Here:
        """The problem at physical values."""
        at = jnp.asarray(values, self._free.values.dtype)
        each = [_evaluated(self._free, at, row) for row in self._rows]
        beside = self._beside.copy()
        beside[:, -1] += beside[:, :-1] @ values
        whole = np.concatenate([*(np.asarray(rows, np.float64) for rows, *_ in each), beside])
        _, of_law, slopes, _ = map(np.asarray, each[0])
        return Here(whole, [whole], of_law, slopes, max(float(drift) for *_, drift in each))


def _record(batch: Batch, row: int) -> Batch:
    """A record of a batch alone."""
    return jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)[row : row + 1], leaf.dtype), batch)


@eqx.filter_jit
def _evaluated(free: FreeParameters, values: Float[Array, " free"], row: Batch) -> tuple[Array, Array, Array, Array]:
    """What a record adds to `Here`."""
    conditional = any(law.has_conditions() for _, law in laws_inside(free.tree))

    def both(values: Array) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        model = free.build(values)
        missed, drift = row.missed_and_drift(model)
        of_law = margins(model) if conditional else jnp.zeros(0, missed.dtype)
        return (missed, of_law), (missed, of_law, drift[0])

    (jacobian, slopes), (missed, of_law, drift) = jax.jacfwd(both, has_aux=True)(values)
    return jnp.concatenate([jacobian, missed[:, None]], axis=1), of_law, slopes, drift


class Lanes(NamedTuple):
    """Many dampers as one problem; a lane is a set of numbers for one of them."""

    coordinates: Coordinates  # of the free numbers, common to all dampers
    problems: tuple[Problem, ...]  # of the dampers
    evaluators: tuple[Evaluator | ByXla, ...]
    damper: Int[np.ndarray, " lanes"]  # the damper of each lane
    levels: Float[np.ndarray, " dampers"]  # size of the force of each damper, root of the weighted sum of squares
    used: tuple[Bool[np.ndarray, " samples"], ...]  # which samples of each damper count

    @classmethod
    def of(cls, problems: Iterable[Problem]) -> "Lanes":
        """A lane for each damper."""
        problems = tuple(problems)
        free = problems[0].free
        each = evaluators(free, [p.residuals for p in problems]) if free.values.dtype == np.float64 else []
        levels = np.array([problem.level for problem in problems])
        how = (tuple(each or map(ByXla, problems)), np.arange(len(problems)), levels, tuple(p.used for p in problems))
        return cls(problems[0].coordinates, problems, *how)

    def here(self, damper: int, values: Float[np.ndarray, " free"]) -> Here:
        """The problem of a damper at physical values."""
        evaluator = self.evaluators[damper]
        if isinstance(evaluator, ByXla):
            return evaluator.here(values)
        whole = evaluator(values)
        return Here(whole, evaluator.counted(whole), *evaluator.margins(values), 0.0)

    def linearise(
        self, y: Float[np.ndarray, "some free"], lanes: Int[np.ndarray, " some"]
    ) -> tuple[Linearisation, Products]:
        """The problems of some lanes at these coordinates, and the products of their columns.

        The products (J, r)ᵀ(J, r), relative to the squares of the measured forces, are a hundred times less work than
        a triangle of each Jacobian, and their rounding errors matter only for what the records do not determine.
        """
        (values, slopes), dampers = self.physical(y), self.damper[lanes]
        to_columns, each = np.zeros((len(y), *(y.shape[1] + 1,) * 2)), []
        to_columns[:, :-1, :-1], to_columns[:, -1, -1] = slopes, 1.0
        products = np.zeros(to_columns.shape)
        for k, damper in enumerate(dampers):
            here = self.here(damper, values[k])
            products[k] = sum(rows.T @ rows for rows in here.counted) / self.levels[damper] ** 2
            each.append((here.margins, here.slopes @ slopes[k]))
        products = to_columns.transpose(0, 2, 1) @ products @ to_columns
        samples = np.array([float(np.count_nonzero(self.used[damper])) for damper in dampers])
        of_law, by_y = map(np.stack, zip(*each, strict=True))
        return Linearisation(rows_of_products(products), of_law, by_y, samples), products

    def physical(
        self, y: Float[np.ndarray, "some free"]
    ) -> tuple[Float[np.ndarray, "some free"], Float[np.ndarray, "some free free"]]:
        """Physical values at coordinates, and their derivatives by these."""
        host = self.coordinates.on_host()
        if host is None:
            values, slopes = _physical(self.coordinates, jnp.asarray(y))
            return np.asarray(values, np.float64), np.asarray(slopes, np.float64)
        values, slopes = map(np.stack, zip(*map(host, y), strict=True))
        return values, slopes

    def of_records(self, damper: int, signal: Float[np.ndarray, " samples"]) -> list[Float[np.ndarray, " used"]]:
        """A signal like the residuals of a damper at the samples of each record that count."""
        used = self.used[damper]
        return [signal[place][used[place]] for place in self.problems[damper].places]

    def noise(self, damper: int, residual: Float[np.ndarray, " samples"], free: float) -> float:
        """Standard deviation of the weighted residual of a damper, larger where it is correlated.

        Arguments:
            damper: its number.
            residual: weighted.
            free: count of free numbers.
        """
        parts = self.of_records(damper, residual)
        squares = sum(float(part @ part) for part in parts) / max(sum(part.size for part in parts) - free, 1)
        alike = correlation_time(parts)
        return self.problems[damper].noise_factor * float(np.sqrt(squares * (alike if alike > CORRELATED else 1.0)))


@eqx.filter_jit
def _physical(coordinates: Coordinates, y: Float[Array, "lanes free"]) -> tuple[Array, Array]:
    return jax.vmap(coordinates.to_physical)(y), jax.vmap(jax.jacfwd(coordinates.to_physical))(y)


def by_rounds(
    plain: Lanes,
    end: SearchLanes,
    loss: str,
    solve: Callable[[Lanes, Float[np.ndarray, "lanes free"]], SearchLanes],
    depends: Dependence | None = None,
) -> tuple[Lanes, SearchLanes]:
    """Least squares again with new weights, until each damper moves no more; each ends by itself.

    Returns:
        The lanes with the weights of the last round, and the end of each damper.
    """
    free, lanes, levels = end.y.shape[1], plain, plain.levels
    y, products, status, steps = end.y.copy(), end.aux.copy(), list(end.status), end.steps.copy()
    rounds: list[Round] = list(map(Round, plain.problems))
    moving = np.isfinite(products[:, -1, -1]) & (products[:, -1, -1] > ROUNDING**2)
    weighted = loss != "squares" or any(isinstance(part, Priors) for part in plain.problems[0].residuals)
    for _ in range(ROUNDS if weighted else 0):
        noise, values = np.ones(len(y)), plain.physical(y)[0]
        for i in np.flatnonzero(moving):
            residual = lanes.here(int(i), values[i]).whole[:, -1]
            noise[i] = lanes.noise(int(i), residual, free)
            after = rounds[i].after(plain.problems[i], residual, noise[i], loss)
            moving[i], rounds[i] = after is not None, after or rounds[i]
        if not np.any(moving):
            break
        lanes = Lanes.of(one.problem for one in rounds)
        tried = np.flatnonzero(moving | (depends is not None))
        again = solve(lanes._replace(damper=tried), y[tried])
        length = np.sqrt(np.maximum(np.diagonal(again.aux, axis1=1, axis2=2)[:, :-1], 0.0))
        if depends is None:
            moved = np.abs(again.y - y[tried]) * length * levels[tried, None]
            settled = np.all(moved < SETTLED * noise[tried, None], axis=1)
        else:
            moved = np.abs(depends.start(again.y) - depends.start(y)) * length[0]
            settled = np.full(len(y), np.all(moved < SETTLED * np.mean(noise / levels)))
        y[tried], products[tried] = again.y, again.aux
        steps[tried] += again.steps
        for i, ended in zip(tried, again.status, strict=True):
            status[i] = ended
        moving[tried[settled]] = False
    return lanes, SearchLanes(y, products, status, steps)
