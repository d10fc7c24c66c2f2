"""comfort, travel and grip mean the same metrics wherever a metric is named."""

from typing import Any

import jax
import numpy as np
import pytest

from jaxdamp import Ride, roads, simulate, tune, vehicles


CAR = vehicles.presets.half_car_002()
WHITE = roads.white("C", 20.0)


def test_a_short_name_is_its_metrics() -> None:
    assert CAR.goal_metrics("travel") == ["front_working_space_peak_to_peak", "rear_working_space_peak_to_peak"]
    assert CAR.goal_metrics("travel", white=True) == ["front_working_space_rms", "rear_working_space_rms"]
    assert CAR.goal_metrics("rms_pitch_acceleration") == ["rms_pitch_acceleration"]
    names = [name for goal in ("comfort", "travel", "grip") for name in CAR.goal_metrics(goal, white=True)]
    assert set(jax.eval_shape(Ride(CAR, WHITE, metrics=["comfort", "travel", "grip"]))) == set(names)
    bump = roads.cosine_bump(0.05, start=0.1, length=4.0, speed=20.0)
    assert set(simulate(CAR, bump, duration=0.5).metrics(["grip"])) == set(CAR.goal_metrics("grip"))
    with pytest.raises(ValueError, match="Did you mean 'comfort'"):
        CAR.goal_metrics("confort")


def test_a_tuning_takes_short_names_as_objective_and_limits() -> None:
    how: Any = {"fresh_roads": 0, "max_steps": 3}
    travel = tune.minimise("travel", CAR, WHITE, limits={"grip": "+10%"}, **how)
    front, rear = CAR.goal_metrics("travel", white=True)
    mean = 0.5 * (float(travel.after[front]) + float(travel.after[rear]))
    assert travel.metric == "travel" and travel.after["travel"] == pytest.approx(mean, rel=1e-12)
    assert set(travel.limits) == set(CAR.goal_metrics("grip"))
    short, full = (tune.minimise(name, CAR, WHITE, **how) for name in ("comfort", "weighted_rms_sprung_acceleration"))
    assert short.metric == full.metric
    np.testing.assert_array_equal([p.after for p in short.parameters], [p.after for p in full.parameters])
    with pytest.raises(ValueError, match="Did you mean 'travel'"):
        tune.minimise("comfort", CAR, WHITE, limits={"trawel": 1.0})
