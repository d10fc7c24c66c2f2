"""What a machine adds to the force of a law, against closed forms."""

import dataclasses
import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp.dampers import AbstractDamper, Bilinear, CoulombFriction, Lag, Linear, Spring
from jaxdamp.export import from_json, to_json
from jaxdamp.parameters import parameters, with_values
from jaxdamp.rig import Rig


RATE, W, A = 1000.0, 2 * np.pi * 5.0, 0.01
TIME = np.arange(601) / RATE
STROKE, VELOCITY = A * np.sin(W * TIME), A * W * np.cos(W * TIME)
LAW = Linear(2000.0)
FULL = Rig(
    gas_force=-120.0,
    gas_stiffness=800.0,
    friction=30.0,
    friction_velocity=0.02,
    moving_mass=1.5,
    force_delay=0.0013,
    force_lag=0.002,
    force_offset=7.0,
    stroke_offset=1e-3,
    temperature_slope=0.002,
    gas_temperature_slope=0.0034,
    heating=1e-2,
    cooling=0.1,
    initial_rise=4.0,
)


@eqx.filter_jit
def _force(rig: Rig, law: AbstractDamper) -> jax.Array:
    return rig.force(law, TIME, STROKE, VELOCITY)


def shown(law: AbstractDamper = LAW, **numbers: float) -> np.ndarray:
    return np.asarray(_force(Rig(**numbers), law))


def test_nothing_is_added_by_default():
    law = Lag(Bilinear(2600.0, 1200.0), 0.004)
    np.testing.assert_array_equal(Rig().force(law, TIME, STROKE, VELOCITY), respond(law, TIME, STROKE, VELOCITY))
    np.testing.assert_array_equal(Rig().readings(law, TIME, STROKE).force, respond(law, TIME, STROKE))


def test_forces_of_the_machine():
    law = shown()
    np.testing.assert_allclose(shown(gas_force=-120.0, force_offset=20.0) - law, -100.0, atol=1e-10)
    np.testing.assert_allclose(shown(gas_force=-120.0, gas_stiffness=900.0) - law, -120.0 + 900.0 * STROKE, atol=1e-10)
    assert np.all(shown(gas_force=-1.0, gas_stiffness=90.0) < law)  # gas pushes the rod out, at any stroke
    seal = respond(CoulombFriction(30.0, 0.005), TIME, STROKE, VELOCITY)
    np.testing.assert_allclose(shown(friction=30.0) - law, seal, atol=1e-10)
    np.testing.assert_allclose(shown(moving_mass=2.0) - law, -2.0 * A * W**2 * np.sin(W * TIME), atol=2e-5)


def test_the_law_moves_at_the_true_stroke():
    np.testing.assert_allclose(shown(Spring(1e4), stroke_offset=2e-3), 1e4 * (STROKE - 2e-3), atol=1e-9)
    gas = shown(gas_force=-50.0, gas_stiffness=900.0, stroke_offset=2e-3) - shown()
    np.testing.assert_allclose(gas, -50.0 + 900.0 * (STROKE - 2e-3), atol=1e-9)


@pytest.mark.parametrize("delay", [0.003, 0.00137, 1e-5, -0.00137])
def test_delay_of_any_part_of_a_sample(delay):
    late = 2000.0 * A * W * np.cos(W * (TIME - delay))
    inside = slice(5, -5)
    np.testing.assert_allclose(shown(force_delay=delay)[inside], late[inside], atol=1e-4)  # of 628 N


def test_lag_of_the_force_channel():
    gain = 1 / (1 + 1j * W * 0.004)
    late = 2000.0 * A * W * np.real(gain * np.exp(1j * W * TIME))
    np.testing.assert_allclose(shown(force_lag=0.004)[100:], late[100:], atol=0.06)
    np.testing.assert_allclose(shown(force_lag=1e-9), shown(), atol=1e-3)


def test_heat_from_the_dissipated_energy():
    """Without cooling the rise is heating times the work; the force that it takes away is not dissipated."""
    readings = Rig(heating=0.01).readings(LAW, TIME, STROKE, VELOCITY)
    work = np.concatenate([[0.0], np.cumsum(np.convolve(2000.0 * VELOCITY**2, [0.5, 0.5], "valid")) / RATE])
    np.testing.assert_allclose(readings.temperature - 293.15, 0.01 * work, rtol=1e-9, atol=1e-12)
    warm = Rig(heating=0.01, temperature_slope=0.05).readings(LAW, TIME, STROKE, VELOCITY)
    np.testing.assert_allclose(warm.temperature - 293.15, (1 - np.exp(-0.05 * 0.01 * work)) / 0.05, rtol=2e-5)
    np.testing.assert_allclose(warm.force, shown() * (1 - 0.05 * (warm.temperature - 293.15)), rtol=1e-12)
    cold = Rig(cooling=3.0, initial_rise=10.0, gas_force=-100.0, gas_temperature_slope=0.01)
    rise = 10.0 * np.exp(-3.0 * TIME)
    np.testing.assert_allclose(cold.force(LAW, TIME, STROKE, VELOCITY) - shown(), -100.0 * (1 + 0.01 * rise), rtol=1e-6)


def test_a_measured_temperature_replaces_the_heat():
    rig = Rig(temperature_slope=0.002, heating=0.01, reference_temperature=300.0)
    force = rig.force(LAW, TIME, STROKE, VELOCITY, temperature=np.full(TIME.shape, 340.0))
    np.testing.assert_allclose(force, 0.92 * shown(), rtol=1e-12)
    with pytest.raises(ValueError, match="`temperature` must be finite"):
        rig.force(LAW, TIME, STROKE, VELOCITY, temperature=np.full(TIME.shape, np.nan))


def test_effects_of_known_numbers_are_those_among_traced_ones():
    """Of traced numbers all effects are computed, of known ones those that are not zero."""
    numbers = {"moving_mass": 2.0, "heating": 0.01, "initial_rise": 3.0, "force_lag": 0.004, "force_delay": 0.00137}
    for name, value in numbers.items():
        rig = Rig(**{name: value}, temperature_slope=0.01)
        assert len(rig.effects()) == 1
        alone = jax.jit(lambda rig=rig: rig.force(LAW, TIME, STROKE, VELOCITY))()
        np.testing.assert_allclose(alone, shown(LAW, **{name: value}, temperature_slope=0.01), rtol=1e-9, atol=1e-6)


def test_derivatives_by_all_parameters_of_law_and_rig():
    law, weight = Lag(Bilinear(2600.0, 1200.0, 0.02), 0.004), np.cos(37.0 * TIME)

    @eqx.filter_jit
    def value(pair):
        return jnp.mean(weight * pair[0].force(pair[1], TIME, STROKE, VELOCITY))

    slopes = {p.path: p.value for p in parameters(eqx.filter_grad(value)((FULL, law)))}
    assert len(slopes) == 15 + 3 and slopes.pop("0.command_lag") == 0.0  # the law takes no command
    for p in (p for p in parameters((FULL, law)) if p.path in slopes):
        step = 1e-4 * p.value
        above, below = (value(with_values((FULL, law), {p.path: p.value + s * step})) for s in (1, -1))
        assert slopes[p.path] != 0, p.path
        np.testing.assert_allclose(slopes[p.path], (above - below) / (2 * step), rtol=1e-4, err_msg=p.path)


def test_derivatives_where_lag_and_delay_are_zero():
    """Right-hand differences: no other number of a fit begins at an edge with an unknown slope."""
    for name in ("force_lag", "force_delay", "heating"):

        @jax.jit
        def value(number, name=name):
            return Rig(**{name: number}, temperature_slope=0.01).force(LAW, TIME, STROKE, VELOCITY)

        slope = jax.jit(jax.jacfwd(value))(0.0)
        np.testing.assert_allclose(slope[5:-5], ((value(1e-7) - value(0.0)) / 1e-7)[5:-5], rtol=1e-3, atol=2.0)


def test_many_machines_at_once():
    delays = np.array([0.0, 0.001, 0.0023])
    many = jax.jit(jax.vmap(lambda d: Rig(force_delay=d, gas_force=-10.0).force(LAW, TIME, STROKE, VELOCITY)))(delays)
    for delay, force in zip(delays, many, strict=True):
        np.testing.assert_allclose(force, shown(force_delay=delay, gas_force=-10.0), atol=1e-9)


def test_written_and_read():
    assert eqx.tree_equal(from_json(to_json(FULL)), FULL)
    assert "gas_force=-120.0" in repr(FULL)


@pytest.mark.parametrize(
    ("name", "value"), [("gas_force", 100.0), ("friction", -1.0), ("force_lag", -1e-3), ("force_offset", np.nan)]
)
def test_numbers_that_no_machine_has(name, value):
    with pytest.raises(ValueError, match=f"`Rig.{name}` must be"):
        Rig(**{name: value})
    with pytest.raises(ValueError, match=f"`Rig.{name}` must be"):
        dataclasses.replace(Rig(), **{name: value})


@pytest.mark.parametrize("temperature", [None, pytest.param(320.0, marks=pytest.mark.slow)])
def test_a_delay_of_half_a_sample_is_exact_where_friction_turns_within_one(temperature):
    """The motion is interpolated, not the force, which turns from one sample to the next."""
    rig = Rig(gas_force=-120.0, friction=30.0, friction_velocity=0.005, force_delay=1e-3, temperature_slope=2e-3)

    def shown(rate):
        time = np.arange(0.0, 1.0, 1.0 / rate)
        stroke, velocity = 0.01 * np.sin(8 * np.pi * time), 0.08 * np.pi * np.cos(8 * np.pi * time)
        warm = None if temperature is None else np.full(time.size, temperature)
        force = eqx.filter_jit(lambda rig, law: rig.force(law, time, stroke, velocity, temperature=warm))
        return np.asarray(force(rig, Linear(1500.0)))[:: round(rate / 500.0)]

    assert np.abs(shown(500.0) - shown(20_000.0))[2:-2].max() < 0.05


def test_the_domain_of_a_gas_force_is_itself_after_pickling():
    """Results of fits hold the domains of their numbers."""
    (gas,) = (p for p in parameters(Rig(gas_force=-50.0)) if p.path == "gas_force")
    assert pickle.loads(pickle.dumps(gas.domain)) is gas.domain
