import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jaxdamp.dampers import (
    Besinger,
    Bilinear,
    CoulombFriction,
    Lag,
    Linear,
    MonoTube,
    PiecewiseLinear,
    PowerLaw,
    SegmentedPolynomial,
    TemperatureScaled,
)
from jaxdamp.parameters import (
    Coordinates,
    Domain,
    checked,
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
    with_values,
)
from jaxdamp.vehicles import presets


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


# ---- checking again


def test_checked_finds_what_any_module_of_a_tree_refuses():
    law = TemperatureScaled(Linear(1500.0), temperature=330.0)
    car = presets.quarter_car_000(law)
    assert checked(car) is car
    too_hot = with_values(car, {"damper.sensitivity": jnp.asarray(0.1)})
    with pytest.raises(ValueError, match="sensitivity"):
        checked(too_hot)
    with pytest.raises(ValueError, match=r"`QuarterCar\.spring_rate` must be positive"):
        checked(with_values(car, {"spring_rate": jnp.asarray(-1.0)}))


@pytest.mark.parametrize(
    ("law", "values"),
    [
        (TemperatureScaled(Linear(1500.0), temperature=330.0), {"sensitivity": 0.1}),
        (Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05), {"compression_rate": 1.0}),
        (MonoTube.reference(), {"gas.pressure": 9e4}),
    ],
    ids=["on the law inside", "between parameters", "on a part"],
)
def test_replace_refuses_what_the_constructor_refuses(law, values):
    with pytest.raises(ValueError, match="Argument"):
        replace(Lag(law, 0.004), {f"law.{name}": value for name, value in values.items()})


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


# ---- coordinates


SMOOTH = ("none", "ordered", "all")


@pytest.mark.parametrize("smooth", SMOOTH)
def test_coordinates_lead_to_the_values_and_back(smooth):
    free = free_parameters(composed(), bounds={"lag_time": (0.001, 0.01)})
    coordinates = Coordinates(free, smooth)
    np.testing.assert_allclose(coordinates.to_physical(coordinates.start), free.values, rtol=1e-12)
    other = free.values * 1.2
    np.testing.assert_allclose(coordinates.to_physical(coordinates.from_physical(other)), other, rtol=1e-9)


@pytest.mark.parametrize("smooth", SMOOTH)
def test_coordinates_within_bounds_and_order_are_values_within_their_domains(smooth, rng):
    law = PiecewiseLinear([-0.1, 0.2, 0.25], [500.0, 2000.0, 800.0, 700.0])
    coordinates = Coordinates(free_parameters(law, bounds={"slopes": (100.0, 3000.0)}), smooth)
    (lower, upper), (rows, gaps) = coordinates.bounds(), coordinates.order()
    assert rows.shape == ((2, 7) if smooth == "none" else (0, 7))
    inside = 0
    for _ in range(20):
        y = np.clip(np.asarray(coordinates.start) + 0.3 * rng.standard_normal(7), lower, upper)
        if np.all(rows @ y >= gaps):
            checked(coordinates.free.build(coordinates.to_physical(jnp.asarray(y))))
            slopes = coordinates.to_physical(jnp.asarray(y))[3:]
            assert np.all((slopes >= 100.0) & (slopes <= 3000.0))
            inside += 1
    assert inside > 5


def test_rows_of_order_say_when_knots_meet():
    coordinates = Coordinates(free_parameters(PiecewiseLinear([-0.1, 0.2], [5.0, 6.0, 7.0]), over=["knots"]), "none")
    rows, gaps = coordinates.order()
    y = coordinates.from_physical(jnp.array([0.1, 0.3]))
    np.testing.assert_allclose(rows @ np.asarray(y), [0.2], rtol=1e-12)
    assert 0.0 < gaps[0] < 1e-6


def test_a_raw_step_of_one_is_of_the_size_of_the_parameter():
    law = SegmentedPolynomial([-1.0, -0.01], 0.2, [1.0] * 4, [1.0] * 2, [1.0] * 4, [1.0] * 2, [1.0] * 4)
    coordinates = Coordinates(free_parameters(law, over=["compression_knots"]), "ordered")
    slope = jax.jacfwd(coordinates.to_physical)(coordinates.start)
    np.testing.assert_allclose(np.abs(slope[1, 1]), 0.01, rtol=0.5)
    np.testing.assert_allclose(np.abs(slope[0, 0]), 0.99, rtol=0.5)


def test_a_zero_starts_inside_its_domain_where_the_map_is_smooth():
    coordinates = Coordinates(free_parameters(PowerLaw(1800.0, 0.5, 900.0, 0.5), over=["rebound_offset"]), "all")
    np.testing.assert_allclose(coordinates.to_physical(coordinates.start), [0.01], rtol=1e-6)


def test_vectors_without_numbers():
    free = free_parameters(PiecewiseLinear([], [1500.0]))
    assert free.names == ["slopes[0]"] and free.values.shape == free.limits()[0].shape == (1,)
    for smooth in SMOOTH:
        assert Coordinates(free, smooth).start.shape == (1,)


def test_ends_of_ranges_and_neighbours():
    law = PiecewiseLinear([-0.1, 0.2], [500.0, 2000.0, 800.0])
    coordinates = Coordinates(free_parameters(law, bounds={"slopes": (100.0, 3000.0)}), "ordered")
    ends = coordinates.at_ends(np.array([0.2 - 1e-7, 0.2, 100.0, 3000.0, 800.0]))
    np.testing.assert_array_equal(ends, [1.0, -1.0, -1.0, 1.0, 0.0])


# ---- ties


def half_car():
    return presets.half_car_002(Bilinear(2600.0, 1200.0))


FRONT = {"front.damper.*": "rear.damper.*"}


def test_a_group_of_tied_parameters_is_one_free_value():
    free = free_parameters(half_car(), over=["damper*"], tie=FRONT)
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
    frozen = free_parameters(car, over=["damper*"], freeze=["front.damper.rebound_rate"], tie=FRONT)
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
