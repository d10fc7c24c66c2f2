"""A run says by how much it takes dampers outside the range of their records, and costs nothing where none has one."""

import warnings
from typing import Any

import jax
import numpy as np
import pytest

from jaxdamp import Ride, respond, roads, simulate
from jaxdamp.dampers import (
    AbstractDamper,
    Bilinear,
    FittedRange,
    Linear,
    MotionRatio,
    OutsideFittedRangeWarning,
    RangeUse,
    with_fitted_range,
)
from jaxdamp.simulation import notes, over_runs
from jaxdamp.vehicles import AbstractVehicle, presets


LAW = Bilinear(2600.0, 1200.0)
SLOW = FittedRange(velocity=(-0.1, 0.2), stroke=(-0.001, 0.001))
WIDE = FittedRange(velocity=(-10.0, 10.0), force=(-1e5, 1e5))
BUMP = roads.cosine_bump(0.05, start=0.2, length=3.0, speed=15.0)
TIMES: dict[str, Any] = {"duration": 1.0, "dt": 0.004}


def half_car(law: AbstractDamper) -> tuple[AbstractVehicle, roads.AbstractRoad]:
    car = presets.half_car_002(law)
    return car, roads.delayed(BUMP, positions=car.axle_positions, speed=15.0)


@pytest.mark.slow
def test_a_run_names_every_damper_with_its_own_numbers():
    car, road = half_car(with_fitted_range(LAW, SLOW))
    with pytest.warns(OutsideFittedRangeWarning) as caught:
        response = simulate(car, road, **TIMES)
    assert [str(w.message) for w in caught] == [f"Extrapolated: {note}" for note in response.notes]
    for name, note in zip(("front", "rear"), response.notes, strict=True):
        velocity = np.asarray(response[f"{name}_damper_velocity"])
        (use,) = response.range_use()[f"{name}_damper"]
        assert use.used == pytest.approx((velocity.min(), velocity.max()), rel=1e-12)
        assert use.share == pytest.approx(np.mean((velocity < -0.1) | (velocity > 0.2)))
        times = max(-velocity.min() / 0.1, velocity.max() / 0.2)
        assert use.times == pytest.approx(times)
        assert note.startswith(f"{name} damper: velocity −") and f"({times:.2g} times)" in note


def test_a_damper_behind_a_motion_ratio_is_judged_by_its_own_velocity():
    car, road = half_car(MotionRatio(with_fitted_range(LAW, SLOW), 0.5))
    with pytest.warns(OutsideFittedRangeWarning):
        response = simulate(car, road, **TIMES)
    (use,) = response.range_use()["front_damper"]
    assert use.used[1] == pytest.approx(0.5 * np.asarray(response["front_damper_velocity"]).max(), rel=1e-12)


def test_within_the_range_and_without_one_nothing_is_said(monkeypatch):
    for law in (with_fitted_range(LAW, WIDE), LAW):
        response = simulate(*half_car(law), **TIMES)
        assert response.notes == () and bool(response.range_use()) == (law is not LAW)
    monkeypatch.setattr(notes, "named_laws", None)  # it would raise if it were called
    assert simulate(*half_car(LAW), **TIMES).notes == ()


def test_a_range_changes_no_number_and_compiles_nothing_anew():
    compiled = []
    plain = simulate(*half_car(LAW), **TIMES)
    ranged = simulate(*half_car(with_fitted_range(LAW, WIDE)), **TIMES)

    def listener(event: str, duration_secs: float, **rest: Any) -> None:
        del duration_secs, rest
        if event.endswith("backend_compile_duration"):
            compiled.append(event)

    jax.monitoring.register_event_duration_secs_listener(listener)
    try:
        again = simulate(*half_car(with_fitted_range(LAW, FittedRange(velocity=(-7.0, 8.0)))), **TIMES)
        assert compiled == []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OutsideFittedRangeWarning)
            assert simulate(*half_car(with_fitted_range(Bilinear(2000.0, 900.0), SLOW)), **TIMES).notes
        assert compiled == []
        jax.jit(lambda x: 3.0 * x - 0.123)(1.0)
        assert compiled, "compilations are no longer counted"
    finally:
        jax.monitoring.unregister_event_duration_listener(listener)
    for response in (ranged, again):
        np.testing.assert_array_equal(response.motion, plain.motion)
        np.testing.assert_array_equal(response.port_force, plain.port_force)


@pytest.mark.slow
def test_inside_compiled_code_nothing_is_said():
    def peak(rate):
        car, road = half_car(with_fitted_range(Linear(rate), SLOW))
        return simulate(car, road, **TIMES)["front_stroke"].max()

    slope = jax.jacfwd(peak)(1500.0)
    plain = jax.jacfwd(lambda rate: simulate(*half_car(Linear(rate)), **TIMES)["front_stroke"].max())(1500.0)
    assert float(slope) == float(plain)


def test_a_ride_says_it_for_a_point_when_asked():
    car, road = half_car(with_fitted_range(LAW, SLOW))
    ride = Ride(car, road, metrics=["rms_pitch_acceleration"], **TIMES)
    plain = Ride(*half_car(LAW), metrics=["rms_pitch_acceleration"], **TIMES)
    point = {"front.damper.rebound_rate": 3000.0}
    assert float(ride(point)["rms_pitch_acceleration"]) == float(plain(point)["rms_pitch_acceleration"])
    with pytest.warns(OutsideFittedRangeWarning):
        stiff = simulate(*half_car(with_fitted_range(LAW, SLOW)), **TIMES).range_use()
    assert {name: [use.words() for use in uses] for name, uses in ride.range_use().items()} == {
        name: [use.words() for use in uses] for name, uses in stiff.items()
    }
    assert ride.range_use(point)["front_damper"][0].used[1] < ride.range_use()["front_damper"][0].used[1]
    assert plain.range_use() == {}


def test_respond_warns_as_well():
    time = np.linspace(0.0, 1.0, 501)
    law = with_fitted_range(Linear(1500.0), SLOW)
    with pytest.warns(OutsideFittedRangeWarning, match=r"Linear: velocity −0.4 to 0.4 m/s.*\(4 times\)"):
        respond(law, time, 0.02 * np.sin(20 * time), 0.4 * np.cos(20 * time))
    slow = respond(law, time, 0.004 * np.sin(20 * time), 0.08 * np.cos(20 * time))
    np.testing.assert_allclose(slow, 1500.0 * 0.08 * np.cos(20 * time), rtol=1e-12)
    jax.jit(lambda scale: respond(law, time, scale * np.sin(20 * time)))(0.02)


def test_of_several_runs_the_extremes_and_the_mean_share_count():
    use = RangeUse("Linear", "velocity", "m/s", (-0.2, 0.1), (-0.1, 0.1), 0.1)
    other = use._replace(used=(-0.1, 0.3), share=0.3)
    (together,) = over_runs([{"damper": [use]}, {"damper": [other]}])["damper"]
    assert together.used == (-0.2, 0.3) and together.share == pytest.approx(0.2)
