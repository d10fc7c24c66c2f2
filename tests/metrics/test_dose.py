import jax
import numpy as np
import pytest

from jaxdamp.metrics import (
    aggregate_force,
    estimated_vibration_dose_value,
    evaluation_method,
    motion_sickness_dose,
    motion_sickness_percentage,
    shock_ratios,
    temperature_rise,
    vibration_dose_value,
    weighted_rms,
    weighted_signal,
    weighting_factor,
)


TIME = np.arange(20000) * 0.002
SINE = np.sin(2 * np.pi * 5.0 * TIME)


def test_dose_of_a_sine():
    # (A^4 3/8 T)^(1/4) over whole cycles
    assert float(vibration_dose_value(1.3 * SINE, 0.002, None)) == pytest.approx(1.3 * (15.0) ** 0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("metric", "values"),
    [
        (lambda x: weighting_factor(x, "Wk"), [0.5, 1]),
        (lambda x: temperature_rise(90.0, x, 1200.0, 1.5), [60.0, 800.0]),
        (lambda x: estimated_vibration_dose_value(x, 100.0), [0.5, 0.6]),
        (lambda x: aggregate_force(x, [0.0, 0.0], 0.1), [[1, 2], [3, 4]]),
        (lambda x: weighting_factor(x, "Wk"), []),
    ],
)
def test_lists_are_taken_as_arrays(metric, values, unchecked):
    np.testing.assert_array_equal(metric(values), metric(np.array(values, float)))


def test_dose_of_a_gaussian_record(rng):
    # (3 sigma^4 T)^(1/4); the fourth power has a standard deviation of sqrt(96) sigma^4
    signal = 0.5 * rng.standard_normal(200_000)
    dose = float(vibration_dose_value(signal, 0.001, None))
    assert dose**4 == pytest.approx(3 * 0.5**4 * 200.0, rel=4 * np.sqrt(96 / 200_000) / 3)


def test_doses_add_as_fourth_powers():
    first, second = 0.8 * SINE[:8000], 1.1 * SINE[8000:]
    parts = [float(vibration_dose_value(part, 0.002, None)) for part in (first, second)]
    both = float(vibration_dose_value(np.concatenate([first, second]), 0.002, None))
    assert both == pytest.approx(sum(part**4 for part in parts) ** 0.25, rel=1e-12)


def test_weighting_is_applied():
    weighted = weighted_signal(SINE, 0.002, "Wk")
    for metric in (vibration_dose_value, motion_sickness_dose):
        assert float(metric(SINE, 0.002, "Wk")) == float(metric(weighted, 0.002, None))
    assert float(vibration_dose_value(SINE, 0.002, "Wd")) < 0.5 * float(vibration_dose_value(SINE, 0.002, "Wk"))


def test_estimate():
    assert float(estimated_vibration_dose_value(0.8, 16.0)) == pytest.approx(1.4 * 0.8 * 2.0, rel=1e-15)
    # for a Gaussian record the estimate is 1.4/3^(1/4) = 6 % high
    assert 1.4 / 3**0.25 == pytest.approx(1.0638, abs=1e-4)
    with pytest.raises(ValueError, match=r"`weighted_rms` must be finite and not negative, but is -1.0"):
        estimated_vibration_dose_value(-1.0, 60.0)
    with pytest.raises(ValueError, match=r"`duration` must be positive and finite, but is 0.0"):
        estimated_vibration_dose_value(1.0, 0.0)


def test_motion_sickness():
    # an hour at 0.16 Hz, sampled at 10 Hz: 0.4/sqrt(2) * 1.006 * 60
    swell = 0.4 * np.sin(2 * np.pi * 0.16 * np.arange(36000) * 0.1)
    expected = 0.4 / np.sqrt(2) * float(weighting_factor(0.16, "Wf")) * 60.0
    dose = float(motion_sickness_dose(swell, 0.1))
    assert dose == pytest.approx(expected, rel=2e-3)
    assert float(motion_sickness_percentage(dose)) == pytest.approx(dose / 3, rel=1e-14)
    assert float(motion_sickness_percentage(dose, 0.25)) == pytest.approx(dose / 4, rel=1e-14)
    assert float(motion_sickness_percentage(1000.0)) == 100.0
    with pytest.raises(ValueError, match=r"`dose` must be finite and not negative, but is -1"):
        motion_sickness_percentage(-1.0)


# ---- which evaluation


def test_ratios_of_a_sine_and_of_noise(rng):
    np.testing.assert_allclose(shock_ratios(SINE, 0.002, None), [np.sqrt(2), 1.0, 1.5**0.25], rtol=1e-12)
    ratios = shock_ratios(rng.standard_normal(100_000), 0.001, None)
    assert 3.5 < float(ratios.crest_factor) < 5.5
    assert 1.0 < float(ratios.transient_ratio) < 1.1  # the RMS of 1000 samples scatters by 2 %
    assert float(ratios.dose_ratio) == pytest.approx(3**0.25, rel=0.01)


def test_smooth_vibration_needs_the_weighted_rms_only():
    answer = evaluation_method(SINE, 0.002, "Wk")
    assert answer.method == "weighted RMS"
    assert answer.transient_ratio == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("burst", "reasons"),
    [
        # b seconds of a sine in T = 40 s: crest factor sqrt(2 T/b), MTVV/a_w = sqrt(T/b) (b at least the window of
        # 1 s), dose ratio (3/2 T/b)^(1/4)
        (10.0, ["MTVV"]),
        (5.0, ["MTVV", "VDV"]),
        (0.5, ["crest factor", "MTVV", "VDV"]),
    ],
)
def test_reasons(burst, reasons):
    record = np.where(TIME < burst, SINE, 0.0)
    answer = evaluation_method(record, 0.002, None)
    assert answer.crest_factor == pytest.approx(np.sqrt(2 * 40 / burst), rel=1e-6)
    assert answer.dose_ratio == pytest.approx((1.5 * 40 / burst) ** 0.25, rel=1e-6)
    assert answer.transient_ratio == pytest.approx(np.sqrt(40 / max(burst, 1.0)), rel=1e-6)
    named = [name for name in ("crest factor", "MTVV", "VDV") if name in answer.method.partition(":")[2]]
    assert named == reasons
    assert answer.method.startswith("weighted RMS and MTVV or VDV: ")


@pytest.mark.parametrize("record", [np.zeros(1000), np.full(1000, np.nan)])
def test_no_words_about_nothing(record):
    with pytest.raises(ValueError, match=r"`acceleration` must be finite and not zero throughout"):
        evaluation_method(record, 0.01, None)


def test_words_do_not_compile():
    with pytest.raises(ValueError, match=r"`acceleration` must be known: texts cannot be compiled.*`shock_ratios`"):
        jax.jit(lambda x: evaluation_method(x, 0.01, None).dose_ratio)(SINE)


def test_a_record_shorter_than_the_window_is_refused():
    with pytest.raises(ValueError, match=r"`time_constant` must lie between.*\(0.5 s\), but is 1"):
        shock_ratios(np.ones(50), 0.01, "Wk")


def test_rms_and_dose_are_of_one_signal():
    # a steady sine: VDV = (3/2)^(1/4) a_w T^(1/4)
    dose, size = float(vibration_dose_value(SINE, 0.002, "Wk")), float(weighted_rms(SINE, 0.002, "Wk"))
    assert dose / size / 40.0**0.25 == pytest.approx(1.5**0.25, rel=2e-3)
