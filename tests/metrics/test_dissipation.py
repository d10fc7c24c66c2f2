import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import beta

from jaxdamp.metrics import dissipated_energy, dissipated_power, equivalent_damping


STROKE, OMEGA, CYCLES = 0.02, 2 * np.pi * 1.5, 3
TIME = np.linspace(0.0, CYCLES / 1.5, 3001)
DT = TIME[1]
X = STROKE * np.sin(OMEGA * TIME)
V = STROKE * OMEGA * np.cos(OMEGA * TIME)


def test_linear_damper():
    energy = CYCLES * np.pi * 1800.0 * OMEGA * STROKE**2
    assert float(dissipated_energy(1800.0 * V, V, DT)) == pytest.approx(energy, rel=1e-12)
    assert float(equivalent_damping(1800.0 * V, V)) == pytest.approx(1800.0, rel=1e-13)


def test_spring_and_gas_force_dissipate_nothing():
    assert float(dissipated_energy(30_000.0 * X - 250.0, V, DT)) == pytest.approx(0.0, abs=1e-10)
    assert float(equivalent_damping(1800.0 * V + 30_000.0 * X - 250.0, V)) == pytest.approx(1800.0, rel=1e-12)


@pytest.mark.parametrize("exponent", [0.4, 2.0])
def test_power_law(exponent):
    # E = 2 q (X w)^(d+1)/w B((d+2)/2, 1/2) per cycle of F = q |v|^d sgn v
    force = 700.0 * np.abs(V) ** exponent * np.sign(V)
    energy = 2 * 700.0 * (STROKE * OMEGA) ** (exponent + 1) / OMEGA * beta((exponent + 2) / 2, 0.5)
    assert float(dissipated_energy(force, V, DT)) == pytest.approx(CYCLES * energy, rel=1e-5)
    expected = energy / (np.pi * OMEGA * STROKE**2)
    assert float(equivalent_damping(force, V)) == pytest.approx(expected, rel=1e-5)


def test_equivalent_damping_is_energy_over_pi_omega_stroke_squared():
    force = 1200.0 * V + 300.0 * np.tanh(V / 0.05) + 9000.0 * X
    per_cycle = dissipated_energy(force, V, DT) / CYCLES
    assert float(equivalent_damping(force, V)) == pytest.approx(
        float(per_cycle) / (np.pi * OMEGA * STROKE**2), rel=1e-12
    )


def test_trapezoidal_rule(rng):
    force, velocity = rng.standard_normal((2, 50))
    assert float(dissipated_energy(force, velocity, 0.1)) == pytest.approx(np.trapezoid(force * velocity, dx=0.1))


def test_power_is_energy_per_time(rng):
    assert float(dissipated_power(1800.0 * V, V)) == pytest.approx(1800.0 * (STROKE * OMEGA) ** 2 / 2, rel=1e-12)
    force, velocity = rng.standard_normal((2, 50))
    energy = float(dissipated_energy(force, velocity, 0.1))
    assert float(dissipated_power(force, velocity)) == pytest.approx(energy / 4.9, rel=1e-12)


def test_gradients():
    rate = jax.jit(jax.grad(lambda c: dissipated_energy(c * jnp.asarray(V), V, DT)))(1800.0)
    assert float(rate) == pytest.approx(CYCLES * np.pi * OMEGA * STROKE**2, rel=1e-12)
    assert float(jax.jit(jax.grad(lambda c: equivalent_damping(c * jnp.asarray(V), V)))(1800.0)) == pytest.approx(
        1.0, rel=1e-12
    )
    power = jax.jit(jax.grad(lambda dt: dissipated_energy(1800.0 * V, V, dt)))(DT)
    assert float(power) == pytest.approx(float(dissipated_energy(1800.0 * V, V, 1.0)), rel=1e-12)


def test_a_damper_at_rest_has_no_equivalent():
    assert np.isnan(equivalent_damping(np.zeros(9), np.zeros(9)))


@pytest.mark.parametrize("metric", [equivalent_damping, dissipated_power, lambda f, v: dissipated_energy(f, v, 0.01)])
def test_errors_of_length(metric, unchecked):
    with pytest.raises(
        ValueError, match=r"`velocity` must be as long as `force` \(9 samples\), but is of length 8.*time base"
    ):
        metric(np.ones(9), np.ones(8))
    with pytest.raises(ValueError, match=r"`velocity` must have one axis, time, but is of shape \(9, 1\)"):
        metric(np.ones(9), np.ones((9, 1)))
    with pytest.raises(ValueError, match=r"`force` must hold at least 2 samples, but is of length 1"):
        metric(np.ones(1), np.ones(1))


def test_interval_must_be_positive():
    with pytest.raises(
        ValueError, match=r"`dt` must be positive and finite, but is -0.01. It is the sampling interval in s"
    ):
        dissipated_energy(V, V, -0.01)
