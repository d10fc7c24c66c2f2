"""One poor table of a file costs the others nothing, and what is left out is said."""

import numpy as np
import pytest

from jaxdamp.bench import RawColumn, RawTable, read, read_rides


T = np.arange(300) / 300
X = 20 * np.sin(6 * np.pi * T)
F = 800 * np.cos(6 * np.pi * T) + 5.0


@pytest.fixture
def read_own(tmp_path):
    """Reads a file of tables: name to columns."""

    def make(function=read, *, tables, **given):
        def reader(file):
            columns = {name: [RawColumn(*c) for c in of_table] for name, of_table in tables.items()}
            return [RawTable(file, tuple(of_table), name) for name, of_table in columns.items()]

        (tmp_path / "a.own").write_text("x")
        return function(tmp_path / "a.own", readers={".own": reader}, **given)

    return make


RUN = [("t", T, "s"), ("x", X, "mm"), ("F", F, "N")]


def test_short_tables_and_tables_without_a_force_are_left_out_beside_a_record(read_own):
    short = [(name, values[:2], unit) for name, values, unit in RUN]
    run = read_own(tables={"run": RUN, "summary": short, "travel": RUN[:2], "events": [("class", T, ""), ("n", T, "")]})
    assert run.names == ("a",)
    notes = " ".join(run[0].notes)
    for said in (
        "'summary' of the file left out: 2 samples, and a record needs 20",
        "'travel' of the file left out: no force",
        "'events' of the file left out: neither stroke nor force",
    ):
        assert said in notes


def test_without_a_record_every_table_says_what_it_lacks(read_own):
    with pytest.raises(ValueError, match=r"record 'summary' has only 2 samples"):
        read_own(tables={"summary": [(name, values[:2], unit) for name, values, unit in RUN], "travel": RUN[:2]})


def test_bad_records_of_a_file_are_skipped_one_by_one(read_own):
    bad = [*RUN[:2], ("F", np.where(T == T[40], np.nan, F), "N")]
    tables = {"one": RUN, "two": bad, "three": RUN}
    with pytest.raises(
        ValueError, match=r"sample 41: the force .* is nan.*The other 2 records can be read: skip_bad=True"
    ):
        read_own(tables=tables)
    runs = read_own(tables=tables, skip_bad=True)
    assert runs.names == ("a/one", "a/three")
    assert len(runs.left_out) == 1 and "record 'two', sample 41: the force" in runs.left_out[0]


def test_road_and_acceleration_in_two_groups_name_file_and_group(read_own):
    time = ("Time", T, "s")
    tables = {"motion": [time, ("road", X, "mm")], "sensors": [time, ("acc", X, "g")]}
    with pytest.raises(
        ValueError, match=r"(?s)a\.own, record 'motion': no channel beside road and time.*'sensors' has no"
    ):
        read_own(read_rides, tables=tables)
