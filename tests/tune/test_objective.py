"""What a tuning minimises beside a name: a metric of any channel, and functions of metrics."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, dampers, metrics, roads, tune, vehicles
from jaxdamp.metrics import Metric
from jaxdamp.parameters import get


CAR, WHITE = vehicles.presets.quarter_car_000(), roads.white("C", 20.0)
BUMP = roads.cosine_bump(0.05, start=0.1, duration=0.2)


def weighted_sum(m):
    return m["rms_sprung_acceleration"] ** 2 + 1e-5 * m["rms_dynamic_tyre_load"] ** 2


def test_a_function_of_metrics_is_minimised():
    """The optimum of a sum lies between those of its parts, where its slope by the rate is zero."""
    result = tune.minimise(weighted_sum, CAR, WHITE)
    assert result.status is tune.Status.CONVERGED and result.metric == "weighted_sum"
    best = get(result.vehicle, "damper.rate")
    parts = ("rms_sprung_acceleration", "rms_dynamic_tyre_load")
    ends = [get(tune.minimise(name, CAR, WHITE).vehicle, "damper.rate") for name in parts]
    assert min(ends) + 1.0 < best < max(ends) - 1.0

    def value(rate):
        rms = vehicles.stationary_rms(
            vehicles.linearise(vehicles.presets.quarter_car_000(dampers.Linear(rate))), WHITE.velocity_psd
        )
        return float(rms["sprung_acceleration"] ** 2 + 1e-5 * rms["dynamic_tyre_load"] ** 2)

    assert value(best) < min(value(best * 0.99), value(best * 1.01))
    assert result.after["weighted_sum"] == pytest.approx(value(best), rel=1e-9)
    assert "weighted_sum" in repr(result) and result.units["weighted_sum"] == ""


def test_a_metric_of_any_channel_is_minimised_and_limited():
    deep, late = Metric("stroke", "minimum", name="deepest"), Metric("stroke", "standard_deviation", window=(0.4, 0.8))
    limits = {"peak_damper_velocity": 10.0}
    result = tune.minimise(late, CAR, BUMP, metrics=[deep], limits=limits, duration=0.8, max_steps=4)
    assert result.metric == late.name and result.after[late.name] < result.before[late.name]
    assert result.units["deepest"] == "m" and result.after["deepest"] < 0
    again = tune.rescore(result, [BUMP], duration=0.8)
    np.testing.assert_allclose(again.after[late.name], result.after[late.name], rtol=1e-9)


@pytest.mark.parametrize("share", [0.9, 0.0])
def test_limits_of_signed_metrics_hold(share):
    """A negative metric below a negative limit, and a limit of zero, are as good as positive ones."""
    highest, start = Metric("stroke", "maximum", window=(0.2, 0.22), name="highest"), -0.0404  # compressed all the time
    result = tune.minimise(
        "peak_damper_velocity", CAR, BUMP, metrics=[highest], limits={"highest": share * start}, duration=0.8
    )
    assert result.before["highest"] == pytest.approx(start, rel=1e-2)
    assert result.after["peak_damper_velocity"] < 0.99 * result.before["peak_damper_velocity"]
    assert result.after["highest"] < share * start + 1e-6 and result.status is tune.Status.CONVERGED
    assert bool(result.active_limits) == (share > 0)


def test_only_what_a_function_asks_for_is_computed():
    result = tune.minimise(lambda m: m["weighted_rms_sprung_acceleration"], CAR, WHITE, max_steps=1)
    assert result.metric == "objective" and "weighted_rms_sprung_acceleration" in result.after
    assert "vibration_dose_value_sprung_acceleration" not in result.after


COMFORT, SPACE = "rms_sprung_acceleration", "working_space_rms"


@pytest.mark.parametrize("beside", [0.0, 1e-6, 1e-3])
def test_targets_met_at_the_start_give_way_to_a_limit(beside):
    """Comfort as it is, but less working space: the damper that the limit needs."""
    start = Ride(CAR, WHITE, metrics=[COMFORT, SPACE])({})
    wanted = tune.Targets({COMFORT: (float(start[COMFORT]) * (1.0 + beside), 0.01)})
    result = tune.minimise(wanted, CAR, WHITE, limits={SPACE: 0.8 * float(start[SPACE])})
    assert result.status is tune.Status.CONVERGED and result.active_limits == (SPACE,)
    # By the closed form the square of the working space falls as one over the rate of a linear damper.
    assert float(get(result.vehicle, "damper.rate")) == pytest.approx(2500.0 / 0.8**2, rel=1e-3)


def test_targets_that_are_met_exactly_are_an_optimum():
    wanted = tune.Targets({COMFORT: (0.93, 0.01)})
    result = tune.minimise(wanted, CAR, WHITE)
    assert result.status is tune.Status.CONVERGED and result.after[COMFORT] == pytest.approx(0.93, rel=1e-6)


def test_what_is_no_objective_is_refused():
    with pytest.raises(KeyError, match="did you mean 'rms_sprung_acceleration'"):
        tune.minimise(lambda m: m["rms_sprung_accel"], CAR, WHITE)
    with pytest.raises(ValueError, match="`metric` must give one number"):
        tune.minimise(lambda m: jnp.stack([m["rms_sprung_acceleration"]] * 2), CAR, WHITE)
    with pytest.raises(ValueError, match="`metric` must have a slope, but is 'lift_off_fraction'"):
        tune.minimise(lambda m: m["lift_off_fraction"], CAR, BUMP, duration=0.4)
    with pytest.raises(ValueError, match=r"`metrics` must have a slope, but is 'lift_off_fraction', a count. Leave it"):
        tune.minimise(COMFORT, CAR, BUMP, metrics=["lift_off_fraction"], duration=0.4)
    with pytest.raises(ValueError, match=r"`metric` must be one of .*'rms_sprung_acceleration'"):
        tune.minimise(Metric("stroke", metrics.percentile(95)), CAR, WHITE)


def test_a_parameter_that_meets_a_limit_is_not_without_effect():
    """The largest acceleration on a bump comes from compression, the extension behind it from rebound."""
    car = vehicles.presets.quarter_car_000(dampers.Bilinear(2500.0, 2500.0))
    kick = Metric("sprung_acceleration", "maximum", name="kick")
    droop = Metric("stroke", "maximum", from_rest=True, name="droop")
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.25)
    result = tune.minimise(kick, car, bump, limits={droop: 0.015}, max_steps=10, duration=1.0, dt=2e-3)
    assert not result.without_effect and result.after["droop"] == pytest.approx(0.015, rel=1e-3)
