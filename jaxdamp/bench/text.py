"""Text files with columns of numbers: delimiter, decimal sign, preamble, header, footer."""

import codecs
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp._files import check_size
from jaxdamp.bench.headers import role_of
from jaxdamp.bench.layout import (
    DELIMITERS,
    GROUPED,
    PLAIN_COMMA,
    PLAINLY,
    Header,
    Layout,
    Rows,
    blocks_of,
    columns_of,
    header_of,
    is_number,
    layout_of,
    named_apart,
    split,
    title,
)
from jaxdamp.bench.raw import RawColumn, RawTable


_LOOK_AT = 2000  # lines that decide on the delimiter
_MOST_COLUMNS = 4096  # of a text file
_CHUNK = 5_000  # lines that are divided at a time, to bound the memory
_WHOLE = re.compile(r"[+-]?\d+")
_MINUS = re.compile(r"(?<![A-DF-Za-df-z])\u2212(?=[\d.,])")  # as spreadsheets write it; not that of "s−1"
_CONTENT = {  # how files of other formats begin
    b"PK\x03\x04": "an XLSX workbook (.xlsx)",
    b"MATLAB": "a MATLAB file (.mat)",
    b"\x89HDF": "an HDF5 file, perhaps of MATLAB (.mat)",
    b"TDSm": "a TDMS file (.tdms)",
    b"MDF ": "an MDF4 file (.mf4)",
    b"PAR1": "a Parquet file (.parquet)",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (.xls), to be saved as .xlsx",
}


def read_text(file: Path, delimiter: str | None = None) -> list[RawTable]:
    """Read a text file with columns of numbers: one record, or one under each line that is like the header.

    The delimiter is the one of comma, semicolon, tab, white space and vertical bar with which most digits are those
    of numbers and time stamps. The comma is the decimal sign where it is not the delimiter and no number has a point.
    The header is the last line without a number above the first row of numbers; a row of units may stand between the
    two. Lines of another form behind the last row of numbers are left out, and a note counts them.
    """
    lines = text_lines(file)
    if delimiter is not None and len(delimiter) != 1:
        _checks.refuse("delimiter", "be one character", repr(delimiter))
    top = list(islice(((n, line) for n, line in enumerate(lines, 1) if line.strip()), _LOOK_AT))
    if not top:
        raise ValueError(f"{file} is empty: export it from the bench again.")
    _check_width(file, top)
    layout = _choose(file, top, delimiter)
    lines, top = _without_empty_end(lines, top, layout)
    rows = [(n, split(line, layout.delimiter)) for n, line in top]
    header = header_of(rows, layout)
    if header is None:
        raise ValueError(f"{file}: no row has a number in each of its {layout.count} columns: mend or shorten it.")
    _check_commas(file, rows, header, layout)
    first = rows[header.first][0]
    above = rows[header.top][0]
    head = lines[above - 1]
    again = lines.count(head) > 1
    like = [at for at, line in enumerate(lines, 1) if line.strip() == head.strip()] if again else [above]
    tables = []
    for block in blocks_of(lambda at: split(lines[at - 1], layout.delimiter), len(lines), above, first, like, layout):
        preamble = tuple(line for line in lines[block.behind : block.header - 1] if line.strip())
        table = _table(file, lines[: block.end], block.first, layout, header)
        tables.append(replace(table, preamble=preamble, record=title(preamble, block, block.header, layout)))
    return named_apart(tables, "")


def _without_empty_end(
    lines: list[str], top: list[tuple[int, str]], layout: Layout
) -> tuple[list[str], list[tuple[int, str]]]:
    """The lines, without the last name where all rows of numbers leave the last column empty, as unused channels do."""
    rows = [(line, split(line, layout.delimiter)) for _, line in top]
    numbers = [line for line, cells in rows if layout.values_in(cells)]
    if layout.delimiter == " " or not all(line.rstrip(" ").endswith(layout.delimiter) for line in numbers):
        return lines, top
    wide = [line for line, cells in rows if len(cells) == layout.count + 1 and not any(map(layout.has_value, cells))]
    shorter = {line: line[: line.rindex(layout.delimiter)] for line in wide}
    return [shorter.get(line, line) for line in lines], [(n, shorter.get(line, line)) for n, line in top]


def _check_commas(file: Path, rows: Rows, header: Header, layout: Layout) -> None:
    """Refuse whole numbers between commas under fewer names: the commas may be decimal signs as well."""
    if layout.delimiter != "," or any(header.names):
        return
    named = ((n, row) for n, row in reversed(rows[: header.first]) if any(map(role_of, row)))
    line, names = next(named, (0, []))
    whole = all(_WHOLE.fullmatch(cell) for _, row in rows[header.first :] if layout.values_in(row) for cell in row)
    if len(names) < layout.count <= 2 * len(names) and not any(map(layout.has_value, names)) and whole:
        raise ValueError(
            f"{file}: line {line} has {len(names)} names, and the rows below have {layout.count} whole numbers: "
            "decimal commas and commas between the columns cannot be told apart. Export the file with semicolons "
            "between the columns or with decimal points; if the numbers are whole, name every column."
        )


def _table(file: Path, lines: list[str], first: int, layout: Layout, header: Header) -> RawTable:
    numbers, body, notes = _body(lines, first, layout)
    columns = _all_at_once(body, layout)
    if columns is None:
        columns = columns_of(file, numbers, _in_chunks(body, layout.delimiter, layout.count), layout)
    columns = [replace(c, name=n, unit=u) for c, n, u in zip(columns, header.names, header.units, strict=True)]
    return RawTable(file, tuple(columns), lines=numbers, notes=notes)


def _check_width(file: Path, top: list[tuple[int, str]]) -> None:
    """Refuse lines with more columns than any record has, before they are divided."""
    if _other_format(top[0][1]):
        return  # which is what is said of it
    number, line = max(top, key=lambda one: len(one[1]))
    count = 1 + max(max(line.count(mark) for mark in ",;\t|"), len(line.split()) - 1)
    if count > _MOST_COLUMNS:
        remedy = "export the channels of one record only"
        raise ValueError(f"{file}, line {number}: {count} columns, more than {_MOST_COLUMNS} that are read: {remedy}.")


def text_lines(file: Path) -> list[str]:
    """The lines of a text file in UTF-8, UTF-16 or the Western code page of Windows."""
    check_size(file, file.stat().st_size)
    raw = file.read_bytes()
    if encoding := _wide_encoding(raw):
        return _with_minus(raw.decode(encoding, errors="replace")).splitlines()
    other = next((name for begin, name in _CONTENT.items() if raw.startswith(begin)), None)
    if other or b"\0" in raw[:4096]:
        kind = f"it looks like {other}: give it that ending" if other else "its format is unknown"
        raise ValueError(f"{file} is not a text file; {kind}, or export it from the bench software as CSV.")
    try:
        return _with_minus(raw.decode("utf-8-sig")).splitlines()
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace").splitlines()


def _wide_encoding(raw: bytes) -> str | None:
    """UTF-16 by its mark, or by the zeros of Western text where there is no mark."""
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-16"
    low, high = raw[:4096:2], raw[1:4096:2]
    if high.count(0) > 0.9 * len(high) and not low.count(0):
        return "utf-16-le"
    return "utf-16-be" if low.count(0) > 0.9 * len(low) and not high.count(0) else None


def _with_minus(text: str) -> str:
    """The text with ASCII signs before its numbers."""
    return _MINUS.sub("-", text) if "\u2212" in text else text


def _choose(file: Path, top: list[tuple[int, str]], given: str | None) -> Layout:
    """The layout with the delimiter given, or with the one that fits best."""
    candidates = [*DELIMITERS] if given in DELIMITERS or given is None else [*DELIMITERS, given]
    layouts = _layouts(top, [d for d in candidates if _divides(d, top)])
    fitting = {d: layout for d, layout in layouts.items() if layout is not None and len(layout.full) > 1}
    best = max(fitting.values(), key=lambda layout: layout.score, default=None)
    if given in fitting:
        return fitting[given]
    if given is not None:
        setting = Setting("delimiter", given)
        hint = f" It looks like {best.delimiter!r} ({DELIMITERS[best.delimiter]}): leave {setting} out." if best else ""
        raise ArgumentError(f"{file} has no columns divided by {given!r}, the delimiter that was given.{hint}", setting)
    kind = _other_format(top[0][1])
    if best is not None and not kind:
        return best
    if not kind and any(_layouts(top, candidates).values()):
        raise ValueError(
            f"{file} has only one column of numbers: a record needs at least the stroke and the force, side by side, "
            f"divided by comma, semicolon, tab, white space or vertical bar.{_grouped(top)}"
        )
    raise ValueError(f"{file} holds no rows of numbers: its first line is {top[0][1][:80]!r}.{kind}{_grouped(top)}")


def _grouped(top: list[tuple[int, str]]) -> str:
    """A sentence on the first cell with a decimal comma or thousands that its file cannot have."""
    cells = ((n, cell, d) for n, line in top for d in DELIMITERS if d != " " and d in line for cell in split(line, d))
    grouped = ((n, cell) for n, cell, d in cells if GROUPED.fullmatch(cell) and not is_number(cell, d))
    return next((f" Line {n} has {cell!r}, which is not read as a number: {PLAINLY}." for n, cell in grouped), "")


def _divides(delimiter: str, top: list[tuple[int, str]]) -> bool:
    return any(len(line.split()) > 1 if delimiter == " " else delimiter in line for _, line in top)


def _layouts(top: list[tuple[int, str]], delimiters: list[str]) -> dict[str, Layout | None]:
    return {d: layout_of([(n, split(line, d)) for n, line in top], d) for d in delimiters}


def _other_format(first: str) -> str:
    """A sentence on a file that is text, but of another kind."""
    begin = first.lstrip()
    kind = "JSON" if re.match(r"\{|\[\s*[\[{\d]", begin) else "HTML or XML" if begin.startswith("<") else ""
    remedy = "export the record from the bench software as CSV, one column a channel"
    return f" It looks like {kind}: {remedy}." if kind else ""


def _body(lines: list[str], first: int, layout: Layout) -> tuple[Sequence[int], list[str], tuple[str, ...]]:
    """Numbers and texts of the lines from the first row of numbers to the last, and a note on those behind it."""
    stop = len(lines)
    while stop > first and not layout.is_row(split(lines[stop - 1], layout.delimiter)):
        stop -= 1
    behind = [(n, line) for n, line in enumerate(lines[stop:], stop + 1) if line.strip()]
    notes = ()
    if behind:
        number, line = behind[0]
        count = f"{len(behind)} line{'s' * (len(behind) > 1)} of another form"
        notes = (f"{count} behind the numbers left out, the first is line {number}: {line.strip()[:60]!r}",)
    body, numbers = lines[first - 1 : stop], range(first, stop + 1)
    if not all(map(str.strip, body)):
        numbers = [n for n, line in zip(numbers, body, strict=True) if line.strip()]
        body = [line for line in body if line.strip()]
    return numbers, body, notes


def _all_at_once(body: list[str], layout: Layout) -> list[RawColumn] | None:
    """The columns by NumPy's reader; None where a row needs a closer look."""
    mark = layout.delimiter
    lines = body if mark == "," else _with_points(body)
    texts = [index for index in range(layout.count) if index not in layout.numeric]
    if not lines or (texts and not _divides_plainly(body, mark, layout.count)):
        return None
    try:
        delimiter, numeric = (None if mark == " " else mark), (layout.numeric if texts else None)
        values = np.loadtxt(lines, delimiter=delimiter, usecols=numeric, comments=None, ndmin=2)
    except ValueError:
        return None
    if values.shape != (len(body), len(layout.numeric)):
        return None
    columns = dict(zip(layout.numeric, values.T, strict=True))
    for index in texts:
        columns[index] = np.array([line.split(mark, index + 1)[index].strip() for line in body], dtype=object)
    return [RawColumn("", columns[index]) for index in range(layout.count)]


def _divides_plainly(body: list[str], mark: str, count: int) -> bool:
    """Whether every line has the delimiter between its columns only, and no quotes."""
    return mark not in " |" and all('"' not in line and line.count(mark) == count - 1 for line in body)


def _with_points(body: list[str]) -> list[str]:
    """The lines with decimal points; none if commas might also divide thousands."""
    if not any("," in line for line in body):
        return body
    plain = not any("." in line for line in body) and any(PLAIN_COMMA.search(line) for line in body)
    return [line.replace(",", ".") for line in body] if plain else []


def _in_chunks(body: list[str], delimiter: str, count: int) -> Iterator[list[list[str]]]:
    for start in range(0, len(body), _CHUNK):
        lines = body[start : start + _CHUNK]
        rows = [split(line, delimiter) for line in lines]
        for cells, line in zip(rows, lines, strict=True):
            if len(cells) == count - 1 and line.rstrip(" ").endswith(delimiter):
                cells.append("")  # the last value is missing
        yield rows
