"""An independent integration of the volumes of oil and gas, the curve of paper 001, limits, starts from records."""

import dataclasses
import functools

import diffrax
import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import _root, respond, roads, simulate
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import Besinger, GasSpring, TwinTube
from jaxdamp.identify import fit
from jaxdamp.parameters import replace
from jaxdamp.rig import quasi_static
from jaxdamp.simulation import Adaptive
from jaxdamp.vehicles import QuarterCar

from .motions import force_at_zero_velocity, last_cycle, work
from .single_precision import single_precision_error


LAW = TwinTube.reference()

# The numbers of the reference, once more: bleed, leak, then opening, stiffness and area of rebound and compression.
PISTON = 5.7e-7, 1.7e-10, (1.08e6, 6.7e10, 1.26e-5), (1e3, 9.25e11, 2.54e-6)
BASE = 2e-7, 3.8e-11, (5e3, 5e8, 1.5e-4), (4e6, 8e11, 1e-5)
ROD, ANNULUS, BULK, ABOVE, BELOW = 3.1416e-4, 1.6493e-3, 1.2e9, 3.3e-4, 3.9e-4
GAS_PRESSURE, GAS_VOLUME, EXPONENT, OUTSIDE, CAVITY = 5e5, 3e-4, 1.3, 101_325.0, 1e4

SLOW_INTAKE = {"base.rebound_valve_area": 3e-7}  # too little oil returns from the reserve


def _flow(valves, drop):
    """Oil [m³/s] through bleed, valve and leak."""
    bleed, leak, rebound, compression = valves
    opening, stiffness, largest = rebound if drop > 0 else compression
    area = bleed + largest * np.tanh(max(abs(drop) - opening, 0.0) / (stiffness * largest))
    return 0.7 * area * np.sqrt(2 / 850.0) * drop / (drop**2 + 1e6) ** 0.25 + leak * drop


def integrated(frequency, amplitude, base=BASE, *, cycles=2, samples=500):
    """Force and pressures of the last cycle, from the volumes of the oil above and below the piston and of the gas."""
    w = 2 * np.pi * frequency

    def pressures(y, x):
        above, below, gas = y
        oil = [GAS_PRESSURE + BULK * (above / (ABOVE - ANNULUS * x) - 1.0)]
        oil += [GAS_PRESSURE + BULK * (below / (BELOW + (ANNULUS + ROD) * x) - 1.0)]
        return *(np.maximum(p, CAVITY) for p in oil), GAS_PRESSURE * (GAS_VOLUME / gas) ** EXPONENT

    def rate(t, y):
        above, below, reserve = pressures(y, amplitude * np.sin(w * t))
        through, inflow = _flow(PISTON, above - below), _flow(base, reserve - below)
        return [-through, through + inflow, inflow]

    t = np.arange((cycles - 1) * samples + 1, cycles * samples + 1) / (samples * frequency)
    start = [ABOVE, BELOW, GAS_VOLUME]
    solved = solve_ivp(rate, (0.0, t[-1]), start, "LSODA", t, rtol=1e-10, atol=1e-16)
    assert solved.success, solved.message
    above, below, _ = pressures(solved.y, amplitude * np.sin(w * t))
    seal = 30.0 * np.tanh(amplitude * w * np.cos(w * t) / 5e-3)
    return above * ANNULUS - below * (ANNULUS + ROD) + OUTSIDE * ROD + seal, above, below


def _sine(frequency, amplitude, samples):
    """Time, stroke and velocity of 4001 samples."""
    w, t = 2 * np.pi * frequency, np.arange(4001) / (samples * frequency)
    return t, amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)


@pytest.mark.parametrize("intake", ["wide", "narrow"])
@pytest.mark.parametrize(
    ("frequency", "amplitude"),
    [*(pytest.param(*motion, marks=pytest.mark.slow) for motion in [(0.5, 0.05), (10.0, 0.005)]), (3.0, 0.03)],
)
def test_against_volumes_of_oil_and_gas(frequency, amplitude, intake):
    """With the narrow intake cavities open and close below the piston."""
    law = LAW if intake == "wide" else replace(LAW, SLOW_INTAKE)
    valves = BASE if intake == "wide" else (*BASE[:2], (5e3, 5e8, 3e-7), BASE[3])
    expected, _, below = integrated(frequency, amplitude, valves)
    assert (np.min(below) == CAVITY) == (intake == "narrow")
    size = np.max(np.abs(expected))
    errors = []
    for samples in (500, 2000):  # of one length and so one program, whatever the number of cycles; all show the second
        force = respond(law, *_sine(frequency, amplitude, samples), substeps=4)[samples + 1 : 2 * samples + 1]
        errors.append(np.max(np.abs(np.asarray(force)[samples // 500 - 1 :: samples // 500] - expected)) / size)
    assert errors[1] < 2e-4 and (errors[1] < errors[0] / 3 or errors[0] < 1e-5), errors


@pytest.mark.slow
def test_flows_from_any_state_by_newton_and_by_halving(monkeypatch):
    """Far outside of motions too: pressures, velocities and steps of all sizes."""
    rng, count = np.random.default_rng(0), 300
    x, v = rng.uniform(-0.18, 0.18, count), rng.normal(size=count) * 10 ** rng.uniform(-4, 0.7, count)
    states = rng.normal(size=(count, 2)) * 10 ** rng.uniform(-7, -2.5, (count, 2))
    steps = 10 ** rng.uniform(-5, -1.3, count)
    after = []
    for newton_steps in (_root.NEWTON_STEPS, 1):
        monkeypatch.setattr(_root, "NEWTON_STEPS", newton_steps)
        after.append(np.asarray(jax.jit(jax.vmap(LAW.implicit_stage))(x, v, states, steps)))
        assert np.all(np.isfinite(after[-1]))
    moved = np.abs(after[0] - states).max(axis=1)
    np.testing.assert_allclose(np.abs(after[0] - after[1]).max(axis=1) / moved, 0.0, atol=1e-7)


def test_the_curve_of_paper_001():
    """The force at constant velocity without gas, up to the largest velocity of the tests, 2π 2.5 Hz 20 mm."""
    published = Besinger(14_400.0, 15_600.0, 3_600.0, limit_velocity=0.125, transition_velocity=0.7)
    v = np.linspace(-0.314, 0.314, 41)
    oil = LAW.piston + LAW.base + LAW.friction
    found, expected = (np.asarray(quasi_static(law, v).force) for law in (oil, published))
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.005 * np.max(np.abs(expected))


@pytest.mark.slow
def test_the_base_valve_passes_what_the_rod_displaces():
    """Whatever area the base valve states: a fit may move that of the rod."""
    v = np.array([-0.07, -0.05, 0.05, 0.3])  # no cavity opens
    thin = replace(LAW, {"gas.rod_area": 0.5 * ROD})
    stated = dataclasses.replace(thin, base=dataclasses.replace(LAW.base, area=0.5 * ROD))
    forces = [np.asarray(quasi_static(law, v).force) for law in (thin, stated)]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-9)
    np.testing.assert_allclose(forces[0], quasi_static(thin.incompressible(), v).force, rtol=3e-3)


def test_a_curve_ends_where_a_cavity_opens():
    """Held for seconds, a cavity compressed the gas until it passed as much oil as without it: 60 % too much force."""
    weak = {"base.compression_opening_pressure": 2e5, "base.compression_valve_stiffness": 5e10}
    law, v = replace(LAW, weak), np.array([-1.0, -0.1, 0.3])
    moving = respond(law, *_sine(1.0 / (0.08 * np.pi), 0.04, 2000))  # of 1 m/s
    assert np.min(np.asarray(moving)[1000:]) > -10e3
    curve = quasi_static(law, v)
    assert curve.settled.tolist() == [False, True, True] and "cavity" in curve.note
    np.testing.assert_allclose(curve.force[1:], quasi_static(law.incompressible(), v[1:]).force, rtol=3e-3)


def test_slow_strokes_show_the_gas():
    """k = n p A_r²/V_g, around −(p − p_atm) A_r, with no hysteresis but friction."""
    silent = replace(LAW, {"friction_force": 1e-6})
    x, _, force = last_cycle(silent, 1e-4, 1e-3, cycles=2, samples=500, substeps=4)
    stiffness = EXPONENT * GAS_PRESSURE * ROD**2 / GAS_VOLUME
    np.testing.assert_allclose(force, -(GAS_PRESSURE - OUTSIDE) * ROD + stiffness * x, atol=0.05)


def test_without_compressibility():
    """The full law tends to the sum of its four laws, in proportion to the frequency at equal velocities."""
    simple = LAW.incompressible()
    assert simple.initial_state().size == 0
    apart = []
    for frequency in (4.0, 2.0, 1.0):
        amplitude = 0.2 / (2 * np.pi * frequency)
        forces = [last_cycle(law, frequency, amplitude, cycles=2, samples=500, substeps=4)[2] for law in (LAW, simple)]
        apart.append(np.sqrt(np.mean((forces[0] - forces[1]) ** 2)) / np.max(forces[1]))
    assert apart[2] < 0.015 and 1.5 < apart[0] / apart[1] < 2.5 and 1.5 < apart[1] / apart[2] < 2.5, apart


def test_a_soft_base_valve_loses_the_compression():
    """Without pressure below the piston the oil above it cavitates, and the next rebound begins without force."""
    soft = replace(LAW, {"base.leak": 1e-9, "base.bleed_area": 1e-5})
    assert np.min(integrated(3.0, 0.03, (1e-5, 1e-9, *BASE[2:]))[1]) == CAVITY
    loops = [last_cycle(law, 3.0, 0.03, cycles=2, samples=500, substeps=4)[1:] for law in (LAW, soft)]
    assert np.min(loops[1][1]) > 0.4 * np.min(loops[0][1])
    zero = [force_at_zero_velocity(*loop) for loop in loops]
    assert zero[1].mean() > zero[0].mean()


def test_passive_everywhere():
    for law in (LAW, replace(LAW, SLOW_INTAKE)):
        for frequency in (0.5, 3.0, 12.0, 30.0):
            for velocity in (0.02, 0.3, 1.5):
                amplitude = min(velocity / (2 * np.pi * frequency), 0.1)
                _, v, force = last_cycle(law, frequency, amplitude, cycles=2, samples=500, substeps=4)
                assert work(frequency, v, force) > 0.0


@pytest.mark.slow
def test_no_drift():
    """A hundred cycles later the loop is the same to rounding."""
    w, t = 2 * np.pi * 12.0, np.arange(100 * 200 + 1) / (200 * 12.0)
    force = np.asarray(respond(LAW, t, 0.01 * np.sin(w * t), 0.01 * w * np.cos(w * t), state=LAW.initial_state()))
    np.testing.assert_allclose(force[-200:], force[401:601], atol=1e-6)


@pytest.mark.slow
def test_finite_and_stable_at_a_step_far_too_long():
    t = 0.05 * np.arange(200)
    v = np.where(np.arange(200) % 20 < 10, 0.1, -0.1)
    force = np.asarray(respond(LAW, t, 0.05 * np.cumsum(v) - 0.03, v))
    low, high = np.asarray(quasi_static(LAW, np.array([-0.1, 0.1])).force)
    assert np.min(force) > low - 200.0 and np.max(force) < high + 200.0


def test_strokes_and_charges_that_are_refused():
    t = np.linspace(0.0, 1.0, 101)
    with pytest.raises(ValueError, match=r"`stroke` must stay from -0\.1887 to 0\.1901 m for TwinTube"):
        respond(LAW, t, 0.2 * np.sin(6.0 * t))
    with pytest.raises(ValueError, match=r"`TwinTube\.gas\.pressure` must be above the cavitation pressure"):
        dataclasses.replace(LAW, gas=GasSpring(5e3, 3e-4, ROD))


@pytest.mark.slow
def test_single_precision():
    assert single_precision_error(TwinTube.reference) < 1e-3


@pytest.mark.slow
def test_both_engines_in_a_quarter_car():
    car = QuarterCar(1500.0, 200.0, 150e3, 900e3, LAW)
    road = roads.cosine_bump(0.02, start=0.1, duration=0.1)
    fast = simulate(car, road, duration=0.6)
    exact = simulate(car, road, duration=0.6, engine=Adaptive(diffrax.Kvaerno5()))
    expected = np.asarray(exact["damper_force"])
    assert np.max(expected) > 1000.0
    errors = np.asarray(fast["damper_force"]) - expected
    assert np.sqrt(np.mean(errors**2)) < 0.005 * np.max(np.abs(expected))


@pytest.mark.slow
def test_identified_from_records_and_geometry():
    """The whole law from a start without knowledge of the valves; other strokes and frequencies are predicted."""
    runs = [
        run
        for test in (SineTest(0.05, 0.1, cycles=1), SineTest(0.03, 1.6, cycles=3), SineTest(0.005, 10.0, cycles=6))
        for run in VirtualDyno(LAW, 1000.0, force_noise=10.0, seed=3).run(test)
    ]
    geometry = {"piston_diameter": 0.05, "rod_diameter": 0.02, "rebound_volume": ABOVE, "compression_volume": BELOW}
    start = functools.partial(TwinTube.guess, **geometry)
    held = ["gas.rod_area", "gas.exponent", "base.rebound_*"]
    result = fit(start, runs, freeze=held, starts=1)
    others = VirtualDyno(LAW, 1000.0, seed=4).run([SineTest(0.02, 0.5, cycles=2), SineTest(0.01, 5.0, cycles=4)])
    assert result.score(others)[0] > 99.0, result
