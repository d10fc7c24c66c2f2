"""Random vehicles of every kind, with random laws on random roads, against equations by hand integrated by SciPy."""

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings, strategies as st

from jaxdamp import roads, simulate
from jaxdamp.parameters import replace

from .by_hand import CASES
from .newton import GRAVITY


pytestmark = pytest.mark.slow_one_in(3)

TIME = np.linspace(0.0, 0.3, 1201)  # steps of 0.25 ms
FADE = 0.03  # s, in which the waves come up
DRAWN = settings(
    max_examples=10,  # of each of six kinds: 60
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture],
)


def between(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


ROAD = st.fixed_dictionaries(
    {
        "height": between(-0.05, 0.06),
        "width": between(0.08, 0.25),
        "waves": st.tuples(*[st.tuples(between(1e-3, 0.01), between(1.0, 15.0), between(0.0, 6.3)) for _ in range(3)]),
        "delay": between(0.03, 0.15),
        "right": between(-1.0, 1.0),
    }
)


def track(road, t):
    """Height and slope of a bump and three waves that come up from time zero on."""
    s, since = np.clip(t / road["width"], 0.0, 1.0), np.maximum(t, 0.0)
    z = 0.5 * road["height"] * (1 - np.cos(2 * np.pi * s))
    slope = np.pi * road["height"] / road["width"] * np.sin(2 * np.pi * s)
    grown = since**2 / (since**2 + FADE**2)
    growth = 2 * since * FADE**2 / (since**2 + FADE**2) ** 2
    for amplitude, frequency, phase in road["waves"]:
        turn = 2 * np.pi * frequency * since + phase
        z = z + amplitude * grown * np.sin(turn)
        slope = slope + amplitude * (growth * np.sin(turn) + grown * 2 * np.pi * frequency * np.cos(turn))
    return z, slope


def under_wheels(case, road):
    """A function of time for the equations by hand: heights and slopes under all wheels."""
    late = road["delay"] * np.array(case.behind)
    size = np.where(case.right, road["right"], 1.0)

    def at(t):
        z, slope = track(road, np.asarray(t)[..., None] - late)
        return z * size, slope * size

    return at


@pytest.mark.parametrize("name", CASES)
@pytest.mark.exhaustive_cases("half car")
def test_motion_is_that_of_the_equations(name):
    case = CASES[name]
    errors = []

    @DRAWN
    @given(
        p=st.fixed_dictionaries({path: between(*pair) for path, pair in case.ranges.items()}),
        road=ROAD,
    )
    def agrees(p, road):
        ground = under_wheels(case, road)
        profile = roads.from_profile(TIME, ground(TIME)[0])
        run = simulate(replace(case.vehicle, p), profile, dt=TIME[1], start={})
        found, exact = np.asarray(run.motion), case.by_hand(p).motion(ground, TIME)
        half = exact.shape[1] // 2
        for part in (slice(0, half), slice(half, None)):
            errors.append(np.abs(found - exact)[:, part].max() / (np.abs(exact)[:, part].max() + 1e-6))

    agrees()
    assert len(errors) >= 2 * 10
    assert max(errors) < 5e-4 and np.median(errors) < 1e-4  # one inertia wrong by 1 % makes 4e-4 to 9e-3


FLYING = {"z_sprung": 0.3, "pitch": 0.04, "roll": -0.03, "beam_pitch": 0.05}


@pytest.mark.parametrize(
    "name",
    [
        name
        for name, case in CASES.items()
        if case.by_hand({path: 0.5 * sum(pair) for path, pair in case.ranges.items()}).rigid
    ],
)
def test_momentum_in_the_air_and_energy_at_the_landing(name):
    """Thrown up, turned and strained: heave and turn are those of a free fall until a tyre touches the ground."""
    case = CASES[name]
    p = {path: 0.5 * sum(pair) for path, pair in case.ranges.items()}
    hand, names = case.by_hand(p), case.vehicle.coordinates
    start = {c: FLYING.get(c, 0.3 + 0.01 * i) for i, c in enumerate(names) if c in FLYING or c.startswith("z_")}
    level = roads.from_profile(TIME, np.zeros((TIME.size, len(case.behind))))
    run = simulate(replace(case.vehicle, p), level, dt=TIME[1], start=start)
    fallen = TIME < 0.12
    rates = np.asarray(run.motion)[:, len(names) :]
    for free in hand.rigid:
        assert all(abs(link.row @ free) < 1e-12 for link in hand.links if link.track is None)
        momentum, weight = rates @ (hand.mass * free), -GRAVITY * np.sum(hand.mass * free * hand.heights)
        scale = GRAVITY * np.sum(hand.mass * np.abs(free) * hand.heights) * 0.12
        np.testing.assert_allclose(momentum[fallen], weight * TIME[fallen], atol=2e-4 * scale)
    energy = {part: float(value) for part, value in run.energy_balance().items()}
    assert energy["road_work"] == 0.0 and energy["absorbed"] > 0.0
    lost = energy["stored"]  # counts the linear tyres as stretched in the air; the laws of lift-off give it back
    assert abs(energy["error"]) < 2e-3 * abs(lost)
