"""Sweeps in blocks into a Zarr store: the numbers of `sweep`, whoever computes them and whatever interrupts."""

import errno
import pickle
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import xarray
import zarr

import jaxdamp
from jaxdamp.blocks import Blocks, running
from jaxdamp.sweeps import block_program, points, random, sobol
from jaxdamp.sweeps.block_program import BlockProgram

from .cases import AXES, decay, failing


COUNT = 600  # points: three blocks of at most 256


def product(point):
    return {"y": point["a"] * point["b"]}


def at(indices):
    return {"a": 1.0 + indices, "b": 0.5 * indices}


def plain(data):
    """As a sweep in memory labels it."""
    data = data.load()
    data.attrs.pop("points_done")
    return data.assign_coords(reason=data["reason"].astype(object))


@pytest.mark.parametrize("shape", [(7,), (3, 4), (5, 1, 7), (300, 3), (2, 1000)])
@pytest.mark.parametrize("size", [1, 6, 256])
def test_blocks_cover_every_point_once_in_order(shape, size):
    blocks = Blocks.of(shape, size)
    parts = [blocks.indices(i) for i in range(blocks.count)]
    assert max(map(len, parts)) <= size and all(np.all(np.diff(part) > 0) for part in parts)
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(np.prod(shape)))


@pytest.mark.parametrize("sample", [random, sobol])
def test_samples_are_the_same_piece_by_piece(sample):
    drawn = sample({"a": (1.0, 2.0), "b": (1.0, 100.0)}, 300, seed=5, log="b")
    for some in (np.arange(64, 192), np.array([3, 299])):
        for name, column in drawn.columns(some).items():
            np.testing.assert_array_equal(column, drawn.values[name][some])


@pytest.mark.parametrize("over", [AXES, points(at, COUNT), random({"a": (0.0, 1.0), "b": (0.0, 1.0)}, COUNT)])
def test_a_store_holds_what_a_sweep_gives(tmp_path, over):
    expected = jaxdamp.sweep(decay(), over, gradients=True)
    data = jaxdamp.sweep(decay(), over, gradients=True, file=tmp_path / "s.zarr")
    assert data.attrs["points_done"] == expected["failed"].size
    assert [name for name in data.coords if name in AXES] == [*AXES]  # a folder does not keep their order
    xarray.testing.assert_identical(plain(data), expected)


def test_points_that_fail_have_their_reasons_in_the_store(tmp_path):
    over = {"a": np.linspace(0.0, 3.0, 7), "b": AXES["b"]}
    with pytest.warns(UserWarning, match="8 of 35 points"):
        data = jaxdamp.sweep(failing, over, file=tmp_path / "s.zarr")
    with pytest.warns(UserWarning, match="8 of 35 points"):
        xarray.testing.assert_identical(plain(data), jaxdamp.sweep(failing, over))


class _Counted:
    """Counts the points that are computed, and stops before a block."""

    def __init__(self, monkeypatch, at: float):
        self.points, self.blocks, self.at, compute = 0, 0, at, BlockProgram.compute

        def counted(work, indices):
            if self.blocks == self.at:
                raise KeyboardInterrupt
            self.points, self.blocks = self.points + indices.size, self.blocks + 1
            return compute(work, indices)

        monkeypatch.setattr(BlockProgram, "compute", counted)


def test_a_store_goes_on_and_a_damaged_block_is_computed_anew(tmp_path, monkeypatch):
    file, over = tmp_path / "s.zarr", points(at, COUNT)
    counted = _Counted(monkeypatch, at=1)
    with pytest.raises(KeyboardInterrupt):
        jaxdamp.sweep(product, over, file=file)
    assert counted.points > 0
    counted.at = np.inf
    data = jaxdamp.sweep(product, over, file=file)
    assert counted.points == COUNT
    expected = data.load()
    chunk = file / "y" / "c" / "1"
    chunk.write_bytes(bytes([chunk.read_bytes()[0] ^ 1]) + chunk.read_bytes()[1:])
    with pytest.warns(UserWarning, match="1 blocks .* damaged"):
        again = jaxdamp.sweep(product, over, file=file)
    assert COUNT < counted.points <= COUNT + 256
    xarray.testing.assert_identical(again.load(), expected)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.zarr"]


def test_a_block_that_lost_a_part_is_computed_anew(tmp_path, monkeypatch):
    """Of the last block, which is smaller; and what failed before does not stay marked."""
    file, over = tmp_path / "s.zarr", points(at, COUNT + 1)
    expected = jaxdamp.sweep(product, over, file=file).load()
    for name in ("y", "a"):
        max((file / name / "c").iterdir(), key=lambda path: int(path.name)).unlink()
        with pytest.warns(UserWarning, match="1 blocks .* damaged"):
            again = jaxdamp.sweep(product, over, file=file)
        xarray.testing.assert_identical(again.load(), expected)
    mark = file / "done" / "c" / "0"
    mark.write_bytes(mark.read_bytes()[:-1])
    with monkeypatch.context() as patched, pytest.warns(UserWarning):
        patched.setattr(BlockProgram, "compute", lambda work, indices: work.without_results(indices, "tried"))
        assert jaxdamp.sweep(product, over, file=file)["failed"].sum() == 201
    (file / "y" / "c" / "0").unlink()
    with pytest.warns(UserWarning, match="1 blocks .* damaged"):
        again = jaxdamp.sweep(product, over, file=file)
    xarray.testing.assert_identical(again.load(), expected)


def test_a_disk_that_is_full_is_named_and_nothing_is_lost(tmp_path, monkeypatch):
    file, over = tmp_path / "s.zarr", points(at, COUNT)
    write = zarr.Array.__setitem__

    def full(array, selection, values):
        if array.name == "/y" and selection[0].start == 200:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(array, selection, values)

    with monkeypatch.context() as patched, pytest.raises(OSError, match=r"Block 1 .*s\.zarr: No space left on device"):
        patched.setattr(zarr.Array, "__setitem__", full)
        jaxdamp.sweep(product, over, file=file)
    data = jaxdamp.sweep(product, over, file=file)
    np.testing.assert_array_equal(data["y"], 0.5 * (1.0 + np.arange(COUNT)) * np.arange(COUNT))


def test_the_names_of_marks_are_free_for_axes_and_results(tmp_path):
    def named(point):
        return {"failed_points": point["block"] + 1.0}

    data = jaxdamp.sweep(named, {"block": [1.0, 2.0, 3.0]}, file=tmp_path / "s.zarr")
    np.testing.assert_array_equal(data["failed_points"], [2.0, 3.0, 4.0])


def test_the_store_of_another_sweep_is_refused(tmp_path):
    file = tmp_path / "s.zarr"
    jaxdamp.sweep(product, {"a": [1.0, 2.0], "b": [3.0]}, file=file)
    for function, over, difference in (
        (product, {"a": [1.0, 2.5], "b": [3.0]}, "values of the axes"),
        (product, {"b": [3.0], "a": [1.0, 2.0]}, r"axes is a \(2\), b \(1\) there, b \(1\), a \(2\) now"),
        (lambda p: {"y": p["a"] * p["b"] + 1.0}, {"a": [1.0, 2.0], "b": [3.0]}, "function is"),
        (lambda p: {"z": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0]}, "results is y float"),
    ):
        with pytest.raises(ValueError, match=difference):
            jaxdamp.sweep(function, over, file=file)
    (tmp_path / "other.zarr").mkdir()
    with pytest.raises(ValueError, match="no store of jaxdamp"):
        jaxdamp.sweep(product, AXES, file=tmp_path / "other.zarr")


def test_parts_of_an_array_job_fill_one_store(tmp_path):
    file, over = tmp_path / "s.zarr", points(at, COUNT)
    done = [jaxdamp.sweep(product, over, file=file, cluster=f"{k}/2").attrs["points_done"] for k in (1, 2)]
    assert done[0] < COUNT == done[1]
    for wrong in ("0/2", "3/2", "two"):
        with pytest.raises(ValueError, match="part such as '1/4'"):
            jaxdamp.sweep(product, over, file=file, cluster=wrong)


class KilledWorker(Exception):
    """As Dask calls it."""


class _Deadly(Executor):
    """Workers, or a child process, that end at one point."""

    def __init__(self, number, ended):
        self.number, self.ended = number, ended

    def submit(self, fn, *args, **_):
        future = Future()
        job, indices = args[0], args[1].blocks.indices(args[2]) if fn is running._block else args[1]
        assert pickle.loads(job.pickled).blocks.count == 3  # it travels
        if self.number in indices:
            future.set_exception(self.ended())
        else:
            future.set_result(fn(*args))
        return future


def test_an_executor_computes_the_blocks_and_a_point_that_ends_its_worker_is_left_out(tmp_path, monkeypatch):
    over = points(at, COUNT)
    expected = jaxdamp.sweep(product, over)
    with ThreadPoolExecutor(2) as pool:
        data = jaxdamp.sweep(product, over, file=tmp_path / "pool.zarr", cluster=pool)
    xarray.testing.assert_identical(plain(data), expected)
    monkeypatch.setattr(running, "_child", lambda: _Deadly(301, BrokenExecutor))
    with pytest.warns(UserWarning, match="1 of 600 points"):
        data = plain(jaxdamp.sweep(product, over, file=tmp_path / "d.zarr", cluster=_Deadly(301, KilledWorker)))
    np.testing.assert_array_equal(np.flatnonzero(data["failed"]), [301])
    assert data["reason"].values[301] == "it ended the process that computed it"
    good = np.arange(COUNT) != 301
    np.testing.assert_array_equal(data["y"].values[good], expected["y"].values[good])


class _Gone(Executor):
    """A cluster that has lost its workers after it was asked for the first blocks."""

    def __init__(self):
        self.asked = 0

    def get_executor(self, **_):
        return self

    def nthreads(self):
        return {} if self.asked else {"a": 1}

    def submit(self, *_, **__):
        self.asked += 1
        return Future()


def test_a_cluster_without_workers_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "LOOK", 0.01)
    monkeypatch.setattr(running, "NO_WORKER", 0.05)
    with pytest.raises(RuntimeError, match=r"All workers .* blocks 0, 1, 2 were asked for"):
        jaxdamp.sweep(product, points(at, COUNT), file=tmp_path / "s.zarr", cluster=_Gone())


class _Lost(_Gone):
    """A client that is closed after some blocks, or whose tasks somebody cancels."""

    def __init__(self, closed):
        super().__init__()
        self.closed = closed

    def nthreads(self):
        if self.closed and self.asked:
            raise AttributeError("'NoneType' object has no attribute 'ncores'")
        return {"a": 1}

    def submit(self, fn, *args, **_):
        self.asked, future = self.asked + 1, Future()
        if self.asked == 1:
            future.set_result(fn(*args))
        elif not self.closed:
            future.cancel()
            future.set_running_or_notify_cancel()
        return future


@pytest.mark.parametrize(
    ("closed", "message"),
    [(True, "The client is closed, or its scheduler"), (False, r"Block \d was cancelled: .*s\.zarr")],
)
def test_a_client_that_ends_is_named_and_what_is_done_stays(tmp_path, monkeypatch, closed, message):
    monkeypatch.setattr(running, "LOOK", 0.0)
    file, over = tmp_path / "s.zarr", points(at, COUNT)
    with pytest.raises(RuntimeError, match=message):
        jaxdamp.sweep(product, over, file=file, cluster=_Lost(closed))
    assert np.count_nonzero(np.asarray(zarr.open_group(file, mode="r")["done"]) >= 0) == 1
    assert jaxdamp.sweep(product, over, file=file).attrs["points_done"] == COUNT


class NoClient:
    """What looks like a Dask client, and is none."""

    def get_executor(self, **_) -> Any:
        return "no executor"


def test_workers_of_other_versions_and_functions_that_cannot_travel_are_refused(tmp_path, monkeypatch):
    file, over = tmp_path / "s.zarr", points(at, COUNT)
    here = running._versions()
    versions = iter([here | {"jax": "0.1"}])
    monkeypatch.setattr(running, "_versions", lambda: next(versions, here))
    with ThreadPoolExecutor(1) as pool, pytest.raises(RuntimeError, match=rf"has jax {here['jax']}, not 0.1 as here"):
        jaxdamp.sweep(product, over, file=file, cluster=pool)
    stuck = Doubled([], {"numbers": (i for i in range(3))})
    with (
        ThreadPoolExecutor(1) as pool,
        pytest.raises(ValueError, match=r"function\.state\.numbers \(generator\) cannot"),
    ):
        jaxdamp.sweep(stuck, over, file=tmp_path / "stuck.zarr", cluster=pool)
    with pytest.raises(ValueError, match=r"end in '\.zarr'"):
        jaxdamp.sweep(product, over, file=tmp_path / "s.nc", cluster="1/2")
    with pytest.raises(ValueError, match="be a Dask client"):
        jaxdamp.sweep(product, over, file=file, cluster=NoClient())


def test_a_block_program_runs_block_by_block_and_compiles_once():
    program = block_program(product, {"a": np.arange(4.0), "b": np.arange(100.0)}, size=100)
    traced = []
    other = block_program(Doubled(traced), {"a": np.arange(4.0)}, size=2)
    assert [float(other.run(i)["y"].sum()) for i in range(2)] == [2.0, 10.0]
    once = len(traced)
    assert float(other.run(0)["y"].sum()) == 2.0 and len(traced) == once
    assert pickle.loads(pickle.dumps(other)).run(1).identical(other.run(1))
    data = xarray.concat([program.run(i) for i in range(program.blocks.count)], "point")
    np.testing.assert_array_equal(data["y"], np.outer(np.arange(4.0), np.arange(100.0)).ravel())
    with pytest.raises(ValueError, match="from 0 to 3"):
        program.run(4)


class Doubled:
    """Twice `a`, and `b`; notes when it is traced."""

    def __init__(self, traced, state=None):
        self.traced, self.state = traced, state

    def __call__(self, point):
        self.traced.append(point)
        return {"y": 2.0 * point["a"] + point.get("b", 0.0)}

    def __getstate__(self):
        return {"traced": [], "state": self.state}
