"""Blocks of a sweep: one program for all of them, and a Zarr store of their results that many processes can fill."""

import functools
import hashlib
from collections.abc import Callable, Mapping
from typing import final

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Dataset
from jaxdamp._warned import warn
from jaxdamp.blocks import AbstractWork, Blocks, BlockStore, Cluster, Variable, block_size, fill
from jaxdamp.sweeps.axes import PARAMETER, AbstractPoints, Grid, Points, as_points
from jaxdamp.sweeps.function import Gradients, PointFunction
from jaxdamp.sweeps.program import quiet
from jaxdamp.sweeps.running import Computation, Runner
from jaxdamp.sweeps.table import Table


PROBES, PROBE = 4, 1024  # pieces of so many computed points, by which two rules are told apart


@final
class BlockProgram(AbstractWork):
    """A function over blocks of points, traced and compiled once in each process.

    Attributes:
        blocks: of the points; `blocks.count` is their number.
    """

    def __init__(self, computation: Computation, size: int | None = None) -> None:
        self._computation, points = computation, computation.points
        self.blocks = Blocks.of(tuple(points.shape.values()), size or block_size(points.count))

    @property
    def function(self) -> PointFunction:
        """What is computed at a point, as it was given."""
        return self._computation.given

    def run(self, number: int) -> Dataset:
        """The results of one block, along the dimension `point`; counted from 0."""
        if not 0 <= number < self.blocks.count:
            _checks.refuse("number", f"be from 0 to {self.blocks.count - 1}", number)
        return self._table(self.blocks.indices(number)).label()

    def compute(self, indices: np.ndarray) -> Mapping[str, np.ndarray]:
        """The results at some points with why they fail, as they are stored."""
        return self._stored(self._table(indices), indices)

    def without_results(self, indices: np.ndarray, reason: str) -> Mapping[str, np.ndarray]:
        """What is stored of points that cannot be computed."""
        table = self._computation.empty(indices)
        table.leave_out(np.full(indices.size, reason, dtype=object))
        return self._stored(table, indices)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name != "_runner"}

    @functools.cached_property
    def _runner(self) -> Runner:
        return self._computation.runner(int(np.prod(self.blocks.box)))

    def _table(self, indices: np.ndarray) -> Table:
        """The results at some points, in increasing order."""
        table = self._computation.empty(indices)
        self._computation.leave_out(table)
        later = self._computation.points.count - int(indices[-1]) - 1
        with quiet():
            for some, results in self._runner.results(indices[~table.done], later):
                table.fill(np.searchsorted(indices, some), results, self._runner.error)
        self._runner.close()
        return table

    def _stored(self, table: Table, indices: np.ndarray) -> dict[str, np.ndarray]:
        reasons = np.array(table.reasons, dtype=object)[table.reason]
        listed = {} if isinstance(self._computation.points, Grid) else self._computation.points.columns(indices)
        return {**table.values, **listed, "failed": table.failed, "reason": reasons}

    @property
    def points(self) -> AbstractPoints:
        """The points."""
        return self._computation.points

    @property
    def scalars(self) -> list[str]:
        """The results that are one number."""
        return [name for name, result in self._computation.traced.results.items() if not result.shape]

    def about(self, name: str) -> dict[str, str]:
        """The unit of a result or an axis."""
        return self._computation.empty(np.arange(1)).about(name)

    def identity(self) -> dict[str, str]:
        """What results belong to, as texts by name."""
        points, traced = self._computation.points, self._computation.traced
        return {
            "axes": ", ".join(f"{name} ({size})" for name, size in points.shape.items())
            + ("" if isinstance(points, Grid) else f": {', '.join(points.names)}"),
            "values of the axes": _digest(points),
            "results": ", ".join(f"{n} {r.dtype}{list(r.shape) or ''}" for n, r in traced.results.items()),
            "function": traced.fingerprint()[:16],
            "jax": jax.__version__,
        }

    def store(self, path: str) -> BlockStore:
        """The store of this sweep, made if it is not there; refused if it is of another sweep."""
        points, traced, about = self._computation.points, self._computation.traced, self.about
        variables = {
            name: Variable(_inner_dims(name, r.shape, set(traced.slopes.values())), r.dtype, about(name))
            for name, r in traced.results.items()
        }
        variables |= {"failed": Variable({}, np.dtype(bool), {}), "reason": Variable({}, str, {})}
        coordinates: dict[str, tuple[str, np.ndarray, dict[str, str]]] = {}
        if isinstance(points, Grid):
            coordinates = {name: (name, values, about(name)) for name, values in points.values.items()}
        else:
            variables |= {name: Variable({}, np.dtype(np.float64), about(name)) for name in points.names}
        store = BlockStore(path, self.blocks, self.identity())
        store.create(tuple(points.shape), variables, coordinates)
        return store

    def dataset(self, store: BlockStore) -> Dataset:
        """The labelled results in a store, read when they are asked for."""
        import xarray

        from jaxdamp.sweeps import accessor  # noqa: F401  (gives datasets their `.jaxdamp`)

        points = self._computation.points
        listed = () if isinstance(points, Grid) else tuple(points.names)
        data = store.dataset((*listed, "failed", "reason"))
        if self._computation.traced.slopes:
            data = data.assign_coords({PARAMETER: (PARAMETER, np.array(points.names))})
        axes = [name for name in points.names if name in data.coords]  # in their order, which a folder does not keep
        results = {name: data.variables[name] for name in self._computation.traced.results}
        others = [str(name) for name in data.coords if name not in axes]
        coordinates = {name: data.variables[name] for name in [*axes, *sorted(others)]}
        return xarray.Dataset(results, coordinates, data.attrs)


@of_known_numbers
def block_program(
    function: PointFunction,
    over: Mapping[str, object] | AbstractPoints,
    *,
    size: int | None = None,
    gradients: Gradients = False,
) -> BlockProgram:
    """A sweep in blocks for an engine of your own: what a worker process makes once and then runs block by block.

    The program can be pickled: it compiles when it first runs in a process. `jaxdamp.sweep` with a `file` that ends in
    `.zarr` does all of it: blocks, store, workers and what happens when one is lost.

    Arguments:
        function: as in `jaxdamp.sweep`.
        over: as in `jaxdamp.sweep`.
        size: largest number of points of a block; if left out, from 256 to 32768 by the number of points.
        gradients: as in `jaxdamp.sweep`.

    Returns:
        The program: `program.blocks.count` blocks, of which `program.run(number)` computes one, as an
        `xarray.Dataset` along `point`.

    >>> program = block_program(lambda p: {"area": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]}, size=2)
    >>> program.blocks.count, program.run(1)["area"].values
    (2, array([6., 8.]))
    """
    return BlockProgram(Computation(function, as_points(over), gradients), size)


def sweep_into_store(
    computation: Computation, path: str, cluster: Cluster, progress: Callable[[int, int], None] | None
) -> Dataset:
    """Compute the blocks that a store lacks, and give all results, read when they are asked for."""
    program = BlockProgram(computation)
    store = program.store(path)
    fill(store, program, cluster, progress, "Sweeping")
    data = program.dataset(store)
    failed = data.attrs["failed_points"]
    if failed:
        warn(
            f"{failed} of {data.attrs['points_done']} points of the sweep failed: what is not finite there is NaN. "
            "`data.failed` marks them, and `data.reason` says why."
        )
    return data


def _digest(points: AbstractPoints) -> str:
    """A hash of the points: of all that are held, or of some pieces of those that are computed."""
    if isinstance(points, Grid | Points):
        pieces = [points.values]
    else:
        begins = np.unique(np.linspace(0, max(points.count - PROBE, 0), PROBES).astype(int))
        pieces = [points.columns(np.arange(i, min(i + PROBE, points.count))) for i in begins]
    digest = hashlib.sha256()
    for columns in pieces:
        for name, values in columns.items():
            digest.update(name.encode() + np.asarray(values, np.float64).tobytes())
    return digest.hexdigest()[:16]


def _inner_dims(name: str, shape: tuple[int, ...], slopes: set[str]) -> dict[str, int]:
    """The names of a result's own axes."""
    if name in slopes:
        return {PARAMETER: shape[0]}
    return {f"{name}_{i}": size for i, size in enumerate(shape)}
