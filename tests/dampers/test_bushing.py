"""Complex stiffness of a linear law, SciPy for others, limits, order and stability of the step."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxdamp import respond
from jaxdamp.dampers import Bilinear, Bushing, Lag, Linear, PowerLaw, SeriesSpring

from .cars import simulated_and_integrated
from .motions import last_cycle, work
from .single_precision import single_precision_error


@pytest.mark.parametrize(
    ("frequency", "oil", "rubber", "damping"),
    [(1.0, 2e6, 6e5, 800.0), (12.0, 2e6, 6e5, 800.0), (12.0, 3e5, 1e5, 3000.0), (30.0, 1e7, 4e5, 2000.0)],
)
def test_complex_stiffness_of_a_linear_law(frequency, oil, rubber, damping):
    rate, amplitude, w = 3000.0, 0.005, 2 * np.pi * frequency
    x, v, force = last_cycle(Bushing(Linear(rate), oil, rubber, damping), frequency, amplitude, cycles=8)
    stiffness = 1 / (1 / (1j * w * rate) + 1 / oil + 1 / (rubber + 1j * w * damping))
    scale = abs(stiffness)
    storage, loss = 2 * np.mean(force * x) / amplitude**2, 2 * np.mean(force * v) / (w * amplitude**2)
    # 2000 steps a cycle of a method of second order: (ω dt)² is 1e-5
    np.testing.assert_allclose(
        [storage / scale, loss / scale], [stiffness.real / scale, stiffness.imag / scale], atol=1e-5
    )
    np.testing.assert_allclose(work(frequency, v, force), np.pi * stiffness.imag * amplitude**2, rtol=2e-5)
    np.testing.assert_allclose(np.abs(force).max(), scale * amplitude, rtol=2e-5)


def test_a_nonlinear_law_by_scipy():
    oil, rubber, damping = 1.5e6, 5e5, 900.0
    law = Bushing(Bilinear(2600.0, 1200.0), oil, rubber, damping)
    w, t = 2 * np.pi * 11.0, np.linspace(0.0, 0.3, 6001)

    def rate(t, y):
        force = oil * y[0]
        moving = force / (2600.0 if force > 0 else 1200.0)
        yielding = (force - rubber * y[1]) / damping
        return [0.5 * np.cos(w * t) - moving - yielding, yielding]

    exact = solve_ivp(rate, (0.0, 0.3), [0.0, 0.0], "LSODA", t, rtol=1e-10, atol=1e-14, max_step=1e-3)
    assert exact.success, exact.message
    force = respond(law, t, 0.5 / w * np.sin(w * t), 0.5 * np.cos(w * t))
    # the start in motion is a transient of 1 ms, followed in steps of 0.05 ms
    np.testing.assert_allclose(force, oil * exact.y[0], atol=5e-4 * 1300.0)
    np.testing.assert_allclose(force[1000:], oil * exact.y[0, 1000:], atol=2e-5 * 1300.0)


def test_rates_are_those_of_the_equations():
    law = Bushing(Linear(2000.0), 2e6, 5e5, 400.0)
    found = law.state_rate(0.01, 0.3, jnp.array([2e-4, 3e-4]))
    yielding = (400.0 - 150.0) / 400.0
    np.testing.assert_allclose(found, [0.3 - 400.0 / 2000.0 - yielding, yielding], rtol=1e-12)


def test_without_damping_in_the_bushing_it_is_a_series_spring():
    law = PowerLaw(1800.0, 0.7, 900.0, 0.7, knee_width=0.01)
    found = last_cycle(Bushing(law, 1e6, 4e5, 1e-3), 10.0, 0.01)[2]
    expected = last_cycle(SeriesSpring(law, 1 / (1 / 1e6 + 1 / 4e5)), 10.0, 0.01)[2]
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_a_law_with_states_inside():
    oil, rubber, damping = 5e6, 4e5, 300.0
    law = Bushing(Linear(2000.0) + 0.5 * Lag(Linear(900.0), 0.01), oil, rubber, damping)
    w, t = 2 * np.pi * 9.0, np.linspace(0.0, 0.25, 5001)

    def rate(t, y):
        x_o, x_b, lagging = y
        force = oil * x_o
        moving, yielding = (force - 0.5 * lagging) / 2000.0, (force - rubber * x_b) / damping
        return [0.4 * np.sin(w * t) - moving - yielding, yielding, (900.0 * moving - lagging) / 0.01]

    exact = solve_ivp(rate, (0.0, 0.25), [0.0] * 3, "LSODA", t, rtol=1e-10, atol=1e-14)
    assert exact.success, exact.message
    force = respond(law, t, 0.4 / w * (1 - np.cos(w * t)), 0.4 * np.sin(w * t))
    expected = oil * exact.y[0]
    np.testing.assert_allclose(force, expected, atol=1e-5 * np.abs(expected).max())


def test_stable_at_a_step_far_too_long():
    law = Bushing(PowerLaw(1800.0, 0.5, 900.0, 0.5), 1.5e7, 1e6, 10.0)
    t = np.arange(200) * 0.05
    v = np.where(np.arange(200) % 20 < 10, 0.8, -0.8)
    force = np.asarray(respond(law, t, np.cumsum(v) * 0.05, v))
    settled = np.abs(force).reshape(20, 10)[2:, 5:]
    np.testing.assert_allclose(settled[::2], 1800.0 * 0.8**0.5, rtol=1e-3)
    assert np.all(np.abs(force) < 2000.0)


@pytest.mark.exhaustive
def test_quarter_car():
    oil, rubber, damping = 4e5, 1.2e5, 700.0

    def force(x, v, x_o, x_b):
        return oil * x_o

    def rate(x, v, x_o, x_b):
        carried = oil * x_o
        yielding = (carried - rubber * x_b) / damping
        return [v - carried / (2000.0 if carried > 0 else 1100.0) - yielding, yielding]

    law = Bushing(Bilinear(2000.0, 1100.0), oil, rubber, damping)
    found, expected = simulated_and_integrated(law, force, rate, states=2, amplitude=0.03, frequency=1.5)
    assert np.ptp(expected) > 0.05
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_single_precision():
    assert single_precision_error(lambda: Bushing(Linear(2000.0), 5e6, 4e5, 300.0)) < 1e-4


@pytest.mark.parametrize("law", [Lag(Linear(1000.0), 0.01), Bushing(Linear(1000.0), 1e6, 1e5, 100.0)])
def test_a_law_that_does_not_answer_at_once_is_refused(law):
    with pytest.raises(
        ValueError, match=r"`law` must be a law whose force depends directly on the velocity.*Lag\(Bushing"
    ):
        Bushing(law, 1e6, 1e5, 100.0)
