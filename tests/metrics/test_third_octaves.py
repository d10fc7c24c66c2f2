"""Third octaves: bands of white noise by hand, and the weighted RMS of the whole."""

import numpy as np
import pytest

from jaxdamp.metrics import power_spectral_density, third_octave_rms, weighted_rms


def test_bands_of_white_noise_have_the_power_of_their_width():
    frequency = np.linspace(0.0, 100.0, 20_001)
    centre, rms = third_octave_rms(frequency, np.full(20_001, 0.3))
    width = centre * (10.0**0.05 - 10.0**-0.05)
    np.testing.assert_allclose(rms, np.sqrt(0.3 * width), rtol=1e-9)
    nominal = [0.5, 0.63, 0.8, 1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8, 10, 12.5, 16, 20, 25, 31.5, 40, 50, 63, 80]
    np.testing.assert_allclose(centre, nominal, rtol=0.013)


def test_weighted_bands_add_up_to_the_weighted_rms():
    time = np.arange(8000) * 0.005
    parts = ((1.0, 0.2), (6.5, 1.0), (16.0, 0.7), (63.0, 0.4))
    signal = np.sum([np.sin(2.0 * np.pi * f * time + f) * a for f, a in parts], axis=0)
    _, rms = third_octave_rms(*power_spectral_density(signal, 0.005, 8000, window="rectangular"), "Wk")
    # the filter starts at rest: the record is long
    assert np.sqrt(np.nansum(np.asarray(rms) ** 2)) == pytest.approx(float(weighted_rms(signal, 0.005, "Wk")), rel=0.01)


def test_bands_that_the_spectrum_does_not_reach_are_nan_and_odd_spectra_are_refused():
    centre, rms = third_octave_rms(np.linspace(1.0, 30.0, 300), np.ones(300))
    np.testing.assert_array_equal(np.isfinite(rms), (centre > 1.2) & (centre < 26.0))
    with pytest.raises(ValueError, match="`frequency` must increase"):
        third_octave_rms(np.array([1.0, 3.0, 2.0]), np.ones(3))
    with pytest.raises(ValueError, match="two lines or more"):
        third_octave_rms(np.ones(3), np.ones(4))
    with pytest.raises(ValueError, match="Did you mean 'Wk'"):
        third_octave_rms(np.array([1.0, 3.0]), np.ones(2), "wk")
