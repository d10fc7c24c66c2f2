"""Text files as benches and loggers write them: time stamps, text columns, bars, footers, decimal signs."""

import re

import numpy as np
import pytest

from jaxdamp.bench import read
from jaxdamp.bench.clock import is_stamp, seconds


T = np.arange(600) / 300
X = 20 * np.sin(3 * np.pi * T)
F = 500 * np.cos(3 * np.pi * T)


def table(path, stamps, header="Zeit;x_mm;F_N;state", delimiter=";", cells=("{:.9g}", "{:.9g}", "OK"), more=()):
    rows = [
        delimiter.join((a, cells[0].format(b), cells[1].format(c), cells[2]))
        for a, b, c in zip(stamps, X, F, strict=True)
    ]
    path.write_text("\n".join([header, *rows, *more]) + "\n", encoding="utf-8")
    return path


def clock(t, form):
    day, rest = divmod((86399.5 if "midnight" in form else 33000.25) + t, 86400.0)
    hours, minutes = int(rest // 3600), int(rest % 3600 // 60)
    behind = f"{minutes:02}:{rest % 60:09.6f}"
    if form == "am":
        return f"11/22/2026 {(hours - 1) % 12 + 1}:{behind} {'AM' if hours < 12 else 'PM'}"
    if form == "german":
        return f"22.11.2026 {hours}:{behind}".replace("." + behind[-6:], "," + behind[-6:])
    if form.startswith("iso"):
        mark, zone = (" " if "space" in form else "T"), ("+01:00" if "zone" in form else "")
        return f"2026-{'03-01' if day else '02-28'}{mark}{hours:02}:{behind}{zone}"
    return f"{hours:02}:{behind}"


@pytest.mark.parametrize(
    ("header", "columns"),
    [("compression travel [mm]", {}), ("bump travel [mm]", {}), ("compression [mm]", {"stroke": 1})],
)
def test_a_header_that_says_compression_is_read_so(tmp_path, header, columns):
    speed = 0.025 * 4 * np.pi * np.cos(4 * np.pi * T)
    force = np.where(speed > 0, 3000 * speed, 1500 * speed) + 50
    rows = [f"{t},{x},{-f}" for t, x, f in zip(T, -25 * np.sin(4 * np.pi * T), force, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join([f"time [s],{header},force [N]", *rows]))
    (run,) = read(tmp_path / "run.csv", columns=columns)
    largest = int(np.argmax(run.force))
    assert run.force[largest] == pytest.approx(992.48, rel=1e-3)
    assert run.velocity[largest] == pytest.approx(0.31416, rel=1e-3)


def test_minus_signs_of_spreadsheets(tmp_path):
    rows = [f"{t},{x:.6f},{f:.4e}".replace("-", "\u2212") for t, x, f in zip(T, X, F, strict=True)]
    (tmp_path / "run.csv").write_text("\n".join(["t_s,x_mm,F_N", *rows]), encoding="utf-8")
    np.testing.assert_allclose(read(tmp_path / "run.csv")[0].force, F, atol=1e-2)


@pytest.mark.parametrize(("mark", "cell"), [(",", '"1,200"'), (",", '"-0,5"'), (";", "1 200"), (";", "-1'200")])
def test_thousands_and_decimal_commas_that_are_not_read_are_named(tmp_path, mark, cell):
    def refused(header, rows, words):
        (tmp_path / "run.csv").write_text("\n".join(mark.join(row) for row in [header, *rows]))
        with pytest.raises(ValueError, match=words):
            read(tmp_path / "run.csv")

    bare, advice = cell.strip('"'), "export the file with decimal points and without a sign for thousands"
    refused(["t_s", "F_N"], [["1", cell]] * 30, f"{bare}.*, which is not read as a number: {advice}")
    rows = [[f"{t}", f"{x:.4f}", f"{f:.4f}"] for t, x, f in zip(T, X, F, strict=True)]
    refused(["t_s", "x_mm", "F_N"], [[*row[:2], cell] for row in rows], f"holds text .*{bare}.*: {advice}")
    refused(["t_s", "F_N", "x_mm"], [*rows, ["2.1", cell, cell]], f"{bare}.* is not a number")


@pytest.mark.parametrize(
    "form", ["iso", "iso space", "iso zone", "iso midnight", "clock", "clock midnight", "am", "german"]
)
def test_time_stamps(tmp_path, form):
    run = read(table(tmp_path / "run.csv", [clock(t, form) for t in T]))[0]
    np.testing.assert_allclose(run.time, T, atol=3e-6)
    np.testing.assert_allclose(run.force, F, atol=1e-5)
    assert "time from 'Zeit' in time stamps" in run.notes[0] and "not used: state" in run.notes[0]
    midnight = form == "clock midnight"
    assert f"time counts from the first time stamp{', with midnight in between' if midnight else ''}" in run.notes


def test_epoch_seconds_and_milliseconds(tmp_path):
    for unit, factor in (("s", 1), ("ms", 1000)):
        epoch = [f"{factor * (1.7e9 + t):.6f}" for t in T]
        run = read(table(tmp_path / f"{unit}.csv", epoch, f"timestamp [{unit}];x_mm;F_N;state"))[0]
        np.testing.assert_allclose(run.time, T, atol=2e-6)
        assert any("1700000000.000 s" in note for note in run.notes)


def test_a_column_of_stamps_beside_a_time_column_is_not_used(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"2026-01-01 10:00:00.{i:03},{t},{x},{f}" for i, (t, x, f) in enumerate(zip(T, X, F, strict=True))]
    path.write_text("\n".join(["Date,t_s,x_mm,F_N", *rows]))
    np.testing.assert_allclose(read(path)[0].time, T)


def test_stamps_that_cannot_be_understood():
    assert not is_stamp("12.5") and not is_stamp("-3")
    with pytest.raises(ValueError, match=r"run, line 1: 'soon' is no time stamp.*columns=\{\"time\": None\}"):
        seconds(np.array(["10:00:00", "soon"], dtype=object), "run", lambda i: f"line {i}")
    with pytest.raises(ValueError, match="different time zones"):
        seconds(np.array(["10:00:00Z", "10:00:01+01:00"], dtype=object), "run", str)
    with pytest.raises(ValueError, match="which number is the day"):
        seconds(np.array(["1/2/2026 10:00:00", "2/2/2026 10:00:01"], dtype=object), "run", str)


def test_bars_around_and_between(tmp_path):
    rows = [f"| {t:.6f} | {x:.9g} | {f:.9g} |" for t, x, f in zip(T, X, F, strict=True)]
    (tmp_path / "run.txt").write_text("\n".join(["| t [s] | x [mm] | F [N] |", *rows]))
    run = read(tmp_path / "run.txt")[0]
    np.testing.assert_allclose(run.force, F, atol=1e-5)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
def test_footers_are_left_out_and_counted(tmp_path, delimiter):
    header = delimiter.join(("Zeit [s]", "x_mm", "F_N", "state"))
    more = ["", "Operator: A. B.", delimiter.join(("max", "-", "-", "end"))]
    run = read(table(tmp_path / "a.csv", [f"{t:.6f}" for t in T], header, delimiter, more=more))[0]
    assert len(run) == 600
    assert "2 lines of another form behind the numbers left out, the first is line 603: 'Operator: A. B.'" in run.notes


def test_other_lines_between_rows_are_refused(tmp_path):
    path = table(tmp_path / "a.csv", [f"{t:.6f}" for t in T], "Zeit [s];x_mm;F_N;state")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:200], "pause", *lines[200:]]))
    with pytest.raises(ValueError, match=r"a\.csv, line 201: 1 values where the file has 4 columns"):
        read(path)
    path.write_text("\n".join([*lines[:200], lines[0], *lines[200:]]))
    with pytest.raises(ValueError, match=r"(?s)3 problems.*line 201, column 'F_N': 'F_N' is not a number"):
        read(path)


def test_two_decimal_signs_are_refused(write):
    rows = {300: "1;5,000;3.5"}
    with pytest.raises(ValueError, match=r"run\.csv, line 302: '5,000' has a comma, '.*' in line 3 a point"):
        read(write(header="t_s;x_mm;F_N", delimiter=";", replace=rows))
    with pytest.raises(ValueError, match=r"line 11: '1,234\.5' has a comma"):
        read(write(header="t_s;x_mm;F_N", delimiter=";", replace={9: "0.03;1,234.5;3.5"}))


@pytest.mark.parametrize("units", ["", "ms,mm,N\n"])
@pytest.mark.parametrize("count", [4, 5, 6])
def test_decimal_commas_between_commas_are_refused(tmp_path, units, count):
    rows = "".join(",".join(["2,0,-251,6,283,007".split(",")[i] for i in range(count)]) + "\n" for _ in range(30))
    (tmp_path / "a.csv").write_text(f"rig 7,\nt,stroke,force\n{units}{rows}")
    with pytest.raises(ValueError, match=rf"line 2 has 3 names, .* {count} whole .*cannot be told apart.*semicolons"):
        read(tmp_path / "a.csv")


@pytest.mark.parametrize(("head", "rows"), [("", "1,2,3\n"), ("front,rear\n", "1,2,3\n"), ("t,F\n", "1,2.5,3\n")])
def test_whole_numbers_that_no_names_explain_have_columns_by_number(tmp_path, head, rows):
    (tmp_path / "a.csv").write_text(head + 30 * rows)
    with pytest.raises(ValueError, match=r"has no header row.*columns="):
        read(tmp_path / "a.csv")


def test_commas_that_may_divide_thousands_are_refused(tmp_path):
    rows = [f"{i};{i % 20};{1000 + i:,}" for i in range(1, 60)]
    (tmp_path / "a.csv").write_text("\n".join(["t_ms;x_mm;F_N", *rows]))
    with pytest.raises(ValueError, match=r"line 2: the comma in '1,001' may be a decimal sign or divide thousands"):
        read(tmp_path / "a.csv")


def test_faults_in_channels_that_are_not_needed_stop_nothing(write):
    temperature = np.full(600, 40.0)
    path = write(header="t_s,x_mm,F_N,T_degC,spare", extra=[temperature, temperature])
    text = path.read_text().splitlines()
    text[50] = ",".join([*text[50].split(",")[:3], "", "broken"])
    path.write_text("\n".join(text))
    run = read(path)[0]
    assert run.temperature is None and len(run) == 600
    assert any(
        "temperature left out: " in note and "line 51, column 'T_degC': the value is missing" in note
        for note in run.notes
    )
    for header, why in (("t_s,x_mm,F_N,temp,spare", "names no unit"), ("t_s,x_mm,F_N,T_degC,T2_degC", "Choose one")):
        run = read(write("b.csv", header=header, extra=[temperature, temperature]))[0]
        assert run.temperature is None and any(why in note for note in run.notes)
    run = read(write("v.csv", header="t_s,x_mm,F_N,v_mm_s", extra=[np.full(600, np.nan)]))[0]
    assert any("velocity left out: " in n and "is nan" in n for n in run.notes) and "harmonic" in run.notes[-1]
    with pytest.raises(ValueError, match="Choose one"):
        read(
            write("c.csv", header="t_s,x_mm,F_N,temp [K],temp [degC]", extra=[temperature] * 2),
            units={"temperature": "K"},
        )


def test_all_problems_of_a_file_in_one_message(write):
    with pytest.raises(
        ValueError, match=r"(?s)2 problems:.*1\. .*'x' \(stroke\) names no unit.*2\. .*'F' \(force\) names no"
    ):
        read(write(header="t_s,x,F"))


def test_a_problem_of_several_files_is_said_once(write, tmp_path):
    files = [write(f"{name}.csv", header="t_s,x,F") for name in ("a", "b", "c")]
    others = rf"The same in {re.escape(str(files[1]))}, {re.escape(str(files[2]))}\."
    said = rf"(?s)^2 problems:\n.*a\.csv, column 'x'[^\n]*{others}\n.*a\.csv, column 'F'[^\n]*{others}$"
    with pytest.raises(ValueError, match=said):
        read(tmp_path)


def test_all_problems_of_a_folder_and_skipping_them(write, tmp_path):
    write("good.csv")
    write("one.csv", header="t_s,x,F")
    (tmp_path / "two.csv").write_text("")
    with pytest.raises(ValueError, match=r"(?s)3 problems:.*one\.csv, column 'x'.*two\.csv is empty"):
        read(tmp_path)
    runs = read(tmp_path, skip_bad=True)
    assert runs.names == ("good",)
    assert len(runs.left_out) == 2 and "2 problems" in runs.left_out[0] and "two.csv is empty" in runs.left_out[1]
    assert "left out 2" in repr(runs) and "two.csv is empty" in runs.describe()
    (tmp_path / "good.csv").unlink()
    with pytest.raises(ValueError, match="3 problems"):
        read(tmp_path, skip_bad=True)
