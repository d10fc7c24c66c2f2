import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, vehicles
from jaxdamp._many_points import outside_domains
from jaxdamp.parameters import interval, parameter, positive


def test_each_number_is_held_against_its_domain():
    car = vehicles.presets.quarter_car_000(dampers.BoucWen(1000.0, 500.0, 2e5, 300.0))
    columns = {"exponent": np.array([0.5, 2.0, 2.0, 30.0]), "tyre_damping": np.array([0.0, 0.0, -1.0, -1.0])}
    exponent, damping = "damper.exponent must be between 1 and 20", "tyre_damping must be not negative [N s/m]"
    assert outside_domains(car, columns).tolist() == [exponent, "", damping, exponent]


def test_conditions_between_several_numbers_are_checked():
    law = dampers.TemperatureScaled(dampers.Linear(1500.0), temperature=320.0)
    car = vehicles.presets.quarter_car_000(dampers.SeriesSpring(law, 1e6))
    reasons = outside_domains(car, {"sensitivity": np.array([0.002, 0.1]), "stiffness": np.array([1e5, 1e6])})
    assert reasons.tolist() == ["", "sensitivity must give a positive factor 1 − κ (T − T₀) on the force"]


class Ordered(eqx.Module):
    """A parameter whose domain ends at another parameter."""

    low: object = parameter("m", "lower end", positive)
    high: object = parameter("m", "upper end", lambda self: interval(float(self.low), 10.0))


def test_domains_that_follow_from_other_values():
    reasons = outside_domains(Ordered(1.0, 2.0), {"low": np.array([1.0, 3.0, 3.0]), "high": np.array([2.0, 2.0, 4.0])})
    assert reasons.tolist() == ["", "high must be between 3 and 10", ""]
    # the lower end alone moves the domain of the other
    assert outside_domains(Ordered(1.0, 2.0), {"low": np.array([1.5, 2.5])}).tolist() == [
        "",
        "high must be between 2.5 and 10",
    ]


def test_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match="did you mean 'rate'"):
        outside_domains(dampers.Linear(1500.0), {"rat": np.array([1.0])})


def test_vectors_are_left_to_the_function():
    law = dampers.PiecewiseLinear(jnp.array([0.1]), jnp.array([900.0, 500.0]))
    assert outside_domains(law, {"knots": np.array([-1.0, 1.0])}).tolist() == ["", ""]
