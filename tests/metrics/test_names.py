"""Names of metrics: old ones that warn, wrong ones that are answered with the nearest, values that know both."""

import jax
import jax.numpy as jnp
import pytest

from jaxdamp import metrics
from jaxdamp.metrics import MetricValues, current_name, current_names


KNOWN = ["rms_sprung_acceleration", "working_space_rms", "front_working_space_peak_to_peak"]
VALUES = MetricValues(working_space_rms=1.0, front_working_space_peak_to_peak=2.0, rms_sprung_acceleration=3.0)


def test_an_old_name_means_the_new_one_and_says_so_where_it_is_used():
    with pytest.warns(FutureWarning, match="'front_working_space_peak' is now called") as caught:
        assert current_name("front_working_space_peak", KNOWN) == "front_working_space_peak_to_peak"
    assert caught[0].filename == __file__
    assert current_name("working_space_rms", KNOWN) == "working_space_rms"
    for wrong in ("working_space_peak", "myworking_space_peak", "rear_working_space_peak"):  # not of this vehicle
        assert current_name(wrong, KNOWN) == wrong


def test_the_old_function_is_the_new_one():
    with pytest.warns(FutureWarning, match="'working_space_peak' is now called 'working_space_peak_to_peak'"):
        old = metrics.working_space_peak
    assert old is metrics.working_space_peak_to_peak
    with pytest.raises(AttributeError, match="no attribute 'working_space_pek'"):
        metrics.working_space_pek  # noqa: B018


def test_values_answer_wrong_and_old_names():
    with pytest.raises(KeyError, match="no metric 'rms_sprung_accel'; did you mean 'rms_sprung_acceleration'"):
        VALUES["rms_sprung_accel"]
    with pytest.raises(KeyError, match="there are working_space_rms, "):
        VALUES["qqq"]
    with pytest.warns(FutureWarning, match="is now called"):
        assert VALUES["front_working_space_peak"] == 2.0
    with pytest.warns(FutureWarning, match="is now called"):
        assert VALUES.get("front_working_space_peak") == 2.0
    assert VALUES.get("nothing", 5) == 5 and VALUES.get("working_space_rms") == 1.0
    assert "front_working_space_peak" in VALUES and "working_space_peak" not in VALUES


def test_values_are_a_tree_as_a_dict_is():
    doubled = jax.jit(lambda values: jax.tree.map(lambda v: 2.0 * v, values))(VALUES)
    assert isinstance(doubled, MetricValues) and doubled == {name: 2.0 * value for name, value in VALUES.items()}
    assert list(doubled) == sorted(VALUES)
    slopes = jax.jacfwd(lambda x: MetricValues(a=x**2, b=3.0 * x))(jnp.asarray(2.0))
    assert {name: float(value) for name, value in slopes.items()} == {"a": 4.0, "b": 3.0}
    assert jax.tree_util.keystr(jax.tree_util.tree_leaves_with_path(VALUES)[0][0]) == (
        "['front_working_space_peak_to_peak']"
    )


def test_a_choice_of_names():
    with pytest.warns(FutureWarning):
        assert current_names("metrics", ["front_working_space_peak"], KNOWN) == ["front_working_space_peak_to_peak"]
    with pytest.raises(ValueError, match=r"`metrics` must be one of .* Did you mean 'rms_sprung_acceleration'"):
        current_names("metrics", ["rms_sprung_accel"], KNOWN)
    with pytest.raises(ValueError, match=r"`metrics` must be a list of names.*Write `metrics=\['working_space_rms'\]`"):
        current_names("metrics", "working_space_rms", KNOWN)


def test_values_with_units_as_a_table_and_as_plain_data():
    values = MetricValues.with_units(
        VALUES, {"working_space_rms": "m", "rms_sprung_acceleration": "m/s^2", "other": "N"}
    )
    assert values.table().records()[0] == {"metric": "working_space_rms", "unit": "m", "value": 1.0}
    assert values.to_dict()["rms_sprung_acceleration"] == {"value": 3.0, "unit": "m/s^2"}
    assert values.to_dict()["front_working_space_peak_to_peak"] == {"value": 2.0, "unit": ""}
    doubled = jax.jit(lambda values: jax.tree.map(lambda v: 2.0 * v, values))(values)
    assert doubled.units == values.units and dict(doubled) == {name: 2.0 * value for name, value in VALUES.items()}
