import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from jaxdamp.roads import sweep_sine


def frequency(sweep, t, start=0.5, stop=20.0, duration=10.0):
    t = np.clip(t, 0.0, duration)
    return start + (stop - start) * t / duration if sweep == "linear" else start * (stop / start) ** (t / duration)


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
@pytest.mark.parametrize("t", [-0.7, 0.3, 4.1, 9.99, 10.7])
def test_phase_is_the_integral_of_the_frequency(sweep, t):
    cycles, _ = integrate.quad(lambda s: frequency(sweep, s), 0.0, t, epsabs=1e-12, limit=200, points=[min(t, 10.0)])
    z = sweep_sine(0.5, 20.0, duration=10.0, amplitude=0.01, sweep=sweep).height(np.array([t]))[0, 0]
    assert float(z) == pytest.approx(0.01 * np.sin(2 * np.pi * cycles), abs=1e-11)


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
def test_constant_amplitude_of_height_or_of_its_rate(sweep):
    time = np.arange(0.0, 10.0, 1e-4)
    flat = np.asarray(sweep_sine(0.5, 20.0, duration=10.0, amplitude=0.01, sweep=sweep).height(time)[:, 0])
    fast = np.asarray(sweep_sine(0.5, 20.0, duration=10.0, velocity_amplitude=0.3, sweep=sweep).height(time)[:, 0])
    np.testing.assert_allclose(fast, flat / 0.01 * 0.3 / (2 * np.pi * frequency(sweep, time)), atol=1e-12)
    rate = np.abs(np.gradient(fast, 1e-4))
    late = time >= 5.0 - 1e-9
    # relative size of the neglected A' sin: f'/(2 pi f^2) < 0.01 for either sweep after half the time
    peaks = rate[late].reshape(-1, 10_000).max(axis=1)
    np.testing.assert_allclose(peaks, 0.3, rtol=1e-3)  # it is in quadrature: second order; differences 2e-5
    assert np.max(np.abs(flat[late])) == pytest.approx(0.01, rel=1e-4)


def test_duration_direction_and_ends():
    up = sweep_sine(1.0, 8.0, duration=5.0, amplitude=0.01, sweep="logarithmic")
    assert up.duration == 5.0 and up.grid is None
    assert jax.jit(lambda T: jnp.array(sweep_sine(1.0, 8.0, duration=T, amplitude=0.01).duration is None))(5.0)
    # the phase of the sweep downwards, seen from its end, is that of the sweep upwards
    time = np.linspace(0.0, 5.0, 500)
    down = sweep_sine(8.0, 1.0, duration=5.0, amplitude=0.01, sweep="logarithmic")
    total = 7.0 * 5.0 / np.log(8.0)
    cycles = 1.0 * 5.0 / np.log(8.0) * np.expm1(np.log(8.0) * (5.0 - time) / 5.0)
    np.testing.assert_allclose(down.height(time)[:, 0], 0.01 * np.sin(2 * np.pi * (total - cycles)), atol=1e-14)


@pytest.mark.parametrize(
    ("argument", "sweep"),
    [("start", "linear"), ("start", "logarithmic"), ("stop", "linear"), ("duration", "logarithmic")],
)
def test_gradients_equal_differences(sweep, argument, check_gradient):
    given = {"start": 0.5, "stop": 9.0, "duration": 4.0, "velocity_amplitude": 0.2}
    time = np.linspace(0.0, 5.0, 301)

    def energy(value):
        return jnp.sum(sweep_sine(**{**given, argument: value}, sweep=sweep).height(time) ** 2)

    check_gradient(energy, given[argument])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"amplitude": None}, r"`amplitude` must be given, or `velocity_amplitude`.*neither was given.*exactly one"),
        ({"velocity_amplitude": 0.1}, r"`amplitude` must be.*not both, but is 0.01 m, and 0.1 m/s as well"),
        ({"stop": 1.0}, r"`stop` must differ from `start` \(1.0 Hz\), but is 1.0 Hz.*Use `sine`"),
        ({"start": 0.0}, r"`start` must be positive and finite, but is 0.0"),
        ({"duration": -1.0}, r"`duration` must be positive and finite, but is -1.0"),
        ({"sweep": "log"}, r"`sweep` must be one of 'linear', 'logarithmic', but is 'log'"),
        ({"ramp": -1.0}, r"`ramp` must be finite and not negative, but is -1.0"),
        ({"amplitude": np.nan}, r"`amplitude` must be finite, but is nan"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        sweep_sine(**{"start": 1.0, "stop": 9.0, "duration": 4.0, "amplitude": 0.01, **arguments})
