import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma

from jaxdamp.metrics import power_spectral_density, rainflow_cycles, spectral_damage, spectral_moments


FREQUENCY = np.linspace(0.0, 250.0, 2501)
SPECTRA = {
    "flat": np.where(FREQUENCY <= 200.0, 1.0, 0.0),
    "two peaks": np.exp(-(((FREQUENCY - 20) / 6) ** 2)) + 0.1 * np.exp(-(((FREQUENCY - 150) / 15) ** 2)),
    "narrow": np.exp(-(((FREQUENCY - 100) / 8) ** 2)),
}


def gaussian_record(density: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """100 s at 4 kHz: sines of fixed amplitude and random phase, so the variance is exact."""
    size, dt = 400_000, 0.00025
    lines = np.interp(np.fft.rfftfreq(size, dt), FREQUENCY, density, right=0.0)
    phase = np.exp(2j * np.pi * rng.random(lines.size))
    return np.fft.irfft(np.sqrt(lines * size / dt / 2) * phase, size)


def test_rainflow_counts_the_example_of_the_standard():
    # ASTM E1049-85, table of figure 6: ranges 3, 4, 4 (one whole), 6, 8, 8, 9 with their means
    cycles = rainflow_cycles([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0])
    table = {(3, -0.5): 0.5, (4, -1.0): 0.5, (4, 1.0): 1.0, (6, 1.0): 0.5, (8, 0.0): 0.5, (8, 1.0): 0.5, (9, 0.5): 0.5}
    assert dict(zip(zip(2 * cycles.amplitude, cycles.mean, strict=True), cycles.count, strict=True)) == table
    assert cycles.damage(3) == sum(count * (span / 2) ** 3 for (span, _), count in table.items())


def test_a_sine_with_an_offset_is_cycles_of_its_amplitude(unchecked):
    found = rainflow_cycles(100.0 + 7.0 * np.cos(np.pi * np.arange(0, 41) / 4))  # five periods
    np.testing.assert_allclose(found.amplitude, 7.0)
    np.testing.assert_allclose(found.mean, 100.0)
    assert np.sum(found.count) == 5.0
    assert rainflow_cycles([3.0, 3.0]).damage(4) == 0.0
    two = rainflow_cycles([1.0, 2.0])
    assert (two.amplitude.tolist(), two.mean.tolist(), two.count.tolist()) == ([0.5], [1.5], [0.5])
    for wrong, message in (([1.0], "hold two or more samples"), ([1.0, np.nan, 2.0], "must be finite.*Cut the gaps")):
        with pytest.raises(ValueError, match=message):
            rainflow_cycles(wrong)


def test_without_the_package_the_line_to_install_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "rainflow", None)
    with pytest.raises(ImportError, match=r"pip install 'jaxdamp\[fatigue\]'"):
        rainflow_cycles([1.0, 2.0, 0.0])


@pytest.mark.parametrize("name", SPECTRA)
def test_dirlik_meets_rainflow_counting(name, rng):
    record = gaussian_record(SPECTRA[name], rng)
    cycles = rainflow_cycles(record)
    for exponent in (3, 4):
        counted = cycles.damage(exponent) / 100.0
        # the formula is good to 10 % or so; the record, some 10^3 independent envelopes, scatters by 5 %
        assert float(spectral_damage(FREQUENCY, SPECTRA[name], exponent)) == pytest.approx(counted, rel=0.12)
        narrow = float(spectral_damage(FREQUENCY, SPECTRA[name], exponent, method="narrow-band"))
        if name == "narrow":
            assert narrow == pytest.approx(counted, rel=0.1)
        else:
            assert narrow > 1.1 * counted


def test_narrow_band_is_the_moment_of_rayleigh():
    sigma, rate, k = 3.0, 7.0, 5.0
    frequency = np.linspace(0.0, 10.0, 1001)
    density = np.where(np.abs(frequency - rate) < 1e-9, sigma**2 / 0.01, 0.0)
    moment = quad(lambda s: s**k * s / sigma**2 * np.exp(-(s**2) / (2 * sigma**2)), 0.0, 60.0)[0]
    for method in ("narrow-band", "dirlik"):  # a line: Dirlik's coefficients are 0/0 there
        assert float(spectral_damage(frequency, density, k, method=method)) == pytest.approx(rate * moment, rel=1e-8)


def test_dirlik_of_a_flat_spectrum_by_hand():
    # m_n = F^(n+1)/(n+1): gamma = sqrt(5)/3, x_m = sqrt(5/3)/2
    big, x_m, irregularity, k = 200.0, np.sqrt(5 / 3) / 2, np.sqrt(5) / 3, 4
    d1 = 2 * (x_m - irregularity**2) / (1 + irregularity**2)
    r = (irregularity - x_m - d1**2) / (1 - irregularity - d1 + d1**2)
    d2 = (1 - irregularity - d1 + d1**2) / (1 - r)
    q = 1.25 * (irregularity - (1 - d1 - d2) - d2 * r) / d1
    shape = d1 * q**k * gamma(1 + k) + 2 ** (k / 2) * gamma(1 + k / 2) * (d2 * abs(r) ** k + 1 - d1 - d2)
    expected = np.sqrt(3 / 5) * big * big ** (k / 2) * shape
    frequency = np.linspace(0.0, big, 20001)
    assert float(spectral_damage(frequency, np.ones(20001), k)) == pytest.approx(expected, rel=1e-6)


def test_moments_equal_the_record(rng):
    record = gaussian_record(SPECTRA["two peaks"], rng)
    m0, m2 = spectral_moments(FREQUENCY, SPECTRA["two peaks"], (0, 2))
    assert float(m0) == pytest.approx(np.var(record), rel=1e-3)
    crossings = np.sum((record[:-1] < 0) & (record[1:] >= 0)) / 100.0
    assert float(jnp.sqrt(m2 / m0)) == pytest.approx(crossings, rel=0.02)
    frequency, density = power_spectral_density(record, 0.00025, 8000)
    estimate = spectral_moments(frequency[:1000], density[:1000], (0, 2))
    np.testing.assert_allclose(estimate, [m0, m2], rtol=0.02)


def test_scaling_and_gradients():
    g = jnp.asarray(SPECTRA["two peaks"])
    for method in ("dirlik", "narrow-band"):
        damage = lambda a, k, m=method: spectral_damage(FREQUENCY, a * g, k, method=m)  # noqa: E731
        value, (by_scale, by_exponent) = jax.jit(jax.value_and_grad(damage, argnums=(0, 1)))(2.0, 5.0)
        assert float(by_scale) == pytest.approx(2.5 * float(value) / 2.0, rel=1e-10)  # a^(k/2)
        difference = (damage(2.0, 5.0 + 1e-5) - damage(2.0, 5.0 - 1e-5)) / 2e-5
        assert float(by_exponent) == pytest.approx(float(difference), rel=1e-6)


def test_nothing_does_no_damage_to_be_spoken_of():
    assert np.isnan(spectral_damage(FREQUENCY, np.zeros(2501), 4))


def test_errors(unchecked):
    g = SPECTRA["flat"]
    with pytest.raises(ValueError, match=r"`exponent` must be positive and finite, but is 0"):
        spectral_damage(FREQUENCY, g, 0)
    with pytest.raises(ValueError, match=r"`method` must be one of 'dirlik', 'narrow-band', but is 'Dirlik'. Did you"):
        spectral_damage(FREQUENCY, g, 3, method="Dirlik")
    with pytest.raises(ValueError, match=r"`density` must be as long as `frequency`"):
        spectral_moments(FREQUENCY, g[:-1])
    with pytest.raises(ValueError, match=r"`frequency` must increase, but is 250 to 0 Hz in another order. Sort"):
        spectral_moments(FREQUENCY[::-1], g)
    with pytest.raises(ValueError, match=r"`orders` must not be negative, but is \(0, -1\)"):
        spectral_moments(FREQUENCY, g, (0, -1))
