"""The same results from one device and from two, whatever the chunk."""

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


@pytest.mark.slow
def test_two_devices(tmp_path, expected, expected_failing):
    script = Path(__file__).with_name("elsewhere.py")
    ended = subprocess.run([sys.executable, script, "2", tmp_path], capture_output=True, text=True, timeout=600)
    assert ended.returncode == 0 and "Traceback" not in ended.stderr, ended.stderr
    found = sorted(tmp_path.glob("decay-*.nc"))
    assert len(found) == 5
    for file in found:
        xarray.testing.assert_allclose(xarray.load_dataset(file), expected, rtol=1e-13)
    failed = xarray.load_dataset(tmp_path / "failing.nc")
    xarray.testing.assert_allclose(failed, expected_failing, rtol=1e-13)
    assert failed.attrs["failed_points"] == expected_failing.attrs["failed_points"] > 7
    assert "the axis 'a' has other values" in (tmp_path / "refusal.txt").read_text(encoding="utf-8")
    done = []
    data = jaxdamp.sweep(
        decay(), AXES, gradients=True, file=tmp_path / "shared.nc", progress=lambda *both: done.append(both)
    )
    assert done == []  # another process has computed it all, and knows the function by the same fingerprint
    xarray.testing.assert_allclose(data, expected, rtol=1e-13)
