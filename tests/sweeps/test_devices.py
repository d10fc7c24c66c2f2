"""The same results from one device and from two, from one process and from two, whatever the chunk."""

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

import jaxdamp

from .cases import AXES, decay, failing


pytestmark = pytest.mark.users_flags


@pytest.fixture(scope="module")
def expected():
    return jaxdamp.sweep(decay(), AXES, gradients=True, devices=1)


@pytest.fixture(scope="module")
def expected_failing():
    with pytest.warns(UserWarning, match="points of the sweep failed"):
        return jaxdamp.sweep(failing, {"a": np.linspace(0.0, 3.0, 7), "b": AXES["b"]}, devices=1)


def elsewhere(folder: Path, processes: int, devices: int) -> None:
    """Run the sweeps of `elsewhere.py` in other processes, to their end and without a word of complaint."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    script = Path(__file__).with_name("elsewhere.py")
    running = [
        subprocess.Popen(
            [sys.executable, script, *map(str, (port, processes, index, devices)), folder],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for index in range(processes)
    ]
    try:
        for process in running:
            _, complaint = process.communicate(timeout=1800)  # processes may wait for each other for ever
            assert process.returncode == 0, complaint
            assert "Traceback" not in complaint
    finally:
        for process in running:
            process.kill()


def compare(folder: Path, expected: xarray.Dataset, expected_failing: xarray.Dataset, processes: int) -> None:
    found = sorted(folder.glob("decay-*.nc"))
    assert len(found) == 5 * processes
    for file in found:
        xarray.testing.assert_allclose(xarray.load_dataset(file), expected, rtol=1e-13)
    for index in range(processes):
        failed = xarray.load_dataset(folder / f"failing-{index}.nc")
        xarray.testing.assert_allclose(failed, expected_failing, rtol=1e-13)
        assert failed.attrs["failed_points"] == expected_failing.attrs["failed_points"] > 7
    assert "the axis 'a' has other values" in (folder / "refusal-0.txt").read_text(encoding="utf-8")


@pytest.mark.slow
def test_two_devices(tmp_path, expected, expected_failing):
    elsewhere(tmp_path, processes=1, devices=2)
    compare(tmp_path, expected, expected_failing, 1)
    done = []
    data = jaxdamp.sweep(
        decay(), AXES, gradients=True, file=tmp_path / "shared.nc", progress=lambda *both: done.append(both)
    )
    assert done == []  # another process has computed it all, and knows the function by the same fingerprint
    xarray.testing.assert_allclose(data, expected, rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("devices", [1, 2])
@pytest.mark.exhaustive_cases("1")
def test_two_processes(tmp_path, expected, expected_failing, devices):
    elsewhere(tmp_path, processes=2, devices=devices)
    compare(tmp_path, expected, expected_failing, 2)
    assert "first process refuses" in (tmp_path / "refusal-1.txt").read_text(encoding="utf-8")
