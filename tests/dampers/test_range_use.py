"""By how much a use leaves the fitted range: the numbers, inside wrappers too, and the words."""

import warnings
from typing import Any

import numpy as np
import pytest

from jaxdamp.dampers import (
    AbstractDamper,
    BumpStop,
    Bushing,
    FittedRange,
    GasSpring,
    Lag,
    Linear,
    ModifiedBoucWen,
    Motion,
    MotionRatio,
    OutsideFittedRangeWarning,
    RangeUse,
    Scaled,
    Scheduled,
    SeriesSpring,
    Spring,
    TemperatureScaled,
    extrapolated,
    range_use,
    with_command,
    with_fitted_range,
)
from jaxdamp.dampers.range_use import sentence


FITTED = with_fitted_range(Linear(1500.0), velocity=(-0.1, 0.2), stroke=(-0.02, 0.02), force=(-150.0, 300.0))
TIME = np.linspace(0.0, 1.0, 4001)
VELOCITY = 0.5 * np.cos(40 * TIME)
MOTION = Motion(0.05 * np.sin(20 * TIME), VELOCITY, 1500.0 * VELOCITY)
SHARE = np.mean((VELOCITY < -0.1) | (VELOCITY > 0.2))


def uses(law: AbstractDamper, motion: Motion = MOTION) -> dict[str, RangeUse]:
    return {use.quantity: use for use in range_use(law, motion)}


def test_velocity_beyond_the_range_is_counted():
    use = uses(FITTED)["velocity"]
    assert use.used == (pytest.approx(-0.5, abs=1e-4), pytest.approx(0.5, abs=1e-4)) and use.fitted == (-0.1, 0.2)
    assert use.outside and use.times == pytest.approx(5.0, rel=1e-3) and use.beyond == pytest.approx(0.4, rel=1e-3)
    assert use.share == pytest.approx(SHARE)


def test_inside_the_range_nothing_is_said():
    slow = Motion(0.01 * np.sin(TIME), 0.1 * np.sin(TIME), 150.0 * np.sin(TIME))
    assert not any(use.outside for use in range_use(FITTED, slow)) and sentence("damper", range_use(FITTED, slow)) == ""
    assert range_use(Linear(1500.0), MOTION) == []


def test_a_small_excess_is_tolerated():
    for peak, outside in ((0.209, False), (0.211, True)):
        use = uses(FITTED, Motion(velocity=np.array([-0.1, peak])))["velocity"]
        assert use.outside is outside and use.beyond == pytest.approx(peak - 0.2)


def test_the_stroke_counts_for_laws_that_depend_on_it():
    covered = FittedRange(velocity=(-0.1, 0.2), stroke=(-0.02, 0.02))
    assert "stroke" not in uses(FITTED) and "stroke" not in uses(Lag(FITTED, 0.01))
    for law in (Linear(1.0) + Spring(1.0, 0.0), GasSpring(2e6, 6e-5, 1e-4, 1.3)):
        use = uses(with_fitted_range(law, covered))["stroke"]
        assert use.outside and use.times == pytest.approx(2.5, rel=1e-3)


@pytest.mark.parametrize(
    ("law", "velocity", "force"),
    [
        (MotionRatio(FITTED, 0.5), 0.25, 1500.0),
        (2.0 * FITTED, 0.5, 375.0),
        (Scaled(FITTED, -1.0, allow_active=True), 0.5, 750.0),
        (SeriesSpring(FITTED, 1e6), 0.5, 750.0),
        (Bushing(FITTED, 1e6, 1e6, 100.0), 0.5, 750.0),
        (TemperatureScaled(FITTED, 343.15, 293.15, 0.004), 0.5, 750.0 / 0.8),
        (Lag(FITTED, 0.01), 0.5, None),
        (FITTED + Spring(10.0, 0.0), 0.5, None),
        (2.0 * MotionRatio(FITTED, 2.0), 1.0, 187.5),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, AbstractDamper) else "",
)
def test_a_law_inside_is_judged_by_its_own_motion(law, velocity, force):
    found = uses(law)
    assert found["velocity"].used[1] == pytest.approx(velocity, rel=1e-4)
    assert found["force"].used[1] == pytest.approx(force, rel=1e-4) if force else "force" not in found


def test_a_factor_of_zero_leaves_the_force_unknown():
    assert set(uses(Scaled(FITTED, 0.0))) == {"velocity"}


def test_each_term_has_its_own_range_and_equal_ones_are_said_once():
    fast = with_fitted_range(BumpStop(0.01, 1e5, 1e7), velocity=(-2.0, 2.0))
    assert sorted(use.fitted for use in range_use(FITTED + fast, MOTION)) == [(-2.0, 2.0), (-0.1, 0.2)]
    whole = with_fitted_range(Linear(1.0) + Linear(2.0), velocity=(-0.1, 0.2)) + Spring(1.0, 0.0)
    assert sentence("damper", range_use(whole, MOTION)).count("velocity") == 1


def test_temperature_is_judged_inside_and_around():
    covered = FittedRange(temperature=(290.0, 310.0), velocity=(-1.0, 1.0))
    inside = TemperatureScaled(with_fitted_range(Linear(1500.0), covered), 353.15, 293.15, 0.002)
    around = with_fitted_range(TemperatureScaled(Linear(1500.0), 353.15, 293.15, 0.002), covered)
    for law in (inside, around, Lag(inside, 0.01)):
        use = uses(law)["temperature"]
        assert use.outside and use.used == (353.15, 353.15) and use.share is None
        assert sentence("damper", range_use(law, MOTION)) == "damper: temperature 80 °C, fitted to 16.9 to 36.9 °C."
    warm = TemperatureScaled(with_fitted_range(Linear(1500.0), covered), 300.0, 293.15, 0.002)
    assert not uses(warm)["temperature"].outside


def test_a_command_beyond_the_records_is_warned_of():
    law = Scheduled((Linear(900.0), Linear(4900.0)), levels=[0.0, 4.0], command=0.5)
    fitted = Lag(with_fitted_range(law, command=(0.0, 2.0)), 0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with_command(fitted, 2.0)
        with_command(law, 4.0)
    with pytest.warns(OutsideFittedRangeWarning, match="command 3.5, fitted to 0 to 2"):
        changed: Any = with_command(fitted, 3.5)
    assert changed.law.fitted_to == fitted.law.fitted_to
    with pytest.raises(ValueError, match="between 0 and 4"):
        with_command(fitted, 5.0)
    with pytest.warns(OutsideFittedRangeWarning, match="command 5"):
        with_command(with_fitted_range(ModifiedBoucWen.prototype(), command=(0.0, 2.0)), 5.0)


def test_the_sentence():
    text = sentence("front damper", range_use(FITTED, MOTION))
    share = f"{100 * SHARE:.0f} %"
    velocity = "velocity −0.5 to 0.5 m/s, fitted to −0.1 to 0.2 m/s (5 times)"
    assert text == f"front damper: {velocity}, {share} of the time outside."
    slow = Motion(velocity=0.1 * np.sin(TIME), force=900.0 * np.sin(TIME))
    assert sentence("damper", range_use(FITTED, slow)).startswith("damper: force 0 to 757 N, fitted to −150 to 300 N")


def test_a_range_of_one_side_has_no_multiple_on_the_other():
    law = with_fitted_range(Linear(1500.0), velocity=(0.0, 0.2))
    assert uses(law, Motion(velocity=np.array([-0.5, 0.1])))["velocity"].times is None
    assert uses(law, Motion(velocity=np.array([-0.5, 0.6])))["velocity"].times == pytest.approx(3.0)


def test_velocities_that_are_extrapolated():
    velocities = np.array([-0.3, -0.1, 0.0, 0.2, 0.3])
    np.testing.assert_array_equal(extrapolated(FITTED, velocities), [True, False, False, False, True])
    np.testing.assert_array_equal(
        extrapolated(MotionRatio(FITTED, 0.5), velocities), [True, False, False, False, False]
    )
    both = FITTED + with_fitted_range(Spring(1.0, 0.0), velocity=(-0.05, 1.0))
    np.testing.assert_array_equal(extrapolated(both, velocities), [True, True, False, False, True])
    assert not extrapolated(Linear(1.0), velocities).any()
