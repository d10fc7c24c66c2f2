import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import working_space_peak, working_space_rms


TRAVEL = 0.04 * np.sin(2 * np.pi * np.arange(128) / 128)


def test_sine():
    assert float(working_space_rms(TRAVEL)) == pytest.approx(0.04 / np.sqrt(2), rel=1e-13)
    assert float(working_space_peak(TRAVEL)) == pytest.approx(0.08, rel=1e-13)


@pytest.mark.parametrize("metric", [working_space_rms, working_space_peak])
def test_offset_changes_nothing(metric):
    assert float(metric(TRAVEL + 0.35)) == pytest.approx(float(metric(TRAVEL)), rel=1e-12)


def test_constant_deflection_uses_no_space():
    constant = jnp.full(10, 0.25)
    assert float(working_space_rms(constant)) == 0.0
    np.testing.assert_array_equal(jax.grad(working_space_rms)(constant), np.zeros(10))


def test_gradient_of_peak_is_at_the_extremes():
    np.testing.assert_array_equal(jax.grad(working_space_peak)(jnp.array([0.0, 0.04, -0.02, 0.01])), [0, 1, -1, 0])
