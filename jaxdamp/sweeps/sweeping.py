"""`sweep`: one function at many points."""

import os
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from jaxdamp import _checks
from jaxdamp._progress import Progress
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Dataset
from jaxdamp.blocks import Cluster
from jaxdamp.sweeps.axes import AbstractPoints, as_points
from jaxdamp.sweeps.block_program import is_store, sweep_into_store
from jaxdamp.sweeps.file import SweepFile
from jaxdamp.sweeps.function import Gradients, PointFunction
from jaxdamp.sweeps.program import quiet
from jaxdamp.sweeps.running import COMPILED, Computation, tell
from jaxdamp.sweeps.table import extent


@of_known_numbers
def sweep(
    function: PointFunction,
    over: Mapping[str, object] | AbstractPoints,
    *,
    chunk: int | None = None,
    devices: int | Sequence[object] | None = None,
    gradients: Gradients = False,
    file: str | os.PathLike[str] | None = None,
    cluster: Cluster = None,
    progress: Callable[[int, int], None] | None = None,
) -> Dataset:
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
            points that are computed side by side on a CPU; `derivatives`, the modes that pass; `side_by_side()`, a form
            that is compiled in its place; `out_of_domain(columns)`, a text for each of many points, empty for those
            that can be computed.
        over: values for each axis, whose every combination is taken (the last axis runs fastest); or
            `jaxdamp.sweeps.points`, `random` or `sobol`. The function gets them as floating numbers.
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
        progress: called with the number of points done and of all points; a line in the terminal if it is left out.

    Returns:
        The results by name with the axes as dimensions (for a list, along `point`). Of a `Ride`, `attrs["loop"]` says
        by what its loop was compiled at the end: XLA, or the C compiler where a long sweep found that to be faster; the
        numbers are the same to rounding. From a `.zarr` store they are read when they are asked for, and
        `attrs["points_done"]` counts those that are done; each process chooses its loop, which is not noted.

    Raises:
        ValueError: axes that are no numbers, a function that does not know an axis or returns no named numbers, no
            point inside the function's domain, a file of another sweep.

    >>> data = sweep(lambda p: {"product": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0, 5.0]})
    >>> float(data["product"].sel(a=2.0, b=5.0))
    10.0
    """
    if not callable(function):
        remedy = "The call is `sweep(function, over)`, such as `sweep(Ride(car, road), {'damper.rate': [1e3, 2e3]})`."
        _checks.refuse("function", "be a function of a point", _checks.described(function), remedy)
    if gradients not in (False, True, "forward", "reverse"):
        _checks.refuse("gradients", "be False, True, 'forward' or 'reverse'", repr(gradients))
    computation = Computation(function, as_points(over), gradients, chunk, devices)
    if is_store(file):
        return sweep_into_store(computation, str(file), cluster, progress)
    if cluster is not None:
        remedy = "Write `file='name.zarr'`, in a folder that all workers reach."
        _checks.refuse("file", "end in '.zarr' where a cluster computes, so that workers can write it", file, remedy)
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
