import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.metrics import international_roughness_by_segment, international_roughness_index
from jaxdamp.metrics.roughness_index import golden_car_step
from jaxdamp.roads import read_crg


# Slope gain of the golden car at 80 km/h, found by an independent program.
GAINS = {1.0: 0.2731, 2.4: 1.6640, 5.0: 1.1697, 16.0: 1.5367, 50.0: 0.1366}


def index_of_sine(wavelength: float, length: float, spacing: float, moving_average: float = 0.25) -> float:
    """In mm/m, of a sine of slope 1 mm/m."""
    x = np.arange(0.0, length + max(moving_average, spacing) + spacing / 2, spacing)
    profile = 0.001 * wavelength / (2 * np.pi) * np.sin(2 * np.pi * x / wavelength)
    return 1000.0 * float(international_roughness_index(profile, spacing, moving_average=moving_average))


# |sine| summed over 100 samples a cycle is right to (pi/100)^2/3 whatever the phase; odd spacings spread the phases
CASES = [(wavelength, 0.01 if wavelength < 2.0 else 0.025, 0.25) for wavelength in GAINS]
CASES += [(2.4, 0.025, 0.0), (16.0, 0.1, 0.25), (5.0, 0.17, 0.25), (5.0, 0.24, 0.25), (16.0, 0.3, 0.25)]


@pytest.mark.parametrize(("wavelength", "spacing", "average"), CASES)
def test_gains(wavelength, spacing, average):
    # the difference of two lengths, whole numbers of all wavelengths apart, is free of the start of the record
    short, long = (length * index_of_sine(wavelength, length, spacing, average) for length in (400.0, 1600.0))
    # the slope over the window of the standard, held from sample to sample
    window = max(1, int(np.floor(average / spacing + 0.5))) * spacing
    loss = np.sinc(window / wavelength) * np.sinc(spacing / wavelength)
    assert (long - short) / 1200.0 == pytest.approx(2 / np.pi * GAINS[wavelength] * loss, rel=2e-3)


def test_known_value():
    # the steady value is 1.0405 m/km; the record starts at rest and needs some 40 m to swing up
    assert index_of_sine(2.4, 1600.0, 0.025) == pytest.approx(1.0405, rel=5e-3)


# For 250 mm, as printed in World Bank Technical Paper 46.
PRINTED = [
    [0.9966071, 0.01091514, -0.002083274, 0.0003190145],
    [-0.5563044, 0.9438768, -0.8324718, 0.05064701],
    [0.02153176, 0.002126763, 0.7508714, 0.008221888],
    [3.335013, 0.3376467, -39.12762, 0.4347564],
]
PRINTED_PUSH = [0.005476107, 1.388776, 0.2275968, 35.79262]


def test_the_step_is_the_one_printed_for_250_mm():
    matrix, push = golden_car_step(0.25)
    np.testing.assert_allclose(matrix, PRINTED, rtol=2e-5)
    np.testing.assert_allclose(push, PRINTED_PUSH, rtol=2e-5)


@pytest.fixture
def road(rng):
    """A rough line over 150 m, a point every 250 mm."""
    n = np.fft.rfftfreq(601, 0.25)
    phase = np.exp(2j * np.pi * rng.random(n.size))
    return np.fft.irfft(np.where(n > 0.01, 1.0 / np.maximum(n, 0.01), 0.0) * phase, 601) * 0.05


def by_the_standard(profile, spacing, coefficients=None):
    """The program of the standard, sample by sample; its coefficients by the Taylor series given there."""
    c, k, t, m = 6.0, 63.3, 653.0, 0.15
    a = np.array([[0, 1, 0, 0], [-k, -c, k, c], [0, 0, 0, 1], [k / m, c / m, -(k + t) / m, -c / m]])
    step, matrix, term = spacing / (80 / 3.6), np.eye(4), np.eye(4)
    for i in range(1, 60):
        term = term @ a * step / i
        matrix = matrix + term
    push = np.linalg.solve(a, (matrix - np.eye(4)) @ [0.0, 0.0, 0.0, t / m])
    matrix, push = (matrix, push) if coefficients is None else (np.array(part) for part in coefficients)
    base, ahead = max(1, int(np.floor(0.25 / spacing + 0.5))), int(np.floor(11.0 / spacing + 0.5))
    slope = (profile[ahead] - profile[0]) / (ahead * spacing)
    state, rates = np.array([slope, 0.0, slope, 0.0]), []
    for i in range(profile.size - base):
        state = matrix @ state + push * (profile[i + base] - profile[i]) / (base * spacing)
        rates.append(abs(state[0] - state[2]))
    return np.array(rates)


@pytest.mark.parametrize("spacing", [0.05, 0.1, 0.16, 0.17, 0.25, 0.3])
def test_equals_the_program_of_the_standard_at_any_spacing(road, spacing):
    x = np.arange(0.0, 150.0 + 1e-9, spacing)
    line = np.interp(x, 0.25 * np.arange(601), road)
    expected = by_the_standard(line, spacing).mean()
    assert float(international_roughness_index(line, spacing)) == pytest.approx(expected, rel=1e-10)


def test_equals_the_printed_program(road):
    expected = by_the_standard(road, 0.25, (PRINTED, PRINTED_PUSH)).mean()
    assert float(international_roughness_index(road, 0.25)) == pytest.approx(expected, rel=1e-6)


def test_a_measured_course_has_the_index_of_the_standard(data):
    pytest.importorskip("pyopencrg")
    for name in ("detrended_rms_course_1in", "detrended_rms_course_3in"):
        course = np.asarray(read_crg(data / "roads" / f"{name}.crg", speed=1.0, lateral=[3.0]).samples)[:, 0]
        expected = by_the_standard(course, 0.05)
        assert float(international_roughness_index(course, 0.05)) == pytest.approx(expected.mean(), rel=1e-9)
        found = international_roughness_by_segment(course, 0.05)
        parts = [expected[first : first + 2000].mean() for first in range(0, expected.size, 2000)]
        np.testing.assert_allclose(found.segments, parts, rtol=1e-9)


def test_segments_are_of_one_run_and_their_mean_is_the_whole(road):
    found = international_roughness_by_segment(road, 0.25, segment=40.0)
    rates = by_the_standard(road, 0.25)
    np.testing.assert_allclose(found.segments, [part.mean() for part in np.split(rates, [160, 320, 480])], rtol=1e-9)
    np.testing.assert_allclose(found.starts, [0.0, 40.0, 80.0, 120.0])
    np.testing.assert_allclose(found.lengths, [40.0, 40.0, 40.0, 30.0])
    assert float(found.whole) == pytest.approx(np.average(found.segments, weights=found.lengths), rel=1e-12)
    assert float(found.whole) == pytest.approx(float(international_roughness_index(road, 0.25)), rel=1e-12)
    rows = found.table().records()
    assert found.is_partial and [row["note"] for row in rows] == ["", "", "", "the last 30 m only", "whole profile"]
    assert rows[1]["IRI"] == pytest.approx(1e3 * rates[160:320].mean())
    assert "the last 30 m only" in str(found)
    even = international_roughness_by_segment(road, 0.25, segment=50.0)
    assert not even.is_partial and even.segments.shape == (3,)
    odd = international_roughness_by_segment(road, 0.25, segment=33.4)  # between samples
    np.testing.assert_allclose(odd.lengths, [33.5, 33.5, 33.25, 33.5, 16.25])


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        (-5.0, r"`segment` must be positive"),
        (0.1, r"`segment` must be at least one sample \(0.25 m\) long, but is 0.1"),
    ],
)
def test_segments_that_hold_nothing_are_refused(road, segment, message):
    with pytest.raises(ValueError, match=message):
        international_roughness_by_segment(road, 0.25, segment=segment)


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
