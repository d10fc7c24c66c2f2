import os
from pathlib import Path

import pytest

from jaxdamp._files import RECORD_SUFFIXES, find_files, natural_key
from jaxdamp.bench import READERS


def _touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).write_text("x")


def test_folder_gives_its_csv_files_in_natural_order(tmp_path):
    _touch(tmp_path, "10mm.csv", "2mm.csv", "1.5mm.csv", "notes.txt", "2mm_B.CSV", "~$a.xlsx", "20mm.xlsx")
    assert [f.name for f in find_files(tmp_path)] == ["1.5mm.csv", "2mm.csv", "2mm_B.CSV", "10mm.csv"]
    found = find_files(tmp_path, (".csv", ".xlsx"))
    assert [f.name for f in found] == ["1.5mm.csv", "2mm.csv", "2mm_B.CSV", "10mm.csv", "20mm.xlsx"]


def test_pattern_and_list(tmp_path):
    _touch(tmp_path, "10mm.csv", "2mm.csv", "other.csv")
    pattern = str(tmp_path / "*mm.csv")
    assert [f.name for f in find_files(pattern)] == ["2mm.csv", "10mm.csv"]
    assert [f.name for f in find_files([tmp_path / "other.csv", pattern])] == ["other.csv", "2mm.csv", "10mm.csv"]


def test_a_file_whose_name_has_brackets_is_found(tmp_path):
    _touch(tmp_path, "run[1].csv")
    assert find_files(str(tmp_path / "run[1].csv"))[0].name == "run[1].csv"


def test_natural_key():
    assert sorted(["a10", "a9", "a9.5"], key=natural_key) == ["a9", "a9.5", "a10"]


def test_missing_file_names_those_alike(tmp_path):
    _touch(tmp_path, "5mm_3Hz.csv", "zzz.bin")
    with pytest.raises(FileNotFoundError, match=r"no file '.*5mm_3.Hz\.csv'.*Did you mean '.*5mm_3Hz\.csv'"):
        find_files(tmp_path / "5mm_3.Hz.csv")
    with pytest.raises(FileNotFoundError, match=r"The folder '.*nowhere' does not exist either"):
        find_files(tmp_path / "nowhere" / "a.csv")


def test_empty_pattern_folder_and_list(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"No file matches the pattern '.*\*\.csv'"):
        find_files(str(tmp_path / "*.csv"))
    _touch(tmp_path, "a.txt")
    with pytest.raises(FileNotFoundError, match=r"holds no \*\.csv or other file of records\. It holds a\.txt"):
        find_files(tmp_path)
    with pytest.raises(ValueError, match="at least one file"):
        find_files([])


def test_the_same_file_twice(tmp_path):
    _touch(tmp_path, "a.csv")
    with pytest.raises(ValueError, match="there 2 times"):
        find_files([tmp_path / "a.csv", tmp_path])


def test_a_pipe_is_no_record(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ValueError, match="a pipe or a device"):
        find_files(tmp_path / "pipe.csv")


def test_every_reader_has_its_suffix():
    assert set(READERS) == set(RECORD_SUFFIXES)
