"""Symmetric limits: a full car is two half cars, two roll cars, four quarter cars."""

import numpy as np
import pytest

from jaxdamp import dampers, simulate
from jaxdamp.vehicles import Axle, Corner, FullCar, HalfCar, QuarterCar, RollCar

from .fleet import bumps, tracks


LAW = dampers.Bilinear(2200.0, 1100.0)
CORNER, OTHER = Corner(40.0, 22e3, 180e3, LAW), Corner(46.0, 26e3, 190e3, LAW)
MASS, AHEAD, BEHIND, WIDTH = 1200.0, 1.2, 1.2, 1.5
CHANNELS = ("stroke", "damper_force", "dynamic_tyre_load", "relative_tyre_load")
HEIGHTS = bumps([0.05, 0.09, 0.2, 0.26], count=601) * np.array([1.0, -0.5, 0.8, 1.3])


def compare(response, name, alone, own=""):
    for channel in CHANNELS:
        mine = np.asarray(response[f"{name}_{channel}"])
        other = np.asarray(alone[f"{own}_{channel}" if own else channel])
        np.testing.assert_allclose(mine, other, atol=1e-9 * np.abs(other).max())


def full(front, rear, anti_roll, pitch_inertia, roll_inertia=MASS * WIDTH**2 / 4):
    axles = (Axle(front, WIDTH, anti_roll), Axle(rear, WIDTH, anti_roll))
    return FullCar(MASS, pitch_inertia, roll_inertia, AHEAD, BEHIND, *axles)


@pytest.mark.slow
def test_four_quarter_cars():
    """J_θ = m l_a l_b and J_φ = m (w/2)², no bars: the corners do not know of each other.

    Four masses could also move crosswise, which a rigid body cannot: linear dampers and a road without warp.
    """
    law = dampers.Bilinear(1500.0, 1500.0)
    corner = Corner(40.0, 22e3, 180e3, law)
    car = full(corner, corner, 0.0, MASS * AHEAD * BEHIND)
    heights = np.stack([*HEIGHTS[:, :3].T, HEIGHTS[:, 1] + HEIGHTS[:, 2] - HEIGHTS[:, 0]], axis=1)
    response = simulate(car, tracks(heights))
    alone = QuarterCar(MASS / 4, 40.0, 22e3, 180e3, law)
    for i, name in enumerate(car.wheel_names):
        compare(response, name, simulate(alone, tracks(heights[:, i : i + 1])))


@pytest.mark.slow
def test_two_half_cars():
    """The same road on both sides, axles that differ: each side is half of the car."""
    car = full(CORNER, OTHER, 9e3, 1500.0)
    response = simulate(car, tracks(HEIGHTS[:, [0, 0, 2, 2]]))  # both sides of an axle alike
    half = simulate(HalfCar(MASS / 2, 750.0, AHEAD, BEHIND, CORNER, OTHER), tracks(HEIGHTS[:, [0, 2]]))
    for end in ("front", "rear"):
        for side in ("left", "right"):
            compare(response, f"{end}_{side}", half, end)
    np.testing.assert_allclose(response["pitch"], half["pitch"], atol=1e-12)
    np.testing.assert_allclose(response["roll"], 0.0, atol=1e-12)


@pytest.mark.slow
def test_two_roll_cars():
    """The same road under both axles, axles alike, with bars."""
    car = full(CORNER, CORNER, 9e3, 1500.0, 500.0)
    response = simulate(car, tracks(HEIGHTS[:, [0, 1, 0, 1]]))
    roll = simulate(RollCar(MASS / 2, 250.0, Axle(CORNER, WIDTH, 9e3)), tracks(HEIGHTS[:, :2]))
    for end in ("front", "rear"):
        for side in ("left", "right"):
            compare(response, f"{end}_{side}", roll, side)
    np.testing.assert_allclose(response["roll"], roll["roll"], atol=1e-12)
    assert np.abs(response["roll"]).max() > 1e-3


def test_anti_roll_bar_is_its_energy():
    """½ k_R (φ − (z_ul − z_ur)/w)² adds to ½ qᵀK q, and nothing else."""
    rate = 9e3
    without, with_bar = (full(CORNER, OTHER, k, 1500.0).port_form().stiffness for k in (0.0, rate))
    q = np.array([0.01, 0.02, 0.03, 0.004, -0.005, 0.006, 0.007])  # z, θ, φ, wheels
    expected = sum(0.5 * rate * (q[2] - (q[i] - q[i + 1]) / WIDTH) ** 2 for i in (3, 5))
    assert 0.5 * q @ (with_bar - without) @ q == pytest.approx(expected, rel=1e-9)
