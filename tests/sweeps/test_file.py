import jax.numpy as jnp
import numpy as np
import pytest
import xarray

import jaxdamp
from jaxdamp.sweeps import points, running
from jaxdamp.sweeps.sweeping import SweepFile

from .cases import AXES, decay


class _Interrupted:
    """Raises at the third call of the program; counts points."""

    def __init__(self, monkeypatch, at):
        self.points, self.calls, self.at = 0, 0, at
        start = running.Program.start

        def counted(program, columns):
            self.calls += 1
            if self.calls == self.at:
                raise KeyboardInterrupt
            self.points += len(columns["a"])
            return start(program, columns)

        monkeypatch.setattr(running.Program, "start", counted)


@pytest.mark.parametrize("over", [AXES, points({"b": np.linspace(0.1, 1.0, 35), "a": np.linspace(0.0, 1.0, 35)})])
def test_a_sweep_goes_on_where_it_stopped(tmp_path, monkeypatch, over):
    options = {"chunk": 4, "devices": 1, "gradients": True}
    monkeypatch.setattr(running, "CALL", 0.0)  # one chunk a call
    expected = jaxdamp.sweep(decay(), over, **options)
    file = tmp_path / "sweep.nc"
    counter = _Interrupted(monkeypatch, at=4)
    with pytest.raises(KeyboardInterrupt):
        jaxdamp.sweep(decay(), over, file=file, **options)
    assert counter.points == 12
    partial = xarray.load_dataset(file, engine="scipy")
    assert int(partial["done"].sum()) == 12 == int(partial["sum"].notnull().sum())
    data = jaxdamp.sweep(decay(), over, file=file, chunk=3, devices=1, gradients=True)
    assert counter.points == 35
    xarray.testing.assert_allclose(data, expected, rtol=1e-14)
    again = jaxdamp.sweep(decay(), over, file=file, gradients="reverse")
    assert counter.points == 35
    xarray.testing.assert_identical(again, data)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sweep.nc"]


def test_the_file_holds_names_with_dots_units_and_doubles(tmp_path):
    def function(point):
        return {"rms.body": point["car.mass"] / 3.0}

    data = jaxdamp.sweep(function, {"car.mass": [1.0, 2.0]}, gradients=True, file=tmp_path / "s.nc")
    kept = xarray.load_dataset(tmp_path / "s.nc")
    assert kept["rms.body"].dtype == np.float64
    xarray.testing.assert_equal(kept.drop_vars("done"), data)
    assert list(kept["parameter"].values) == ["car.mass"]


def test_failures_are_kept(tmp_path):
    for _ in range(2):
        with pytest.warns(UserWarning, match="1 of 2 points"):
            data = jaxdamp.sweep(lambda p: {"y": jnp.sqrt(p["a"])}, {"a": [-1.0, 1.0]}, file=tmp_path / "s.nc")
        np.testing.assert_array_equal(data["failed"], [True, False])


def _other(point):
    return {"y": point["a"] * point["b"] + 1.0}


@pytest.mark.parametrize(
    ("function", "over", "options", "message"),
    [
        (_other, {"a": [1.0, 2.0], "b": [3.0]}, {}, "the function computes something else"),
        (None, {"a": [1.0, 2.5], "b": [3.0]}, {}, r"the axis 'a' has other values .*; now 2 .* 2.5"),
        (None, {"b": [3.0], "a": [1.0, 2.0]}, {}, "its axes are 'a', 'b'"),
        (None, points({"a": [1.0, 2.0], "b": [3.0, 3.0]}), {}, "its axes are"),
        (None, {"a": [1.0, 2.0], "b": [3.0]}, {"gradients": True}, "its results are 'y', not 'd_y', 'y'"),
    ],
)
def test_the_file_of_another_sweep_is_refused(tmp_path, function, over, options, message):
    def product(point):
        return {"y": point["a"] * point["b"]}

    jaxdamp.sweep(product, {"a": [1.0, 2.0], "b": [3.0]}, file=tmp_path / "s.nc")
    with pytest.raises(ValueError, match=message):
        jaxdamp.sweep(function or product, over, file=tmp_path / "s.nc", **options)


def test_the_numbers_inside_a_function_count(tmp_path):
    rates = jnp.linspace(0.1, 1.0, 40)
    jaxdamp.sweep(decay(), AXES, file=tmp_path / "s.nc")
    with pytest.raises(ValueError, match="from other numbers"):
        jaxdamp.sweep(type(decay())(rates.at[7].add(0.01)), AXES, file=tmp_path / "s.nc")
    for i, table in enumerate((rates, rates.at[7].add(0.01))):
        file = tmp_path / "closure.nc"
        if i:
            with pytest.raises(ValueError, match="from other numbers"):
                jaxdamp.sweep(lambda p, t=table: {"y": jnp.sum(t * p["a"])}, {"a": [1.0]}, file=file)
        else:
            jaxdamp.sweep(lambda p, t=table: {"y": jnp.sum(t * p["a"])}, {"a": [1.0]}, file=file)


def test_files_that_cannot_be_are_refused(tmp_path):
    def product(point):
        return {"y": 2.0 * point["a"]}

    with pytest.raises(ValueError, match=r"end in '\.nc'"):
        jaxdamp.sweep(product, {"a": [1.0]}, file=tmp_path / "s.csv")
    with pytest.raises(ValueError, match="lie in a folder that exists"):
        jaxdamp.sweep(product, {"a": [1.0]}, file=tmp_path / "none" / "s.nc")
    (tmp_path / "text.nc").write_text("nothing")
    with pytest.raises(ValueError, match="cannot be read as a sweep"):
        jaxdamp.sweep(product, {"a": [1.0]}, file=tmp_path / "text.nc")
    xarray.Dataset({"y": ("a", [1.0])}).to_netcdf(tmp_path / "foreign.nc", engine="scipy")
    with pytest.raises(ValueError, match=r"not written by `jaxdamp\.sweep`"):
        jaxdamp.sweep(product, {"a": [1.0]}, file=tmp_path / "foreign.nc")


def test_a_full_disk_stops_no_sweep(tmp_path, monkeypatch):
    def full(self):
        raise OSError("No space left on device")

    monkeypatch.setattr(SweepFile, "_write", full)
    with pytest.warns(UserWarning, match="No space left"):
        data = jaxdamp.sweep(lambda p: {"y": 2.0 * p["a"]}, {"a": [1.0]}, file=tmp_path / "s.nc")
    assert data["y"] == 2.0


def test_damaged_points_are_computed_anew(tmp_path):
    file = tmp_path / "sweep.nc"
    over = {"a": np.linspace(0.0, 1.0, 10_000)}
    whole = jaxdamp.sweep(lambda p: {"y": p["a"] ** 2}, over, file=file)
    raw = bytearray(file.read_bytes())
    at = raw.find(np.asarray(whole["y"].values[5000:5003], ">f8").tobytes())
    raw[at : at + 8] = np.array(7.0, ">f8").tobytes()
    file.write_bytes(raw)
    with pytest.warns(UserWarning, match="4096 of 10000 points in .* were damaged on the disk"):
        again = jaxdamp.sweep(lambda p: {"y": p["a"] ** 2}, over, file=file)
    np.testing.assert_array_equal(again["y"], whole["y"])
