"""The force of a law whose command varies: closed forms, an independent integrator, derivatives, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp.dampers import BoucWen, Lag, Linear, ModifiedBoucWen, Scheduled, TemperatureScaled, with_command
from jaxdamp.export import from_json, to_json
from jaxdamp.rig import Rig, respond
from jaxdamp.simulation import Exponential


TIME = np.linspace(0.0, 1.0, 1001)
DT = 1e-3
STROKE, VELOCITY = 0.01 * np.sin(12.0 * TIME), 0.12 * np.cos(12.0 * TIME)
LAW = Scheduled((Linear(500.0), Linear(2500.0)), [0.0, 1.0], 0.0)
STEP = np.where(TIME > 0.3 + DT / 2, 1.0, 0.2)  # rises between two samples
LAG = 8e-3


def lagged_step(time, begin):
    """0.2 to 1.0 in a straight line over one sample, behind a first-order lag: the closed form."""
    ramp, late = np.maximum(time - begin, 0.0), np.maximum(time - begin - DT, 0.0)

    def answer(since):
        return since - LAG * (1.0 - np.exp(-since / LAG))

    return 0.2 + 0.8 * (answer(ramp) - answer(late)) / DT


def test_a_law_has_the_command_at_once():
    force = respond(LAW, TIME, STROKE, VELOCITY, command=STEP)
    np.testing.assert_allclose(force, (500.0 + 2000.0 * STEP) * VELOCITY, rtol=1e-12)
    held = respond(LAW, TIME, STROKE, VELOCITY, command=0.7)
    np.testing.assert_array_equal(held, respond(with_command(LAW, 0.7), TIME, STROKE, VELOCITY))
    noisy = respond(LAW, TIME, STROKE, VELOCITY, command=np.where(STEP > 0.5, 1.04, -0.04))
    np.testing.assert_allclose(noisy, np.where(STEP > 0.5, 2500.0, 500.0) * VELOCITY, rtol=1e-12)


def test_behind_the_lag_of_the_actuator_it_is_the_closed_form():
    force = Rig(command_lag=LAG).force(LAW, TIME, STROKE, VELOCITY, command=STEP)
    expected = (500.0 + 2000.0 * lagged_step(TIME, 0.3)) * VELOCITY
    np.testing.assert_allclose(force, expected, atol=1e-9)
    both = Rig(command_lag=LAG, force_delay=5 * DT).force(LAW, TIME, STROKE, VELOCITY, command=STEP)
    np.testing.assert_allclose(both[5:], expected[:-5], atol=1e-9)


def test_it_goes_through_wrappers_and_beside_a_temperature():
    wrapped = TemperatureScaled(LAW, sensitivity=0.002, temperature=293.15) + Linear(100.0)
    force = respond(wrapped, TIME, STROKE, VELOCITY, command=STEP, temperature=np.full(TIME.shape, 343.15))
    np.testing.assert_allclose(force, (0.9 * (500.0 + 2000.0 * STEP) + 100.0) * VELOCITY, rtol=1e-12)


def errors_beside_scipy(law_at, law, command):
    """Largest error of the force at 1, 2 and 4 times the sampling rate, relative to its range."""
    found = []
    for parts in (1, 2, 4):
        time = np.linspace(0.0, 0.2, 200 * parts + 1)
        x, v = 0.01 * np.sin(12.0 * time), 0.12 * np.cos(12.0 * time)
        rig, start = Rig(command_lag=LAG), law.initial_state()
        force = np.asarray(rig.force(law, time, x, v, command=command(time)))

        rate = jax.jit(lambda x, v, u, z: law_at(u).state_rate(x, v, z))

        def slopes(t, y, rate=rate):
            x, v = 0.01 * np.sin(12.0 * t), 0.12 * np.cos(12.0 * t)
            return np.append(np.asarray(rate(x, v, y[-1], y[:-1])), (command(t) - y[-1]) / LAG)

        y0 = np.append(np.asarray(start), command(0.0))
        solved = solve_ivp(slopes, (0.0, 0.2), y0, t_eval=time[::parts], rtol=1e-9, atol=1e-12, max_step=5e-3).y
        at = jax.jit(jax.vmap(lambda x, v, u, z: law_at(u).force(x, v, z)))
        true = np.asarray(at(x[::parts], v[::parts], solved[-1], solved[:-1].T))
        found.append(np.abs(force[::parts] - true).max() / np.ptp(true))
    return found


@pytest.mark.parametrize("blend", ["parameters", pytest.param("force", marks=pytest.mark.slow)])
def test_a_law_with_states_agrees_with_an_independent_integrator(blend):
    soft, hard = BoucWen(500.0, 1000.0, 60.0, 1e-3), BoucWen(1800.0, 1000.0, 400.0, 1.5e-3)
    law = Scheduled((soft, hard), [0.0, 1.0], 0.3, blend)
    errors = errors_beside_scipy(law.at, law, lambda t: 0.5 + 0.4 * np.sin(40.0 * t))
    assert errors[0] < 5e-5 and errors[0] / errors[1] > 3.0 and errors[2] < 5e-6


@pytest.mark.slow
def test_a_voltage_of_a_law_of_its_own_and_pieces_of_a_record():
    law, volts = ModifiedBoucWen.prototype(), 1.0 + np.sin(9.0 * TIME)
    whole = respond(law, TIME, STROKE, VELOCITY, command=volts, state=law.initial_state())
    first, state = respond(
        law,
        TIME[:501],
        STROKE[:501],
        VELOCITY[:501],
        command=volts[:501],
        state=law.initial_state(),
        return_state=True,
    )
    rest = respond(law, TIME[500:], STROKE[500:], VELOCITY[500:], command=volts[500:], state=state)
    np.testing.assert_allclose(np.append(first, rest[1:]), whole, rtol=1e-6)
    assert np.ptp(whole) > 1.2 * np.ptp(respond(law, TIME, STROKE, VELOCITY, state=law.initial_state()))


def test_derivatives_by_the_lag_and_many_lags_at_once():
    law = Scheduled((Lag(Linear(500.0), 0.003), Lag(Linear(2500.0), 0.003)), [0.0, 1.0], 0.0)

    def force(lag):
        return Rig(command_lag=lag).force(law, TIME, STROKE, VELOCITY, command=STEP)

    slope = jax.jacfwd(force)(LAG)
    np.testing.assert_allclose(slope, (force(LAG + 1e-6) - force(LAG - 1e-6)) / 2e-6, atol=1e-3 * np.ptp(slope))
    many = jax.vmap(force)(jnp.array([0.0, LAG]))
    np.testing.assert_allclose(many[1], force(LAG), rtol=1e-9)
    np.testing.assert_allclose(
        many[0], respond(law, TIME, STROKE, VELOCITY, command=STEP, state=np.zeros(1)), atol=60.0
    )


def test_written_and_read():
    assert float(from_json(to_json(Rig(command_lag=LAG))).command_lag) == LAG


@pytest.mark.parametrize(
    ("law", "command", "message"),
    [
        (Linear(1.0), STEP, "be left out beside a law that takes none"),
        (LAW, STEP[1:], "be one value or as long as `time`"),
        (LAW, 2.0 * STEP, r"stay between the levels 0 and 1 of the law, but is from 0.4 to 2"),
        (LAW, np.where(TIME > 0.5, np.nan, 0.0), "be finite"),
    ],
)
def test_commands_that_cannot_be_are_refused(law, command, message):
    with pytest.raises(ValueError, match=f"`command` must {message}"):
        respond(law, TIME, STROKE, VELOCITY, command=command)


def test_refusals_of_machine_and_engine():
    with pytest.raises(ValueError, match="`command` must be left out beside an engine"):
        respond(LAW, TIME, STROKE, VELOCITY, command=STEP, engine=Exponential())
    with pytest.raises(ValueError, match="`command` must be as long as `time`"):
        Rig(command_lag=LAG).force(LAW, TIME, STROKE, VELOCITY, command=STEP[:-1])
    with pytest.raises(ValueError, match="command_lag"):
        Rig(command_lag=-1e-3)
