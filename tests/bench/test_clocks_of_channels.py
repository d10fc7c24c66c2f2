"""Channels with clocks of their own: each at its instants, joined where they are one record, none lost in silence."""

import datetime

import numpy as np
import pytest

from jaxdamp.bench import RawColumn, RawTable, read


T = np.arange(600) / 300
START = datetime.datetime(2026, 3, 1, 9, 30)


def stroke(time):
    return 20 * np.sin(9 * time)


def force(time):
    return 540 * np.cos(9 * time)


def tdms(path, **groups):
    """A TDMS file of groups of channels: name to values and properties."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject(group, name.split(" ")[0], values, properties=properties)
                for group, channels in groups.items()
                for name, (values, properties) in channels.items()
            ]
        )
    return path


def wave(values, unit, step=1 / 300, late: float = 0.0, **more):
    start = START + datetime.timedelta(seconds=late)
    return values, {"unit_string": unit, "wf_increment": step, "wf_start_time": start, **more}


def assert_is_the_motion(run, shift=0.0):
    np.testing.assert_allclose(run.stroke, 1e-3 * stroke(run.time + shift), atol=2e-6)
    np.testing.assert_allclose(run.force, force(run.time + shift), atol=0.05)


def test_groups_of_a_tdms_file_keep_their_places_in_time(tmp_path):
    late = {"F": wave(force(T + 0.1), "N", late=0.1)}
    (run,) = read(tdms(tmp_path / "a.tdms", motion={"x": wave(stroke(T), "mm")}, load=late))
    assert_is_the_motion(run)
    offset = {"F": wave(force(T + 0.1), "N", wf_start_offset=0.1)}
    (run,) = read(tdms(tmp_path / "b.tdms", motion={"x": wave(stroke(T), "mm")}, load=offset))
    assert_is_the_motion(run)


def test_dates_of_tdms_groups_count_from_the_first_of_the_file(tmp_path):
    def dates(late):
        return np.datetime64(START) + ((T + late) * 1e6).round().astype("timedelta64[us]"), {}

    motion = {"Time": dates(0.0), "x": (stroke(T), {"unit_string": "mm"})}
    load = {"Time": dates(0.1), "F": (force(T + 0.1), {"unit_string": "N"})}
    (run,) = read(tdms(tmp_path / "a.tdms", motion=motion, load=load))
    assert_is_the_motion(run)


def test_channels_of_one_group_have_clocks_of_their_own(tmp_path):
    half = np.arange(300) / 150
    channels = {
        "x": wave(stroke(T), "mm"),
        "F": wave(force(half), "N", step=1 / 150),
        "oil_temperature": wave(20 + np.arange(3.0), "degC", step=1.0),
        "counter": ([1, 2, 3, 4], {}),
    }
    run = read(tdms(tmp_path / "a.tdms", test=channels))[0]
    assert_is_the_motion(run)
    np.testing.assert_allclose(np.asarray(run.temperature), 293.15 + run.time)
    notes = " ".join(run.notes)
    assert "the stroke in 'x' and the force in 'F', on different clocks" in notes
    assert "'oil_temperature' brought from a clock of 1 Hz onto that of the record by straight lines" in notes
    assert "or the clock of the others: counter (4)" in notes


def test_a_channel_that_starts_later_in_its_group(tmp_path):
    channels = {"x": wave(stroke(T), "mm"), "F": wave(force(T + 0.1), "N", late=0.1)}
    assert_is_the_motion(read(tdms(tmp_path / "a.tdms", test=channels))[0])


def test_a_waveform_without_offset_or_start(tmp_path):
    channels = {"x": wave(stroke(T), "mm"), "F": (force(T), {"unit_string": "N", "wf_increment": 1 / 300})}
    run = read(tdms(tmp_path / "a.tdms", test=channels))[0]
    assert_is_the_motion(run)
    assert any("no start time in the file of F: taken as the first of the group" in note for note in run.notes)


@pytest.mark.parametrize("name", ["Time", "Zeit"])
def test_a_channel_of_the_time_wins_over_the_default_clock_of_waveforms(tmp_path, name):
    channels = {"x": wave(stroke(T), "mm", 1.0), "F": wave(force(T), "N", 1.0), name: (T, {"unit_string": "s"})}
    np.testing.assert_array_equal(read(tdms(tmp_path / "a.tdms", test=channels))[0].time, T)


def mat(path, **fields):
    import scipy.io

    scipy.io.savemat(path, {"rec": fields})
    return path


def test_the_length_with_stroke_and_force_wins_in_mat(tmp_path):
    others = {f"gain_{name}": np.arange(30.0) for name in "abcde"}
    run = read(mat(tmp_path / "a.mat", t_s=T, x_mm=stroke(T), F_N=force(T), **others))[0]
    assert_is_the_motion(run)
    assert any("gain_a (30), gain_b (30)" in note for note in run.notes)
    with pytest.raises(ValueError, match=r"a\.mat: the stroke has 600 samples and the force has 599 samples, and not"):
        read(mat(tmp_path / "a.mat", t_s=T, x_mm=stroke(T), F_N=force(T)[1:]))


def two_groups(file, hole=()):
    slow = np.arange(200) / 100
    loads = force(T)
    loads[list(hole)] = np.nan
    return [
        RawTable(file, (RawColumn("time", slow, "s"), RawColumn("x", stroke(slow), "mm")), "motion"),
        RawTable(file, (RawColumn("time", T, "s"), RawColumn("F", loads, "N")), "load"),
    ]


def test_a_missing_value_in_one_of_two_groups_does_not_lose_the_force(tmp_path):
    (tmp_path / "a.own").write_text("x")
    readers = {".own": lambda file: two_groups(file, (50, 51, 400))}
    with pytest.raises(ValueError, match=r"the force \(column 'F'\) is nan \(3 such values in all\)\..*drop_bad_rows"):
        read(tmp_path / "a.own", readers=readers)
    run = read(tmp_path / "a.own", drop_bad_rows=True, readers=readers)[0]
    np.testing.assert_allclose(run.force, force(run.time), atol=2.0)
    assert "3 bad rows left out" in run.describe()


def test_a_missing_value_of_the_slower_group_is_missing_between_its_neighbours(tmp_path):
    (tmp_path / "a.own").write_text("x")
    slow = np.arange(200) / 100
    values = np.where(np.arange(200) == 90, np.nan, stroke(slow))

    def reader(file):
        return [
            RawTable(file, (RawColumn("t", slow, "s"), RawColumn("x", values, "mm")), "motion"),
            two_groups(file)[1],
        ]

    with pytest.raises(ValueError, match=r"the stroke \(column 'x'\) is nan \(5 such values in all\)"):
        read(tmp_path / "a.own", readers={".own": reader})
    run = read(tmp_path / "a.own", readers={".own": reader}, drop_bad_rows=True)[0]
    np.testing.assert_allclose(run.stroke, 1e-3 * stroke(run.time), atol=1e-4)


def mdf(path, *groups, version="4.10"):
    from asammdf import MDF

    with MDF(version=version) as file:
        for comment, signals in groups:
            file.append(signals, comment=comment)
        file.save(path, overwrite=True)
    return path


def signal(name, values, unit, time=T, **more):
    from asammdf import Signal

    return Signal(values, time, unit=unit, name=name, **more)


def test_a_master_channel_that_is_no_time_is_no_time(tmp_path):
    turned = {"master_metadata": ("angle", 2)}
    channels = [signal("x", stroke(T), "mm", 360 * T, **turned), signal("F", force(T), "N", 360 * T, **turned)]
    path = mdf(tmp_path / "a.mf4", ("swept", channels))
    with pytest.raises(ValueError, match=r"a\.mf4 has no time column: pass the rate"):
        read(path)
    run = read(path, sampling_rate=300)[0]
    assert_is_the_motion(run)
    assert any("not used: angle" in note for note in run.notes)


def test_invalid_samples_of_mdf_are_missing_values(tmp_path):
    bad = np.arange(600) == 77
    channels = [signal("x", stroke(T), "mm"), signal("F", force(T), "N", invalidation_bits=bad)]
    path = mdf(tmp_path / "a.mf4", ("run", channels))
    with pytest.raises(ValueError, match=r"sample 78: the force \(column 'F'\) is nan \(1 such values in all\)"):
        read(path)
    assert "1 bad row left out" in read(path, drop_bad_rows=True)[0].describe()


def test_mdf_3(tmp_path):
    path = mdf(tmp_path / "a.mdf", ("run", [signal("x", stroke(T), "mm"), signal("F", force(T), "N")]), version="3.30")
    assert_is_the_motion(read(path)[0])


def test_runs_of_mdf_with_the_same_clock_stay_two(tmp_path):
    def run(size):
        return [("motion", [signal("x", size * stroke(T), "mm")]), ("load", [signal("F", size * force(T), "N")])]

    runs = read(mdf(tmp_path / "a.mf4", *run(1), *run(2)))
    assert runs.names == ("a/motion 1", "a/motion 2")
    np.testing.assert_allclose(runs[1].force, 2 * runs[0].force)
