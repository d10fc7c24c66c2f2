import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp.metrics import damper_temperature, temperature_rise


CAPACITY, COOLING = 1200.0, 1.5


def test_rise_solves_the_balance():
    time = np.linspace(0.0, 3000.0, 40)
    solution = solve_ivp(
        lambda t, rise: (90.0 - COOLING * rise) / CAPACITY, (0.0, 3000.0), [12.0], t_eval=time, rtol=1e-10, atol=1e-10
    )
    np.testing.assert_allclose(temperature_rise(90.0, time, CAPACITY, COOLING, 12.0), solution.y[0], rtol=1e-8)


def test_rise_has_its_limits():
    assert float(temperature_rise(90.0, 1e6, CAPACITY, COOLING, 5.0)) == pytest.approx(60.0, rel=1e-12)
    assert float(temperature_rise(90.0, 100.0, CAPACITY, 0.0, 5.0)) == pytest.approx(5.0 + 7.5, rel=1e-14)
    assert float(temperature_rise(90.0, 0.0, CAPACITY, COOLING, 5.0)) == 5.0


@pytest.mark.parametrize("cooling", [0.0, 1e-5, 0.0119, 0.0121, 1.5])
def test_slope_in_the_cooling(cooling):
    # 0.012 W/K is where the series takes over at 100 s
    slope = jax.grad(lambda h: temperature_rise(90.0, 100.0, CAPACITY, h, 3.0))(cooling)
    h = 1e-3
    values = [temperature_rise(90.0, 100.0, CAPACITY, max(cooling + i * h, 0.0), 3.0) for i in (-1, 0, 1, 2)]
    before, here, after, beyond = (float(v) for v in values)
    central = (after - before) / (2 * h) if cooling > h else (4 * after - 3 * here - beyond) / (2 * h)
    assert float(slope) == pytest.approx(central, rel=1e-6)


def test_record_equals_the_closed_form_and_the_integrator():
    constant = damper_temperature(np.full(50, 90.0), 60.0, CAPACITY, COOLING, 20.0, 32.0)
    expected = 20.0 + temperature_rise(90.0, 60.0 * np.arange(50), CAPACITY, COOLING, 12.0)
    np.testing.assert_allclose(constant, expected, rtol=1e-12)
    time = 30.0 * np.arange(60)
    power = 100.0 + 80.0 * np.sin(time / 150.0)
    solution = solve_ivp(
        lambda t, y: (np.interp(t, time, power) - COOLING * (y - 20.0)) / CAPACITY,
        (0.0, time[-1]), [20.0], t_eval=time, max_step=30.0, rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    np.testing.assert_allclose(damper_temperature(power, 30.0, CAPACITY, COOLING, 20.0), solution.y[0], rtol=1e-6)


@pytest.mark.parametrize("traced", [False, True])
def test_single_precision_does_not_drift_over_a_long_record(traced):
    """A time constant of 3 million samples, of which 1 - exp(-dt/tau) has two digits left."""
    call = jax.jit(damper_temperature) if traced else damper_temperature
    found = call(np.full(200_001, 90.0, np.float32), 1e-3, 3000.0, 1.0, 20.0)
    expected = 90.0 * -np.expm1(-200.0 / 3000.0)
    assert found.dtype == np.float32 and float(found[-1]) - 20.0 == pytest.approx(expected, rel=2e-6)


def test_record_has_gradients():
    power = jnp.asarray(100.0 + 80.0 * np.sin(np.arange(60) / 5.0))

    def last(cooling, ambient):
        return damper_temperature(power, 30.0, CAPACITY, cooling, ambient)[-1]

    by_cooling, by_ambient = jax.jit(jax.grad(last, argnums=(0, 1)))(COOLING, 20.0)
    difference = (last(COOLING + 1e-4, 20.0) - last(COOLING - 1e-4, 20.0)) / 2e-4
    assert float(by_cooling) == pytest.approx(float(difference), rel=1e-6)
    assert float(by_ambient) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"heat_capacity": 0.0}, r"`heat_capacity` must be positive and finite, but is 0.0.*mass times specific heat"),
        ({"cooling": -1.0}, r"`cooling` must be .*but is -1.0"),
        ({"start": np.nan}, r"`start` must be finite, but is nan"),
    ],
)
def test_errors(change, message):
    with pytest.raises(ValueError, match=message):
        temperature_rise(**{"power": 9.0, "time": 1.0, "heat_capacity": 100.0, "cooling": 1.0, **change})
    with pytest.raises(ValueError, match=message):
        damper_temperature(
            **{"power": np.ones(9), "dt": 1.0, "heat_capacity": 1.0, "cooling": 1.0, "ambient": 0.0, **change}
        )


def test_time_does_not_run_backwards():
    with pytest.raises(ValueError, match=r"`time` must be finite and not negative, but is -1.0"):
        temperature_rise(9.0, -1.0, 100.0, 1.0)
    with pytest.raises(ValueError, match=r"`cooling` must be positive.*without cooling use `temperature_rise`"):
        damper_temperature(np.ones(9), 1.0, 100.0, 0.0, 20.0)
