"""A hundred bad and odd text files: each is read rightly, or refused with file, place and remedy."""

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
import pytest

from jaxdamp.bench import read


T = np.arange(240) / 240
X = np.round(20 * np.sin(6 * np.pi * T), 6)
F = np.round(500 * np.cos(6 * np.pi * T), 6)


def text(
    header="t_s,x_mm,F_N",
    delimiter=",",
    decimal=".",
    form="{:.6f}",
    edit: Callable[[list[str]], list[str]] = lambda lines: lines,
    columns=(T, X, F),
    end="\n",
    encoding="utf-8",
) -> bytes:
    """A record as text, with a fault or a peculiarity."""
    rows = [delimiter.join(form.format(v).replace(".", decimal) for v in row) for row in zip(*columns, strict=True)]
    return (end.join(edit([*header.split("\n"), *rows])) + end).encode(encoding)


def line(number: int, new: str) -> Callable[[list[str]], list[str]]:
    """Replaces the line of this number, from 1."""
    return lambda lines: [*lines[: number - 1], new, *lines[number:]]


def odd() -> Iterator[tuple[str, bytes]]:
    """Files that are to be read."""
    names = {",": ("t_s", "x_mm", "F_N"), "units": ("t [s]", "x [mm]", "F [N]"), "rows": ("t", "x", "F")}
    for delimiter, decimal in product(",;\t| ", ".,"):
        if delimiter != "," or decimal == ".":
            yield f"{delimiter!r} {decimal}", text(delimiter.join(names[","]), delimiter, decimal)
            if delimiter != " ":
                header = delimiter.join(names["rows"]) + "\n" + delimiter.join(("s", "mm", "N"))
                yield f"{delimiter!r} {decimal} row of units", text(header, delimiter, decimal)
    for encoding, end in product(
        ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"), ("\n", "\r\n", "\r")
    ):
        yield f"{encoding} {end!r}", text("Zeit [s],Däm-Weg [mm],F [N]", encoding=encoding, end=end)
    for form in ("{:.9e}", "{:+.6f}", "{:12.6f}", '"{:.6f}"', "{:.6f} ", "{:.9E}"):
        yield f"form {form}", text(form=form)
    yield "D exponents", text(form="{:.9e}", edit=lambda lines: [lines[0], *(n.replace("e", "D") for n in lines[1:])])
    yield "units in the header", text(",".join(names["units"]))
    yield "preamble", text(edit=lambda lines: ["Bench 7, hall 2", "Date: 1.3.2026", "Rate, 240, Hz", "", *lines])
    yield "a preamble of numbers", text(edit=lambda lines: ["offset,1.5,2.5", *lines])
    yield "comments", text(edit=lambda lines: ["# made by hand", "# of wood", *lines])
    yield "blank lines", text(edit=lambda lines: ["", *lines[:50], "", "   ", *lines[50:], "", ""])
    yield "trailing delimiters", text("t_s,x_mm,F_N,", edit=lambda lines: [lines[0], *(n + "," for n in lines[1:])])
    for header in ("t_s,x_mm,F_N,T_degC", "t,x,F,T\ns,mm,N,degC"):
        count = header.count("\n") + 1
        named = text(header, edit=lambda lines, n=count: [*lines[:n], *(row + "," for row in lines[n:])])
        yield f"an unused last channel, {count} lines of header", named
    yield "footer", text(edit=lambda lines: [*lines, "end of record", "checksum 4711"])
    yield "a footer of the same width", text(edit=lambda lines: [*lines, "end,of,record"])
    yield (
        "text columns",
        text(
            "t_s,state,x_mm,F_N,who",
            edit=lambda lines: lines[:1] + [f"{a},run,{b},{c},A. B." for a, b, c in (n.split(",") for n in lines[1:])],
        ),
    )
    yield (
        "an empty column",
        text(
            "t_s,x_mm,spare,F_N",
            edit=lambda lines: lines[:1] + [f"{a},{b},,{c}" for a, b, c in (n.split(",") for n in lines[1:])],
        ),
    )
    yield (
        "an extra column with faults",
        text(
            "t_s,x_mm,F_N,T_degC",
            edit=lambda lines: lines[:1] + [f"{n},{'20.5' if i % 3 else '---'}" for i, n in enumerate(lines[1:])],
        ),
    )
    yield "set points", text("t_s,x_mm,F_N,x target [mm]", columns=(T, X, F, 0 * X))
    yield "milliseconds", text("t [ms],x_mm,F_N", columns=(1e3 * T, X, F))
    yield "kilonewtons and metres", text("t_s,x [m],F [kN]", form="{:.9f}", columns=(T, X / 1e3, F / 1e3))
    yield (
        "inches and pounds",
        text("Time, s;Disp, in;Load, lbs", ";", form="{:.12g}", columns=(T, X / 25.4, F / 4.4482216152605)),
    )
    yield "force before stroke", text("F_N,x_mm,t_s", columns=(F, X, T))
    yield "time of an old epoch", text("t_s,x_mm,F_N", columns=(T + 1.7e9, X, F))


def bad() -> Iterator[tuple[str, bytes, str]]:
    """Files that are to be refused, and what the message must say beside the file."""
    yield "empty", b"", "is empty: export it"
    yield "blank", b" \n\n ", "is empty"
    for kind, begin in (
        ("XLSX", b"PK\3\4"),
        ("MATLAB", b"MATLAB 5.0 MAT"),
        ("TDMS", b"TDSm"),
        ("MDF4", b"MDF     4.10"),
    ):
        yield f"content of {kind}", begin + b"\0" * 99, f"looks like an? {kind}"
    yield "unknown binary", b"\1\2\0" * 200, "not a text file.*as CSV"
    yield "JSON", b'{"t": [' + b"0.1, " * 60000 + b"0]}", "looks like JSON.*as CSV"
    yield "JSON of rows", b"[[0, 1, 2],\n" + b"[0, 1, 2],\n" * 99, "looks like JSON"
    yield "HTML", b"<html><body>0,1,2</body></html>\n" * 30, "looks like HTML"
    yield "prose", b"The damper was noisy.\nWe stopped at noon.\n", "no rows of numbers"
    yield "header only", b"t_s,x_mm,F_N\n", "no rows of numbers"
    yield "one column", text("F_N", columns=(F,)), "only one column of numbers"
    yield "no header", text(edit=lambda lines: lines[1:]), r"no header row.*columns=\{\"time\": 0"
    yield "short", text(edit=lambda lines: lines[:13]), "only 12 samples, too few"
    yield (
        "no stroke",
        text(
            "t_s,x_mm,F_N",
            form="{:.6f}",
            edit=lambda lines: [*lines[:1], *(f"{n.split(',')[0]},,{n.split(',')[2]}" for n in lines[1:])],
        ),
        r"column 'x_mm' \(stroke\) is empty",
    )
    for number in (2, 3, 120, 241):
        yield (
            f"text in line {number}",
            text(edit=line(number, "0.5,overload,1.0")),
            f"line {number}, column 'x_mm': 'overload'",
        )
        yield (
            f"missing in line {number}",
            text(edit=line(number, "0.5,,1.0")),
            f"line {number}, column 'x_mm': the value is missing",
        )
        yield f"nan in line {number}", text(edit=line(number, "0.5,1.0,nan")), f"line {number}: the force .*nan"
        yield f"inf in line {number}", text(edit=line(number, "0.5,-inf,1.0")), f"line {number}: the stroke .*inf"
    for number in (3, 120):
        yield (
            f"short line {number}",
            text(edit=line(number, "0.5,1.0")),
            f"line {number}: 2 values where the file has 3",
        )
        yield f"long line {number}", text(edit=line(number, "0.5,1.0,2.0,3.0")), f"line {number}: 4 values"
        yield f"words in line {number}", text(edit=line(number, "pause")), f"line {number}: 1 values"
        yield f"header again in line {number}", text(edit=line(number, "t_s,x_mm,F_N")), f"line {number}, column 'F_N'"
    for number in (120, 200):
        edit = line(number, "0.1;5,000;3.0")
        yield f"comma in line {number}", text("t_s;x_mm;F_N", ";", edit=edit), f"line {number}: '5,000' has a comma"
        edit = line(number, "0,1;5.000;3,0")
        yield f"point in line {number}", text("t_s;x_mm;F_N", ";", ",", edit=edit), f"'5.000' in line {number} a point"
        yield (
            f"thousands in line {number}",
            text(edit=line(number, '0.5,1.0,"1,234.5"')),
            f"line {number}, .*'1,234.5' is not",
        )
        yield f"time back in line {number}", text(edit=line(number, "0.1,1.0,2.0")), f"line {number}: time goes from"
    thousands = np.arange(1000.0, 1240.0)
    yield (
        "commas without decimals",
        text("t_ms;x_mm;F_N", ";", form="{:,.0f}", columns=(thousands, X, F)),
        "or divide thousands",
    )
    yield "time stands", text(columns=(np.round(T, 1), X, F)), "line 3: time goes from .* but must increase"
    yield "a stroke that stands", text(columns=(T, 0 * X + 3, F)), "the stroke is constant"
    yield "no unit", text("t_s,x,F_N"), r"'x' \(stroke\) names no unit.*units=\{\"stroke\": \"mm\"\}"
    yield "no units", text("t,x,F"), "3 problems"
    yield "an unknown unit", text("t_s,x [parsnips],F [bananas]"), "2 problems.*'bananas' is no known unit of force"
    yield "volts", text("t_s,x [V],F_N"), r"gains=\{\"stroke\": \"10 mm/V\"\}"
    yield "a unit of another quantity", text("t_s,stroke [N],F_N"), "'N' is a unit of force, not of stroke"
    yield "no force", text("t_s,x_mm,v_mm_s"), "no column for the force"
    yield "two strokes", text("t_s,x_mm,F_N,LVDT_mm", columns=(T, X, F, X)), r"could all be the stroke\. Choose one"
    yield "no time", text("x_mm,F_N", columns=(X, F)), "no time column: pass the rate"
    yield (
        "stamps that are none",
        text("time,x_mm,F_N", edit=lambda lines: lines[:1] + ["later," + n.split(",", 1)[1] for n in lines[1:]]),
        "'later' is no time stamp",
    )
    yield "a spring", text("t_s,x_mm,F_N", columns=(T, X, X)), "sign convention cannot be established"
    yield (
        "a wrong velocity",
        text("t_s,x_mm,F_N,v_mm_s", columns=(T, X, F, F)),
        "one of the two has a wrong unit|velocity column",
    )


ODD, BAD = list(odd()), list(bad())


def test_there_are_a_hundred():
    assert len(ODD) + len(BAD) >= 100
    assert len({name for name, *_ in ODD + BAD}) == len(ODD) + len(BAD)


@pytest.mark.parametrize("content", [c for _, c in ODD], ids=[name for name, _ in ODD])
def test_odd_files_are_read_rightly(tmp_path, content):
    (tmp_path / "run.csv").write_bytes(content)
    run = read(tmp_path / "run.csv")[0]
    np.testing.assert_allclose(run.time, T, atol=2e-6)
    np.testing.assert_allclose(run.stroke, X * 1e-3, atol=1e-8)
    np.testing.assert_allclose(run.force, F, atol=1e-5)


@pytest.mark.parametrize(("content", "message"), [(c, m) for _, c, m in BAD], ids=[name for name, *_ in BAD])
def test_bad_files_are_refused_with_file_place_and_remedy(tmp_path, content, message):
    (tmp_path / "run.csv").write_bytes(content)
    with pytest.raises(ValueError, match=rf"(?s)(?=.*run\.csv).*({message})"):
        read(tmp_path / "run.csv")
