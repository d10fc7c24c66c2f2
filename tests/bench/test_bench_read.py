import re

import numpy as np
import pytest

from jaxdamp.bench import read


def test_record_in_si_from_other_units(write):
    si = read(write())[0]
    inch = read(
        write(
            "inch.csv",
            "Time, ms;Displacement, in;Load, lbs",
            ";",
            ",",
            scale=(1e3, 1 / 0.0254, 1 / 4.4482216152605),
            preamble=["Bench 3; shift 2"],
        )
    )[0]
    for channel in ("time", "stroke", "velocity", "force"):
        np.testing.assert_allclose(getattr(inch, channel), getattr(si, channel), rtol=1e-6, atol=1e-6)
    assert si.name == "run"
    assert si.source.endswith("run.csv")
    assert si.amplitude == pytest.approx(0.02, rel=1e-3)
    assert si.notes[0] == "time from 't_s' in s, stroke from 'x_mm' in mm, force from 'F_N' in N; brought to SI"
    assert si.notes[1] == "force and stroke of the file agree in sign (work per cycle +35.52 J)"
    assert 'pass sign="compression-positive"' in si.notes[2]
    assert "harmonic regression, 1.5 Hz" in si.notes[3]


def test_unused_columns_and_temperature(write):
    run = read(write(header="t_s,x_mm,F_N,cycle,T_degC", extra=[np.ones(600), np.full(600, 40.0)]))[0]
    assert run.temperature is not None
    np.testing.assert_allclose(run.temperature, 313.15)
    assert "not used: cycle" in run.notes[0]


def test_a_temperature_that_no_damper_has_is_left_out_or_refused(write):
    """Of a thermocouple that fell off, and of degrees Celsius that are said to be kelvin."""
    broken = np.where(np.arange(600) < 590, 40.0, -9999.0)
    off = write("off.csv", header="t_s,x_mm,F_N,T_degC", extra=[broken])
    why = "'T_degC': the temperature is -9725.85 K, -9999 °C (10 values below 150 K"
    run = read(off)[0]
    assert run.temperature is None and any(n.startswith("temperature left out: ") and why in n for n in run.notes)
    with pytest.raises(ValueError, match=re.escape(why)):
        read(off, columns={"temperature": "T_degC"})
    warm = write("warm.csv", header="t_s,x_mm,F_N,T [K]", extra=[np.full(600, 40.0)])
    assert any('Name it with units={"temperature": "degC"}' in note for note in read(warm)[0].notes)
    named = read(warm, units={"temperature": "degC"})[0]
    assert named.temperature is not None and np.allclose(named.temperature, 313.15)


def test_compression_positive_files_are_turned(write):
    plain, turned = read(write())[0], read(write("b.csv"), sign="compression-positive")[0]
    for channel in ("stroke", "velocity", "force"):
        np.testing.assert_array_equal(getattr(turned, channel), -getattr(plain, channel))
    assert turned.work_per_cycle == plain.work_per_cycle > 0
    assert "as given: stroke, velocity and force turned" in turned.notes[2]


def test_force_of_the_other_sign_is_found_and_turned(write):
    plain, turned = read(write())[0], read(write("b.csv", scale=(1, 1e3, -1)))[0]
    np.testing.assert_array_equal(turned.force, plain.force)
    np.testing.assert_array_equal(turned.stroke, plain.stroke)
    with pytest.raises(ValueError, match="contradicts the data"):
        read(write("c.csv", scale=(1, 1e3, -1)), sign="rebound-positive")
    again = read(write("c.csv", scale=(1, 1e3, -1)), sign="rebound-positive", force_sign="opposite")[0]
    np.testing.assert_array_equal(again.force, plain.force)


def test_sign_that_cannot_be_established(write):
    path = write(scale=(1, 1e3, 0), header="t_s,x_mm,F_N", extra=[200 * np.sin(2 * np.pi * 1.5 * np.arange(600) / 300)])
    with pytest.raises(ValueError, match=r"run\.csv: the sign convention cannot be established"):
        read(path)
    assert read(path, sign="rebound-positive")[0].work_per_cycle == pytest.approx(0.0, abs=0.01)


def test_sampling_rate_instead_of_time(write):
    path = write(header="x_mm,F_N", scale=(0, 1e3, 1))
    with pytest.raises(ValueError, match=r"no time column.*sampling_rate=1000"):
        read(path)
    run = read(path, sampling_rate=300.0)[0]
    np.testing.assert_allclose(run.time, np.arange(600) / 300)
    assert "300 Hz" in run.notes[1]
    with pytest.raises(ValueError, match="sampling_rate=500 contradicts the time column, which has 300"):
        read(write("b.csv"), sampling_rate=500.0)
    assert read(write("b.csv"), sampling_rate=500.0, columns={"time": None})[0].frequency == pytest.approx(
        2.5, rel=1e-3
    )


V = 0.02 * 3 * np.pi * np.cos(3 * np.pi * np.arange(600) / 300)


def test_velocity_column_is_used_if_it_is_the_derivative(write):
    run = read(write(header="t_s,x_mm,F_N,v_mm_s", extra=[1010 * V]))[0]
    np.testing.assert_allclose(run.velocity, 1.01 * V, rtol=1e-6, atol=1e-9)
    assert "velocity as measured; it is 1.01 times the stroke's derivative" in run.notes[-1]
    assert "differ" not in run.notes[-1]
    assert "they differ, look at both" in read(write(header="t_s,x_mm,F_N,v_mm_s", extra=[1100 * V]))[0].notes[-1]


@pytest.mark.parametrize(
    ("column", "message"),
    [
        (-1e3 * V, "opposite sign of the stroke's derivative"),
        (V, "0.001 times the stroke's derivative: one of the two has a wrong unit"),
        (np.roll(1e3 * V, 40), "not the derivative of the stroke"),
        (0 * V, "not the derivative of the stroke"),
    ],
)
def test_velocity_column_that_contradicts_the_stroke(write, column, message):
    path = write(header="t_s,x_mm,F_N,v_mm_s", extra=[column])
    with pytest.raises(ValueError, match=message):
        read(path)
    assert read(path, columns={"velocity": None})[0].peak_velocity == pytest.approx(np.max(np.abs(V)), rel=1e-4)


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"replace": {9: "0.03,nan,1.0"}}, r"run\.csv, line 11: the stroke \(column 'x_mm'\) is nan"),
        ({"replace": {9: "0.03,1.0,inf"}}, r"line 11: the force \(column 'F_N'\) is inf"),
        (
            {"drop": [*range(150, 160), *range(300, 310), *range(450, 460)]},
            r"run\.csv, line 152: 10 samples are missing between 0\.496667 and 0\.533333 s \(3 such gaps",
        ),
        ({"replace": {100: "0.2,1.0,1.0"}}, r"run\.csv, line 102: time goes from 0\.33 s to 0\.2 s, but must increase"),
        (
            {"scale": (1, 0, 1), "header": "t_s,F_N,x_mm", "extra": [np.ones(600)]},
            r"column 'x_mm': the stroke is constant",
        ),
        ({"count": 12}, r"only 12 samples, too few"),
        ({"header": "t_s,x,F_N"}, r"column 'x' \(stroke\) names no unit"),
        ({"header": "t_s,x [milimeter],F_N"}, r"'milimeter' is no known unit of stroke\..*units="),
    ],
)
def test_bad_files(write, faults, message):
    with pytest.raises(ValueError, match=message):
        read(write(**faults))


def test_a_clock_that_jitters_is_resampled(tmp_path, rng):
    time = np.arange(600) / 300 + rng.uniform(-0.2, 0.2, 600) / 300
    x, f = 20 * np.sin(3 * np.pi * time), 500 * np.cos(3 * np.pi * time)
    rows = [f"{a},{b},{c}" for a, b, c in zip(time, x, f, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t_s,x_mm,F_N", *rows]))
    run = read(tmp_path / "run.csv")[0]
    np.testing.assert_allclose(np.diff(run.time), np.ptp(time) / 599, rtol=1e-9)
    np.testing.assert_allclose(run.stroke, 0.020 * np.sin(3 * np.pi * run.time), atol=5e-6)
    np.testing.assert_allclose(run.force, 500 * np.cos(3 * np.pi * run.time), atol=0.1)
    assert any("clock jitters by up to 0." in note and "linear interpolation at" in note for note in run.notes)


def test_a_record_with_gaps_is_cut_into_parts(write):
    path = write(count=1200, drop=[*range(100, 110), *range(700, 705)])
    runs = read(path, command={"run": 2.0})
    assert runs.names == ("run_part1", "run_part2")
    assert [len(run) for run in runs] == [590, 495]
    assert all(run.command == 2.0 for run in runs)
    whole = read(write("whole.csv", count=1200))[0]
    np.testing.assert_array_equal(runs[0].force, whole.force[110:700])
    assert any("part 2 of 3 between gaps in time, 0.366667 to 2.33 s" in note for note in runs[0].notes)
    assert any("1 part without a full cycle left out, 100 samples" in note for note in runs[1].notes)


@pytest.mark.parametrize("rate", [24.0, 100.0, 700.0])
def test_a_record_whose_rate_changes_is_cut_there(tmp_path, rate):
    """It was resampled at a mean rate, as if its clock jittered by hundreds of steps, or refused for gaps."""

    def written(*times):
        time = np.concatenate(times)
        rows = [f"{t:.4f},{20 * np.sin(9 * t)},{500 * np.cos(9 * t)}" for t in time]
        (tmp_path / "run.csv").write_text("\n".join(["t_s,x_mm,F_N", *rows]))
        return tmp_path / "run.csv"

    first, other = np.arange(900) / 300, 3.0 + np.arange(int(4 * rate)) / rate
    runs = read(written(first, other))
    assert runs.names == ("run_part1", "run_part2") and [len(run) for run in runs] == [900, len(other)]
    assert [run.sampling_rate for run in runs] == pytest.approx([300.0, rate], rel=1e-4)
    for run in runs:
        np.testing.assert_allclose(run.force, 500 * np.cos(9 * run.time), atol=0.5)
    assert any("part 2 of 2 between changes of the sampling rate, 3 to " in note for note in runs[1].notes)
    with pytest.raises(ValueError, match=r"line 62: the sampling rate changes from 299.9 to 600.6 Hz \(1 such change"):
        read(written(first[:60], 0.2 + np.arange(30) / 600))


def test_bad_words_are_refused_before_a_file_is_opened():
    with pytest.raises(ValueError, match=r"`sign`.*Did you mean 'compression-positive'"):
        read("nowhere.csv", sign="compression positive")
    with pytest.raises(ValueError, match="`sampling_rate`"):
        read("nowhere.csv", sampling_rate=-1.0)


def test_files_of_the_same_name_are_told_apart(write, tmp_path):
    for folder in ("cold", "warm"):
        (tmp_path / folder).mkdir()
        write(f"{folder}/run.csv")
    assert read(str(tmp_path / "*" / "run.csv")).names == ("cold/run", "warm/run")
    for folder in ("cold", "warm"):
        (tmp_path / folder / "data").mkdir()
        write(f"{folder}/data/run.csv")
    assert read(str(tmp_path / "*" / "data" / "run.csv")).names == ("cold/data/run", "warm/data/run")


def test_measured_damper(data):
    """Magnetorheological damper at three currents: rates, frequencies and work, without a word about the sign."""
    runs = read(data / "mr_damper")
    assert len(runs) == 12
    for run in runs:
        size, frequency, _ = run.name.split("_")
        assert run.sampling_rate == pytest.approx(1000.0 if run.name.startswith("5mm_3.0Hz") else 200.0)
        assert run.frequency == pytest.approx(float(frequency[:-2]), rel=0.03)
        assert 0.8 < run.amplitude / (1e-3 * float(size[:-2])) < 1.0
        assert run.peak_velocity == pytest.approx(2 * np.pi * run.frequency * run.amplitude, rel=0.03)
        assert run.work_per_cycle > 0
        assert "agree in sign (work per cycle +" in run.notes[1]
        assert "Savitzky-Golay" in run.notes[-1]  # rest before and after
    by_current = [runs[f"5mm_3.0Hz_{current}A"].work_per_cycle for current in ("0", "0.5", "1.0")]
    assert by_current == sorted(by_current)


def test_steady_part_of_a_measured_record_is_harmonic(data):
    run = read(data / "mr_damper" / "5mm_3.0Hz_1.0A.csv")[0]
    middle = run.between(3.4, 5.7)
    again = type(run).from_arrays("middle", middle.time, middle.stroke, middle.force)
    assert "harmonic regression" in again.notes[-1]
    assert np.std(again.velocity - middle.velocity) < 0.02 * np.std(again.velocity)
