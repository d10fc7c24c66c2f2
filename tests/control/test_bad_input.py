"""What a controller cannot do is refused or said, by names, values and remedies."""

import re

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, roads, simulate
from jaxdamp.control import (
    AbstractPolicy,
    AccelerationDriven,
    Controlled,
    RateLimit,
    Sensors,
    SignalSensor,
    Skyhook,
    StateFeedback,
    lqr,
)
from jaxdamp.dampers import Bilinear, Linear, PiecewiseLinear, Scheduled
from jaxdamp.parameters import replace
from jaxdamp.vehicles import Corner, ForceDriven, Guided, HalfCar, QuarterCar


VALVE = PiecewiseLinear([-0.3, 0.3], [2000.0, 2000.0, 2000.0])
DAMPER = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.25)
HALF = HalfCar(700.0, 1200.0, 1.2, 1.5, Corner(40.0, 18e3, 200e3, DAMPER), Corner(45.0, 22e3, 200e3, DAMPER))
QUARTER = QuarterCar(400.0, 50.0, 20e3, 250e3, DAMPER)
ROAD = roads.iso8608("C", speed=20.0, seed=1, duration=4.0)


def quarter(damper):
    return QuarterCar(400.0, 50.0, 20e3, 250e3, damper)


class Root(AbstractPolicy):
    """A policy that is no number where the body falls."""

    def __call__(self, seen, state):
        return 3000.0 * jnp.sqrt(seen.body_velocity), state


def test_a_policy_that_gives_no_number_is_named_with_damper_and_time():
    both = Controlled(HALF, {"front_damper": Skyhook(), "rear_damper": Root()})
    with pytest.raises(
        ValueError, match=r"`policy \(Root\)` must demand finite forces, but is nan N for rear_damper at"
    ):
        simulate(both, ROAD, duration=0.5)
    values = Ride(Controlled(QUARTER, Root()), ROAD, metrics=["rms_sprung_acceleration"], duration=0.5)()
    assert np.isnan(values["rms_sprung_acceleration"])  # of many points in a sweep, one is a value


def test_a_vehicle_that_diverges_by_itself_does_not_blame_the_policy():
    car = Controlled(QUARTER, StateFeedback(velocity=1.0))
    with pytest.raises(ValueError, match="`vehicle` must have a finite response"):
        simulate(car, ROAD, duration=0.5, start={"z_sprung": 1e308})


def test_an_rms_that_counts_jumps_of_the_command_late_is_said():
    """By how much, beside a run with a tenth of the step on the same road."""
    for policy, most in ((Skyhook(1e9), 0.02), (AccelerationDriven(), -0.02)):
        coarse, fine = (simulate(Controlled(QUARTER, policy), ROAD, duration=1.0, dt=dt) for dt in (1e-3, 1e-4))
        rms = [float(np.std(np.asarray(run["sprung_acceleration"]))) for run in (coarse, fine)]
        missed = rms[0] / rms[1] - 1.0
        assert 0.005 < missed / np.sign(most) < 0.02
        (note,) = [note for note in coarse.notes if "jump" in note]
        said = float(re.findall(r"about ([\d.]+) % too", note)[0])
        assert said == pytest.approx(100.0 * abs(missed), rel=0.4) and ("large" in note) == (most > 0.0)
        assert not any("jump" in note for note in fine.notes)
    lagging = Controlled(QUARTER, Skyhook(1e9), actuator_lag=5e-3)
    assert not any("jump" in note for note in simulate(lagging, ROAD, duration=1.0).notes)


def test_commands_that_stay_at_a_limit_are_said():
    weak = Scheduled((Linear(300.0), Linear(400.0)), levels=[0.0, 2.0], command=0.5)
    hard = simulate(Controlled(quarter(weak), StateFeedback(velocity=1e6)), ROAD, duration=1.0)
    assert len(hard.notes) == 1 and hard.notes[0].startswith(
        "The command of the damper stood at its highest level, 2, 9"
    )
    assert hard.notes[0].endswith("the damper can be no harder than it is there.")
    closed = Scheduled((Linear(400.0), Linear(300.0)), levels=[0.0, 2.0], command=0.5)  # clicks from closed
    for policy, words in (
        (StateFeedback(velocity=1e6), "lowest level, 0"),
        (StateFeedback(velocity=-1e6), "highest level, 2"),
    ):
        (note,) = simulate(Controlled(quarter(closed), policy), ROAD, duration=1.0).notes
        assert words in note and note.endswith(f"no {'harder' if 'lowest' in note else 'softer'} than it is there.")
    slow = simulate(Controlled(QUARTER, Skyhook(), rate_limit=RateLimit(3.0, 3.0)), ROAD, duration=1.0)
    assert len(slow.notes) == 1 and "changed as fast as its actuator can, 3 up and 3 down per second" in slow.notes[0]
    slower = Controlled(QUARTER, Skyhook(), rate_limit=RateLimit(1.5, 1.5))
    (note,) = simulate(slower, ROAD, duration=1.0, every=5).notes
    assert note.endswith("at least 66 % of the time.")  # strides at the limit from end to end; of all instants it is 74
    (note,) = simulate(Controlled(QUARTER, Skyhook(), rate_limit=RateLimit(20.0, 20.0)), ROAD, duration=1.0).notes
    assert note.endswith(" 20 % of the time.")  # which costs 4 % of comfort
    assert not simulate(Controlled(QUARTER, Skyhook(), rate_limit=RateLimit(100.0, 100.0)), ROAD, duration=1.0).notes


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: simulate(_delayed(0.5), ROAD, duration=0.5),
            "`delay` must be shorter than the run of 0.5 s, but is 0.5 s",
        ),
        (lambda: Ride(_delayed(2.0), ROAD, duration=1.0), "No command of the controller would be applied"),
        (lambda: Ride(_delayed(0.0), ROAD, duration=1.0)({"car.damper.levels.1": 2.0}), "levels"),
        (lambda: _command(1.5), "`Scheduled.command` must be between 0 and 1, but is 1.5"),
        (
            lambda: Controlled(QUARTER, "skyhook"),  # type: ignore[arg-type]
            "`policy` must be a policy, or .* but is the text 'skyhook'",
        ),
        (lambda: Controlled(QUARTER, None), "`policy` must be a policy, .* but is None. Such as"),  # type: ignore[arg-type]
        (lambda: Controlled(QUARTER, {}), "`policy` must hold a policy of one damper or more"),
        (lambda: _delayed(np.inf), "`delay` must be finite and not negative, but is inf"),
        (lambda: Controlled(QUARTER, Skyhook(), still=0.0), "`still` must be positive and finite, but is 0"),
        (lambda: Controlled(quarter(Linear(1e3)), Skyhook()), "which takes a command"),
        (lambda: Controlled(_delayed(0.0), Skyhook()), "`car` must have no controller yet, but is a Controlled"),
        (
            lambda: simulate(Controlled(QUARTER, Skyhook(), period=7.5e-4), ROAD, duration=1.0),
            "`period` must be a whole",
        ),
        (
            lambda: simulate(Controlled(QUARTER, Skyhook(), period=0.5), ROAD, duration=0.5),
            "`period` must be shorter than the run of 0.5 s, but is 0.5 s",
        ),
        (lambda: Controlled(DAMPER, Skyhook()), "`car` must be a vehicle, but is a Scheduled"),  # type: ignore[arg-type]
        (lambda: lqr(DAMPER), "`car` must be a vehicle, but is a Scheduled"),  # type: ignore[arg-type]
        (
            lambda: Controlled(QUARTER, Skyhook(), sensors=SignalSensor()),  # type: ignore[arg-type]
            "`sensors` must be `Sensors`, or a dict of them by damper, but is a SignalSensor",
        ),
        (
            lambda: Controlled(QUARTER, Skyhook(), sensors={"damper": 5}),  # type: ignore[arg-type]
            "`sensors` must be .* but is the number 5",
        ),
        (lambda: Sensors(seed=1.5), "`seed` must be a whole number, but is 1.5"),
        (
            lambda: Guided(Controlled(QUARTER, Skyhook()), ()),
            r"`car` must be without a controller, .* `Controlled\(Guided\(vehicle, ...\), policy\)`",
        ),
        (lambda: ForceDriven(Controlled(QUARTER, Skyhook())), r"`Controlled\(ForceDriven\(vehicle"),
        (lambda: Guided(DAMPER, ()), "`car` must be a vehicle"),  # type: ignore[arg-type]
    ],
    ids="""delay,delay of a ride,levels are no parameter,command,a word,no policy,no policies,endless delay,still,\
no command,two controllers,period,one sample,a damper,regulator of a damper,a signal,a number,seed,guided,force driven,\
guided damper""".split(","),
)
def test_what_cannot_be_controlled_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.slow
def test_a_part_of_a_run_may_be_shorter_than_the_delay():
    whole = simulate(_delayed(0.1), ROAD, duration=0.3)
    _, state = simulate(_delayed(0.1), ROAD, duration=0.05, return_state=True)
    rest = simulate(_delayed(0.1), ROAD, duration=0.25, state=state)
    np.testing.assert_allclose(rest["damper_command"], whole["damper_command"][50:], rtol=1e-9)


def _delayed(delay):
    return Controlled(QUARTER, Skyhook(), delay=delay)


def _command(command):
    return Controlled(quarter(Scheduled(DAMPER.laws, levels=[0.0, 1.0], command=command)), Skyhook())


@pytest.mark.parametrize("blend", ["parameters", "force"])
def test_a_damper_adjusted_in_one_direction_or_fast_alone_is_commanded(blend):
    """Levels of the same force at 0.1 m/s in extension differ elsewhere."""
    damper = Scheduled((Bilinear(1500.0, 300.0), Bilinear(1500.0, 2000.0)), [0.0, 1.0], command=0.0, blend=blend)
    command = simulate(Controlled(quarter(damper), Skyhook(3e4)), ROAD, duration=1.0)["damper_command"]
    assert np.min(command) < 0.1 and np.max(command) > 0.9
    fast = Scheduled((VALVE, replace(VALVE, {"slopes": [2e3, 2e3, 900.0]})), [0.0, 1.0], command=0.0, blend=blend)
    run = simulate(Controlled(quarter(fast), StateFeedback()), ROAD, duration=0.5, start={"z_sprung": -0.1})
    rebound = np.asarray(run["damper_velocity"])[:-1] > 0.5  # where the second level is softer
    assert rebound.any() and np.median(np.asarray(run["damper_command"])[1:][rebound]) > 0.9


@pytest.mark.parametrize("top", [2100.0, 1999.0])
def test_the_softest_level_is_commanded_where_forces_of_levels_are_not_in_order(top):
    """Of a coil that saturates the last level may be a little softer than the one before."""
    levels = Scheduled((Linear(300.0), Linear(2000.0), Linear(top)), levels=[0.0, 1.0, 2.0], command=0.0)
    soft = simulate(Controlled(quarter(levels), StateFeedback()), ROAD, duration=1.0)  # which demands no force
    assert np.max(soft["damper_command"]) < 0.1
    hard = simulate(Controlled(quarter(levels), StateFeedback(velocity=1e6)), ROAD, duration=1.0)
    moving = np.abs(np.asarray(hard["damper_velocity"])) > 0.1
    held = np.asarray(hard["damper_force"])[moving] / np.asarray(hard["damper_velocity"])[moving]
    assert np.median(held) > 1900.0
