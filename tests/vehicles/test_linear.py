"""What the linearised vehicle says: modes, frequency response, stationary response, equivalent elements."""

import json
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, roads
from jaxdamp.parameters import replace
from jaxdamp.vehicles import CubicSpring, QuarterCar, frequency_response, linearise, modes, spectral_rms, stationary_rms
from jaxdamp.vehicles.presets import full_car_jazar, golden_car, half_car_002, quarter_car_000, truck_001


MS, MU, K, KT, C = 1200.0, 125.0, 60e3, 220e3, 2500.0


def acceleration_gain(frequency):
    """s² k_t (c s + k)/D of the quarter car of paper 000."""
    s = 2j * np.pi * frequency
    d = (MS * s**2 + C * s + K) * (MU * s**2 + C * s + K + KT) - (C * s + K) ** 2
    return s**2 * KT * (C * s + K) / d


def test_frequency_response_of_the_quarter_car_is_the_closed_form():
    frequency = np.linspace(0.0, 25.0, 101)
    gains = frequency_response(quarter_car_000(), frequency)
    np.testing.assert_allclose(gains["sprung_acceleration"], acceleration_gain(frequency), atol=1e-9)
    assert set(gains) == set(quarter_car_000().units)
    # at ω² = k_t/m_u the ratio of body to road is k_t/m_s whatever spring and damper
    invariant = np.array([np.sqrt(KT / MU) / (2 * np.pi)])
    for law in (dampers.Linear(500.0), dampers.Linear(9e3)):
        gain = frequency_response(quarter_car_000(law), invariant)["sprung_acceleration"][0]
        assert abs(gain) == pytest.approx(KT / MS, rel=1e-10)


def test_modes_of_the_golden_car():
    found = modes(golden_car())
    np.testing.assert_allclose(found.frequency, [1.2363, 10.755], rtol=5e-5)
    np.testing.assert_allclose(found.damping_ratio, [0.333, 0.302], atol=5e-4)
    np.testing.assert_allclose(found.damped_frequency, found.frequency * np.sqrt(1 - found.damping_ratio**2))
    assert "z_unsprung 1.00" in str(found) and len(str(found).splitlines()) == 5
    assert found.table().records()[0]["frequency"] == found.frequency[0]
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["frequency"] == {"value": list(found.frequency), "unit": "Hz"}


def test_undamped_modes_solve_the_eigenproblem_and_overdamped_ones_do_not_oscillate():
    car = full_car_jazar()
    found, form = modes(car), car.port_form()
    left = np.asarray(form.stiffness) @ found.shapes
    right = np.asarray(form.mass) @ found.shapes * (2 * np.pi * found.undamped_frequency) ** 2
    np.testing.assert_allclose(left, right, atol=1e-9 * np.abs(left).max())
    np.testing.assert_allclose(np.abs(found.shapes).max(axis=0), 1.0)
    stiff = modes(full_car_jazar(dampers.Linear(12e3)))
    assert stiff.decays.size > 0 and 2 * stiff.poles.size + stiff.decays.size == 14
    assert "without oscillation" in str(stiff)


def test_undamped_modes_have_the_stiffness_to_which_states_settle():
    gas = dampers.Linear(2500.0) + dampers.GasSpring(2e6, 6e-5, 1e-4)
    plain, behind = (modes(quarter_car_000(law)).undamped_frequency for law in (gas, dampers.Lag(gas, 0.004)))
    np.testing.assert_allclose(behind, plain, rtol=1e-6)
    assert plain[0] > 1.002 * modes(quarter_car_000()).undamped_frequency[0]


@pytest.mark.slow
def test_walking_beam_pitches_on_its_tyres_alone():
    truck = replace(truck_001(), {"tandem.tyre_damping": 0.0})
    beam: Any = truck.tandem
    expected = np.sqrt(float(beam.tyre_stiffness * beam.spread**2 / (2 * beam.pitch_inertia))) / (2 * np.pi)
    found = modes(truck)
    lone = np.flatnonzero(np.abs(found.damping_ratio) < 1e-9)
    assert found.frequency[lone] == pytest.approx([expected], rel=1e-9)
    loads = np.asarray(truck.static_wheel_loads())
    assert loads[1] == pytest.approx(loads[2], rel=1e-12)
    assert loads == pytest.approx(9.80665 * np.array([6900.0, 9000.0, 9000.0]), rel=1e-9)
    with pytest.raises(ValueError, match=r"`vehicle` must come to rest when linearised"):
        stationary_rms(truck, speed=20.0)


@pytest.mark.parametrize("speed", [8.0, *(pytest.param(speed, marks=pytest.mark.slow) for speed in (None, 25.0))])
def test_stationary_response_is_the_integral_of_the_frequency_response(speed):
    """White rate of height: S_z = 2 S/(2πf)². What lies outside the band is below a thousandth."""
    car = half_car_002()
    ranges = np.geomspace(1e-3, 0.199, 400), np.linspace(0.2, 60.0, 20_000), np.geomspace(61, 3e3, 4000)
    frequency = np.concatenate(ranges)
    together = speed is None
    exact = stationary_rms(car, 2.5e-4, speed=speed, in_phase=together)
    density = 2 * 2.5e-4 / (2 * np.pi * frequency) ** 2
    band = spectral_rms(car, frequency, density, speed=speed, in_phase=together)
    names = ["sprung_acceleration", "pitch_acceleration", "rear_damper_force", "front_stroke", "rear_dynamic_tyre_load"]
    for name in [*names, "pitch"]:
        assert float(band[name]) == pytest.approx(float(exact[name]), rel=2e-3), name


@pytest.mark.slow
def test_two_tracks_apart_roll_the_car_and_one_track_does_not():
    frequency = np.geomspace(0.05, 40.0, 3000)
    density = 256e-6 * 0.1**2 * 20.0 / frequency**2  # class C at 20 m/s
    gamma = np.asarray(roads.coherency(jnp.asarray(frequency / 20.0), 1.45))
    car = linearise(full_car_jazar())
    rough = spectral_rms(car, frequency, density, speed=20.0, coherence=gamma)
    flat = spectral_rms(car, frequency, density, speed=20.0)
    assert float(flat["roll"]) < 1e-12 < 1e-3 < float(rough["roll"])
    # heave is the mean of the tracks: of variance (1 + γ)/2
    half = spectral_rms(car, frequency, density * (1 + gamma) / 2, speed=20.0)
    assert float(rough["sprung_acceleration"]) == pytest.approx(float(half["sprung_acceleration"]), rel=1e-9)
    apart = spectral_rms(car, frequency, density * (1 - gamma) / 2, speed=20.0, coherence=-np.ones_like(gamma))
    assert float(rough["roll"]) == pytest.approx(float(apart["roll"]), rel=1e-9)


PARAMETERS = ["front.spring_rate", "front_distance", "pitch_inertia", "rear.damper.rate", "sprung_mass"]


@pytest.mark.slow
def test_gradients_of_the_stationary_response_agree_with_differences():
    """With an axle delay, in geometry, masses, springs, dampers and speed."""
    car = half_car_002()
    start = jnp.array([23.5e3, 1.0, 1100.0, 1560.0, 580.0, 20.0])

    @jax.jit
    def rms(values):
        changed = replace(car, dict(zip(PARAMETERS, values[:5], strict=True)))
        found = stationary_rms(changed, 1e-3, speed=values[5])
        return jnp.stack([found[n] for n in ("sprung_acceleration", "pitch_acceleration", "rear_dynamic_tyre_load")])

    level, forward = np.asarray(rms(start)), jax.jit(jax.jacfwd(rms))(start)
    for i, scale in enumerate(start):
        steps = [np.eye(6)[i] * float(scale) * h for h in (2e-4, 4e-4)]
        near, far = ((rms(start + s) - rms(start - s)) / (2 * s[i]) for s in steps)
        sensitivity = float(scale) * (4 * near - far) / 3 / level  # relative changes, of order one
        np.testing.assert_allclose(float(scale) * forward[:, i] / level, sensitivity, atol=1e-7)


# ---- equivalent elements


def slopes(law, amplitude, frequency):
    """Stiffness and damping that stand for the law in a quarter car."""
    car = QuarterCar(400.0, 40.0, 2e4, 2e5, law)
    a = np.asarray(linearise(car, amplitude=amplitude, frequency=frequency).state_matrix)
    return -400.0 * a[2, 0] - 2e4, -400.0 * a[2, 2]


@pytest.mark.parametrize("amplitude", [0.004, 0.03])
def test_equivalent_elements_are_the_closed_forms(amplitude):
    frequency, omega = 1.4, 2 * np.pi * 1.4
    assert slopes(dampers.Linear(1700.0), amplitude, frequency) == pytest.approx((0.0, 1700.0), abs=1e-6)
    # friction with a vanishing width: 4 F/(π ω X)
    found = slopes(dampers.CoulombFriction(80.0, 1e-6), amplitude, frequency)[1]
    assert found == pytest.approx(4 * 80.0 / (np.pi * omega * amplitude), rel=1e-4)
    # |v|^0.5 power law: energy per cycle 3.4961 c ω^0.5 X^1.5, divided by π ω X²
    found = slopes(dampers.PowerLaw(1000.0, 0.5, 1000.0, 0.5, knee_width=1e-9), amplitude, frequency)[1]
    assert found == pytest.approx(
        3.4961 * 1000.0 * omega**0.5 * amplitude**1.5 / (np.pi * omega * amplitude**2), rel=1e-3
    )
    # Maxwell: c/(1 + (ωτ)²), k (ωτ)²/(1 + (ωτ)²), to the second order of the law's step
    c, k = 2000.0, 4e4
    share = (omega * c / k) ** 2
    found = slopes(dampers.SeriesSpring(dampers.Linear(c), k), amplitude, frequency)
    assert found == pytest.approx((k * share / (1 + share), c / (1 + share)), rel=1e-3)


def test_cubic_spring_stiffens_with_the_amplitude():
    law = CubicSpring(0.0, 1e7) + dampers.Linear(1000.0)
    assert slopes(law, 0.05, 1.0)[0] == pytest.approx(0.75 * 1e7 * 0.05**2, rel=1e-9)
    assert slopes(law, 0.01, 1.0)[1] == pytest.approx(1000.0, rel=1e-9)


def test_friction_with_memory_at_rest_has_no_stationary_response_but_one_in_motion():
    car = quarter_car_000(dampers.Linear(1500.0) + dampers.Dahl(100.0, 1e6))
    with pytest.raises(ValueError, match=r"must come to rest when linearised.*velocity_psd="):
        stationary_rms(linearise(car))
    found = stationary_rms(linearise(car, amplitude=0.01, frequency=1.2))
    assert 20.0 < float(found["sprung_acceleration"]) < 40.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda car: linearise(car, amplitude=0.01), r"`frequency` must be given with the other"),
        (lambda car: linearise(car, amplitude=-0.01, frequency=1.0), r"`amplitude` must be positive"),
        (
            lambda car: linearise(car, amplitude=[0.01, 0.02, 0.03], frequency=1.0),
            r"`amplitude` must be one number, or one for each of the ports damper, but is of shape \(3,\)",
        ),
        (lambda car: linearise(car, amplitude=0.01, frequency=jnp.ones(2)), r"`frequency` must be one number"),
        (lambda car: frequency_response(car, np.array([[1.0]])), r"`frequency` must have one axis"),
        (lambda car: frequency_response(car, [1.0], speed=0.0), r"`speed` must be positive"),
        (lambda car: frequency_response(car, [1.0], speed=1.0, by_wheel=True), r"`speed` must be left out"),
        (lambda car: spectral_rms(car, [2.0, 1.0], [1.0, 1.0]), r"`frequency` must increase"),
        (lambda car: spectral_rms(car, [1.0, 2.0], [1.0]), r"`density` must have the shape"),
        (lambda car: spectral_rms(car, [1.0, 2.0], [-1.0, 1.0]), r"`density` must be finite and not negative"),
        (
            lambda _: spectral_rms(full_car_jazar(), [1.0, 2.0], [1.0, 1.0], in_phase=True, coherence=[1.0, -2.0]),
            r"`coherence` must be between -1 and 1, but is \[ 1. -2.\]",
        ),
        (
            lambda car: spectral_rms(car, [1.0, 2.0], [1.0, 1.0], coherence=[1.0, 1.0]),
            r"`coherence` must be left out where a wheel stands for both sides",
        ),
        (lambda car: stationary_rms(car, -1.0), r"`velocity_psd` must be positive"),
    ],
)
def test_refuses_what_makes_no_sense(call, message):
    with pytest.raises(ValueError, match=message):
        call(quarter_car_000())
