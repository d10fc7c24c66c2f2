"""Sweeps in words and on a page: the best points, within limits, rounded as they are shown."""

import numpy as np
import pytest

import jaxdamp
from jaxdamp._display import Display, display, shown_in
from jaxdamp.report import sweep_report
from jaxdamp.report.sweeps import MOST_POINTS, best_points, points_table
from jaxdamp.sweeps import without_effect
from tests.sweeps.cases import AXES


def product(point):
    return {"product": point["a"] * point["b"]}


def test_an_axis_without_effect_is_named_and_no_value_of_it_is_called_the_best():
    data = jaxdamp.sweep(lambda p: {"area": p["a"] ** 2 + 0.0 * p["b"], "level": 0.0 * p["a"] + 3.0}, AXES)
    assert without_effect(data) == {"area": ["b"], "level": ["a", "b"]}
    assert "no effect of b on area" in str(data.jaxdamp.table())
    sentences = best_points(data)
    assert "b has no effect on area: no value of it is better than another." in sentences
    (smallest,) = [sentence for sentence in sentences if sentence.startswith("Smallest")]
    assert smallest.startswith("Smallest area") and "b =" not in smallest
    assert without_effect(jaxdamp.sweep(product, {"a": [1.0], "b": [2.0, 3.0]})) == {}


def test_where_no_point_is_within_the_limits_the_nearest_is_named():
    data = jaxdamp.sweep(product, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    nearest = "the nearest one, a = 1, b = 3, has product of 3, above its limit of 2.5"
    assert best_points(data, {"product": 2.5}) == [f"0 of 4 points are within all limits: {nearest}."]
    (low,) = best_points(data, {"product": (10.0, 20.0)})
    assert low.endswith("the nearest one, a = 2, b = 4, has product of 8, below its limit of 10.")
    within, *others = best_points(data, {"product": 3.5})
    assert within == "1 of 4 points are within all limits; smallest product: 3 at a = 1, b = 3." and not others
    assert best_points(data)[0].startswith("Smallest product: 3 at ")


def test_numbers_in_sentences_are_rounded_as_they_are_shown():
    data = jaxdamp.sweep(product, {"a": [1179.34016], "b": [0.5]})
    data["a"].attrs["units"], data["product"].attrs["units"] = "kg", "N"
    assert points_table(data).columns == data.jaxdamp.table().columns
    with shown_in(Display("imperial")):
        limited = points_table(data, {"product": (400.0, 500.0)})
        assert limited.title.endswith("limits: product ≥ 89.92 lbf and ≤ 112.4 lbf")
        assert limited.records()[0]["limits"] == "not met"
        (sentence,) = best_points(data)
        assert sentence == display().words(sentence) == "Smallest product: 132.6 lbf at a = 2600 lb, b = 0.5."


def test_the_title_of_a_table_on_a_page_is_in_words():
    data = jaxdamp.sweep(product, {"a": [1.0, 2.0], "b": [0.5]}).rename(product="rms_dynamic_tyre_load")
    limited = points_table(data, {"rms_dynamic_tyre_load": 1.0})
    assert "limits: tyre load variation, RMS ≤ 1</caption>" in limited.to_html(words=True)
    assert "limits: rms_dynamic_tyre_load ≤ 1</caption>" in limited.to_html()


@pytest.mark.parametrize("file", [None, "s.zarr"])
def test_the_page_of_a_large_grid_has_its_first_points(tmp_path, file):
    axes = {name: np.linspace(1.0, 2.0, 11) for name in "abc"}
    data = jaxdamp.sweep(lambda p: {"volume": p["a"] * p["b"] * p["c"]}, axes, file=file and tmp_path / file)
    page = sweep_report(data).to_html()
    assert page.count("<tr>") == 1 + MOST_POINTS and "the first 1000 of 1331 rows" in page
