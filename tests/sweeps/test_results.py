import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray

import jaxdamp
from jaxdamp.sweeps import points, random, running, sobol

from .cases import AXES, Decay, decay, failing


def product(point):
    return {"product": point["a"] * point["b"]}


def test_a_grid_is_labelled_and_equals_a_loop():
    data = jaxdamp.sweep(decay(), AXES)
    assert data["sum"].dims == ("a", "b") and data["profile"].dims == ("a", "b", "profile_0")
    assert list(data.data_vars) == ["sum", "square", "profile"]
    assert data.attrs["failed_points"] == 0 and not data["failed"].any()
    assert data["sum"].attrs["units"] == "m" and data["a"].attrs["units"] == "s" and "units" not in data["square"].attrs
    for a in AXES["a"]:
        for b in AXES["b"]:
            here = decay()({"a": jnp.asarray(a), "b": jnp.asarray(b)})
            for name, value in here.items():
                np.testing.assert_allclose(data[name].sel(a=a, b=b), value, rtol=1e-13)


def test_names_with_dots_and_integers_as_values():
    data = jaxdamp.sweep(lambda p: {"x.y": p["car.mass"] + 0.5}, {"car.mass": range(3)})
    np.testing.assert_array_equal(data["x.y"].sel({"car.mass": 2}), 2.5)


def test_a_list_of_points():
    data = jaxdamp.sweep(product, points({"a": [1.0, 2.0, 3.0], "b": [4.0, 5.0, 6.0]}))
    assert data["product"].dims == ("point",) == data["a"].dims
    np.testing.assert_array_equal(data["product"], [4.0, 10.0, 18.0])


@pytest.mark.parametrize("sample", [random, sobol])
def test_samples_fill_their_ranges_and_repeat(sample):
    ranges = {"a": (1.0, 100.0), "b": (-2.0, 2.0)}
    drawn = sample(ranges, 500, seed=3, log=["a"])
    again, other = sample(ranges, 500, seed=3, log=["a"]), sample(ranges, 500, seed=4, log=["a"])
    data = jaxdamp.sweep(product, drawn)
    assert data.sizes == {"point": 500}
    np.testing.assert_allclose(data["product"], data["a"] * data["b"], rtol=1e-14)
    for name, (low, high) in ranges.items():
        assert low <= data[name].min() < low + 0.1 * (high - low) and data[name].max() <= high
        np.testing.assert_array_equal(drawn.values[name], again.values[name])
        assert np.any(drawn.values[name] != other.values[name])
    assert np.median(drawn.values["a"]) == pytest.approx(10.0, rel=0.15)
    assert np.all(sample({"a": (1.0, 100.0)}, 50, log=True).values["a"] <= 100.0)


def test_sobol_points_are_even():
    drawn = sobol({"a": (0.0, 1.0), "b": (0.0, 1.0)}, 256)
    counts, _, _ = np.histogram2d(drawn.values["a"], drawn.values["b"], bins=16, range=[[0.0, 1.0], [0.0, 1.0]])
    assert np.all(counts == 1)


@pytest.mark.parametrize("chunk", [1, 7, 4096])
def test_the_chunk_changes_nothing(chunk):
    expected = jaxdamp.sweep(decay(), AXES, gradients=True)
    xarray.testing.assert_allclose(jaxdamp.sweep(decay(), AXES, gradients=True, chunk=chunk), expected, rtol=1e-13)


def test_many_calls_of_many_rounds(monkeypatch):
    monkeypatch.setattr("jaxdamp.sweeps.program.BUFFER_POINTS", 64)
    seen = []
    data = jaxdamp.sweep(
        product,
        {"a": np.arange(37.0), "b": np.arange(41.0)},
        chunk=4,
        devices=1,
        progress=lambda done, total: seen.append((done, total)),
    )
    np.testing.assert_array_equal(data["product"], np.outer(np.arange(37.0), np.arange(41.0)))
    assert seen[-1] == (37 * 41, 37 * 41) and len(seen) > 20
    assert sorted(seen) == seen


def test_a_chunk_that_does_not_fit_is_made_smaller(monkeypatch):
    chunks = []
    original = running.prepare

    def prepare(*arguments, **options):
        program = original(*arguments, **options)
        chunks.append(program.layout.chunk)
        return program

    monkeypatch.setattr(running, "prepare", prepare)
    monkeypatch.setattr("jaxdamp.sweeps.program.free_memory", lambda mesh: 4e5)
    monkeypatch.setattr("jaxdamp.sweeps.program.BUFFER_POINTS", 64)
    data = jaxdamp.sweep(lambda p: {"wide": p["a"] * jnp.ones(200)}, {"a": np.arange(300.0)}, devices=1)
    assert chunks[0] < 256
    np.testing.assert_array_equal(data["wide"][:, 3], np.arange(300.0))


@pytest.mark.parametrize(
    ("options", "chunk"), [({}, 32), ({"gradients": "forward"}, 8), ({"gradients": "reverse"}, 8), ({"chunk": 5}, 5)]
)
def test_the_function_says_how_many_lanes_it_likes(monkeypatch, options, chunk):
    chunks, start = set(), running.Program.start

    def noted(program, columns):
        chunks.add(program.layout.chunk)
        return start(program, columns)

    monkeypatch.setattr(running.Program, "start", noted)
    jaxdamp.sweep(decay(), {"a": np.linspace(0.0, 1.0, 50), "b": [1.0, 2.0]}, devices=1, **options)
    assert chunks == {chunk}


def test_memory_that_runs_out_halves_the_chunk(monkeypatch):
    start, asked = running.Program.start, []

    def exhausted(program, columns):
        asked.append(program.layout.chunk)
        if program.layout.chunk > 8:
            raise RuntimeError("RESOURCE_EXHAUSTED: Out of memory")
        return start(program, columns)

    monkeypatch.setattr(running.Program, "start", exhausted)
    data = jaxdamp.sweep(product, {"a": np.arange(8.0), "b": np.arange(8.0)}, devices=1)
    assert asked[:4] == [64, 32, 16, 8] and set(asked[3:]) == {8}
    np.testing.assert_array_equal(data["product"], np.outer(np.arange(8.0), np.arange(8.0)))


def test_arrays_are_arguments_and_programs_are_kept():
    calls = []

    class Counted(Decay):
        def __call__(self, point):
            calls.append(1)
            return super().__call__(point)

    first = jaxdamp.sweep(Counted(jnp.linspace(0.1, 1.0, 40)), AXES)
    traced = len(calls)
    second = jaxdamp.sweep(Counted(jnp.linspace(0.2, 2.0, 40)), AXES)
    assert len(calls) == traced + 1  # traced to see what it returns, but not compiled
    a, b = AXES["a"][2], AXES["b"][2]
    for data, top in ((first, 1.0), (second, 2.0)):
        expected = b * np.sum(np.exp(-a * np.linspace(0.1 * top, top, 40)))
        np.testing.assert_allclose(data["sum"].sel(a=a, b=b), expected, rtol=1e-13)


def test_counts_and_booleans_become_floating_results():
    data = jaxdamp.sweep(lambda p: {"n": jnp.sum(p["a"] > 1.0), "large": p["a"] > 1.0}, {"a": [0.0, 2.0]})
    assert data["n"].dtype == data["large"].dtype == np.float64
    np.testing.assert_array_equal(data["n"], [0.0, 1.0])


# ---- failures


def test_what_is_not_finite_is_nan_and_counted():
    def function(point):
        return {"root": jnp.sqrt(point["a"]), "twice": 2.0 * point["a"]}

    with pytest.warns(UserWarning, match=r"2 of 5 points .* at a from -2 to -1\. .*data\.failed"):
        data = jaxdamp.sweep(function, {"a": [-2.0, -1.0, 0.0, 1.0, 4.0]})
    np.testing.assert_array_equal(data["root"], [np.nan, np.nan, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(data["twice"], [-4.0, -2.0, 0.0, 2.0, 8.0])
    np.testing.assert_array_equal(data["failed"], [True, True, False, False, False])
    np.testing.assert_array_equal(data["reason"], ["root is not finite"] * 2 + [""] * 3)
    assert data.attrs["failed_points"] == 2
    assert data.where(data.failed, drop=True).sizes == {"a": 2}


@pytest.mark.parametrize("chunk", [None, 4])
def test_points_that_raise_are_found(chunk, capfd):
    axes = {"a": np.linspace(0.0, 3.0, 11), "b": np.linspace(-0.1, 1.1, 13)}
    with pytest.warns(
        UserWarning,
        match="Why: the function raised: too much of both .*b.*is not finite|Why: y is not finite .*raised: too much",
    ):
        data = jaxdamp.sweep(failing, axes, chunk=chunk)
    a, b = np.meshgrid(axes["a"], axes["b"], indexing="ij")
    bad = a * b > 3.0
    assert 0 < bad.sum() < 20
    np.testing.assert_allclose(data["y"], np.where(bad | (b < 0), np.nan, b * np.exp(-a)), rtol=1e-14)
    np.testing.assert_array_equal(data["failed"], bad | (b < 0))
    reasons = np.where(b < 0, "y is not finite", np.where(bad, "the function raised: too much of both", ""))
    np.testing.assert_array_equal(data["reason"].values.astype(str), reasons)
    np.testing.assert_allclose(data["pair"][..., 0], np.where(bad, np.nan, a))
    assert data.attrs["failed_points"] == np.sum(bad | (b < 0))
    assert capfd.readouterr().err == ""
    jax.effects_barrier()  # raises again what a callback raised last


def test_all_points_may_fail():
    with pytest.warns(UserWarning, match="3 of 3 points"):
        data = jaxdamp.sweep(failing, {"a": [10.0], "b": [1.0, 2.0, 3.0]})
    assert data["y"].isnull().all()


class Bounded(eqx.Module):
    """A function that says itself where it has values."""

    def out_of_domain(self, columns):
        return np.where(columns["a"] < 0.0, "a must not be negative", "")

    def __call__(self, point):
        return {"y": point["a"] + point["b"]}


@pytest.mark.parametrize(
    "over",
    [
        {"a": [-2.0, -1.0, 0.0, 1.0], "b": [1.0, 2.0]},
        points({"a": [-1.0, 1.0, -2.0], "b": [1.0, 2.0, 3.0]}),
        random({"a": (-1.0, 1.0), "b": (0.0, 1.0)}, 20),
        sobol({"a": (-1.0, 1.0), "b": (0.0, 1.0)}, 16),
    ],
)
def test_points_outside_a_domain_are_not_computed(over, tmp_path):
    with pytest.warns(UserWarning, match=r"points of the sweep failed: .* Why: a must not be negative \(\d+\)"):
        data = jaxdamp.sweep(Bounded(), over, gradients=True, file=tmp_path / "a.nc")
    a, b = xarray.broadcast(data["a"], data["b"])
    outside = a.values < 0.0
    assert 0 < outside.sum() < outside.size
    np.testing.assert_array_equal(data["failed"], outside)
    np.testing.assert_array_equal(data["reason"].values.astype(str), np.where(outside, "a must not be negative", ""))
    np.testing.assert_allclose(data["y"], np.where(outside, np.nan, a + b), rtol=1e-15)
    np.testing.assert_array_equal(np.isnan(data["d_y"].values).all(axis=-1), outside)
    with pytest.warns(UserWarning, match="Why: a must not be negative"):
        again = jaxdamp.sweep(Bounded(), over, gradients=True, file=tmp_path / "a.nc")
    xarray.testing.assert_identical(again, data)


def test_a_sweep_with_no_point_inside_the_domain_is_refused():
    with pytest.raises(
        ValueError, match=r"`over` must hold a point .*\(a must not be negative\), but is a from -2 to -1"
    ):
        jaxdamp.sweep(Bounded(), {"a": [-2.0, -1.0], "b": [1.0]})


# ---- static mistakes


@pytest.mark.parametrize(
    ("function", "over", "message"),
    [
        (lambda p: {"y": p["mass"]}, {"mas": [1.0]}, r"asks for 'mass', but the axes are 'mas'\. Did you mean 'mas'"),
        (lambda p: p["a"], {"a": [1.0]}, "return a mapping from names to numbers"),
        (lambda p: {}, {"a": [1.0]}, "return a mapping"),
        (lambda p: {"a": p["a"]}, {"a": [1.0]}, "return names"),
        (lambda p: {"failed": p["a"]}, {"a": [1.0]}, "return names"),
        (lambda p: {"y": (p["a"], {})}, {"a": [1.0]}, "return numbers, also as 'y'"),
        (lambda p: {"y": jax.lax.complex(p["a"], p["a"])}, {"a": [1.0]}, "real numbers"),
        (product, {}, "have at least one axis"),
        (product, {"a": 3.0, "b": [1.0]}, r"over\['a'\]` must be a sequence of one or more numbers"),
        (product, {"a": [], "b": [1.0]}, "be a sequence"),
        (product, {"a": ["soft", "hard"], "b": [1.0]}, "be numbers"),
        (product, {"a": [1.0, np.nan], "b": [1.0]}, "be finite"),
        (product, {"point": [1.0]}, "have names"),
        (product, {"a": [1.0, 2.0, 1.0], "b": [1.0]}, r"over\['a'\]` must have each value once, but is 1, 2 times"),
        (product, {"a/b": [1.0]}, "have names"),
    ],
)
def test_static_mistakes_are_refused_at_once(function, over, message):
    with pytest.raises(ValueError, match=message):
        jaxdamp.sweep(function, over)


def test_an_error_of_the_function_itself_comes_through():
    with pytest.raises(ZeroDivisionError):
        jaxdamp.sweep(lambda p: {"y": p["a"] * (1 / 0)}, {"a": [1.0]})


def test_an_axis_that_changes_nothing_is_noticed():
    with pytest.warns(UserWarning, match="does not use the axis 'c'"):
        jaxdamp.sweep(product, {"a": [1.0], "c": [1.0], "b": [1.0]})


def test_settings_are_checked():
    with pytest.raises(ValueError, match="`chunk` must be one or more"):
        jaxdamp.sweep(product, {"a": [1.0], "b": [1.0]}, chunk=0)
    with pytest.raises(ValueError, match=r"`devices` must be from 1 to .*jaxdamp\.configure"):
        jaxdamp.sweep(product, {"a": [1.0], "b": [1.0]}, devices=99)
    with pytest.raises(ValueError, match="equally many"):
        points({"a": [1.0], "b": [1.0, 2.0]})
    with pytest.raises(ValueError, match="increasing order"):
        random({"a": (2.0, 1.0)}, 4)
    with pytest.raises(ValueError, match="no logarithm"):
        sobol({"a": (0.0, 1.0)}, 4, log=True)
    with pytest.raises(ValueError, match=r"`log` must be one of .* Did you mean 'rate'"):
        random({"rate": (0.1, 1.0)}, 4, log=["rates"])
    with pytest.raises(ValueError, match="`count` must be one or more"):
        random({"a": (0.0, 1.0)}, 0)


# ---- what the dataset can do


def test_a_grid_as_a_table_has_a_row_for_each_point():
    data = jaxdamp.sweep(decay(), AXES)
    table = data.jaxdamp.table()
    assert [column.name for column in table.columns] == ["a", "b", "sum", "square"]  # the profile is no number
    assert {column.name: column.unit for column in table.columns}["sum"] == "m"
    rows = table.records()
    assert len(rows) == len(AXES["a"]) * len(AXES["b"])
    for row in rows:
        assert row["sum"] == float(data["sum"].sel(a=row["a"], b=row["b"]))


def test_points_that_failed_have_a_reason_and_no_number():
    def root(point):
        return {"root": jnp.sqrt(point["a"])}

    with pytest.warns(UserWarning, match="1 of 3 points"):
        data = jaxdamp.sweep(root, points({"a": [-1.0, 0.0, 4.0]}))
    assert data.jaxdamp.table().rows == ((-1.0, None, "root is not finite"), (0.0, 0.0, ""), (4.0, 2.0, ""))
    plain = json.loads(json.dumps(data.jaxdamp.to_dict(), allow_nan=False))
    assert plain["data_vars"]["root"]["data"] == [None, 0.0, 2.0] and plain["attrs"] == {"failed_points": 1}


def test_a_dataset_draws_itself():
    data = jaxdamp.sweep(product, {"a": [1.0, 2.0], "b": [3.0, 4.0, 5.0]})
    (axes,) = data.jaxdamp.plot("product", over="b").axes
    assert axes.get_xlabel() == "b" and len(axes.get_lines()) == 2
