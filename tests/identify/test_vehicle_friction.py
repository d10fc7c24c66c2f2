"""Friction that a fit of a vehicle lacks is named by its residual, and nothing else is called friction."""

import pytest

from jaxdamp import identify, roads
from jaxdamp.dampers import CoulombFriction, Dahl, Linear, SeriesSpring
from jaxdamp.rig import Sensor
from jaxdamp.vehicles import Guide, Guided, QuarterCar


pytestmark = pytest.mark.filterwarnings("ignore:A step of dt")
CAR = QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0))
NOISE = {"sprung_acceleration": 0.05, "stroke": 1e-4}
FREE = ["spring_rate", "tyre_stiffness", "unsprung_mass", "damper.**"]
TRUTHS = {
    "none": None,
    "coulomb": CoulombFriction(60.0, 0.01),
    **{f"gives by {1e3 * give:g} mm": Dahl(60.0 / give, 60.0) for give in (1e-4, 4e-4, 1.5e-3)},
}

SEEDS = [pytest.param(0, marks=pytest.mark.slow), *(pytest.param(n, marks=pytest.mark.exhaustive) for n in (1, 2))]


def words(true, start, over=FREE, seed=0, sensors=None):
    """The sentences on the residual of a fit to two drives."""
    how = {"duration": 3.0, "sampling_rate": 200.0, "finer": 5, "seed": seed, "sensors": sensors or {}}
    cuts = [roads.iso8608("C", speed=20.0, seed=10 * seed + i) for i in range(2)]
    drives = [identify.virtual_ride(true, road, NOISE, name=f"drive {i}", **how) for i, road in enumerate(cuts)]
    result = identify.fit(start, drives, dt=5e-3, over=over, freeze=["friction_velocity"] if over != FREE else [])
    return [warning for warning in result.warnings if warning.startswith("By its residual")]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("truth", TRUTHS)
def test_coulomb_friction_that_should_give_is_named_and_no_other(truth, seed):
    start = Guided(CAR, (Guide(CoulombFriction(30.0, 0.01)),))
    told = words(Guided(CAR, (Guide(TRUTHS[truth]),)), start, [*FREE, "guides.0.law.**"], seed)
    assert [text.split(",")[1].strip() for text in told] == ["the friction at guides.0.law gives before it slides"] * (
        "gives" in truth
    )


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("truth", TRUTHS)
def test_friction_of_a_vehicle_without_is_named(truth, seed):
    told = words(Guided(CAR, (Guide(TRUTHS[truth]),)), Guided(CAR, (Guide(None),)), seed=seed)
    assert len(told) == (truth != "none")
    dry = ["there is dry friction at guides.0.law"]  # to which friction that gives by 0.1 mm comes near
    named = {"coulomb": dry, "gives by 0.1 mm": [*dry, "gives before"]}.get(truth, ["gives before it slides"])
    assert not told or any(text in told[0] for text in named)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("true", "sensors", "cause"),
    [
        (CAR, {"stroke": Sensor(lag=4e-3)}, "stroke comes"),
        (CAR, {"sprung_acceleration": Sensor(gain=0.85)}, "a gain of 0.8"),
        (QuarterCar(300.0, 40.0, 20e3, 180e3, SeriesSpring(Linear(1500.0), 2e5)), {}, ""),
        (QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0), tyre_damping=200.0), {}, ""),
    ],
    ids=["lag of a sensor", "gain of a sensor", "spring in series", "damping of the tyre"],
)
def test_what_is_no_friction_is_not_called_so(true, sensors, cause):
    told = words(true, CAR, sensors=sensors)
    assert not any("friction" in text for text in told), told
    assert cause in " ".join(told)
