"""The problems of many dampers side by side: one law with other numbers for each, and the same free numbers."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._triangles import rows_of_products
from jaxdamp._types import Scalar
from jaxdamp.identify.criteria import NEXT_TO_NOTHING, QUIETER, ROUNDS, SETTLED, Priors, Round
from jaxdamp.identify.dependence import Dependence, Products
from jaxdamp.identify.initial_states import DRIFT
from jaxdamp.identify.noise import CORRELATED, correlation_time, levels_differ, own_levels
from jaxdamp.identify.predicting import fit_percent, score
from jaxdamp.identify.problem import ROUNDING, Problem
from jaxdamp.identify.search import Here, Searches, searches_of
from jaxdamp.identify.traces import Batch, signals
from jaxdamp.parameters import FreeParameters
from jaxdamp.solve import Linearisation, SearchLanes


BLIND = 1e-12  # eigenvalue of JᵀJ, relative to the largest, below which a direction changes no force


class Lanes(NamedTuple):
    """Many dampers as one problem; a lane is a set of numbers for one of them."""

    problems: Sequence[Problem]  # of the dampers
    searches: Sequence[Searches]
    used: Sequence[Bool[np.ndarray, " samples"]]  # which samples of each damper count
    damper: Int[np.ndarray, " lanes"]  # the damper of each lane
    force_noise: float | None = None  # N, where it is known

    @classmethod
    def of(cls, problems: Sequence[Problem], force_noise: float | None = None) -> "Lanes":
        """A lane for each damper."""
        used = [p.used for p in problems]
        return cls(problems, searches_of(problems), used, np.arange(len(problems)), force_noise)

    def linearise(
        self, y: Float[np.ndarray, "some free"], lanes: Int[np.ndarray, " some"]
    ) -> tuple[Linearisation, Products]:
        """The problems of some lanes at these coordinates, and the products of their columns."""
        dampers, each = self.damper[lanes], []
        for at, damper in zip(y, dampers, strict=True):
            here = self.searches[damper].here(at)
            each.append((self.searches[damper].products(here), here.margins, here.slopes))
        products, margins, slopes = map(np.stack, zip(*each, strict=True))
        samples = np.array([float(np.count_nonzero(self.used[damper])) for damper in dampers])
        return Linearisation(rows_of_products(products), margins, slopes, samples), products

    def of_records(self, damper: int, signal: Float[np.ndarray, " samples"]) -> list[Float[np.ndarray, " used"]]:
        """A signal like the residuals of a damper at the samples of each record that count."""
        used = self.used[damper]
        return [signal[place][used[place]] for place in self.problems[damper].places]

    def variances(
        self, damper: int, residual: Float[np.ndarray, " samples"], free: float | int
    ) -> Float[np.ndarray, " records"]:
        """Variance of the weighted residual in each record of a damper, larger where it is correlated unless known.

        It is one for all records, or one for each if the problem weights them so, it is known, or their levels of white
        noise differ by more than chance.
        """
        problem, parts = self.problems[damper], self.of_records(damper, residual)
        if self.force_noise is not None:
            return (self.force_noise / np.array(problem.sigma)) ** 2
        squares, sizes = (np.array(each, float) for each in zip(*((p @ p, p.size) for p in parts), strict=True))
        alike = correlation_time(parts)
        wider = np.full(sizes.shape, alike if alike > CORRELATED else 1.0)
        if problem.robust is not None:
            wider *= [np.max(part, initial=0.0) ** 2 for part in self.of_records(damper, problem.robust.factor)]
        if not (problem.each or own_levels(problem.robust) or (alike <= CORRELATED and levels_differ(problem, parts))):
            return wider * np.sum(squares) / max(np.sum(sizes) - free, 1)
        return wider * squares / np.maximum(sizes * (1.0 - free / np.sum(sizes)), 1)

    def mean(self, damper: int, of_records: Float[np.ndarray, " records"]) -> float:
        """The mean of a number of each record of a damper over its samples."""
        sizes = [np.count_nonzero(self.used[damper][place]) for place in self.problems[damper].places]
        return float(np.average(of_records, weights=sizes))

    def excess(
        self, damper: int, here: Here, variances: Float[np.ndarray, " records"]
    ) -> Float[np.ndarray, "free free"]:
        """The products of columns as in `Searches.products`, with the variances beyond the least as weights.

        Priors count with the mean variance.
        """
        beyond = np.full(len(here.whole), self.mean(damper, variances) - variances.min())
        for place, variance in zip(self.problems[damper].places, variances, strict=True):
            beyond[place] = variance - variances.min()
        noisy = np.sqrt(np.maximum(beyond, 0.0))[:, None] * here.whole[:, :-1] @ here.units
        return noisy.T @ noisy / self.problems[damper].level ** 2


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
    free, lanes, levels = end.y.shape[1], plain, np.array([problem.level for problem in plain.problems])
    rounds = list(map(Round, plain.problems))
    moving = np.isfinite(end.aux[:, -1, -1]) & (end.aux[:, -1, -1] > ROUNDING**2)
    priors = [part for part in plain.problems[0].residuals if isinstance(part, Priors)]
    noise = np.ones(len(end.y))
    for _ in range(ROUNDS if loss != "squares" or priors else 0):
        for i in map(int, np.flatnonzero(moving)):
            residual = lanes.searches[i].here(end.y[i]).whole[:, -1]
            noise[i] = np.sqrt(lanes.mean(i, lanes.variances(i, residual, free)))
            after = rounds[i].after(plain.problems[i], residual, noise[i], loss)
            moving[i], rounds[i] = after is not None, after or rounds[i]
        if not np.any(moving):
            break
        lanes = Lanes.of([one.problem for one in rounds], plain.force_noise)
        tried = np.flatnonzero(moving | (depends is not None))
        again = solve(lanes._replace(damper=tried), end.y[tried])
        length = np.sqrt(np.maximum(np.diagonal(again.aux, axis1=1, axis2=2)[:, :-1], 0.0))
        if depends is None:
            moved = np.abs(again.y - end.y[tried]) * length * levels[tried, None]
            settled = np.all(moved < SETTLED * noise[tried, None], axis=1)
        else:
            moved = np.abs(depends.start(again.y) - depends.start(end.y)) * length[0]
            settled = np.full(len(end.y), np.all(moved < SETTLED * np.mean(noise / levels)))
        end = _went_on(end, tried, again)
        moving[tried[settled]] = False
    if loss != "squares" or not any(part.relative for part in priors):
        return lanes, end
    return _without_their_own_noise(lanes, end, noise, solve, depends)


def _without_their_own_noise(
    lanes: Lanes,
    end: SearchLanes,
    noise_beside: Float[np.ndarray, " dampers"],
    solve: Callable[[Lanes, Float[np.ndarray, "lanes free"]], SearchLanes],
    depends: Dependence | None,
) -> tuple[Lanes, SearchLanes]:
    """Priors beside the noise of fits without them, where that is less: as `criteria.solve_by`, for each damper."""
    free = [
        problem.at_noise(NEXT_TO_NOTHING * noise) for problem, noise in zip(lanes.problems, noise_beside, strict=True)
    ]
    alone, problems = solve(Lanes.of(free, lanes.force_noise), end.y), list(lanes.problems)
    for i, (y, squares) in enumerate(zip(alone.y, alone.aux[:, -1, -1], strict=True)):
        residual = lanes.searches[i].here(y).whole[:, -1]
        level = np.sqrt(lanes.mean(i, lanes.variances(i, residual, y.size)))
        if squares > ROUNDING**2 and level < QUIETER * noise_beside[i]:
            problems[i] = problems[i].at_noise(level)
    weighed = Lanes.of(problems, lanes.force_noise)
    wrong = [one is not before for one, before in zip(problems, lanes.problems, strict=True)]
    tried = np.flatnonzero(np.full(len(wrong), any(wrong)) if depends is not None else wrong)
    if not tried.size:
        return lanes, end
    again = solve(weighed._replace(damper=tried), alone.y[tried])
    return weighed, _went_on(end, tried, again)


def _went_on(end: SearchLanes, lanes: Int[np.ndarray, " some"], again: SearchLanes) -> SearchLanes:
    """The ends of searches of which some went on."""
    y, products, status, steps = end.y.copy(), end.aux.copy(), np.array(end.status, object), end.steps.copy()
    y[lanes], products[lanes], status[lanes] = again.y, again.aux, again.status
    steps[lanes] += again.steps
    return SearchLanes(y, products, list(status), steps)


def judged(lanes: Lanes, end: SearchLanes, depends: Dependence | None) -> dict[str, Any]:
    """Numbers of each damper with standard errors, errors of it and of each of its records, and drift of states.

    All are NaN for a damper on whose records the law ended without finite forces and derivatives.
    """
    count, free = end.y.shape
    finite = np.ones(count, bool)
    percent, rmse, drift = (np.zeros(count) for _ in range(3))
    values, by_record, noise = np.zeros((count, free)), list[np.ndarray](), list[_Noise]()
    for i, problem in enumerate(lanes.problems):
        here = lanes.searches[i].here(end.y[i])
        if not np.all(np.isfinite(here.whole)):
            finite[i], nothing = False, np.zeros((free, free))
            noise.append(_Noise(here.units, nothing, 0.0, nothing))
            by_record.append(np.full(len(problem.runs), np.nan))
            continue
        values[i] = here.values
        variances = lanes.variances(i, here.whole[:, -1], free if depends is None else depends.size / count)
        variances /= problem.level**2
        curved = here  # with rows of the second derivatives of the loss
        if problem.robust is not None:
            curved = here._replace(whole=here.whole * problem.robust.root[:, None])
        whole = lanes.searches[i].products(curved)[:-1, :-1]
        noise.append(_Noise(here.units, whole, float(variances.min()), lanes.excess(i, curved, variances)))
        periodic = [part for part in problem.residuals if isinstance(part, Batch) and part.cycle is not None]
        drift[i] = max(
            [float(_drift(problem.free, jnp.asarray(here.values), batch)) for batch in periodic], default=0.0
        )
        percent[i], rmse[i], each = _errors(lanes, i, here, settled=bool(drift[i] <= DRIFT))
        by_record.append(each)
    errors_of_numbers = _standard_errors(noise, depends)
    for numbers in (values, errors_of_numbers, percent, rmse):
        numbers[~finite] = np.nan
    named = {"values": values, "standard_errors": errors_of_numbers, "fit_percent": percent, "rmse": rmse}
    return named | {"record_rmse": tuple(by_record), "drift": drift}


def _errors(
    lanes: Lanes, damper: int, here: Here, *, settled: bool
) -> tuple[float, float, Float[np.ndarray, " records"]]:
    """Fit percent and RMSE [N] of a damper, and the RMSE [N] of each record, over all samples.

    Where means of samples were fitted, their residuals lack most of the noise, and the samples are predicted, but for
    a motion in which the states do not become periodic.
    """
    problem = lanes.problems[damper]
    averaged = any(dt * run.sampling_rate > 1.5 for dt, run in zip(problem.sample_steps, problem.runs, strict=True))
    if averaged and settled:
        percent, rmse, scores = score(
            problem.free.build(jnp.asarray(here.values)), problem.runs, None, problem.initial_state
        )
        return percent, rmse, np.array([of_record.rmse for of_record in scores])
    columns = here.whole[:, -1], *signals(problem.residuals, "weight", "force")
    missed, weight, force = (lanes.of_records(damper, column) for column in columns)
    errors = [part / root for part, root in zip(missed, weight, strict=True)]
    percent = fit_percent(force, [measured - error for measured, error in zip(force, errors, strict=True)])
    each = np.array([np.mean(np.square(error)) for error in errors])
    return percent, float(np.sqrt(np.average(each, weights=[error.size for error in errors]))), np.sqrt(each)


@compiled_for_loops
def _drift(free: FreeParameters, values: Float[Array, " free"], batch: Batch) -> Scalar:
    """Largest change of the states over the cycle before records that start in the periodic solution."""
    return jnp.max(batch.settled_forces(free.build(values))[1])


class _Noise(NamedTuple):
    """What the standard errors of a damper follow from, at its end."""

    units: Float[np.ndarray, "free free"]  # derivatives of the numbers by the coordinates
    products: Float[np.ndarray, "free free"]  # of the columns of the Jacobian by the coordinates
    least: float  # variance of a record, relative to the level of the damper
    excess: Float[np.ndarray, "free free"]  # the products, weighted by the variances beyond the least

    def beyond(self, least: float) -> Float[np.ndarray, "free free"]:
        """The products, weighted by the variances beyond a lower one."""
        return self.excess + (self.least - least) * self.products


def _standard_errors(noise: Sequence[_Noise], depends: Dependence | None) -> Float[np.ndarray, "dampers free"]:
    """Standard errors of the numbers of each damper: (JᵀJ)⁻¹ Jᵀ Σ J (JᵀJ)⁻¹ with the variance Σ of each record."""
    if depends is None:
        each = [_covariance(one.products, one.least, one.excess) for one in noise]
    else:
        least, whole, beyond = min(one.least for one in noise), *np.zeros((2, depends.size, depends.size))
        for i, one in enumerate(noise):
            columns, rows = depends.rows(i)
            whole[np.ix_(columns, columns)] += rows.T @ one.products @ rows
            beyond[np.ix_(columns, columns)] += rows.T @ one.beyond(least) @ rows
        each = [_covariance(whole, least, beyond)] * len(noise)
    free = len(noise[0].units)
    errors = np.zeros((len(noise), free))
    for i, (covariance, lost) in enumerate(each):
        columns, rows = (np.arange(free), np.eye(free)) if depends is None else depends.rows(i)
        to_values = noise[i].units @ rows
        variances = np.diag(to_values @ covariance[np.ix_(columns, columns)] @ to_values.T)
        undetermined = np.any(lost[columns] & (to_values != 0), axis=1)
        errors[i] = np.where(undetermined, np.inf, np.sqrt(np.maximum(variances, 0.0)))
    return errors


def _covariance(
    products: Float[np.ndarray, "free free"], least: float, beyond: Float[np.ndarray, "free free"]
) -> tuple[Float[np.ndarray, "free free"], Bool[np.ndarray, " free"]]:
    """The covariance of coordinates, and which take part in directions that change no force.

    By the products of the columns of the Jacobian, the variance that every sample has, and the products weighted by
    the variances beyond it.
    """
    norms = np.sqrt(np.diag(products))
    scale = np.where(norms > 0, norms, 1.0)
    squares, directions = np.linalg.eigh(products / np.outer(scale, scale))
    seen = squares > BLIND * squares[-1]
    inverse = (directions[:, seen] / squares[seen]) @ directions[:, seen].T / np.outer(scale, scale)
    lost = np.sum(directions[:, seen] ** 2, axis=1) < 1.0 - 1e-3
    return least * inverse + inverse @ beyond @ inverse, lost
