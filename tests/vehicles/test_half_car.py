"""Paper 002, its sign put right."""

import numpy as np
import pytest
import scipy.linalg

from jaxdamp import dampers, metrics, roads, simulate
from jaxdamp.parameters import replace
from jaxdamp.vehicles import Corner, HalfCar, QuarterCar, frequency_response, linearise, modes
from jaxdamp.vehicles.presets import half_car_002

from .fleet import bumps, tracks, vehicles


M, J, MU, K, KT, LA, LB = 580.0, 1100.0, 40.0, 23.5e3, 190e3, 1.0, 1.5
BUMP = roads.cosine_bump(0.06, start=1.0, duration=0.25)


def by_hand(c, rear_sign=-1.0):
    """State matrix with q = (x_s, θ, x_u1, x_u2) from the paper, with a choice of sign in equation 2."""
    rows = np.array([[1.0, LA, -1.0, 0.0], [1.0, -LB, 0.0, -1.0]])  # x_s1 − x_u1, x_s2 − x_u2
    back = rows.copy()
    back[1, 1] = rear_sign * LB
    mass = np.diag([M, J, MU, MU])
    stiffness = K * back.T @ rows + np.diag([0.0, 0.0, KT, KT])
    top = np.hstack([np.zeros((4, 4)), np.eye(4)])
    return np.vstack([top, -np.linalg.solve(mass, np.hstack([stiffness, c * back.T @ rows]))])


def with_damping(c):
    return half_car_002(dampers.Linear(c))


def test_undamped_modes_of_paper_002():
    np.testing.assert_allclose(modes(half_car_002()).undamped_frequency, [1.1566, 1.4312, 11.6348, 11.6387], atol=5e-5)


def test_matrices_are_those_written_by_hand_with_the_right_sign():
    np.testing.assert_allclose(linearise(with_damping(1000.0)).state_matrix, by_hand(1000.0), rtol=1e-12, atol=1e-9)


def test_equation_2_as_printed_is_unstable():
    wrong = np.linalg.eigvals(by_hand(1000.0, rear_sign=1.0)).real.max()
    assert wrong == pytest.approx(3.9796, abs=1e-4)
    assert np.linalg.eigvals(np.asarray(linearise(with_damping(1000.0)).state_matrix)).real.max() < 0


# Independent values: exact first-order hold at 0.25 ms, written to four or five digits; degrees for pitch.
REFERENCE = {
    (1000.0, 0.0): ((4.9530, -5.4655), (0.05054, -0.02756), (0.4743, -0.5512), (1.3317, 0.01455, 0.2401)),
    (1560.0, 0.1): ((2.9642, -4.6961), (0.04697, -0.02251), (0.6146, -0.2987), (1.0618, 0.01299, 0.1451)),
}


def over_the_bump(c, delay):
    """Acceleration [m/s²], displacement [m], pitch [degree] of the car of paper 002 on its bump, for 3 s."""
    road = roads.delayed(BUMP, delays=[0.0, delay])
    response = simulate(with_damping(c), road, duration=3.0, dt=2.5e-4)
    return [np.asarray(response[name]) * unit for name, unit in CHANNELS]


CHANNELS = (("sprung_acceleration", 1.0), ("z_sprung", 1.0), ("pitch", 180.0 / np.pi))


@pytest.mark.parametrize("case", REFERENCE, ids=str)
def test_reference_values_of_the_half_car(case):
    for values, (top, bottom), rms in zip(over_the_bump(*case), REFERENCE[case][:3], REFERENCE[case][3], strict=True):
        assert values.max() == pytest.approx(top, rel=5e-4)
        assert values.min() == pytest.approx(bottom, rel=5e-4)
        assert float(metrics.rms(values)) == pytest.approx(rms, rel=5e-4)


def test_linear_column_of_table_2_and_3_of_paper_002():
    """Within 4 % with c = 1560 N s/m, a delay of 0.0986 s, first peaks, RMS to 1.935 s: none of them in the paper."""
    for values, peak, rms in zip(
        over_the_bump(1560.0, 0.0986), (3.06, 0.048, 0.608), (1.263, 0.0165, 0.1632), strict=True
    ):
        inner = values[1:-1]
        tops = inner[(inner > values[:-2]) & (inner > values[2:]) & (inner > 0.5 * values.max())]
        assert tops[0] == pytest.approx(peak, rel=0.04)
        assert float(metrics.rms(values[: round(1.935 / 2.5e-4) + 1])) == pytest.approx(rms, rel=0.04)


def test_ends_are_two_quarter_cars_when_the_inertia_is_m_la_lb():
    law = dampers.Bilinear(2200.0, 1100.0)
    corner = Corner(MU, K, KT, law)
    car = HalfCar(M, M * LA * LB, LA, LB, corner, corner)
    heights = bumps([0.05, 0.17])
    heights[:, 1] *= -0.7
    response = simulate(car, tracks(heights))
    for i, (end, mass) in enumerate((("front", M * LB / (LA + LB)), ("rear", M * LA / (LA + LB)))):
        alone = simulate(QuarterCar(mass, MU, K, KT, law), tracks(heights[:, i : i + 1]))
        for channel in ("stroke", "damper_force", "dynamic_tyre_load"):
            scale = np.abs(alone[channel]).max()
            np.testing.assert_allclose(response[f"{end}_{channel}"], alone[channel], atol=1e-9 * scale)


def test_frequency_response_with_an_axle_delay_is_that_of_the_equations():
    c, speed = 1560.0, 25.0
    frequency = np.array([0.3, 1.2, 2.5, 5.0, 11.6, 20.0])
    gains = frequency_response(with_damping(c), frequency, speed=speed)
    drive = np.zeros((8, 2))
    drive[6, 0] = drive[7, 1] = KT / MU
    for i, f in enumerate(frequency):
        s = 2j * np.pi * f
        ends = np.array([1.0, np.exp(-s * (LA + LB) / speed)])
        state = np.linalg.solve(s * np.eye(8) - by_hand(c), drive @ ends)
        assert gains["z_sprung"][i] == pytest.approx(state[0], rel=1e-10)
        assert gains["pitch_acceleration"][i] == pytest.approx(s * s * state[1], rel=1e-10)
        assert gains["rear_stroke"][i] == pytest.approx(state[0] - LB * state[1] - state[3], rel=1e-9)
        assert gains["front_dynamic_tyre_load"][i] == pytest.approx(KT * (1.0 - state[2]), rel=1e-9)


def test_wheelbase_filters_heave_and_pitch():
    """A symmetric car does not heave with its axles half a wave apart, nor pitch with them a whole wave apart."""
    car = replace(with_damping(1500.0), {"front_distance": 1.25, "rear_distance": 1.25})
    speed, base = 20.0, 2.5
    gains = frequency_response(car, np.array([0.5, 1.0, 1.5, 2.0]) * speed / base, speed=speed)
    heave, pitch = np.abs(gains["sprung_acceleration"]), np.abs(gains["pitch_acceleration"])
    assert np.all(heave[[0, 2]] < 1e-9 * heave.max()) and np.all(pitch[[1, 3]] < 1e-9 * pitch.max())
    assert np.all(heave[[1, 3]] > 0.1 * heave.max()) and np.all(pitch[[0, 2]] > 0.1 * pitch.max())


def test_places_move_with_the_body():

    car = vehicles()["half car with seat"]
    response = simulate(car, roads.delayed(BUMP, delays=[0.0, 0.1]), duration=1.5, start={"pitch": 0.01})
    moved = np.asarray(response["z_sprung"]) + 0.3 * np.asarray(response["pitch"])
    np.testing.assert_allclose(response["z_driver"], moved, atol=1e-15)
    assert float(response["pitch"][0]) == 0.01
    shaken = np.asarray(response["sprung_acceleration"]) + 0.3 * np.asarray(response["pitch_acceleration"])
    np.testing.assert_allclose(response["driver_acceleration"], shaken, atol=1e-12)
    seat = np.asarray(response["z_seat"]) - response["z_sprung"] - 0.4 * np.asarray(response["pitch"])
    np.testing.assert_allclose(response["seat_stroke"], seat, atol=1e-15)


def test_scipy_agrees_on_the_decay():
    """Free motion of the linear car from a pitch angle: the matrix exponential of the equations written by hand."""
    flat = roads.from_profile(np.arange(1601) * 2.5e-4, np.zeros((1601, 2)))
    response = simulate(with_damping(1000.0), flat, dt=2.5e-4, start={"pitch": 0.02})
    begin = np.zeros(8)
    begin[1] = 0.02
    exact = np.array([scipy.linalg.expm(by_hand(1000.0) * t) @ begin for t in (0.1, 0.4)])
    np.testing.assert_allclose(np.asarray(response.motion)[[400, 1600]], exact, atol=4e-6)
