"""One number three ways: simulated on a road, by the Lyapunov equation, in closed form; and the papers' arithmetic."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import metrics, roads, simulate
from jaxdamp.vehicles import frequency_response, spectral_rms, stationary_rms
from jaxdamp.vehicles.presets import quarter_car_000

from .test_quarter_car import closed_forms


@pytest.mark.slow
def test_simulated_stationary_and_closed_form_are_one():
    """Two laps of a road of 500 m at 20 m/s, the second one steady: its waves are all there a whole number of times."""
    car, speed, length, dt = quarter_car_000(), 20.0, 500.0, 2e-3
    white = roads.white("C", speed)
    exact = stationary_rms(car, white.velocity_psd)
    first, then = (
        roads.iso8608("C", speed, seed=4, length=length, ramp=ramp, amplitudes="fixed") for ramp in (0.5, 0.0)
    )
    run = simulate(car, roads.joined(first, then), duration=2 * length / speed, dt=dt)
    lap = round(length / speed / dt)
    closed = np.sqrt(float(white.velocity_psd) * np.array(closed_forms(1200.0, 125.0, 60e3, 220e3, 2500.0)))
    names = ("sprung_acceleration", "stroke", "dynamic_tyre_load")
    for name, level in zip(names, closed, strict=True):
        assert float(exact[name]) == pytest.approx(level, rel=1e-9)
        driven = float(metrics.rms(run[name][-lap:]))
        assert driven == pytest.approx(level, rel=0.02)  # the road ends at 2.83 cycle/m, and has lines
    # within the band the simulation is the sum over the spectrum to the order of its step
    frequency = np.arange(6, 1416) * speed / length
    density = np.asarray(256e-6 * (0.1 * speed) ** 2 / speed / frequency**2)
    band = spectral_rms(car, frequency, density)
    for name in names:
        assert float(metrics.rms(run[name][-lap:])) == pytest.approx(float(band[name]), rel=4e-3)


def test_white_road_height_of_paper_000():
    """Acceleration by road, 65.8131 1/s² for white height from 0.1 to 50 Hz."""
    frequency = np.linspace(0.1, 50.0, 50_000)
    gain = np.abs(frequency_response(quarter_car_000(), frequency)["sprung_acceleration"])
    found = jnp.sqrt(jnp.trapezoid(gain**2, jnp.asarray(frequency)) / 49.9)
    assert float(found) == pytest.approx(65.8131, abs=1e-4)


def test_arithmetic_of_the_papers():
    """Paper 002 prints 56.23, 58.33 and 59.63 % less, paper 003 means of 12.5 and 20.5 kN s/m."""
    table = {58.27: (1.263, 0.527), 58.18: (0.0165, 0.0069), 59.68: (0.1632, 0.0658)}
    for percent, (linear, hybrid) in table.items():
        assert 100 * (1 - hybrid / linear) == pytest.approx(percent, abs=5e-3)
    assert np.mean([11.9, 13.6]) == pytest.approx(12.75) and np.mean([19.8, 20.9]) == pytest.approx(20.35)
