import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jaxdamp.dampers import Bilinear, CoulombFriction, Lag, Linear, PiecewiseLinear, PowerLaw, SegmentedPolynomial
from jaxdamp.parameters import (
    Domain,
    free_parameters,
    get,
    increasing,
    increasing_negative,
    interval,
    match_paths,
    name_patterns,
    nonnegative,
    ordered_interval,
    parameters,
    positive,
    real,
    replace,
)


# ---- transforms

DOMAINS = [
    real,
    positive,
    nonnegative,
    increasing,
    increasing_negative,
    interval(-3.0, 0.5),
    ordered_interval(-2.0, 1.0),
]
RAW = arrays(np.float64, 4, elements=st.floats(-8.0, 8.0))
SCALE = arrays(np.float64, 4, elements=st.floats(1e-3, 1e6))


@pytest.mark.parametrize("domain", DOMAINS, ids=lambda d: d.name)
@settings(max_examples=40, deadline=None)
@given(raw=RAW, scale=SCALE)
def test_from_raw_lands_in_the_domain_and_to_raw_leads_back(domain: Domain, raw, scale):
    value = domain.from_raw(jnp.asarray(raw), jnp.asarray(scale))
    array = np.asarray(value)
    assert np.all(np.isfinite(array)) and np.all(array >= domain.lower) and np.all(array <= domain.upper)
    ordered = domain.steps is not None
    if not ordered or np.all(np.diff(array) > 1e-12 * np.abs(array).max()):
        assert domain.contains(array)
    if domain is nonnegative:
        raw = np.maximum(np.abs(raw), 0.1)  # a search starts at a hundredth of the scale
    # a difference of large numbers cannot tell steps that are smaller than their rounding
    if ordered and np.min(np.abs(np.diff(array))) < 1e-4 * np.abs(array).max():
        return
    np.testing.assert_allclose(domain.to_raw(value, jnp.asarray(scale)), raw, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("domain", "values"),
    [
        (real, [-2.0, 0.0, 5e3]),
        (positive, [1e-6, 1.0, 5e3]),
        (nonnegative, [0.5, 1.0, 5e3]),
        (increasing, [-2.0, 0.0, 5.0]),
        (increasing_negative, [-2.0, -0.5, -0.001]),
        (interval(-3.0, 6000.0), [-2.0, 0.0, 5e3]),
        (ordered_interval(-3.0, 1.0), [-2.0, 0.0, 0.9]),
    ],
    ids=lambda a: getattr(a, "name", ""),
)
def test_values_to_raw_and_back(domain, values):
    value, scale = jnp.array(values), jnp.array([2.0, 3.0, 4.0])
    assert domain.contains(np.asarray(value))
    np.testing.assert_allclose(domain.from_raw(domain.to_raw(value, scale), scale), value, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("domain", "values"),
    [
        (positive, [1.0, 0.0]),
        (nonnegative, [1.0, -1e-300]),
        (increasing, [0.0, 0.0]),
        (increasing_negative, [-1.0, 0.0]),
        (interval(0.0, 1.0), [0.5, 1.5]),
        (ordered_interval(0.0, 1.0), [0.7, 0.5]),
        (ordered_interval(0.0, 1.0), [0.5, 1.5]),
    ],
    ids=lambda a: getattr(a, "name", ""),
)
def test_domains_do_not_contain(domain, values):
    assert not domain.contains(np.array(values))


@pytest.mark.parametrize("make", [interval, ordered_interval])
@pytest.mark.parametrize("pair", [(1.0, 0.0), (0.0, np.inf), (np.nan, 1.0)])
def test_intervals_need_two_finite_numbers_in_order(make, pair):
    with pytest.raises(ValueError, match="Bounds must be two finite numbers in increasing order"):
        make(*pair)


# ---- paths


def composed():
    return Lag(PiecewiseLinear([-0.1, 0.2], [500.0, 2000.0, 800.0]) + 0.5 * CoulombFriction(40.0, 0.01), 0.004)


PATHS = [
    "law.terms.0.knots",
    "law.terms.0.slopes",
    "law.terms.1.law.friction_force",
    "law.terms.1.law.friction_velocity",
    "law.terms.1.factor",
    "lag_time",
]


def test_parameters_of_a_composition():
    found = parameters(composed())
    assert [p.path for p in found] == PATHS
    assert [p.unit for p in found] == ["m/s", "N s/m", "N", "m/s", "", "s"]
    assert [p.domain.name for p in found] == [
        "strictly increasing",
        "positive",
        "positive",
        "positive",
        "not negative",
        "positive",
    ]
    assert [p.linear for p in found] == [False, True, True, False, False, False]


def test_a_domain_may_depend_on_a_setting():
    law = PiecewiseLinear([0.0], [500.0, -2.0], monotone=False)
    assert {p.path: p.domain.name for p in parameters(law)}["slopes"] == "real"


def test_get_follows_a_path():
    law = composed()
    assert get(law, "law.terms.1.law.friction_force") == 40.0
    assert get(law, "") is law


@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        (["lag_time"], ["lag_time"]),
        ("lag_time", ["lag_time"]),
        (["slopes", "knots"], PATHS[:2]),
        (["friction_*"], PATHS[2:4]),
        (["law.terms.1.*"], PATHS[2:5]),
        (["*"], PATHS),
        (["lag_time", "lag_time"], ["lag_time"]),
        ([], []),
    ],
)
def test_patterns(patterns, expected):
    assert match_paths(PATHS, patterns) == expected


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(ValueError, match=r"No parameter is named 'lagtime': did you mean 'lag_time'\? The parameters"):
        match_paths(PATHS, ["lagtime"])
    with pytest.raises(ValueError, match=r"No parameter is named 'qqq': The parameters are law\.terms\.0\.knots, "):
        match_paths(PATHS, ["qqq"])


def test_replace():
    law = composed()
    changed = replace(law, {"lag_time": 0.01, "friction_force": 55, "law.terms.0.slopes": [1.0, 2.0, 3.0]})
    assert get(changed, "lag_time") == 0.01 and get(changed, "law.terms.1.law.friction_force") == 55.0
    np.testing.assert_array_equal(get(changed, "law.terms.0.slopes"), [1.0, 2.0, 3.0])
    assert get(law, "lag_time") == 0.004
    assert jax.tree.structure(changed) == jax.tree.structure(law)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"lag": 1.0}, "No parameter is named 'lag'"),
        (
            {"lag_time": -1.0},
            r"`Lag\.lag_time` must be positive \[s\], but is -1\.0\. It is the time constant of the lag",
        ),
        ({"friction_force": np.nan}, r"`CoulombFriction\.friction_force` must be finite, but is nan"),
        ({"knots": [0.2, 0.1]}, r"`PiecewiseLinear\.knots` must be strictly increasing"),
    ],
)
def test_replace_refuses(values, message):
    with pytest.raises(ValueError, match=message):
        replace(composed(), values)


def test_replace_inside_compiled_functions():
    def force(rate):
        return replace(Linear(1.0), {"rate": rate}).force_velocity(0.5)

    assert jax.jit(jax.grad(force))(3.0) == 0.5
    rates = jnp.array([1.0, 2.0])
    np.testing.assert_array_equal(jax.vmap(force)(rates), 0.5 * rates)


# ---- free parameters


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
    np.testing.assert_allclose(free.physical(free.raw), free.values, rtol=1e-12)
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
    free = free_parameters(law, bounds={"rebound_rate": (1000.0, 3000.0)})
    lower, upper = free.limits()
    np.testing.assert_array_equal(lower, [1000.0, 0.0])
    np.testing.assert_array_equal(upper, [3000.0, np.inf])
    np.testing.assert_allclose(free.physical(free.raw), [2600.0, 1200.0], rtol=1e-9)
    for raw in (-50.0, 50.0):
        value = free.physical(jnp.full(2, raw))[0]
        assert 1000.0 <= value <= 3000.0


def test_bounds_meet_the_domain():
    free = free_parameters(Linear(100.0), bounds={"rate": (-500.0, 500.0)})
    assert free.limits()[0] == 0.0


def test_bounds_keep_the_order_of_knots():
    law = PiecewiseLinear([-0.1, 0.2, 0.25], [500.0, 2000.0, 800.0, 700.0])
    free = free_parameters(law, over=["knots"], bounds={"knots": (-0.5, 0.5)})
    np.testing.assert_allclose(free.physical(free.raw), [-0.1, 0.2, 0.25], rtol=1e-9)
    for key in range(5):
        knots = free.physical(3.0 * jax.random.normal(jax.random.key(key), (3,)))
        assert np.all(np.diff(knots) > 0) and knots[0] > -0.5 and knots[-1] < 0.5


def test_a_raw_step_of_one_is_of_the_size_of_the_parameter():
    law = SegmentedPolynomial([-1.0, -0.01], 0.2, [1.0] * 4, [1.0] * 2, [1.0] * 4, [1.0] * 2, [1.0] * 4)
    free = free_parameters(law, over=["compression_knots"])
    slope = jax.jacfwd(free.physical)(free.raw)
    np.testing.assert_allclose(np.abs(slope[1, 1]), 0.01, rtol=0.5)
    np.testing.assert_allclose(np.abs(slope[0, 0]), 0.99, rtol=0.5)


def test_a_zero_starts_inside_its_domain():
    free = free_parameters(PowerLaw(1800.0, 0.5, 900.0, 0.5), over=["rebound_offset"])
    assert free.values[0] == 0.0
    np.testing.assert_allclose(free.physical(free.raw), [0.01], rtol=1e-6)


def test_vectors_without_numbers():
    free = free_parameters(PiecewiseLinear([], [1500.0]))
    assert free.names == ["slopes[0]"] and free.values.shape == free.raw.shape == free.limits()[0].shape == (1,)


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
