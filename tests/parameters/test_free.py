"""Free parameters of a fit or a tuning, and ties between them."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import (
    Bilinear,
    Linear,
)
from jaxdamp.parameters import (
    free_parameters,
    get,
    name_patterns,
    replace,
)
from jaxdamp.vehicles import presets

from .laws import PATHS, composed


def test_free_parameters_as_vectors():
    free = free_parameters(composed(), freeze=["knots", "factor"])
    assert free.names == [
        "law.terms.0.slopes[0]",
        "law.terms.0.slopes[1]",
        "law.terms.0.slopes[2]",
        "law.terms.1.law.friction_force",
        "law.terms.1.law.friction_velocity",
        "lag_time",
    ]
    np.testing.assert_array_equal(free.values, [500.0, 2000.0, 800.0, 40.0, 0.01, 0.004])
    built = free.build(2.0 * free.values)
    assert get(built, "lag_time") == 0.008
    np.testing.assert_array_equal(get(built, "law.terms.0.slopes"), [1000.0, 4000.0, 1600.0])
    np.testing.assert_array_equal(get(built, "law.terms.0.knots"), [-0.1, 0.2])
    same = free.build(free.values)
    assert eqx.tree_equal(same, composed())


def test_over_and_freeze():
    law = composed()
    assert free_parameters(law, over=["lag_time"]).names == ["lag_time"]
    assert free_parameters(law, over=["friction_*"], freeze=["friction_velocity"]).names == [PATHS[2]]


def test_limits_and_bounds():
    law = Bilinear(2600.0, 1200.0)
    lower, upper = free_parameters(law, bounds={"rebound_rate": (1000.0, 3000.0)}).limits()
    np.testing.assert_array_equal(lower, [1000.0, 0.0])
    np.testing.assert_array_equal(upper, [3000.0, np.inf])


def test_bounds_meet_the_domain():
    free = free_parameters(Linear(100.0), bounds={"rate": (-500.0, 500.0)})
    assert free.limits()[0] == 0.0


def test_build_is_differentiable():
    free = free_parameters(composed(), over=["slopes"])
    slope = jax.grad(lambda values: free.build(values).law.terms[0].force_velocity(0.5))(free.values)
    np.testing.assert_allclose(slope, [0.0, 0.2, 0.3], atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"over": ["rebound"]}, "No parameter is named 'rebound': did you mean"),
        ({"freeze": ["foo"]}, "No parameter is named 'foo'"),
        ({"bounds": {"foo": (0.0, 1.0)}}, "No parameter is named 'foo'"),
        ({"freeze": ["*"]}, "All parameters are frozen, nothing is left to change: rebound_rate, compression_rate"),
        ({"over": []}, "nothing is left to change"),
        (
            {"bounds": {"rebound_rate": (3000.0, 4000.0)}},
            r"`rebound_rate` must start strictly between 3000 and 4000 \[N s/m\], but is 2600\.0\. Start inside",
        ),
        ({"bounds": {"rebound_rate": (0.0, np.inf)}}, r"`bounds\['rebound_rate'\]` must be two finite numbers"),
        ({"bounds": {"rebound_rate": (-5.0, -1.0)}}, "leave a range where rebound_rate is positive, but is (-5"),
        ({"bounds": {"rebound_rate": (4000.0, 3000.0)}}, "in increasing order, but is (4000.0, 3000.0)"),
    ],
)
def test_free_parameters_refuse(arguments, message):
    pattern = message if "\\" in message else re.escape(message)
    with pytest.raises(ValueError, match=pattern):
        free_parameters(Bilinear(2600.0, 1200.0), **arguments)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"rate": 3000.0}, "`freeze` must be names of parameters.*It takes no values"),
        ([("rate", (1.0, 2.0))], r"`freeze` must be names of parameters.*Write \['damper.rate'\]"),
        (3000.0, "`freeze` must be names of parameters"),
    ],
)
def test_names_that_carry_values_are_refused(names, message):
    with pytest.raises(ValueError, match=message):
        name_patterns("freeze", names)
    assert name_patterns("freeze", "rate") == ["rate"] and name_patterns("freeze", ("a", "b*")) == ["a", "b*"]


def test_bounds_of_what_is_not_free_are_refused():
    law = Bilinear(2600.0, 1400.0)
    with pytest.raises(ValueError, match=r"`bounds\['rebound_rate'\]` must bound a parameter that is free"):
        free_parameters(law, freeze=["rebound_rate"], bounds={"rebound_rate": (1.0, 1e4)})
    assert free_parameters(law, freeze=["rebound_rate"], bounds={"*_rate": (1.0, 1e4)}).names == ["compression_rate"]


def half_car():
    return presets.half_car_002(Bilinear(2600.0, 1200.0))


FRONT = {"front.damper.*": "rear.damper.*"}


def test_a_group_of_tied_parameters_is_one_free_value():
    free = free_parameters(half_car(), over=["damper.**"], tie=FRONT)
    assert free.names == ["rear.damper.rebound_rate", "rear.damper.compression_rate"]
    assert free.followers == [("front.damper.rebound_rate",), ("front.damper.compression_rate",)]
    for tree in (free.build(jnp.array([3000.0, 1000.0])), free.started_at(np.array([3000.0, 1000.0])).tree):
        assert get(tree, "front.damper.rebound_rate") == get(tree, "rear.damper.rebound_rate") == 3000.0
        assert get(tree, "front.damper.compression_rate") == 1000.0


def test_the_derivative_of_a_group_is_the_sum():
    def loads(car):
        return 2.0 * get(car, "front.damper.rebound_rate") + 3.0 * get(car, "rear.damper.rebound_rate")

    free = free_parameters(half_car(), over=["rebound_rate"], tie=FRONT)
    assert jax.grad(lambda values: loads(free.build(values)))(free.values) == 5.0


def test_over_freeze_and_bounds_of_one_hold_for_its_group():
    car = half_car()
    assert free_parameters(car, over=["front.damper.*"], tie=FRONT).names[0] == "rear.damper.rebound_rate"
    frozen = free_parameters(car, over=["damper.**"], freeze=["front.damper.rebound_rate"], tie=FRONT)
    assert frozen.names == ["rear.damper.compression_rate"] and len(frozen.ties) == 1
    bounded = free_parameters(car, over=["rebound_rate"], tie=FRONT, bounds={"front.*.rebound_rate": (1e3, 9e3)})
    assert bounded.limits() == (1e3, 9e3)


def test_one_parameter_may_lead_many_and_chains_have_one_end():
    law = Linear(10.0) + Linear(10.0) + Linear(10.0)
    assert free_parameters(law, tie={"rate": "terms.1.rate"}).names == ["terms.1.rate"]
    chain = free_parameters(law, tie={"terms.0.rate": "terms.1.rate", "terms.1.rate": "terms.2.rate"})
    assert chain.names == ["terms.2.rate"] and len(chain.followers[0]) == 2


def test_a_group_is_linear_only_if_all_of_it_is():
    law = replace(Linear(2.0) + 2.0 * Linear(10.0), {"terms.0.rate": 2.0})
    assert [p.linear for p in free_parameters(law, over=["rate"]).chosen] == [True, True]


@pytest.mark.parametrize(
    ("tie", "message"),
    [
        ({"front.dmper.*": "rear.damper.*"}, "No parameter is named 'front.dmper.*'"),
        ({"front.damper.*": "rear.dmper.*"}, "No parameter is named 'rear.dmper.*'"),
        (
            {"front.damper.*": "rear.*.rebound_rate"},
            "name one parameter that front.damper.rebound_rate takes its value",
        ),
        ({"front.damper.rebound_rate": "*_rate"}, "name one parameter that"),
        ({"front.damper.rebound_rate": "rear.unsprung_mass"}, "must tie parameters of one kind"),
        (
            {"front.damper.rebound_rate": "rear.damper.compression_rate"},
            "must tie parameters that start from one value",
        ),
        (
            {"front.*.rebound_rate": "rear.*.rebound_rate", "rear.*.rebound_rate": "front.*.rebound_rate"},
            "lead back to",
        ),
    ],
)
def test_ties_that_make_no_sense_are_refused(tie, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        free_parameters(half_car(), tie=tie)


def test_a_start_is_moved_into_its_bounds_and_ties():
    law = Bilinear(2600.0, 1200.0)
    free = free_parameters(law, bounds={"rebound_rate": (1000.0, 2000.0)}, move=True)
    assert free.values.tolist() == [1980.0, 1200.0]
    tied = free_parameters(law, tie={"rebound_rate": "compression_rate"}, move=True)
    assert tied.names == ["compression_rate"] and float(tied.tree.rebound_rate) == 1200.0
    with pytest.raises(ValueError, match="must start strictly between 1000 and 2000"):
        free_parameters(law, bounds={"rebound_rate": (1000.0, 2000.0)})


@pytest.mark.parametrize(("path", "near"), [("rebound_rat", "rebound_rate"), ("terms.5.rate", "rebound_rate")])
def test_a_path_to_nothing_names_the_nearest(path, near):
    with pytest.raises(LookupError, match=f"Nothing is at the path '{path}': .*{near}"):
        get(Bilinear(2600.0, 1200.0), path)
