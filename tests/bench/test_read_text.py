import numpy as np
import pytest

from jaxdamp.bench import read
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.text import read_text


def read_table(path, delimiter=None) -> RawTable:
    (table,) = read_text(path, delimiter)
    return table


def values(table: RawTable) -> np.ndarray:
    return np.stack([np.asarray(column.values) for column in table.columns], axis=1)


def units(table: RawTable) -> tuple[str, ...]:
    return tuple(column.unit for column in table.columns)


@pytest.mark.parametrize(
    ("delimiter", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ","), (" ", "."), ("|", ".")]
)
def test_delimiters_and_decimal_signs(write, delimiter, decimal):
    path = write(header=f"t_s{delimiter}x_mm{delimiter}F_N", delimiter=delimiter, decimal=decimal)
    table = read_table(path)
    assert table.names == ("t_s", "x_mm", "F_N")
    assert values(table).shape == (600, 3)
    assert values(table)[150, 1] == pytest.approx(20e0 * np.sin(2 * np.pi * 1.5 * 0.5), abs=1e-7)
    assert tuple(table.lines[:2]) == (2, 3)


def test_preamble_and_row_of_units(write):
    preamble = ["Damper bench 7", "Rate,2000,Hz", "", "Operator,A. B.", "time,stroke,force"]
    table = read_table(write(preamble=preamble, header="[s],[mm],[N]"))
    assert table.names == ("time", "stroke", "force")
    assert units(table) == ("s", "mm", "N")
    assert table.preamble == ("Damper bench 7", "Rate,2000,Hz", "Operator,A. B.")
    assert table.lines[0] == 7


def test_a_preamble_that_looks_like_a_header_is_no_row_of_units(write):
    table = read_table(write(preamble=["front,left,new"], header="t_s,x_mm,F_N"))
    assert table.names == ("t_s", "x_mm", "F_N")
    assert units(table) == ("", "", "")


def test_quotes_and_trailing_delimiters(tmp_path):
    rows = "\n".join(f'"{i}",{i * i},' for i in range(30))
    (tmp_path / "a.csv").write_text('"Time, s","Force, N",\n' + rows)
    table = read_table(tmp_path / "a.csv")
    assert table.names == ("Time, s", "Force, N")
    np.testing.assert_array_equal(values(table)[:, 1], np.arange(30.0) ** 2)


def test_white_space_header_with_apart_units(write):
    table = read_table(write(header="t [s] x [mm] F (N)", delimiter=" "))
    assert table.names == ("t [s]", "x [mm]", "F (N)")


def test_other_encodings(write):
    path = write(header="Zeit [s];Weg [mm];Kraft [N];T [°C]", delimiter=";", extra=[np.full(600, 30.0)])
    text = path.read_text(encoding="utf-8")
    for encoding in ("utf-16", "cp1252", "utf-8-sig"):
        path.write_bytes(text.encode(encoding))
        assert read_table(path).names[3] == "T [°C]"


def test_no_header(write):
    assert not read_table(write(header=None)).is_named


def test_empty_file_and_binary_file(tmp_path):
    (tmp_path / "a.csv").write_text("\n \n")
    with pytest.raises(ValueError, match=r"a\.csv is empty"):
        read_table(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_bytes(b"PK\x03\x04\0\0\0")
    with pytest.raises(ValueError, match="not a text file"):
        read_table(tmp_path / "b.csv")
    (tmp_path / "c.csv").write_text("time,force\n")
    with pytest.raises(ValueError, match="no rows of numbers"):
        read_table(tmp_path / "c.csv")


def test_one_column_only(write):
    with pytest.raises(ValueError, match="only one column"):
        read_table(write(header="F_N", scale=(0, 0, 1.0)))


def test_wrong_delimiter(write):
    with pytest.raises(ValueError, match=r"no columns divided by ';'.*It looks like ',' \(comma\)"):
        read_table(write(), ";")
    with pytest.raises(ValueError, match="one character"):
        read_table(write(), ", ")


@pytest.mark.parametrize("row", [0, 77])
def test_text_among_the_numbers_names_line_and_column(write, row):
    with pytest.raises(ValueError, match=rf"run\.csv, line {row + 2}, column 'x_mm': 'overload' is not a number"):
        read(write(replace={row: "0.25,overload,1.0"}))


def test_missing_value(write):
    with pytest.raises(ValueError, match=r"line 79, column 'x_mm': the value is missing"):
        read(write(replace={77: "0.25,,1.0"}))
    with pytest.raises(ValueError, match=r"line 79: 2 values where the file has 3 columns"):
        read(write(replace={77: "0.25,1.0"}))
