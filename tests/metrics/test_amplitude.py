import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import crest_factor, peak, rms


CYCLE = np.sin(2 * np.pi * np.arange(128) / 128)


def test_rms_of_a_sine():
    assert float(rms(3.0 * CYCLE)) == pytest.approx(3.0 / np.sqrt(2), rel=1e-14)


def test_rms_keeps_the_mean():
    assert float(rms(2.0 + 3.0 * CYCLE)) == pytest.approx(np.sqrt(4.0 + 4.5), rel=1e-14)


def test_rms_gradient_is_the_closed_form():
    x = jnp.asarray(0.5 + CYCLE)
    np.testing.assert_allclose(jax.grad(rms)(x), x / (128 * rms(x)), rtol=1e-13)


def test_rms_gradient_in_amplitude():
    assert float(jax.grad(lambda a: rms(a * jnp.asarray(CYCLE)))(0.3)) == pytest.approx(1 / np.sqrt(2), rel=1e-13)
    assert float(jax.grad(lambda a: rms(a * jnp.asarray(CYCLE)))(0.0)) == 0.0


def test_peak_is_the_largest_magnitude():
    assert float(peak(np.array([0.5, -2.5, 2.0]))) == 2.5
    np.testing.assert_array_equal(jax.grad(peak)(jnp.array([0.5, -2.5, 2.0])), [0.0, -1.0, 0.0])


def test_crest_factors():
    assert float(crest_factor(0.01 * CYCLE)) == pytest.approx(np.sqrt(2), rel=1e-14)
    assert float(crest_factor(np.sign(CYCLE + 1e-3))) == pytest.approx(1.0, rel=1e-14)
    assert np.isnan(crest_factor(np.zeros(5)))
