"""Laws of one kind at several ports are stacked and computed together, as if each were called by itself.

Several laws share a car, each kind at both ends with its own numbers, so that few programs are compiled.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, roads, simulate
from jaxdamp.dampers import BoucWen, Lag, Linear, MotionRatio, Scheduled, Spring, TemperatureScaled
from jaxdamp.parameters import free_parameters
from jaxdamp.vehicles import Corner, HalfCar
from jaxdamp.vehicles.ports import Ports, is_smooth

from .test_contract import LAWS, network


COMPOSITIONS = {
    "network and spring": lambda: network() + Spring(2000.0),
    "lag of a network": lambda: Lag(network(1), 0.004),
    "schedule of lags": lambda: Scheduled((Lag(Linear(900.0), 0.01), Lag(Linear(1500.0), 0.02)), [0, 2], 0.7),
    "scaled sum with hysteresis": lambda: 0.5 * (BoucWen(800.0, 0.0, 300.0, 1e-3) + Spring(2000.0)),
}
EVERY = LAWS | COMPOSITIONS
SLOTS = ("damper", "extra_spring", "bump_stop", "friction")  # of a corner: so many laws share a car
GROUPS = [list(EVERY)[i : i + len(SLOTS)] for i in range(0, len(EVERY), len(SLOTS))]
ONCE_CRASHED = ["scheduled", "network and spring", "lag of a network"]

DT, STEPS = 1e-3, 50
TIME = DT * np.arange(STEPS + 1)
HEIGHTS = 0.01 * (1.0 - np.cos(2 * np.pi * np.clip((TIME[:, None] - np.array([0.002, 0.012])) / 0.03, 0.0, 1.0)))
METRICS = ["rms_sprung_acceleration", "rms_front_dynamic_tyre_load", "rms_rear_dynamic_tyre_load"]


def ends(names):
    """The laws for one end of a car, and the same with other numbers for the other end."""
    laws = {slot: EVERY[name]() for slot, name in zip(SLOTS, names, strict=False)}
    free = {slot: free_parameters(law) for slot, law in laws.items()}
    return laws, {slot: f.build(f.values * 1.02) for slot, f in free.items()}


def car(front, rear):
    """Symmetric but for its laws."""
    ahead, behind = (Corner(40.0, 23.5e3, 190e3, **laws) for laws in (front, rear))
    return HalfCar(580.0, 1100.0, 1.2, 1.2, ahead, behind)


def road(heights):
    return roads.from_profile(TIME, heights)


def ride(front, rear, heights):
    """The metrics of a ride, at a step that the steepest of the laws can bear."""
    return Ride(car(front, rear), road(heights), metrics=METRICS, substeps=64)()


def assert_mirrored(names, *, rtol):
    """With both ends of the car and the road exchanged, the ride is the same but for the ends: no law is mistaken."""
    one, other = ends(names)
    there, back = ride(one, other, HEIGHTS), ride(other, one, HEIGHTS[:, ::-1])
    exchanged = [METRICS[0], METRICS[2], METRICS[1]]
    same_laws = ride(one, one, HEIGHTS)
    for name, mirror in zip(METRICS, exchanged, strict=True):
        assert float(there[name]) > 0.1
        assert float(there[name]) == pytest.approx(float(back[mirror]), rel=rtol)
    # the numbers of the rear end count
    assert abs(float(there[METRICS[2]]) / float(same_laws[METRICS[2]]) - 1.0) > 5 * rtol


def test_laws_that_could_not_be_stacked():
    """`simulate` and `Ride`, against the same laws of which one is wrapped, so that each is called by itself."""
    front, rear = ends(ONCE_CRASHED)
    apart = {slot: 1.0 * law for slot, law in rear.items()}
    assert [len(kind) for kind in Ports([*front.values(), *rear.values()]).members] == [2, 2, 2]
    assert len(Ports([*front.values(), *apart.values()]).members) == 6
    together, separate = (
        np.asarray(simulate(car(front, laws), road(HEIGHTS), substeps=1).motion) for laws in (rear, apart)
    )
    scale = np.max(np.abs(separate), axis=0)
    assert np.all(scale > 1e-4)
    np.testing.assert_allclose(together / scale, separate / scale, atol=1e-11)
    assert_mirrored(ONCE_CRASHED, rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS, ids=lambda group: f"{group[0]} to {group[-1]}")
def test_every_law_and_composition(group):
    assert_mirrored(group, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("group", [ONCE_CRASHED, *GROUPS[::4]], ids=lambda group: f"{group[0]} to {group[-1]}")
def test_in_single_precision(group):
    with jax.enable_x64(False):
        assert_mirrored(group, rtol=5e-5)


# ---- what the engines ask of a law


def test_states_may_be_extrapolated_whatever_the_order_of_wrappers():
    lag = Lag(Linear(900.0), 0.01)
    foreseen = [lag, Scheduled((lag, lag), [0, 1], 0.5), Lag(Scheduled((Linear(900.0),) * 2, [0, 1], 0.5), 0.01)]
    foreseen += [2.0 * lag + Spring(1e3), MotionRatio(lag, 0.8), TemperatureScaled(lag, 300.0)]
    stepped = [Linear(900.0), network(), Lag(network(), 0.01), Scheduled((network(),) * 2, [0, 1], 0.5)]
    assert all(map(is_smooth, foreseen)) and not any(map(is_smooth, stepped))
    assert Ports([*foreseen, *stepped]).smooth == (True,) * len(foreseen) + (False,) * len(stepped)


def test_wrappers_predict_as_the_law_inside_does():
    law = BoucWen(800.0, 0.0, 300.0, 1e-3)
    state, way = jnp.array([0.3]), (0.0, 0.2, 2.2e-4, 0.24)
    cheap = law.predict(*way, state, 1e-3)
    assert abs(float(cheap[0] - law.advance(*way, state, 1e-3)[0])) > 1e-6  # they can be told apart
    wrapped = [2.0 * law, law + Spring(2e3), Spring(2e3) + 0.5 * law, TemperatureScaled(law, 300.0)]
    wrapped += [Scheduled((law, law), [0, 1], 0.5), MotionRatio(law, 1.0)]
    for outer in wrapped:
        np.testing.assert_allclose(outer.predict(*way, state, 1e-3), cheap, rtol=1e-14)
    halved = MotionRatio(law, 0.5).predict(*way, state, 1e-3)
    np.testing.assert_allclose(halved, law.predict(0.0, 0.1, 1.1e-4, 0.12, state, 1e-3), rtol=1e-14)
