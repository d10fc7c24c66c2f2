"""Records of vehicles: made of arrays, written, and read from files of others."""

import numpy as np
import pytest

from jaxdamp.bench import RideRecord, read_rides


TIME = np.arange(200) / 100
WAVE = np.sin(5 * TIME)
UNITS = {"sprung_acceleration": "m/s^2", "front_stroke": "m"}
CHANNELS = {"sprung_acceleration": WAVE, "front_stroke": 0.01 * WAVE}


def record(**changed):
    given = {"name": "one", "time": TIME, "road": 0.02 * WAVE, "channels": CHANNELS, "units": UNITS} | changed
    return RideRecord(**given)


def test_a_record_is_written_and_read_to_the_last_bit(tmp_path):
    two = record(road=np.stack([WAVE, 0.5 * WAVE], axis=1), settings={"payload": 80})
    again = read_rides(two.to_csv(tmp_path / "one.csv"))[0]
    assert again.name == "one" and again.units == two.units and dict(again.settings) == {"payload": 80}
    for old, new in ((two.road, again.road), (two.time, again.time)):
        np.testing.assert_array_equal(old, new)
    for channel in CHANNELS:
        np.testing.assert_array_equal(two[channel], again[channel])


def test_columns_of_a_file_get_names_units_and_signs(tmp_path):
    rows = [f"{1000 * t};{10 * w};{w};{5 * w}" for t, w in zip(TIME, WAVE, strict=True)]
    (tmp_path / "shaker.csv").write_text("\n".join(["Zeit [ms];pad mm;acc body [g];LVDT", *rows]))
    manifest = tmp_path / "rides.toml"
    manifest.write_text(
        'road = "pad mm"\nreversed_channels = ["front_stroke"]\n[units]\nroad = "mm"\nfront_stroke = "mm"\n'
        '[columns]\ntime = "Zeit"\nsprung_acceleration = "acc body"\nfront_stroke = 3\n'
    )
    one = read_rides(tmp_path / "shaker.csv", manifest=manifest)[0]
    np.testing.assert_allclose(one.time, TIME, atol=1e-12)
    np.testing.assert_allclose(one.road[:, 0], 0.01 * WAVE, atol=1e-15)
    np.testing.assert_allclose(one["sprung_acceleration"], 9.80665 * WAVE)
    np.testing.assert_allclose(one["front_stroke"], -0.005 * WAVE)
    assert one.units == UNITS
    manifest.rename(tmp_path / "jaxdamp.toml")  # taken by itself, as that of bench records
    (two,) = read_rides(tmp_path)
    np.testing.assert_array_equal(two["front_stroke"], one["front_stroke"])
    assert f"read as the manifest {tmp_path / 'jaxdamp.toml'} says" in two.notes
    with pytest.raises(ValueError, match="has no column `road`"):
        read_rides(tmp_path, manifest=False)


@pytest.mark.parametrize("header", ["Time [s]", "Zeit [s]", "t_s [s]"])
def test_the_time_of_a_ride_is_found_as_that_of_a_bench_record(tmp_path, header):
    rows = [f"{t},{w},{w}" for t, w in zip(TIME, WAVE, strict=True)]
    (tmp_path / "ride.csv").write_text("\n".join([f"{header},road [mm],stroke [mm]", *rows]))
    one = read_rides(tmp_path / "ride.csv")[0]
    np.testing.assert_array_equal(one.time, TIME)
    assert [*one.channels] == ["stroke"]


def test_forces_on_the_wheels_are_known_by_their_unit(tmp_path):
    one = record(driven_by="forces", road=300.0 * WAVE)
    again = read_rides(one.to_csv(tmp_path / "one.csv"))[0]
    assert again.driven_by == "forces" and "moved by 600 N" in repr(again)
    with pytest.raises(ValueError, match="Did you mean 'forces'"):
        record(driven_by="force")


def test_parts_and_figures():
    part = record().between(0.5, 1.5)
    assert len(part) == 100 and part.dt == pytest.approx(0.01) and part.notes[-1] == "cut to 0.5 to 1.5 s"
    assert record().summary()["sampling_rate"] == pytest.approx(100.0)
    with pytest.raises(ValueError, match="read-only"):
        part.road[0] = 1.0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"channels": {}}, "`channels` must hold at least one"),
        ({"channels": {"stroke": WAVE[1:]}, "units": {}}, "`stroke` must have one sample for each of 200"),
        ({"channels": {"stroke": np.where(TIME == 0.5, np.nan, WAVE)}, "units": {}}, "stroke is nan"),
        ({"road": np.zeros(200)}, "`road` must move"),
        ({"time": TIME**2}, "not uniform"),
        ({"units": {"front_strok": "m"}}, "Did you mean 'front_stroke'"),
    ],
)
def test_wrong_records_are_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        record(**changed)


@pytest.mark.parametrize(
    ("header", "how", "message"),
    [
        ("time [s],road [m],stroke", {}, "no unit. Write it into the header"),
        ("time [s],road [m],stroke [bar]", {}, "'bar' is no unit of 'stroke'"),
        ("time [s],road [s],stroke [m]", {}, "'s' is no unit of 'road'"),
        ("time [s],pad [m],stroke [m]", {}, "no column `road`"),
        ("since [s],road [m],stroke [m]", {}, "pass `sampling_rate`"),
        ("time [s],road [m],stroke [m]", {"columns": {"stroke": "strok"}}, "no column 'strok'.*Did you mean 'stroke'"),
        ("time [s],road [m],stroke [m]", {"sampling_rate": 100.0}, "leave `sampling_rate` out"),
        ("time [s],road [m],stroke [m]", {"units": {"strike": "m"}}, "Did you mean 'stroke'"),
    ],
)
def test_files_that_do_not_say_what_they_hold_are_refused(tmp_path, header, how, message):
    rows = [f"{t},{w},{w}" for t, w in zip(TIME, WAVE, strict=True)]
    (tmp_path / "odd.csv").write_text("\n".join([header, *rows]))
    with pytest.raises(ValueError, match=message):
        read_rides(tmp_path / "odd.csv", **how)


def test_a_record_without_units_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="without one for 'front_stroke'"):
        record(units={"sprung_acceleration": "m/s^2"}).to_csv(tmp_path / "one.csv")
