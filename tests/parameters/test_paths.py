"""Parameters by path: listed, read, replaced, and checked again."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.dampers import (
    Besinger,
    Lag,
    Linear,
    MonoTube,
    PiecewiseLinear,
    TemperatureScaled,
)
from jaxdamp.parameters import (
    checked,
    get,
    match_paths,
    matched_in_words,
    parameters,
    replace,
    with_values,
)
from jaxdamp.vehicles import presets

from .laws import PATHS, composed


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
        (["law.terms.1.*"], PATHS[4:5]),  # not those of the law inside: a `*` crosses no dot
        (["law.terms.1.**"], PATHS[2:5]),
        (["law.terms.*.law.*", "**.friction_force"], PATHS[2:4]),
        (["terms.**.friction_force", "terms.1.**.factor"], [PATHS[2], PATHS[4]]),
        (["law.**_force"], PATHS[2:3]),
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


def test_a_pattern_that_fits_nothing_is_answered_with_what_would():
    with pytest.raises(
        ValueError, match=r"named 'terms\.\*_force': a `\*` .* 'terms\.\*\*_force' would be law\.terms\.1"
    ):
        match_paths(PATHS, ["terms.*_force"])
    with pytest.raises(ValueError, match=r"named 'lag_tme\*': the nearest are lag_time.* The parameters are"):
        match_paths(PATHS, ["lag_tme*"])


def test_what_patterns_stand_for_is_said():
    words = matched_in_words(PATHS, freeze=["law.terms.1.*", "lag_time"], bounds={"friction_*": (0.0, 1.0)})
    friction = "law.terms.1.law.friction_force, law.terms.1.law.friction_velocity"
    assert words == f"freeze 'law.terms.1.*' = law.terms.1.factor; bounds 'friction_*' = {friction}"


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
        ({"lag_time": 0.1, "*_time": 0.2}, "'lag_time' and '\\*_time', which both name lag_time"),
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
