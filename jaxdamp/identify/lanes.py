"""The records of many dampers side by side, compared with one law with other numbers for each damper."""

import dataclasses
import functools
import os
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxdamp._jacobian import value_and_jacobian, with_jacobian
from jaxdamp._triangles import rows_of_products
from jaxdamp.bench import BenchRun
from jaxdamp.identify.criteria import HALF, LOSSES, ROUNDS, SETTLED, Priors, noise_factor
from jaxdamp.identify.dependence import Dependence, Products
from jaxdamp.identify.model import Model
from jaxdamp.identify.noise import CORRELATED, correlation_time
from jaxdamp.identify.problem import ROUNDING
from jaxdamp.identify.search import condition_margins
from jaxdamp.identify.traces import Batch, record_batches
from jaxdamp.parameters import Coordinates
from jaxdamp.solve import Linearisation, SearchLanes


CHUNK_SAMPLES = 32768  # of the records in one call, which should fit into the cache; all calls of a group are alike


class Group(NamedTuple):
    """Records of equal length."""

    batch: Batch
    damper: Int[np.ndarray, " records"]  # that each record belongs to
    level: Float[np.ndarray, " records"]  # of the force of its damper, root of the sum of squares

    @property
    def chunk(self) -> int:
        """Number of records in one call."""
        return max(CHUNK_SAMPLES // self.batch.weight.shape[1], 1)

    def parts(self, count: int) -> list[slice]:
        """Pieces of `count` records for one call each."""
        return [slice(begin, begin + self.chunk) for begin in range(0, count, self.chunk)]


class LanePriors(NamedTuple):
    """Prior knowledge of parameters, common to all dampers, in units of the noise of each."""

    priors: Priors
    noise: Float[np.ndarray, " dampers"]  # standard deviation of a weighted sample


class Missed(NamedTuple):
    """What the law misses in a record."""

    number: int  # of the record among those of all dampers
    force: Float[np.ndarray, " samples"]  # as measured, N
    residual: Float[np.ndarray, " samples"]  # weighted
    weight: Float[np.ndarray, " samples"]
    drift: float  # relative change of the states over the cycle before a record that starts in the periodic solution


class Lanes(NamedTuple):
    """Many dampers as one problem; a lane is a set of numbers for one of them."""

    coordinates: Coordinates  # of the free numbers, common to all dampers
    groups: tuple[Group, ...]  # the records
    damper: Int[np.ndarray, " lanes"]  # the damper of each lane
    priors: LanePriors | None = None  # what is known of the numbers beforehand

    def linearise(
        self, y: Float[np.ndarray, "some free"], lanes: Int[np.ndarray, " some"]
    ) -> tuple[Linearisation, Products]:
        """The problems of some lanes at these coordinates, and the products of their columns.

        The products (J, r)ᵀ(J, r), relative to the squares of the measured forces, are a hundred times less work than
        a triangle of each Jacobian, and their rounding errors matter only for what the records do not determine.
        """
        count, size = y.shape[0], y.shape[1] + 1
        products, margins, slopes = np.zeros((count, size, size)), np.zeros((count, 0)), np.zeros((count, 0, size - 1))
        for number, group in enumerate(self.groups):
            # each record of a group with each of these lanes of its damper
            lane, record = np.nonzero(self.damper[lanes][:, None] == group.damper[None, :])
            for part, (sums, of_law, by_y, *_) in self._chunks(group, y, lane, record):
                if not number and not part.start and of_law.shape[1]:
                    margins, slopes = np.zeros((count, of_law.shape[1])), np.zeros((count, *by_y.shape[1:]))
                np.add.at(products, lane[part], sums)
                margins[lane[part]], slopes[lane[part]] = of_law, by_y
        if self.priors is not None:
            rows = np.asarray(_prior_rows(self.coordinates, jnp.asarray(y), self.priors.priors), np.float64)
            rows = rows * (self.priors.noise / self.levels())[self.damper[lanes], None, None]
            products += rows.transpose(0, 2, 1) @ rows
        samples = self.samples()[self.damper[lanes]]
        return Linearisation(rows_of_products(products), margins, slopes, samples), products

    def residuals(self, y: Float[np.ndarray, "dampers free"]) -> list[Float[np.ndarray, "records time"]]:
        """Weighted residual of every record of each group, with one lane for each damper."""
        return [residual for residual, _ in self._residuals_and_drift(y)]

    def _residuals_and_drift(self, y: Float[np.ndarray, "dampers free"]) -> list[tuple[np.ndarray, np.ndarray]]:
        of_groups = []
        for group in self.groups:
            parts = [outputs for _, outputs in self._chunks(group, y, group.damper, np.arange(group.damper.size))]
            residual, drift = (np.concatenate([outputs[k] for outputs in parts]) for k in (3, 4))
            of_groups.append((residual * group.level[:, None], drift))
        return of_groups

    def missed(self, y: Float[np.ndarray, "dampers free"]) -> list[list[Missed]]:
        """What the law misses in every record of each damper, with one lane for each, at the samples that count."""
        by_damper: list[list[Missed]] = [[] for _ in range(y.shape[0])]
        for group, (residual, drift) in zip(self.groups, self._residuals_and_drift(y), strict=True):
            force, weight = np.asarray(group.batch.force), np.asarray(group.batch.weight)
            for k, (i, number) in enumerate(zip(group.damper, np.asarray(group.batch.number), strict=True)):
                used = weight[k] > 0
                samples = (force[k][used], residual[k][used], weight[k][used])
                by_damper[i].append(Missed(int(number), *samples, float(drift[k])))
        return by_damper

    def levels(self) -> Float[np.ndarray, " dampers"]:
        """Size of the force of each damper, root of the weighted sum of squares."""
        levels = np.ones(1 + max(int(group.damper.max()) for group in self.groups))
        for group in self.groups:
            levels[group.damper] = group.level
        return levels

    def samples(self) -> Float[np.ndarray, " dampers"]:
        """Number of samples of each damper that count."""
        counts = np.zeros(1 + max(int(group.damper.max()) for group in self.groups))
        for group in self.groups:
            np.add.at(counts, group.damper, np.count_nonzero(np.asarray(group.batch.weight) > 0, axis=1))
        return counts

    def _chunks(
        self, group: Group, y: np.ndarray, lane: np.ndarray, record: np.ndarray
    ) -> Iterator[tuple[slice, list[np.ndarray]]]:
        """What `_compared` gives for pairs of a lane and a record, in pieces that are computed at the same time."""
        dtype, double = self.coordinates.free.values.dtype, jnp.result_type(float) == jnp.float64
        problem = _flattened((self.coordinates, group.batch))

        def compared(part: slice) -> list[np.ndarray]:
            places, rows = (np.pad(a[part], (0, group.chunk - a[part].size), "edge") for a in (lane, record))
            point, level = y[places].astype(dtype), group.level[rows].astype(dtype)
            with jax.enable_x64(double):  # a thread begins with the precision of the process
                computed = _compared(problem.structure, problem.arrays, point, rows, level)
            return [np.asarray(a, np.float64)[: lane[part].size] for a in computed]

        parts = group.parts(lane.size)
        each = _workers().map(compared, parts) if len(parts) > 1 else map(compared, parts)
        yield from zip(parts, each, strict=True)


@functools.cache
def _workers() -> ThreadPoolExecutor:
    """Threads for the calls of all fits; starting them takes as long as a call."""
    return ThreadPoolExecutor(os.cpu_count())


@eqx.filter_jit
def _prior_rows(coordinates: Coordinates, y: Array, priors: Priors) -> Array:
    """For each lane the derivatives of the residuals of priors, and these in the last column."""

    def one(y: Array) -> Array:
        missed, slopes = with_jacobian(lambda y: priors(coordinates.free.build(coordinates.to_physical(y))))(y)
        return jnp.concatenate([slopes, missed[:, None]], axis=1)

    return jax.vmap(one)(y)


class _Flattened(NamedTuple):
    """A tree taken apart once for many calls; `eqx.filter_jit` would do it in each, which takes as long as the call."""

    structure: Hashable  # and what is no array
    arrays: list[Array]


def _flattened(tree: PyTree) -> _Flattened:
    dynamic, static = eqx.partition(tree, lambda leaf: isinstance(leaf, jax.Array | np.ndarray))
    (arrays, shape), (others, static_shape) = jax.tree.flatten(dynamic), jax.tree.flatten(static)
    return _Flattened((shape, static_shape, tuple(others)), arrays)


@functools.partial(jax.jit, static_argnums=0)
def _compared(
    structure: Any,
    arrays: list[Array],
    y: Array,  # Float[Array, "pairs free"]
    record: Array,  # Int[Array, " pairs"]
    level: Array,  # Float[Array, " pairs"]
) -> tuple[Array, Array, Array, Array, Array]:
    """For each pair of a lane and a record: products of Jacobian and residual, margins and slopes, residual, drift."""
    shape, static_shape, others = structure
    coordinates, batch = eqx.combine(jax.tree.unflatten(shape, arrays), jax.tree.unflatten(static_shape, others))
    free = coordinates.free
    fields = ("dt", "stroke", "velocity", "force", "weight", "number", "fixed", "temperature", "command", "cycle")
    rows = {name: jax.tree.map(lambda a: a[record][:, None], getattr(batch, name)) for name in fields}

    def compared(y: Array, row: dict[str, PyTree], level: Array) -> dict[str, Array]:
        missed, drift = dataclasses.replace(batch, **row).missed_and_drift(free.build(coordinates.to_physical(y)))
        return {"missed": missed / level, "drift": drift[0]}

    def side_by_side(point: dict[str, Array]) -> dict[str, Array]:
        return jax.vmap(compared)(jnp.stack(list(point.values()), axis=1), rows, level)

    columns = {f"{i:03}": column for i, column in enumerate(y.T)}
    values, slopes = value_and_jacobian(side_by_side, columns, of=["missed"])
    both = jnp.stack([*slopes["missed"].values(), values["missed"]], axis=1)
    of_law, by_y = jax.vmap(lambda y: condition_margins(coordinates, y))(y)
    return both @ both.transpose(0, 2, 1), of_law, by_y, values["missed"], values["drift"]


def grouped_records(
    model: Model,
    records: Sequence[Sequence[BenchRun]],
    sigma: Sequence[Sequence[float]],
    samples_per_cycle: int | None,
    initial_state: str = "warm_up",
) -> tuple[Group, ...]:
    """The records of all dampers in groups of equal length, prepared as `traces.batches` does for one damper."""
    owner = np.repeat(np.arange(len(records)), [len(runs) for runs in records])
    together = [run for runs in records for run in runs]
    batches = record_batches(
        model, together, [s for of_damper in sigma for s in of_damper], samples_per_cycle, initial_state
    )
    squares = np.zeros(len(records))
    for batch in batches:
        weighted = np.asarray(batch.force) * np.asarray(batch.weight)
        np.add.at(squares, owner[np.asarray(batch.number)], np.sum(weighted**2, axis=1))
    level = np.sqrt(squares)
    numbers = [owner[np.asarray(batch.number)] for batch in batches]
    return tuple(Group(batch, number, level[number]) for batch, number in zip(batches, numbers, strict=True))


class Fitted(NamedTuple):
    """The ends of all dampers, one lane each, and the lanes with the weights of the last round."""

    lanes: Lanes  # with the final weights
    end: SearchLanes  # of each damper
    factor: Float[np.ndarray, " dampers"]  # on the noise that weighted residuals show, because of a robust loss
    share_left_out: Float[np.ndarray, " dampers"]  # of its samples, with less than half weight by a robust loss


def noise_level(weighted: list[np.ndarray], free: float | int) -> float:
    """Standard deviation of the weighted residual of a damper, larger where it is correlated."""
    size = sum(residual.size for residual in weighted)
    squares = sum(float(residual @ residual) for residual in weighted) / max(size - free, 1)
    alike = correlation_time(weighted)
    return float(np.sqrt(squares * (alike if alike > CORRELATED else 1.0)))


def by_rounds(
    plain: Lanes,
    end: SearchLanes,
    loss: str,
    solve: Callable[[Lanes, Float[np.ndarray, "lanes free"]], SearchLanes],
    depends: Dependence | None = None,
) -> Fitted:
    """Least squares again with new weights, until each damper moves no more; each ends by itself."""
    free, priors = end.y.shape[1], plain.priors
    y, products, status, steps = end.y.copy(), end.aux.copy(), list(end.status), end.steps.copy()
    weights = _Weights(plain, loss)
    moving = np.isfinite(products[:, -1, -1]) & (products[:, -1, -1] > ROUNDING**2)
    lanes, levels = plain, plain.levels()
    for _ in range(ROUNDS if loss != "squares" or priors is not None else 0):
        noise = weights.updated(lanes.residuals(y), moving, free)
        if not np.any(moving):
            break
        if priors is not None:
            priors = priors._replace(noise=np.where(moving, noise, priors.noise))
        lanes = plain._replace(groups=weights.groups(), priors=priors)
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
    return Fitted(lanes, SearchLanes(y, products, status, steps), weights.factor, weights.share_left_out)


class _Weights:
    """The roots of the weights of all samples by a loss, beside those that are stated."""

    def __init__(self, plain: Lanes, loss: str) -> None:
        self.plain, self.loss, count = plain, loss, len(plain.damper)
        self.roots = [np.ones(np.shape(group.batch.weight)) for group in plain.groups]
        self.factor, self.share_left_out = np.ones(count), np.zeros(count)

    def updated(self, residuals: list[np.ndarray], moving: np.ndarray, free: int) -> Float[np.ndarray, " dampers"]:
        """Take the weights from weighted residuals of the dampers that move; the noise of each, one for the others."""
        noise = np.ones(len(self.factor))
        for i in np.flatnonzero(moving):
            rows = list(self._rows(int(i)))
            weighted = [residuals[g][k][at] for g, k, at in rows]
            noise[i] = self.factor[i] * noise_level(weighted, free)
            together = np.concatenate([w / self.roots[g][k][at] for w, (g, k, at) in zip(weighted, rows, strict=True)])
            spread = 1.4826 * float(np.median(np.abs(together))) if self.loss != "squares" else 1.0
            moving[i] = spread > 0
            if moving[i]:
                weight = LOSSES[self.loss].weight(together / spread)
                self.factor[i] = noise_factor(LOSSES[self.loss], together / spread)
                self.share_left_out[i] = np.mean(weight < HALF)
                ends = np.cumsum([w.size for w in weighted])[:-1]
                for (g, k, at), root in zip(rows, np.split(np.sqrt(weight), ends), strict=True):
                    self.roots[g][k, at] = root
        return noise

    def groups(self) -> tuple[Group, ...]:
        """The records with these weights."""
        pairs = zip(self.plain.groups, self.roots, strict=True)
        return tuple(group._replace(batch=group.batch.reweighted(root.ravel())) for group, root in pairs)

    def _rows(self, damper: int) -> Iterator[tuple[int, int, Bool[np.ndarray, " time"]]]:
        """Group and row of each record of a damper, with its samples that count."""
        for g, group in enumerate(self.plain.groups):
            for k in np.flatnonzero(group.damper == damper):
                yield g, int(k), np.asarray(group.batch.weight[k]) > 0
