"""Files that would take minutes or gigabytes are refused at once; bad rows are left out on request."""

import zipfile

import numpy as np
import openpyxl
import pytest

from jaxdamp import bench


def test_too_many_columns_are_refused_before_they_are_divided(tmp_path):
    (tmp_path / "a.csv").write_text("\n".join([",".join(["1"] * 5000)] * 3))
    with pytest.raises(ValueError, match="5000 columns, more than 4096"):
        bench.read(tmp_path / "a.csv")


def test_a_workbook_that_swells_is_refused(tmp_path):
    book = openpyxl.Workbook()
    book.create_sheet("a").append(["t_s", "x_mm", "F_N"])
    book.save(tmp_path / "a.xlsx")
    with (
        zipfile.ZipFile(tmp_path / "a.xlsx") as old,
        zipfile.ZipFile(tmp_path / "b.xlsx", "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            new.writestr(name, old.read(name) + b" " * (70 * 2**20 if name.endswith("sheet1.xml") else 0))
    with pytest.raises(ValueError, match=r"sheet1.xml inflates to 70 MiB; the limit is"):
        bench.read(tmp_path / "b.xlsx")


TIME = np.arange(400) / 200
ROWS = [f"{t:.4f},{20 * np.sin(9 * t):.5f},{500 * np.cos(9 * t):.4f}" for t in TIME]


def test_bad_rows_are_left_out_on_request_and_counted(tmp_path):
    rows = [*ROWS]
    for at in (50, 51, 200):
        rows[at] = f"{TIME[at]:.4f},,NaN"
    (tmp_path / "a.csv").write_text("\n".join(["t_s,x_mm,F_N", *rows]))
    with pytest.raises(ValueError) as refused:
        bench.read(tmp_path / "a.csv")
    missing = "line 52, column 'x_mm': the value is missing (3 such values in all). Mend or remove the line, or"
    nan = "line 52: the force (column 'F_N') is nan (3 such values in all). Cut the record there or mend it. Or"
    assert all(f"{what} pass drop_bad_rows=True." in str(refused.value) for what in (missing, nan))
    run = bench.read(tmp_path / "a.csv", drop_bad_rows=True)[0]
    assert len(run) == 400 and "3 bad rows left out, straight lines instead; the first is line 52" in run.describe()
    assert np.allclose(run.force, 500 * np.cos(9 * run.time), atol=3.0)


def test_bad_rows_behind_the_last_good_one_are_cut_off(tmp_path):
    (tmp_path / "a.csv").write_text("\n".join(["t_s,x_mm,F_N", *ROWS, "max,20.0,500.0", "min,-20.0,-500.0"]))
    (run,) = bench.read(tmp_path / "a.csv", drop_bad_rows=True)
    assert len(run) == 400 and "2 bad rows left out; the first is line 402" in run.notes


def test_a_hole_in_a_record_is_no_bad_row(tmp_path):
    rows = [row if not 100 <= at < 115 else f"{TIME[at]:.4f},1,?" for at, row in enumerate(ROWS)]
    (tmp_path / "a.csv").write_text("\n".join(["t_s,x_mm,F_N", *rows]))
    with pytest.raises(ValueError, match="15 of 400 rows are bad, up to 15 one after the other"):
        bench.read(tmp_path / "a.csv", drop_bad_rows=True)
