import json

import numpy as np
import pytest

from jaxdamp.roads import assess_roughness, iso8608


SPEED = 20.0


def profile(road_class="C", length=1000.0, spacing=0.1, seed=0, **options):
    road = iso8608(road_class, SPEED, seed=seed, length=max(2 * length, 500.0), ramp=0.0, **options)
    return np.asarray(road.height(np.arange(round(length / spacing)) * spacing / SPEED)[:, 0])


@pytest.mark.parametrize(("letter", "psd"), [("A", 16e-6), ("C", 256e-6), ("F", 16384e-6)])
def test_finds_the_class_it_was_made_with(letter, psd):
    found = assess_roughness(profile(letter, seed=1), 0.1)
    assert found.road_class == letter
    # one kilometre: standard deviations 0.10 of ln G_d(n0) and 0.06 of the waviness
    assert abs(np.log(found.roughness_psd / psd)) < 4 * 0.10
    assert abs(found.waviness - 2.0) < 4 * 0.06
    assert found.verdict.startswith(f"Class {letter}: G_d(n0) = ")


def test_is_right_on_average_and_scatters_as_stated():
    found = [assess_roughness(profile(seed=seed, spacing=0.15), 0.15) for seed in range(20)]
    level = np.log([f.roughness_psd / 256e-6 for f in found])
    waviness = np.array([f.waviness for f in found])
    assert abs(level.mean()) < 4 * 0.10 / np.sqrt(20)
    assert abs(waviness.mean() - 2.0) < 4 * 0.06 / np.sqrt(20)
    assert 0.06 < level.std() < 0.15 and 0.035 < waviness.std() < 0.09  # 0.10 and 0.06, of 20 within a factor 1.5


@pytest.mark.parametrize("waviness", [1.5, 2.6])
def test_other_waviness_is_found_and_told(waviness):
    found = assess_roughness(profile(waviness=waviness, seed=2), 0.1, bands_per_octave=3)
    assert found.spatial_frequency.size == 24
    assert abs(found.waviness - waviness) < 0.2
    stronger = "long waves are stronger" if waviness > 2 else "short waves are stronger"
    assert f"differs from the value of the standard, 2: {stronger}" in found.verdict


def test_the_roughness_does_not_depend_on_the_width_of_the_bands():
    z = profile(waviness=4.0, length=5000.0, seed=1)
    wide, narrow = (assess_roughness(z, 0.1, bands_per_octave=count) for count in (1, 6))
    assert wide.roughness_psd == pytest.approx(narrow.roughness_psd, rel=0.04)  # the mean over an octave is 17 % higher


def test_a_single_wave_has_its_variance_and_is_no_straight_line():
    place = 0.1 * np.arange(10_000)
    found = assess_roughness(0.03 * np.sin(2 * np.pi * place / 4.0) + 1e-4 * profile(seed=3), 0.1)
    width = found.spatial_frequency * (np.sqrt(2) - 1 / np.sqrt(2))
    assert np.sum(found.displacement_psd * width) == pytest.approx(
        0.03**2 / 2, rel=0.02
    )  # the bands' lines, one by one
    assert found.rms == pytest.approx(0.03 / np.sqrt(2), rel=1e-3)
    assert "deviates from a straight line" in found.verdict and "roughest has a wavelength of 4 m" in found.verdict


def test_slope_and_offset_do_not_count():
    z, place = profile(seed=4), 0.1 * np.arange(10_000)
    plain, tilted = assess_roughness(z, 0.1), assess_roughness(z + 100.0 + 0.05 * place, 0.1)
    np.testing.assert_allclose(tilted.displacement_psd, plain.displacement_psd, rtol=1e-6)
    assert tilted.rms == pytest.approx(plain.rms, rel=1e-9)


def test_what_the_record_cannot_show_is_told():
    short = assess_roughness(profile(length=60.0, seed=5), 0.1)
    assert "the record is too short" in short.verdict and short.spatial_frequency[0] > 3 / 60
    coarse = assess_roughness(profile(spacing=0.7, seed=5), 0.7)
    assert "samples are too far apart" in coarse.verdict and coarse.spatial_frequency[-1] < 0.5 / 0.7
    tiny = assess_roughness(profile(length=10.0, spacing=0.05, seed=5), 0.05)
    assert "extrapolated" in tiny.verdict


def test_table_is_readable():
    lines = str(assess_roughness(profile(seed=6), 0.1)).splitlines()
    assert lines[1].split() == ["n", "[cycle/m]", "wavelength", "[m]", "G_d", "[m^3]", "lines", "class"]
    assert len(lines) == 2 + 8 + 1
    assert len({len(line) for line in lines[2:10]}) == 1
    assert lines[2].split()[-1] in "BCD"
    found = assess_roughness(profile(seed=6), 0.1)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["road_class"] == found.road_class and plain["bands"]["rows"][0][2] == found.displacement_psd[0]


ROUGH = np.sin(np.arange(1000.0))


@pytest.mark.parametrize(
    ("height", "spacing", "options", "message"),
    [
        (ROUGH[:, None], 0.1, {}, r"`height` must hold one track, but is of shape \(1000, 1\).*height\[:, 0\]"),
        (np.full(1000, 3.0), 0.1, {}, r"`height` must hold a rough road, but is level"),
        (np.arange(1000.0), 0.1, {}, r"`height` must hold a rough road, but is level or a straight slope"),
        (np.append(ROUGH, np.nan), 0.1, {}, r"`height` must be finite"),
        (ROUGH[:20], 0.1, {}, r"`height` must be long and fine enough.*is 20 samples 0.1 m apart.*longer"),
        (ROUGH[:0], 0.1, {}, r"`height` must"),
        (ROUGH, 0.0, {}, r"`spacing` must be positive"),
        (ROUGH, 0.1, {"bands_per_octave": 0}, r"`bands_per_octave` must be positive"),
    ],
)
def test_errors(height, spacing, options, message, unchecked):
    with pytest.raises(ValueError, match=message):
        assess_roughness(height, spacing, **options)
