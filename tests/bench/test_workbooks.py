"""Workbooks as other programs write them: sizes that are wrong, blocks in one sheet, formulas without values."""

import zipfile

import numpy as np
import openpyxl
import pytest

from jaxdamp.bench import read


T = np.round(np.arange(300) / 300, 9)
X = np.round(20 * np.sin(6 * np.pi * T), 9)
F = np.round(800 * np.cos(6 * np.pi * T) + 5.0, 9)
HEADER = ("t [s]", "x [mm]", "F [N]")


def rows(factor=1.0):
    return [HEADER, *zip(T.tolist(), X.tolist(), (factor * F).tolist(), strict=True)]


def workbook(path, **sheets):
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, lines in sheets.items():
        sheet = book.create_sheet(name)
        for line in lines:
            sheet.append(line)
    book.save(path)
    return path


def test_rows_beyond_the_size_that_the_sheet_states_are_read(tmp_path):
    whole = workbook(tmp_path / "whole.xlsx", only=rows())
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(tmp_path / "a.xlsx", "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b'<dimension ref="A1:C301"', b'<dimension ref="A1:C100"'))
    run = read(tmp_path / "a.xlsx")[0]
    np.testing.assert_array_equal(run.force, F)


def test_blocks_in_one_sheet_are_records(tmp_path):
    stacked = [("Run 1",), *rows(), (), ("Run 2",), *rows(2.0), ("end of test",)]
    runs = read(workbook(tmp_path / "a.xlsx", only=stacked))
    assert runs.names == ("a/only Run 1", "a/only Run 2")
    np.testing.assert_array_equal(runs[1].force, 2 * F)
    assert any("one of 2 blocks of the file" in note for note in runs[0].notes)
    assert any("1 row of another form behind the numbers left out" in note for note in runs[1].notes)
    stacked[310] = (T[5], "off", 1.0)
    with pytest.raises(ValueError, match=r"record 'only Run 2', line 311, column 'x \[mm\]': 'off' is not a number"):
        read(workbook(tmp_path / "a.xlsx", only=stacked))


def test_blocks_with_a_row_of_units(tmp_path):
    block = [("t", "x", "F"), ("s", "mm", "N"), *rows()[1:]]
    runs = read(workbook(tmp_path / "a.xlsx", cold=[*block, *block], warm=block))
    assert runs.names == ("a/cold first", "a/cold line 303", "a/warm")
    np.testing.assert_array_equal(runs[1].stroke, 1e-3 * X)


def test_a_header_inside_one_record_is_a_fault(tmp_path):
    lines = rows()
    with pytest.raises(ValueError, match=r"line 151, column '.*' is not a number"):
        read(workbook(tmp_path / "a.xlsx", only=[*lines[:150], HEADER, *lines[150:]]))


def test_formulas_without_values_are_named(tmp_path):
    lines = [HEADER, *((t, x, f"=0.5*B{i}") for i, (t, x) in enumerate(zip(T.tolist(), X.tolist(), strict=True), 2))]
    with pytest.raises(ValueError, match=r"'F \[N\]' \(force\) holds text \('formula without a stored value; save the"):
        read(workbook(tmp_path / "a.xlsx", only=lines))
    some = [*rows()[:50], (T[49], X[49], "=A1"), *rows()[51:]]
    with pytest.raises(ValueError, match=r"line 51, column 'F \[N\]': 'formula without a stored value; save"):
        read(workbook(tmp_path / "a.xlsx", only=some))
    all_of_them = [HEADER, *(("=1", "=2", "=3"),) * 30]
    with pytest.raises(ValueError, match=r"a\.xlsx holds no record, but a formula without a stored value"):
        read(workbook(tmp_path / "a.xlsx", only=all_of_them))
    mean = [*rows(), ("mean", None, "=AVERAGE(C2:C301)")]
    np.testing.assert_array_equal(read(workbook(tmp_path / "a.xlsx", only=mean))[0].force, F)


def test_a_cell_of_several_lines_is_one_cell(tmp_path):
    """A note typed beside the numbers, with line breaks and numbers of its own."""
    lines: list[tuple] = [(*row, None) for row in rows()]
    lines[5] = (*lines[5][:3], "warm\n30\nagain from here\n31")
    run = read(workbook(tmp_path / "a.xlsx", only=lines))[0]
    np.testing.assert_array_equal(run.force, F)
