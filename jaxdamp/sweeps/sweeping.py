"""`sweep`: one function at many points."""

import json
import os
import time
import zlib
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import TypedDict, Unpack, final, overload

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress, tell
from jaxdamp._settings import with_defaults
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import DataArray, Dataset
from jaxdamp._warned import warn
from jaxdamp._writing import whole
from jaxdamp.blocks import Cluster
from jaxdamp.sweeps.axes import AbstractPoints, as_points
from jaxdamp.sweeps.block_program import BlockProgram, sweep_into_store
from jaxdamp.sweeps.function import Gradients, PointFunction
from jaxdamp.sweeps.program import quiet
from jaxdamp.sweeps.running import COMPILED, Computation
from jaxdamp.sweeps.summary import Summary, SweepSummary, summarise
from jaxdamp.sweeps.table import Table, extent


INTERVAL = 10.0  # s between two writings
LARGEST = 2**31 - 1  # bytes of one variable in a classic netCDF file
MARK, AXES = "jaxdamp_sweep", "axes"  # attributes that hold the fingerprint of the function, and the axes in order
CHECKSUMS = "checksums"  # attribute: of each block of points
BLOCK = 4096  # points


class SweepSettings(TypedDict, total=False):
    """The keywords of `sweep` beside function, points and `summary`.

    Arguments:
        chunk: points computed side by side on one device; chosen to fit into the memory if left out.
        devices: how many devices (of each process), or which; all of them if left out.
        gradients: also the exact derivative of each scalar result `r` by each axis, as `d_r` along the dimension
            `parameter`. True chooses between `"forward"`, for few axes, and `"reverse"`, for many, which needs more
            memory.
        file: for the results; the same sweep goes on from it after an interruption. A netCDF file (`.nc`) is written
            every ten seconds or so. A Zarr store (`.zarr`, a folder) is written block by block, and of all points only
            those of a block are held in memory: for sweeps of any size.
        cluster: who computes the blocks of a `.zarr` store, all of this machine's devices if left out: a Dask `Client`,
            an executor of `concurrent.futures`, or a part of an array job such as "3/16", which leaves the other parts
            to calls in other processes.
        progress: called with the number of points done and of all points, of this part in an array job; a line in the
            terminal if it is left out.
    """

    chunk: int | None
    devices: int | Sequence[object] | None
    gradients: Gradients
    file: str | os.PathLike[str] | None
    cluster: Cluster
    progress: Callable[[int, int], None] | None


DEFAULTS: SweepSettings = {
    "chunk": None, "devices": None, "gradients": False, "file": None, "cluster": None, "progress": None
}  # fmt: skip
Over = Mapping[str, object] | AbstractPoints


@overload
def sweep(
    function: PointFunction, over: Over, *, summary: None = None, **settings: Unpack[SweepSettings]
) -> Dataset: ...
@overload
def sweep(
    function: PointFunction, over: Over, *, summary: Summary, **settings: Unpack[SweepSettings]
) -> SweepSummary: ...
@of_known_numbers
@with_defaults(DEFAULTS)
def sweep(
    function: PointFunction,
    over: Mapping[str, object] | AbstractPoints,
    *,
    summary: Summary | None = None,
    **settings: Unpack[SweepSettings],
) -> "Dataset | SweepSummary":
    """Compute a function at every point of a grid, a list or a sample: all cores, or all GPUs, many points at a time.

    A point at which a result is not finite, or at which the function raises while it runs (`equinox.error_if`), does
    not stop the sweep: what is not finite becomes NaN, and a warning at the end says how many points failed, where and
    why. The coordinate `failed` marks them, `reason` says why, `attrs["failed_points"]` counts them. Points that the
    function itself calls out of its domain, as a `Ride` does with a negative mass, are not computed, and fail too.

    A processor counts as one device until `jaxdamp.configure()` is called, before anything is computed. Several
    processes and machines share a sweep through `file` and `cluster`.

    Arguments:
        function: a pure JAX function from a point, a mapping from the names of the axes to scalars, to results by name:
            numbers, or arrays of fixed shape. An equinox module that is called so is compiled once for all values of
            its arrays; arrays that a plain function closes over are compiled in. It may say more of itself
            (`sweeps.SweepFunction`): `units` of results and axes, which label the results; `lanes`, the number of
            points that are computed side by side on a CPU; `sequential_points`, up to how many it has sooner one after
            the other; `derivatives`, the modes that pass; `reaching(columns)` and `side_by_side()`, forms that are
            compiled in its place, for these values of the axes and for many points; `out_of_domain(columns)`, a text
            for each of many points, empty for those that can be computed.
        over: values for each axis, whose every combination is taken (the last axis runs fastest); or
            `jaxdamp.sweeps.points`, `random` or `sobol`. The function gets them as floating numbers.
        summary: what is kept instead of all results: statistics, and the histograms, best points and Pareto set that a
            `sweeps.Summary` names, gathered block by block, so that 1e9 points take the memory of a block. A `.zarr`
            store then has one text for each block.
        settings: keywords, all optional: `chunk` and `devices` say where points are computed, `gradients` what else,
            `file` and `cluster` how a sweep goes on and is shared, `progress` who is told (see `SweepSettings`).

    Returns:
        The results by name with the axes as dimensions (for a list, along `point`). Of a `Ride`, `attrs["loop"]` says
        by what its loop was compiled at the end: XLA, which drives few cars one after the other, or the C compiler; the
        numbers are the same to rounding. From a `.zarr` store they are read when they are asked for, and
        `attrs["points_done"]` counts those that are done; each process chooses its loop, which is not noted. With
        `summary`, a `SweepSummary` of the points that are done.

    Raises:
        ValueError: axes that are no numbers, a function that does not know an axis or returns no named numbers, no
            point inside the function's domain, a file of another sweep.

    >>> data = sweep(lambda p: {"product": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0, 5.0]})
    >>> float(data["product"].sel(a=2.0, b=5.0))
    10.0
    """
    gradients, file = settings["gradients"], settings["file"]
    cluster, progress = settings["cluster"], settings["progress"]
    _check_call(function, gradients, file, by_block=cluster is not None or (file is not None and summary is not None))
    computation = Computation(function, as_points(over), gradients, settings["chunk"], settings["devices"])
    if summary is not None:
        return summarise(BlockProgram(computation), summary, None if file is None else str(file), cluster, progress)
    if file is not None and Path(file).suffix == ".zarr":
        return sweep_into_store(computation, str(file), cluster, progress)
    table, count = computation.empty(), computation.points.count
    stored = None if file is None else SweepFile(file, table)
    if stored is not None:
        stored.resume()
    if computation.leave_out(table):
        must = f"hold a point that can be computed ({'; '.join(table.reasons[1:])})"
        where = extent(table.points.columns(np.arange(count)))
        _checks.refuse("over", must, f"{where}, all outside", "Sweep over values that it can have.")
    left = np.flatnonzero(~table.done)
    loop = COMPILED
    if left.size:
        runner = computation.runner(len(left))
        with Progress("Sweeping") as shown, quiet():
            try:
                for indices, results in runner.results(left):
                    table.fill(indices, results, runner.error)
                    if stored is not None:
                        stored.save()
                    tell(progress, shown, int(table.done.sum()), count, runner.rate)
            finally:
                if stored is not None:
                    stored.save(now=True)
            runner.close()
        loop = computation.loop(runner)
    table.warn()
    data = table.label()
    return data.assign_attrs(loop=loop) if computation.can_be_printed else data


def _check_call(function: object, gradients: object, file: str | os.PathLike[str] | None, *, by_block: bool) -> None:
    """Refuse what is no function, unknown derivatives, and a file that cannot be written block by block."""
    if not callable(function):
        remedy = "The call is `sweep(function, over)`, such as `sweep(Ride(car, road), {'damper.rate': [1e3, 2e3]})`."
        _checks.refuse("function", "be a function of a point", _checks.described(function), remedy)
    if gradients not in (False, True, "forward", "reverse"):
        _checks.refuse("gradients", "be False, True, 'forward' or 'reverse'", repr(gradients))
    if by_block and (file is None or Path(file).suffix != ".zarr"):
        remedy = "Write `file='name.zarr'`, in a folder that all workers reach."
        _checks.refuse("file", "end in '.zarr', so that it can be written block by block", file, remedy)


@final
class SweepFile:
    """A netCDF file (classic format, 64-bit offsets) that is at any time the labelled results of what is done."""

    def __init__(self, path: str | os.PathLike[str], table: Table) -> None:
        self.path, self._table = Path(path).expanduser(), table
        if self.path.suffix != ".nc":
            _checks.refuse("file", "end in '.nc', for netCDF, or '.zarr', for Zarr", repr(str(path)))
        if not self.path.parent.is_dir():
            _checks.refuse("file", "lie in a folder that exists", self.path, "Make the folder first.")
        large = [name for name, values in table.values.items() if values.nbytes > LARGEST]
        if large:
            remedy = "Sweep in several parts, each into its own file."
            _checks.refuse("file", "hold at most 2 GiB of each result", f"too small for {', '.join(large)}", remedy)
        self._fingerprint = table.traced.fingerprint()
        self._next, self._pause = time.monotonic() + INTERVAL, INTERVAL

    def resume(self) -> None:
        """Fill the table with what the file holds."""
        import xarray  # noqa: F401 so that no interrupt can hit it while it loads

        if self.path.exists():
            self._load()

    def _load(self) -> None:
        import xarray

        try:
            stored = xarray.load_dataset(self.path, engine="scipy")
        except Exception as error:
            remedy = "Choose another name, or delete the file."
            raise ValueError(f"Argument `file`: {self.path} cannot be read as a sweep ({error}). {remedy}") from error
        differences = self._differences(stored)
        if differences:
            raise ValueError(
                f"Argument `file`: {self.path} holds another sweep: {'; '.join(differences)}. Choose another name, or "
                "delete the file to begin anew."
            )
        table = self._table
        for name, values in table.values.items():
            table.values[name] = np.array(stored[name].values, values.dtype).reshape(values.shape)
        table.done = np.array(stored["done"].values, bool).ravel()
        reasons = np.array(stored["reason"].values, str).ravel()
        for reason in dict.fromkeys(reasons[reasons != ""]):
            table.give_reasons(np.flatnonzero(reasons == reason), str(reason))
        self._drop_damaged(json.loads(stored.attrs[CHECKSUMS]))

    def _drop_damaged(self, checksums: list[int]) -> None:
        """Points in blocks of the file that are not as they were written count as not done, and are computed anew."""
        table = self._table
        pairs = enumerate(zip(checksums, _checksums(table), strict=True))
        damaged = np.isin(np.arange(len(table.done)) // BLOCK, [i for i, (before, now) in pairs if before != now])
        if not damaged.any():
            return
        for values in table.values.values():
            values[damaged] = np.nan
        table.done[damaged], table.reason[damaged] = False, 0
        warn(
            f"{np.count_nonzero(damaged)} of {len(damaged)} points in {self.path} were damaged on the disk, and are "
            "computed anew."
        )

    def _differences(self, stored: Dataset) -> list[str]:
        """What keeps the file from being a part of this sweep, in words."""
        if MARK not in stored.attrs or "done" not in stored:
            return ["it was not written by `jaxdamp.sweep`"]
        if "reason" not in stored.coords:
            return ["an older jaxdamp wrote it, which did not note why points fail"]
        if CHECKSUMS not in stored.attrs:
            return ["an older jaxdamp wrote it, without the sums by which damage is seen"]
        new, axes = self._table.label(), json.loads(stored.attrs[AXES])
        if stored["failed"].dims != new["failed"].dims or axes != self._table.points.names:
            names, before = ", ".join(map(repr, self._table.points.names)), ", ".join(map(repr, axes))
            over = f"along {', '.join(map(repr, stored['failed'].dims))}"
            return [f"its axes are {before} {over}, not {names}"]
        differences = [text for name in axes if (text := _other_axis(name, stored[name].values, new[name].values))]
        results = set(stored.data_vars) - {"done"}
        if results != set(new.data_vars):
            names = [", ".join(map(repr, sorted(map(str, each)))) for each in (results, new.data_vars)]
            return [*differences, f"its results are {names[0]}, not {names[1]}"]
        differences += [text for name in new.data_vars if (text := _other_result(name, stored[name], new[name]))]
        if not differences and stored.attrs[MARK] != self._fingerprint:
            differences.append(_other_function(stored.attrs.get("jax_version")))
        return differences

    def save(self, *, now: bool = False) -> None:
        """Write what is done if it is time, whole or not at all; what cannot be written stops no sweep."""
        start = time.monotonic()
        if start < self._next and not now:
            return
        try:
            self._write()
        except OSError as error:
            warn(f"The sweep could not be written to {self.path}: {error}")
        taken = time.monotonic() - start
        self._pause = max(INTERVAL, 20 * taken)
        self._next = time.monotonic() + self._pause

    def _write(self) -> None:
        data, done = self._table.label(), self._table.done
        data["done"] = (data["failed"].dims, done.reshape(data["failed"].shape).astype(np.int8))
        data.attrs |= {
            MARK: self._fingerprint,
            AXES: json.dumps(self._table.points.names),
            "jax_version": jax.__version__,
            CHECKSUMS: json.dumps(_checksums(self._table)),
        }
        with whole(self.path) as draft:
            data.to_netcdf(draft, engine="scipy", format="NETCDF3_64BIT")


def _other_function(version: str | None) -> str:
    """In what the function differs, which that version of JAX has traced."""
    other = f", which JAX {version} traced, and now JAX {jax.__version__}" if version != jax.__version__ else ""
    return f"the function computes something else, or from other numbers{other}"


def _other_axis(name: str, stored: np.ndarray, new: np.ndarray) -> str:
    """In what the values of an axis differ; empty if they do not."""
    if np.array_equal(stored, new):
        return ""
    old, now = (f"{len(v)} values from {v.min():.6g} to {v.max():.6g}" for v in (stored, new))
    return f"the axis {name!r} has other values ({old}; now {now})"


def _other_result(name: Hashable, stored: DataArray, new: DataArray) -> str:
    """In what the type or shape of a result differ; empty if they do not."""
    if stored.dtype.newbyteorder("=") == new.dtype and stored.shape == new.shape:
        return ""
    old, now = (f"{v.dtype.newbyteorder('=')} {v.shape}" for v in (stored, new))
    return f"{name!r} is {old} there, now {now}"


def _checksums(table: Table) -> list[int]:
    """A sum over the results, states and reasons of each block of points."""
    count = len(table.done)
    texts = np.array(table.reasons, dtype=object)[table.reason]
    sums = []
    for start in range(0, count, BLOCK):
        part = slice(start, start + BLOCK)
        total = zlib.crc32("\n".join(texts[part]).encode())
        results = [table.values[name] for name in sorted(table.values)]  # other processes send them in another order
        for values in (*results, table.done.astype(bool)):
            total = zlib.crc32(np.ascontiguousarray(values[part]).tobytes(), total)
        sums.append(total)
    return sums
