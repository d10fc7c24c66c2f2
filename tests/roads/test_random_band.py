from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jaxdamp.roads import band_limited


DT, DURATION = 0.005, 20.0
TIME = DT * np.arange(4000)


def road(**arguments):
    settings = {"low": 0.5, "high": 40.0, "duration": DURATION, "dt": DT, "seed": 1, "ramp": 0.0, "rms": 0.002}
    return band_limited(**{**settings, **arguments})


def test_rms_is_exact():
    height = road(rms=0.0034).height(TIME)
    assert float(jnp.sqrt(jnp.mean(height**2))) == pytest.approx(0.0034, rel=1e-13)
    assert float(jnp.mean(height)) == pytest.approx(0.0, abs=1e-16)


def test_peak_to_peak_is_exact():
    height = road(rms=None, peak_to_peak=0.01).height(TIME)
    assert float(jnp.ptp(height)) == pytest.approx(0.01, rel=1e-13)


def test_spectrum_is_flat_in_the_band_and_zero_outside():
    power = np.abs(np.fft.rfft(road().height(TIME)[:, 0])) ** 2
    density = 2.0 * power * DT / TIME.size
    frequency = np.fft.rfftfreq(TIME.size, DT)
    inside = (frequency >= 0.5 - 1e-9) & (frequency <= 40.0 + 1e-9)
    assert inside.sum() == 791
    np.testing.assert_allclose(density[inside], 0.002**2 / (791 / DURATION), rtol=1e-10)
    assert density[~inside].max() < 1e-25


def test_heights_are_nearly_gaussian():
    height = np.asarray(road().height(TIME)[:, 0])
    # 791 lines: the kurtosis over phases is 3 - 1.5/791; a period holds about 1580 independent samples
    assert abs(stats.kurtosis(height)) < 4 * np.sqrt(24 / 1580)
    assert abs(stats.skew(height)) < 4 * np.sqrt(6 / 1580)


def test_repeats_without_a_jump():
    r = road()
    np.testing.assert_allclose(r.height(TIME + 3 * DURATION), r.height(TIME), atol=1e-13)
    steps = np.abs(np.diff(np.asarray(r.height(TIME)[:, 0])))
    assert abs(float(r.height(TIME)[-1, 0] - r.height(TIME)[0, 0])) <= steps.max()
    assert r.grid == DT
    assert r.duration == pytest.approx(DURATION)


def test_ramp_starts_at_rest_on_level_ground_and_only_once():
    faded, plain = road(ramp=0.5), road()
    fade = 0.5 * (1 - np.cos(np.pi * np.clip(TIME / 0.5, 0, 1)))
    np.testing.assert_allclose(faded.height(TIME)[:, 0], fade * plain.height(TIME)[:, 0], atol=1e-16)
    np.testing.assert_allclose(faded.height(TIME + DURATION), plain.height(TIME + DURATION), rtol=1e-13)


def test_default_band_is_that_of_the_paper_and_fades_in():
    default = band_limited(rms=1.0, duration=DURATION, dt=DT, seed=1)
    explicit = band_limited(0.1, 50.0, rms=1.0, duration=DURATION, dt=DT, seed=1, ramp=0.5)
    np.testing.assert_array_equal(default.height(TIME), explicit.height(TIME))
    assert float(default.height(TIME)[0, 0]) == 0.0


def test_seeds_reproduce_and_differ():
    np.testing.assert_array_equal(road(seed=5).samples, road(seed=5).samples)
    np.testing.assert_array_equal(road(seed=5).samples, road(seed=jax.random.key(5)).samples)
    np.testing.assert_array_equal(road(seed=5).samples, road(seed=jax.random.PRNGKey(5)).samples)
    # phases are independent: the correlation of two realisations has a standard deviation of 1/sqrt(2 lines)
    correlation = np.corrcoef(road(seed=5).samples[:, 0], road(seed=6).samples[:, 0])[0, 1]
    assert abs(correlation) < 4 / np.sqrt(2 * 791)


def test_seeds_can_be_batched():
    keys = jax.random.split(jax.random.key(0), 3)
    batch = jax.jit(jax.vmap(lambda key: road(seed=key).samples))(keys)
    np.testing.assert_allclose(batch, jnp.stack([road(seed=key).samples for key in keys]), atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rms": None}, r"`rms` must be given, or `peak_to_peak`.*neither was given.*exactly one"),
        ({"peak_to_peak": 0.01}, r"`rms` must be.*not both, but is 0.002 m, and peak_to_peak 0.01 m.*exactly one"),
        ({"low": 40.0}, r"`low` must be below `high` \(40.0 Hz\), but is 40.0 Hz.*Exchange"),
        (
            {"high": 100.0},
            r"`high` must be below the Nyquist frequency 1/\(2 dt\) = 100 Hz, but is 100.0 Hz.*smaller `dt`",
        ),
        ({"duration": 20.0021}, r"`duration` must be a multiple of `dt` \(0.005 s\), but is 20.0021 s.*Use 20 s"),
        (
            {"duration": 1.0},
            r"`duration` must hold at least one period.*is 1.0 s for a band from 0.5 to 40.0 Hz.*longer",
        ),
        ({"low": 1.01, "high": 1.04}, r"`duration` must hold.*one multiple of 1/duration.*from 1.01 to 1.04 Hz.*wider"),
        ({"low": -0.1}, r"`low` must be finite and not negative, but is -0.1"),
        ({"high": np.inf}, r"`high` must be positive and finite, but is inf"),
        ({"dt": 0.0}, r"`dt` must be positive and finite, but is 0.0"),
        ({"duration": -1.0}, r"`duration` must be positive and finite, but is -1.0"),
        ({"rms": -0.002}, r"`rms` must be positive and finite, but is -0.002"),
        ({"rms": None, "peak_to_peak": 0.0}, r"`peak_to_peak` must be positive and finite, but is 0.0"),
        ({"ramp": -0.5}, r"`ramp` must be finite and not negative, but is -0.5.*Use 0"),
    ],
)
def test_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        road(**arguments)


@pytest.mark.parametrize("held", [{"rms": 0.002}, {"rms": None, "peak_to_peak": 0.01}])
def test_drawn_again_it_keeps_its_spectrum_and_size(held):
    original: Any = road(**held)
    again, other = (original.reseeded(seed) for seed in (5, 6))
    elsewhere: Any = road(seed=2, **held).reseeded(5)
    size = jnp.std if held["rms"] else jnp.ptp
    power = np.abs(np.fft.rfft([each.samples[:, 0] for each in (original, again, other)])) ** 2
    for one, of in zip((again, other), power[1:], strict=True):
        assert float(size(one.samples)) == pytest.approx(float(size(original.samples)), rel=1e-12)
        np.testing.assert_allclose(of / of.sum(), power[0] / power[0].sum(), rtol=1e-9, atol=1e-15)
    samples = [each.samples[:, 0] for each in (original, again, other, elsewhere)]
    np.testing.assert_allclose(np.corrcoef(samples), np.eye(4), atol=4 / np.sqrt(1580))
    np.testing.assert_array_equal(original.reseeded(5).samples, again.samples)
