import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from jaxdamp.metrics import international_roughness_index


# Slope gain of the golden car at 80 km/h, found by an independent program.
GAINS = {1.0: 0.2731, 2.4: 1.6640, 5.0: 1.1697, 16.0: 1.5367, 50.0: 0.1366}


def index_of_sine(wavelength: float, length: float, moving_average: float = 0.25) -> float:
    """In mm/m, of a sine of slope 1 mm/m; without what straight lines between samples take from it."""
    spacing = spacing_for(wavelength)
    x = np.arange(0.0, length + max(moving_average, spacing) + spacing / 2, spacing)
    profile = 0.001 * wavelength / (2 * np.pi) * np.sin(2 * np.pi * x / wavelength) / np.sinc(spacing / wavelength) ** 2
    return 1000.0 * float(international_roughness_index(profile, spacing, moving_average=moving_average))


def spacing_for(wavelength: float) -> float:
    # |sine| summed over 100 samples a cycle is right to (pi/100)^2/3 whatever the phase
    return 0.01 if wavelength < 2.0 else 0.025


@pytest.mark.parametrize(("wavelength", "average"), [*((wavelength, 0.25) for wavelength in GAINS), (2.4, 0.0)])
def test_gains(wavelength, average):
    # the difference of two lengths, whole numbers of all wavelengths apart, is free of the start of the record
    short, long = (length * index_of_sine(wavelength, length, average) for length in (400.0, 1600.0))
    # without an average the solution still averages over its step
    loss = np.sinc(max(average, spacing_for(wavelength)) / wavelength)
    assert (long - short) / 1200.0 == pytest.approx(2 / np.pi * GAINS[wavelength] * loss, rel=1e-3)


def test_known_value():
    # the steady value is 1.0405 m/km; the record starts at rest and needs some 40 m to swing up
    assert index_of_sine(2.4, 1600.0) == pytest.approx(1.0405, rel=5e-3)


@pytest.fixture
def road(rng):
    """A rough line over 150 m, a point every 250 mm."""
    n = np.fft.rfftfreq(601, 0.25)
    phase = np.exp(2j * np.pi * rng.random(n.size))
    return np.fft.irfft(np.where(n > 0.01, 1.0 / np.maximum(n, 0.01), 0.0) * phase, 601) * 0.05


def test_equals_scipy(road):
    # the same line, averaged by a dense sum, through lsim of the equations in heights
    x = np.arange(0.0, 150.0 - 1e-9, 0.0125)
    line = np.interp(x, 0.25 * np.arange(601), road)
    smooth = np.convolve(line, np.concatenate([[0.5], np.ones(19), [0.5]]) / 20, "valid")
    c, k, t, m = 6.0, 63.3, 653.0, 0.15
    a = np.array([[0, 1, 0, 0], [-k, -c, k, c], [0, 0, 0, 1], [k / m, c / m, -(k + t) / m, -c / m]])
    slope = (line[880] - line[0]) / 11.0
    speed = 80 / 3.6
    start = np.array([smooth[0], slope * speed, smooth[0], slope * speed])
    b, out = np.array([[0], [0], [0], [t / m]]), np.array([[0.0, 1.0, 0.0, -1.0]])
    _, rate, _ = scipy.signal.lsim(
        (a, b, out, np.zeros((1, 1))), smooth, 0.0125 / speed * np.arange(smooth.size), start
    )
    expected = np.mean(np.abs(rate)) / speed
    assert float(international_roughness_index(road, 0.25)) == pytest.approx(expected, rel=2e-3)


def test_does_not_depend_on_the_sampling_of_one_line(road):
    reference = float(international_roughness_index(road, 0.25))
    for cuts in (3, 10):
        x = np.linspace(0.0, 150.0, 600 * cuts + 1)
        finer = np.interp(x, 0.25 * np.arange(601), road)
        assert float(international_roughness_index(finer, 0.25 / cuts)) == pytest.approx(reference, rel=1e-3)


def test_offset_slope_and_scale(road):
    reference = float(international_roughness_index(road, 0.25))
    tilted = 3.0 + 0.02 * 0.25 * np.arange(601) - 2.0 * road
    assert float(international_roughness_index(tilted, 0.25)) == pytest.approx(2.0 * reference, rel=1e-9)
    assert float(international_roughness_index(0.1 * np.arange(100.0), 0.25)) == pytest.approx(0.0, abs=1e-12)


def test_gradient(road):
    x, direction = jnp.asarray(road), jnp.cos(0.7 * jnp.arange(601.0)) * 0.001

    def index(scale):
        return international_roughness_index(x + scale * direction, 0.25)

    slope = jax.jit(jax.grad(index))(0.5)
    assert float(slope) == pytest.approx(float(index(0.5001) - index(0.4999)) / 2e-4, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"spacing": 0.1},
            r"`profile` must be longer than 11.25 m, but is 9.9 m long. Measure further, or check `spac",
        ),
        ({"spacing": -0.1}, r"`spacing` must be positive and finite, but is -0.1"),
        ({"spacing": 250.0}, r"`spacing` must not exceed 0.3 m, but is 250.0.*it is in m"),
        ({"moving_average": -1.0}, r"`moving_average` must be finite and not negative, but is -1.0"),
    ],
)
def test_errors(change, message):
    with pytest.raises(ValueError, match=message):
        international_roughness_index(**{"profile": np.zeros(100), "spacing": 0.25, **change})


def test_spacing_must_be_known():
    with pytest.raises(ValueError, match=r"`spacing` must be known when the code is compiled, but is traced"):
        jax.jit(lambda h: international_roughness_index(jnp.zeros(100), h))(0.25)
