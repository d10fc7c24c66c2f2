"""What is gathered of a sweep block by block: the figures of all its points together, to the bit."""

import math
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdamp
from jaxdamp.blocks import block_size
from jaxdamp.sweeps import Summary, points
from jaxdamp.sweeps.gathered import Figures, exact_sums, front

from .cases import AXES, failing


COUNT = 1500  # points: six blocks of at most 256
KEEP = Summary(
    histograms={"y": [-1.0, 0.0, 0.5, 1.0]}, smallest={"y": 3, "z": 1}, largest={"y": 5}, pareto=["y", "z", "w"]
)


def at(indices):
    return {"a": np.sin(1.7 * indices), "b": np.cos(np.floor(indices / 2))}


def several(point):
    """Three numbers of which many are alike, one of them not finite at some points, and an array."""
    y = point["a"] + 0.1 * point["b"]
    z = (point["b"] - 0.3) ** 2
    return {"y": y, "z": z, "w": jnp.where(point["b"] > -0.9, point["b"], jnp.inf), "pair": jnp.stack([y, z])}


@pytest.fixture(scope="module")
def whole():
    with pytest.warns(UserWarning, match="points of the sweep failed"):
        return jaxdamp.sweep(several, points(at, COUNT))


def swept(**options):
    return jaxdamp.sweep(several, points(at, COUNT), summary=KEEP, **options)


def test_the_figures_are_those_of_the_whole_sweep(whole):
    found = swept()
    assert found.points == COUNT > 5 * block_size(COUNT)
    assert found.failed_points == int(whole["failed"].sum()) > 0 and found.reasons == {
        "w is not finite": found.failed_points
    }
    assert set(found.statistics) == {"y", "z", "w"}
    for name, row in found.statistics.items():
        values = whole[name].values[np.isfinite(whole[name].values)]
        exact = [Fraction(float(v)) for v in values]
        mean = sum(exact) / len(exact)
        spread = math.sqrt(sum((v - mean) ** 2 for v in exact) / len(exact))
        assert row.values.tolist() == [len(exact), float(mean), spread, values.min(), values.max()]
    y = whole["y"].values
    counts, _ = np.histogram(y, [-np.inf, -1.0, 0.0, 0.5, 1.0, np.inf])
    np.testing.assert_array_equal(found.histograms["y"], counts)
    for kept, order in (
        (found.smallest["y"], np.argsort(y, kind="stable")[:3]),
        (found.largest["y"], np.argsort(-y, kind="stable")[:5]),
        (found.smallest["z"], np.argsort(whole["z"].values, kind="stable")[:1]),
    ):
        np.testing.assert_array_equal(kept["index"], order)
        for name in ("a", "b", "y", "z", "w"):
            np.testing.assert_array_equal(kept[name], whole[name][order])
    assert found.pareto is not None
    table = np.stack([whole[name].values for name in ("y", "z", "w")], axis=1)
    beaten = [np.any(np.all(table <= row, axis=1) & np.any(table < row, axis=1)) for row in table]
    np.testing.assert_array_equal(
        found.pareto["index"], np.flatnonzero(~np.array(beaten) & np.all(np.isfinite(table), 1))
    )


def test_a_store_goes_on_and_whoever_computes_gives_the_same(tmp_path, whole):
    file, here = tmp_path / "s.zarr", swept()
    first = swept(file=file, cluster="1/3")
    assert 0 < first.points < COUNT
    rest = swept(file=file)
    for found in (rest, swept(file=file)):
        assert found.to_dict() == here.to_dict() and found.statistics.identical(here.statistics)
        assert found.pareto is not None and here.pareto is not None and found.pareto.identical(here.pareto)
    chunk = file / "summary" / "c" / "2"
    chunk.write_bytes(chunk.read_bytes()[:-1])
    with pytest.warns(UserWarning, match="1 blocks .* damaged"):
        assert swept(file=file).to_dict() == here.to_dict()
    assert swept(file=tmp_path / "parts.zarr", cluster="9/9").points == 0
    with pytest.raises(ValueError, match="other work: summary is histograms"):
        jaxdamp.sweep(several, points(at, COUNT), summary=Summary(), file=file)
    with pytest.raises(ValueError, match=r"other work: .*there, None now"):
        jaxdamp.sweep(several, points(at, COUNT), file=file)


def test_grids_units_and_points_that_raise(tmp_path):
    over = {"a": np.linspace(0.0, 3.0, 7), "b": AXES["b"]}
    with pytest.warns(UserWarning, match="8 of 35"):
        whole = jaxdamp.sweep(failing, over)
    found = jaxdamp.sweep(failing, over, summary=Summary(largest={"y": 2}))
    assert found.failed_points == 8 and found.statistics["y"][0] == 27 and len(found.warnings) == 2
    np.testing.assert_array_equal(found.largest["y"]["y"], np.sort(whole["y"].values[np.isfinite(whole["y"])])[:-3:-1])


@pytest.mark.parametrize("scale", [1.0, 1e300, 5e-324])
def test_sums_are_exact_and_merge_in_any_order(scale):
    rng = np.random.default_rng(3)
    values = scale * np.round(rng.standard_normal(999) * 10.0 ** rng.integers(0, 8, 999))
    values = values[np.isfinite(values)]
    exact = [Fraction(v) for v in values.tolist()]
    total, squares = exact_sums(values)
    assert Fraction(total, 2**1200) == sum(exact) and Fraction(squares, 2**2400) == sum(v * v for v in exact)
    parts = [Figures.of(part) for part in np.array_split(values, 7)]
    assert sum(parts, Figures()) == sum(parts[::-1], Figures()) == Figures.of(values)


def test_a_front_of_many_points_is_that_of_all_pairs():
    values = np.round(np.random.default_rng(1).random((700, 3)), 2)  # with equal points
    beaten = [np.any(np.all(values <= row, axis=1) & np.any(values < row, axis=1)) for row in values]
    np.testing.assert_array_equal(front(values), np.flatnonzero(~np.array(beaten)))
    assert front(np.zeros((0, 2))).size == 0


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        (Summary(histograms={"y": [1.0, 0.0]}), "two or more numbers in increasing order"),
        (Summary(histograms={"q": [0.0, 1.0]}), r"`summary\.histograms` must be one of 'y', 'z', 'w'"),
        (Summary(smallest={"pair": 1}), r"`summary\.smallest` must be one of"),
        (Summary(largest={"y": 0}), r"summary\.largest\['y'\]"),
        (Summary(pareto=["y"]), "two or more different results, but is y"),
    ],
)
def test_what_cannot_be_kept_is_refused(keep, message):
    with pytest.raises(ValueError, match=message):
        jaxdamp.sweep(several, points(at, 3), summary=keep)


def test_a_summary_needs_a_store_that_is_written_by_block(tmp_path):
    with pytest.raises(ValueError, match=r"end in '\.zarr'"):
        swept(file=tmp_path / "s.nc")
    with pytest.raises(ValueError, match=r"end in '\.zarr'"):
        swept(cluster="1/2")
