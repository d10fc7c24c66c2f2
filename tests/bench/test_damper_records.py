"""The records of many dampers: a tree of folders, a table of files, a function; read when they are asked for."""

import os
import pickle
from typing import Any

import pytest

from jaxdamp.bench import BenchRun, DamperRecords, SineTest, VirtualDyno, read_dampers
from jaxdamp.dampers import Linear


TESTS = [SineTest(0.01, 1.0), SineTest(0.01, 2.0)]


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """Two days with two dampers each, of two records."""
    top = tmp_path_factory.mktemp("line")
    for day, rate in (("day 9", 1000.0), ("day 10", 2000.0)):
        for damper in (1, 2):
            runs = VirtualDyno(Linear(rate + damper), sampling_rate=100.0).run(TESTS)
            runs.write(top / day / f"damper {damper}")
    (top / ".hidden").mkdir()
    (top / ".hidden" / "x.csv").write_text("")
    (top / "notes.txt").write_text("not a record")
    return top


def rate(runs: tuple[BenchRun, ...]) -> float:
    return round(float(runs[0].force.max() / runs[0].velocity.max()), 3)


def test_a_folder_or_a_file_of_a_tree_is_a_damper(tree):
    dampers = read_dampers(tree, each="folder")
    assert list(dampers) == ["day 9/damper 1", "day 9/damper 2", "day 10/damper 1", "day 10/damper 2"]
    assert [len(runs) for runs in dampers.values()] == [2] * 4 and rate(dampers["day 10/damper 1"]) == 2001.0
    files = read_dampers(tree, each="file")
    assert len(files) == 8 and [len(runs) for runs in files.values()] == [1] * 8
    again = pickle.loads(pickle.dumps(dampers.part(["day 9/damper 2"])))
    assert list(again) == ["day 9/damper 2"] and rate(again["day 9/damper 2"]) == 1002.0
    assert list(read_dampers(tree / "day 9" / "damper 1", each="folder")) == ["damper 1"]


def test_how_to_read_stands_at_the_top_or_with_the_damper(tree, tmp_path):
    for name, manifest in (("top", "jaxdamp.toml"), ("own", "day 9/damper 1/jaxdamp.toml")):
        copy = tmp_path / name
        os.system(f"cp -r '{tree}' '{copy}'")
        plain = read_dampers(copy, each="folder")
        (copy / manifest).write_text('sign = "rebound-positive"\nunits = {force = "kN"}\n')
        dampers = read_dampers(copy, each="folder")
        own = name == "own"
        assert rate(dampers["day 9/damper 1"]) == 1001e3 and rate(dampers["day 9/damper 2"]) == (
            1002.0 if own else 1002e3
        )
        changed = [name for name in dampers if dampers.stamp(name) != plain.stamp(name)]
        assert changed == (["day 9/damper 1"] if own else list(dampers))
    assert rate(read_dampers(tree, each="folder", units={"force": "kN"})["day 9/damper 1"]) == 1001e3


def test_a_manifest_is_taken_as_by_read(tree, tmp_path, monkeypatch):
    top = tmp_path / "line"
    os.system(f"cp -r '{tree}' '{top}'")
    (top / "jaxdamp.toml").write_text('units = {force = "kN"}\n')
    (top / "how.toml").write_text('units = {force = "daN"}\n')
    monkeypatch.chdir(top)
    rates = []
    for manifest in (True, False, None, "how.toml", top / "how.toml"):
        dampers = read_dampers(top, each="folder", manifest=manifest)
        with monkeypatch.context() as elsewhere:
            elsewhere.chdir(tmp_path)
            rates.append(rate(dampers["day 9/damper 1"]))
    assert rates == [1001e3, 1001.0, 1001.0, 10010.0, 10010.0]
    with pytest.raises(FileNotFoundError, match=r"no manifest 'that\.toml', nor in"):
        read_dampers(top, each="folder", manifest="that.toml")


def test_another_way_of_reading_changes_every_stamp(tree, tmp_path):
    def stamps(**options: Any) -> tuple[str, ...]:
        dampers = read_dampers(tree, each="folder", **options)
        return tuple(map(dampers.stamp, dampers))

    (tmp_path / "how.toml").write_text('units = {force = "N"}\n')
    ways: list[dict[str, Any]] = [
        {},
        {"units": {"force": "N"}},
        {"units": {"force": "lbf"}},
        {"sign": "compression-positive", "gains": {"force": 2.0}},
        {"manifest": tmp_path / "how.toml"},
        {"readers": {".x": lambda file: file}},
    ]
    found = [stamps(**way) for way in ways]
    assert len({stamp for each in found for stamp in each}) == 4 * len(ways)
    assert stamps(gains={"force": 2.0}, sign="compression-positive") == found[3]
    assert stamps(readers={".x": lambda file: file}) == found[5]
    (tmp_path / "how.toml").write_text('units = {force = "lbf"}\n')
    assert not {*stamps(**ways[4])} & {*found[4]}
    processed = read_dampers(tree, each="folder", sign="rebound-positive").process(moving=True)
    assert processed.stamp("day 9/damper 1").endswith("{'sign': 'rebound-positive'} {'moving': True}")


def test_a_table_of_files_gives_names_and_order(tree, tmp_path):
    import pyarrow
    import pyarrow.parquet

    rows = [(d, str(tree / day / f"damper {i}" / f)) for d, day, i, f in _rows(tree)]
    columns = {"damper": [r[0] for r in rows], "file": [r[1] for r in rows], "shift": ["early"] * len(rows)}
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "line.parquet")
    (tmp_path / "line.csv").write_text("damper,file\n" + "\n".join(",".join(row) for row in rows) + "\n")
    for table in ("line.parquet", "line.csv"):
        dampers = read_dampers(tmp_path / table, each="name")
        assert list(dampers) == ["B", "A"] and rate(dampers["B"]) == 2002.0 and len(dampers["A"]) == 2
    (tmp_path / "bad.csv").write_text("damper;file\nA;x.csv\n")
    with pytest.raises(ValueError, match=r"bad\.csv, row 1: no 'damper'; its columns are 'damper;file'"):
        read_dampers(tmp_path / "bad.csv", each="name")


def _rows(tree):
    for damper, day, i in (("B", "day 10", 2), ("A", "day 9", 1)):
        for file in sorted(os.listdir(tree / day / f"damper {i}")):
            yield damper, day, i, file


def test_a_file_that_changes_changes_its_stamp(tmp_path):
    VirtualDyno(Linear(1000.0), sampling_rate=100.0).run(TESTS).write(tmp_path / "one")
    before = read_dampers(tmp_path, each="folder")
    assert read_dampers(tmp_path, each="folder").stamp("one") == before.stamp("one") != ""
    file = next((tmp_path / "one").iterdir())
    file.write_text(file.read_text() + "\n")
    assert read_dampers(tmp_path, each="folder").stamp("one") != before.stamp("one")


def test_what_is_no_line_is_refused(tree, tmp_path):
    for paths, each, error, message in (
        (tree, "damper", ValueError, "`each` must be one of 'folder', 'file'"),
        (tmp_path / "none", "name", FileNotFoundError, "There is no folder or table"),
        (tmp_path, "folder", FileNotFoundError, r"holds no \*\.csv"),
    ):
        with pytest.raises(error, match=message):
            read_dampers(paths, each=each)
    wrong: list[tuple[Any, str]] = [
        ((1, [1]), "`read` must be a function"),
        ((rate, [1, 2], ["a"]), "`names` must have one text for each of 2 dampers"),
        ((rate, [1, 2], ["a", "a"]), "be different and not empty, but is 2 times 'a'"),
        ((rate, [1], None, []), "`stamps` must have one text for each of 1 dampers"),
    ]
    for arguments, message in wrong:
        with pytest.raises(ValueError, match=message):
            DamperRecords(*arguments)
