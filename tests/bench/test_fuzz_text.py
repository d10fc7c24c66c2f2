"""Random text files: the reader neither crashes nor gives a number that the file does not hold."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jaxdamp.bench import read
from jaxdamp.bench.layout import NUMBER
from jaxdamp.bench.text import read_text


class File(NamedTuple):
    """A text file and what stands in it."""

    delimiter: str
    decimal: str
    above: list[str]
    names: list[str]
    cells: list[list[str]]
    behind: list[str]

    def text(self) -> str:
        rows = [self.delimiter.join(row) for row in self.cells]
        return "\n".join([*self.above, self.delimiter.join(self.names), *rows, *self.behind]) + "\n"

    def value(self, row: int, column: int) -> float | None:
        """The number in a cell, read independently of the library."""
        text = self.cells[row][column].strip().strip('"').strip()
        if self.decimal == ",":
            text = text.replace(".", "?").replace(",", ".")
        return float(text.lower().replace("d", "e")) if NUMBER.fullmatch(text) else None


SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
FORMS = ("{:.6f}", "{:.4e}", "{:+.3f}", "{:.9g}", "{:10.4f}", '"{:.5f}"', "{:.4E}")


@st.composite
def files(draw) -> File:
    delimiter = draw(st.sampled_from(",;\t| "))
    decimal = "." if delimiter == "," else draw(st.sampled_from(".,"))
    count, rows = draw(st.integers(3, 5)), draw(st.integers(25, 40))
    form = draw(st.sampled_from([f for f in FORMS if delimiter != " " or '"' not in f]))
    size = 10.0 ** draw(st.integers(-3, 5))
    numbers = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).uniform(-size, size, (rows, count))
    numbers[0] = 0.125  # a decimal sign that divides no thousands
    cells = [[form.format(number).replace(".", decimal) for number in row] for row in numbers]
    if draw(st.booleans()):  # a column of text or of time stamps
        kind, index = (
            draw(st.sampled_from(["run", "10:00:{:02}", "2026-01-01T10:00:{:02}"])),
            draw(st.integers(0, count - 1)),
        )
        cells = [[*row[:index], kind.format(n), *row[index + 1 :]] for n, row in enumerate(cells)]
    words = st.lists(st.text("abc:# %", min_size=1, max_size=12).filter(str.strip), max_size=3)
    return File(delimiter, decimal, draw(words), [f"channel{i}" for i in range(count)], cells, draw(words))


def check(file: File, path: Path) -> None:
    """The table is that of the file, or a clear error says why there is none."""
    path.write_text(file.text(), encoding="utf-8")
    try:
        (table,) = read_text(path)
    except ValueError as error:
        assert str(path) in str(error)
        return
    first = len(file.above) + 2
    rows = [number - first for number in table.lines]
    assert rows == sorted(set(rows)) and all(0 <= row < len(file.cells) for row in rows)
    for index, column in enumerate(table.columns):
        for sample, row in enumerate(rows):
            expected = file.value(row, index) if len(file.cells[row]) == len(file.names) else None
            if expected is None:
                assert column.is_text or sample in column.faults, (row, index, column.values[sample])
            elif not column.is_text:
                np.testing.assert_equal(column.values[sample], expected)


@st.composite
def faulty(draw) -> File:
    """A file with a cell that somebody has typed over."""
    file = draw(files())
    row, column = draw(st.integers(0, len(file.cells) - 1)), draw(st.integers(0, len(file.names) - 1))
    word = draw(
        st.text("0123456789.,-+eEdD nax_'%:", max_size=7) | st.sampled_from(["nan", "1e999", "--", "0x10", "1_000"])
    )
    if file.delimiter in word or '"' in word:
        word = "oops"
    cells = [list(cells) for cells in file.cells]
    cells[row][column] = word
    return file._replace(cells=cells)


def whole_files(tmp_path_factory, examples: int) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "run.csv"

    @settings(max_examples=examples, deadline=None, derandomize=True, suppress_health_check=SLOW)
    @given(files())
    def whole(file: File) -> None:
        path.write_text(file.text(), encoding="utf-8")
        (table,) = read_text(path)
        assert table.names == tuple(file.names) and len(table) == len(file.cells)
        check(file, path)

    whole()


def typed_over(tmp_path_factory, examples: int) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "run.csv"

    @settings(max_examples=examples, deadline=None, derandomize=True, suppress_health_check=SLOW)
    @given(faulty())
    def typed(file: File) -> None:
        check(file, path)

    typed()


def any_bytes(tmp_path_factory, examples: int) -> None:
    """Arbitrary content ends in a record or in a clear error."""
    path = tmp_path_factory.mktemp("fuzz") / "run.csv"
    words = st.text("0123456789.,;\t| \n\"'eE-+:x_[]mN{}<", max_size=300)
    header = st.sampled_from(["", "t_s,x_mm,F_N\n", "t [s];x [mm];F [N]\n"])

    @settings(max_examples=examples, deadline=None, derandomize=True, suppress_health_check=SLOW)
    @given(st.binary(max_size=200) | st.tuples(header, words).map(lambda parts: "".join(parts).encode()))
    def anything(content: bytes) -> None:
        path.write_bytes(content)
        try:
            read(path)
        except ValueError as error:
            assert str(path) in str(error)

    anything()


PROPERTIES = (whole_files, typed_over, any_bytes)


@pytest.mark.parametrize("check_property", PROPERTIES)
def test_random_files(tmp_path_factory, check_property):
    check_property(tmp_path_factory, 40)


@pytest.mark.exhaustive
@pytest.mark.parametrize("check_property", PROPERTIES)
def test_two_thousand_random_files(tmp_path_factory, check_property):
    check_property(tmp_path_factory, 2000)
