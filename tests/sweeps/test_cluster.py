"""Sweeps and fits on a Dask cluster whose workers or client are killed: the numbers of one process to the bit."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr

import jaxdamp
from jaxdamp import identify
from jaxdamp.sweeps import points

from .cases import decay
from .on_cluster import BLOCK, DAMPERS, FATAL, POINTS, at, ending, start


def _run(folder, kill):
    here = Path(__file__).parent
    command = [sys.executable, str(here / "on_cluster.py"), str(folder), kill]
    return subprocess.run(command, timeout=300, capture_output=True, text=True, cwd=here, check=False)


@pytest.mark.slow
def test_whoever_is_killed_the_sweep_ends_with_the_numbers_of_one_process(tmp_path):
    expected = jaxdamp.sweep(decay(), POINTS)
    ended = _run(tmp_path, "worker")
    assert ended.returncode == 0, ended.stderr
    ended = _run(tmp_path, "client")
    assert ended.returncode == -signal.SIGKILL
    marks = np.asarray(zarr.open_group(tmp_path / "client.zarr", mode="r")["done"])
    assert 4 <= np.count_nonzero(marks >= 0) < POINTS.count // BLOCK == len(marks)
    (tmp_path / "client.zarr").rename(tmp_path / "nobody.zarr")
    assert _run(tmp_path, "nobody").returncode == 0
    for name in ("worker", "nobody"):
        data = jaxdamp.sweep(decay(), POINTS, file=tmp_path / f"{name}.zarr")  # computes nothing more
        for result in expected:
            np.testing.assert_array_equal(data[result], expected[result])


@pytest.mark.slow
def test_a_point_that_ends_workers_is_named_and_left_out(tmp_path):
    ended = _run(tmp_path, "point")
    assert ended.returncode == 0, ended.stderr
    with pytest.warns(UserWarning, match="1 of 2468 points"):
        data = jaxdamp.sweep(ending, points(at, 2 * FATAL), file=tmp_path / "point.zarr")  # computes nothing more
    np.testing.assert_array_equal(np.flatnonzero(data["failed"]), [FATAL])
    np.testing.assert_array_equal(data["y"], np.where(data["failed"], np.nan, 2.0 * np.arange(2 * FATAL)))


@pytest.mark.slow
def test_fits_of_a_cluster_that_loses_a_worker_are_those_of_one_process(tmp_path):
    ended = _run(tmp_path, "fits")
    assert ended.returncode == 0, ended.stderr
    fits = identify.fit_many(start(), DAMPERS, file=tmp_path / "fits.zarr")  # computes nothing more
    here = identify.fit_many(start(), DAMPERS, file=tmp_path / "here.zarr")
    assert fits.converged and len(fits) == len(DAMPERS)
    np.testing.assert_array_equal(fits.values, here.values)
    np.testing.assert_array_equal(fits.standard_errors, here.standard_errors)
