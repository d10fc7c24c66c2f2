"""The records of many dampers side by side, compared with one law with other numbers for each damper."""

import dataclasses
import functools
import os
from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jaxdamp._jacobian import value_and_jacobian
from jaxdamp._triangles import rows_of_products
from jaxdamp.bench import BenchRun
from jaxdamp.identify.criteria import Priors
from jaxdamp.identify.model import Model
from jaxdamp.identify.search import condition_margins
from jaxdamp.identify.traces import Batch, record_batches
from jaxdamp.parameters import Coordinates
from jaxdamp.solve import Linearisation


CHUNK_SAMPLES = 32768  # of the records in one call, which should fit into the cache; all calls of a group are alike


Products = Float[np.ndarray, "_lanes _columns _columns"]


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
            lane, record = self._pairs(group, lanes)
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
        found = []
        for group in self.groups:
            parts = [own for _, own in self._chunks(group, y, group.damper, np.arange(group.damper.size))]
            residual, drift = (np.concatenate([own[k] for own in parts]) for k in (3, 4))
            found.append((residual * group.level[:, None], drift))
        return found

    def missed(self, y: Float[np.ndarray, "dampers free"]) -> list[list[Missed]]:
        """What the law misses in every record of each damper, with one lane for each, at the samples that count."""
        found: list[list[Missed]] = [[] for _ in range(y.shape[0])]
        for group, (residual, drift) in zip(self.groups, self._residuals_and_drift(y), strict=True):
            force, weight = np.asarray(group.batch.force), np.asarray(group.batch.weight)
            for k, (i, number) in enumerate(zip(group.damper, np.asarray(group.batch.number), strict=True)):
                used = weight[k] > 0
                own = (force[k][used], residual[k][used], weight[k][used])
                found[i].append(Missed(int(number), *own, float(drift[k])))
        return found

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

    def _pairs(self, group: Group, lanes: Int[np.ndarray, " some"]) -> tuple[np.ndarray, np.ndarray]:
        """Each record of a group with each of these lanes of its damper: the place of the lane, and the record."""
        fits = self.damper[lanes][:, None] == group.damper[None, :]
        which, record = np.nonzero(fits)
        return which, record

    def _chunks(
        self, group: Group, y: np.ndarray, lane: np.ndarray, record: np.ndarray
    ) -> Iterator[tuple[slice, list[np.ndarray]]]:
        """What `_compared` gives for pairs of a lane and a record, in pieces that are computed at the same time."""
        dtype, double = self.coordinates.free.values.dtype, jnp.result_type(float) == jnp.float64
        problem = _flattened((self.coordinates, group.batch))

        def compared(part: slice) -> list[np.ndarray]:
            own, rows = (np.pad(a[part], (0, group.chunk - a[part].size), "edge") for a in (lane, record))
            point, level = y[own].astype(dtype), group.level[rows].astype(dtype)
            with jax.enable_x64(double):  # a thread begins with the precision of the process
                found = _compared(problem.structure, problem.arrays, point, rows, level)
            return [np.asarray(a, np.float64)[: lane[part].size] for a in found]

        parts = group.parts(lane.size)
        each = _workers().map(compared, parts) if len(parts) > 1 else map(compared, parts)
        yield from zip(parts, each, strict=True)


@functools.cache
def _workers() -> ThreadPoolExecutor:
    """Threads for the calls of all fits; starting them takes as long as a call."""
    return ThreadPoolExecutor(os.cpu_count())


@eqx.filter_jit
def _prior_rows(coordinates: Coordinates, y: Any, priors: Priors) -> Array:
    """For each lane the derivatives of the residuals of priors, and these in the last column."""

    def one(y: Array) -> Array:
        def residual(y: Array) -> tuple[Array, Array]:
            missed = priors(coordinates.free.build(coordinates.to_physical(y)))
            return missed, missed

        slopes, missed = jax.jacfwd(residual, has_aux=True)(y)
        return jnp.concatenate([slopes, missed[:, None]], axis=1)

    return jax.vmap(one)(y)


class _Flattened(NamedTuple):
    """A tree taken apart once for many calls; `eqx.filter_jit` would do it in each, which takes as long as the call."""

    structure: Hashable  # and what is no array
    arrays: list[Any]


def _flattened(tree: Any) -> _Flattened:
    dynamic, static = eqx.partition(tree, lambda leaf: isinstance(leaf, jax.Array | np.ndarray))
    (arrays, shape), (others, rest) = jax.tree.flatten(dynamic), jax.tree.flatten(static)
    return _Flattened((shape, rest, tuple(others)), arrays)


@functools.partial(jax.jit, static_argnums=0)
def _compared(
    structure: Any,
    arrays: list[Any],
    y: Any,  # Float[Array, "pairs free"]
    record: Any,  # Int[Array, " pairs"]
    level: Any,  # Float[Array, " pairs"]
) -> tuple[Array, Array, Array, Array, Array]:
    """For each pair of a lane and a record: products of Jacobian and residual, margins and slopes, residual, drift."""
    shape, rest, others = structure
    coordinates, batch = eqx.combine(jax.tree.unflatten(shape, arrays), jax.tree.unflatten(rest, others))
    free = coordinates.free
    fields = ("dt", "stroke", "velocity", "force", "weight", "number", "fixed", "temperature", "cycle")
    rows = {name: jax.tree.map(lambda a: a[record][:, None], getattr(batch, name)) for name in fields}

    def compared(y: Array, row: dict[str, Any], level: Array) -> dict[str, Array]:
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
    batches = record_batches(model, together, [s for own in sigma for s in own], samples_per_cycle, initial_state)
    squares = np.zeros(len(records))
    for batch in batches:
        weighted = np.asarray(batch.force) * np.asarray(batch.weight)
        np.add.at(squares, owner[np.asarray(batch.number)], np.sum(weighted**2, axis=1))
    level = np.sqrt(squares)
    numbers = [owner[np.asarray(batch.number)] for batch in batches]
    return tuple(Group(batch, number, level[number]) for batch, number in zip(batches, numbers, strict=True))
