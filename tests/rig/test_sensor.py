import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from jaxdamp.rig import Sensor


DT = 1e-3
TIME = DT * np.arange(2000)
SIGNAL = np.sin(2 * np.pi * 3.0 * TIME)


def test_lag_and_high_pass_are_first_order_filters():
    shown = Sensor(gain=1.5, offset=0.2, lag=4e-3, high_pass=0.4)(jnp.asarray(SIGNAL), DT)
    corner = 2 * np.pi * 0.4
    filters = [([1.0], [4e-3, 1.0]), ([1.0, 0.0], [1.0, corner])]
    expected = SIGNAL
    for numerator, denominator in filters:
        _, expected, _ = scipy.signal.lsim((numerator, denominator), expected, TIME)
    np.testing.assert_allclose(shown, 1.5 * expected + 0.2, atol=2e-4)


def test_delay_is_a_shift_by_a_part_of_a_sample():
    shown = Sensor(delay=2.5e-4)(jnp.asarray(SIGNAL), DT)
    np.testing.assert_allclose(shown[5:], np.sin(2 * np.pi * 3.0 * (TIME[5:] - 2.5e-4)), atol=1e-7)


def test_derivatives_are_finite_where_an_effect_starts_at_zero():
    def total(number):
        return jnp.sum(Sensor(lag=number, delay=number)(jnp.asarray(SIGNAL), DT) ** 2)

    assert np.isfinite(jax.jit(jax.jacfwd(total))(0.0))


def test_a_sensor_has_what_it_is_given():
    sensor = Sensor(offset=0.0, lag=1e-3)
    assert sensor.given == ("offset", "lag") and repr(sensor) == "Sensor(offset=0.0, lag=0.001)"
    with pytest.raises(ValueError, match="lag"):
        Sensor(lag=-1e-3)
    with pytest.raises(ValueError, match="`high_pass` must be positive"):
        Sensor(high_pass=0.0)
