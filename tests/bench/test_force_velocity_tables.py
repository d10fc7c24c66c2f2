"""Force-velocity tables: units, signs, directions and settings as sheets have them; and several tests in one file."""

import jax.numpy as jnp
import numpy as np
import openpyxl
import pytest
from matplotlib.text import Text

from jaxdamp import bench, dampers, identify
from jaxdamp._display import Display, shown_in
from jaxdamp.bench.settings import settings_in_name
from jaxdamp.dampers import Bilinear, SplineTable, with_command
from jaxdamp.export import to_csv
from jaxdamp.parameters import get
from jaxdamp.plots import force_velocity_family


LBF, INCH = 4.4482216152605, 0.0254
SI = {"velocity": "m/s", "force": "N"}
SHEET = "velocity [in/s],R1 [lbf],R2 [lbf],C1 [lbf],C2 [lbf]\n1,10,20,5,6\n5,40,60,15,18\n"


def written(folder, text, name="sheet.csv"):
    (folder / name).write_text(text)
    return folder / name


def test_a_sheet_in_pounds_is_a_family(tmp_path):
    written(tmp_path, SHEET)
    table = bench.read_table(tmp_path.glob("*.csv"))
    assert table.settings == ("1", "2") and table.is_family
    assert np.allclose(table.curves[1].velocity, np.array([-5, -1, 0, 1, 5]) * INCH)
    assert np.allclose(table.curves[1].force, np.array([-18, -6, 0, 20, 60]) * LBF)
    law = table.law()
    assert float(with_command(law, 1.5).force(0.0, 5 * INCH, law.initial_state())) == pytest.approx(50 * LBF)
    assert law.fitted_to is not None and law.fitted_to.command == (1.0, 2.0)
    assert isinstance(table.law("2", SplineTable), SplineTable)
    assert len(force_velocity_family(table).axes[0].lines) >= 2


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("v [m/s],F [N]\n-0.2,-30\n-0.1,-20\n0.1,50\n0.2,70\n", {"sign": "rebound-positive"}),
        ("v [m/s],F [N]\n0.2,30\n0.1,20\n-0.1,-50\n-0.2,-70\n", {"sign": "compression-positive"}),
        ("v [m/s],F [N]\n-0.2,30\n-0.1,20\n0.1,-50\n0.2,-70\n", {"sign": "rebound-positive"}),
        ("v [m/s],F [N]\n-0.2,30\n-0.1,20\n0.1,50\n0.2,70\n", {"sign": "rebound-positive"}),
        ("v [m/s],F [N]\n0.1,20\n0.2,30\n0.1,-50\n0.2,-70\n", {"sign": "compression-positive"}),
        ("v [mm/s];rebound [N];bump [N]\n100;50;-20\n200;70;-30\n", {}),
        ("speed,load,direction\n0.1,50,reb\n0.2,70,reb\n0.1,20,comp\n0.2,30,comp\n", {"units": SI}),
    ],
)  # fmt: skip
def test_every_way_to_write_directions_gives_the_same_points(tmp_path, text, options):
    (curve,) = bench.read_table(written(tmp_path, text), **options).curves
    moving = curve.velocity != 0.0
    assert np.allclose(curve.velocity[moving], [-0.2, -0.1, 0.1, 0.2])
    assert np.allclose(curve.force[moving], [-30, -20, 50, 70]) and not np.any(curve.force[~moving])


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("v [m/s],F [N]\n-0.1,-20\n0.1,50\n", {}, 'sign="compression-positive"'),
        ("v [m/s],F [N]\n0.1,20\n0.1,-50\n", {}, "positive forces may be rebound or compression"),
        ("v [m/s],F [N]\n0.1,20\n0.2,50\n", {}, 'side="symmetric"'),
        ("v [m/s],F [N]\n0.1,20\n0.2,50\n", {"side": "rebound"}, "no points in compression"),
        ("v,F [N]\n0.1,20\n0.2,50\n", {"side": "symmetric"}, "names no unit"),
        ("t [s],v [m/s],F [N]\n0,0.1,20\n1,0.2,50\n", {}, "is no force-velocity table"),
        ("v [m/s],F [N]\n0.1,20\n0.2,50\n", {"side": "up"}, "`side` must be one of"),
    ],
)
def test_what_the_file_does_not_say_is_asked_for(tmp_path, text, options, words):
    with pytest.raises(ValueError) as caught:
        bench.read_table(written(tmp_path, text), **options)
    assert words in str(caught.value)


def test_of_tables_among_records_the_tables_are_named(tmp_path):
    records = [tmp_path / "1.csv", tmp_path / "2.csv"]
    for record in records:
        record.write_text("t_s,x_mm,F_N\n0,0,20\n1,1,50\n")
    table = written(tmp_path, "v [m/s],F [N]\n-0.1,-20\n0.1,50\n")
    with pytest.raises(ValueError) as caught:
        bench.read_table([table, *records])
    assert f"are t_s, x_mm, F_N. Further files that are none: 1. Give {table} apart from records." in str(caught.value)


@pytest.mark.parametrize("sign", ["rebound-positive", "compression-positive"])
def test_the_table_of_a_law_says_its_sign(tmp_path, sign):
    law = Bilinear(2600.0, 1200.0)
    with shown_in(Display(sign=sign)):
        to_csv(law, tmp_path / "law.csv", np.linspace(-0.5, 0.5, 11))
    curve = bench.read_table(tmp_path / "law.csv").curves[0]
    np.testing.assert_allclose(curve.force, law.force_velocity(jnp.asarray(curve.velocity)), rtol=1e-9, atol=1e-9)


def test_a_manifest_says_how_a_table_is_read(tmp_path):
    folder = tmp_path / "sheets"
    folder.mkdir()
    written(folder, "velocity [m/s],force\n-0.5,-30\n0.5,50\n")
    manifest = folder / "jaxdamp.toml"
    manifest.write_text('sign = "compression-positive"\n[units]\nforce = "kgf"\n')
    table = bench.read_table(folder)
    assert bench.are_tables(folder) and f"read as the manifest {manifest} says" in table.notes
    np.testing.assert_allclose(table.curves[0].force, [-50 * 9.80665, 0.0, 30 * 9.80665][::2], rtol=1e-12)
    given = bench.read_table(folder, units={"force": "N"}, sign="rebound-positive")
    np.testing.assert_allclose(given.curves[0].force, [-30.0, 50.0])
    manifest.write_text("command = 3\n")
    with pytest.raises(ValueError, match="unknown key 'command'; there are sign, columns, units"):
        bench.read_table(folder)


def test_letters_of_types_and_adjusters_are_no_direction(tmp_path):
    signed = "velocity [m/s],force [N]\n-0.2,-30\n-0.1,-20\n0.1,50\n0.2,70\n"
    (curve,) = bench.read_table(written(tmp_path, signed, "audi_r8.csv"), sign="rebound-positive").curves
    np.testing.assert_allclose(curve.force, [-30.0, -20.0, 50.0, 70.0])
    adjusted = "velocity [m/s],rebound C4 R6 [N],rebound C4 R8 [N],compression [N]\n0.1,50,55,20\n0.2,70,75,30\n"
    table = bench.read_table(written(tmp_path, adjusted))
    assert table.settings == ("C4 R6", "C4 R8")
    assert [curve.force[-1] for curve in table.curves] == [70.0, 75.0]
    halves = [
        written(tmp_path, f"velocity [m/s],force [N]\n0.1,{f}\n", f"front_{s}.csv") for s, f in (("r", 50), ("c", 20))
    ]
    np.testing.assert_allclose(bench.read_table(halves).curves[0].force, [-20.0, 0.0, 50.0])


@pytest.mark.parametrize(("head", "way"), [("rebound [N],reb [N],bump [N]", "rebound"), ("3 clicks,3 clk,4 clk", "")])
def test_two_columns_for_one_setting_are_refused(tmp_path, head, way):
    rows = "0.1,50,55,20\n0.2,60,65,30\n" if way else "0.1,50,55,20\n-0.1,-50,-55,-20\n"
    with pytest.raises(ValueError, match=rf"columns .* and .* both give the force in {way}.*keep one of them"):
        bench.read_table(written(tmp_path, f"v [m/s],{head}\n{rows}"), units={"force": "N"}, sign="rebound-positive")


def test_settings_below_zero_keep_their_sign(tmp_path):
    for head in ("R -2 [N],R 0 [N],R +2 [N],C -2 [N],C 0 [N],C +2 [N]", "R-click -2 [N],R 0,R 2,C -2 clicks,C 0,C 2"):
        text = f"velocity [m/s],{head}\n0.1,100,200,300,50,100,150\n"
        table = bench.read_table(written(tmp_path, text), units={"force": "N"})
        assert table.settings == ("-2", "0", "2")
        assert [curve.force[-1] for curve in table.curves] == [100.0, 200.0, 300.0]
    names = {"r_-2clicks": -2.0, "-2 clicks": -2.0, "run-2clicks": 2.0, "clicks_-3": -3.0, "a - 3clicks": 3.0}
    assert {name: settings_in_name(name)["clicks"] for name in names} == names
    assert settings_in_name("x_-0.5A") == {"current": -0.5}


def test_settings_stand_in_rows_blocks_sheets_and_headers(tmp_path):
    rows = "clicks,v [m/s],reb [N],comp [N]\n1,0.1,10,5\n1,0.2,20,9\n2,0.1,12,5\n2,0.2,22,9\n"
    blocks = (
        "1 clk\nv [m/s],reb [N],comp [N]\n0.1,10,5\n0.2,20,9\n\n2 clk\nv [m/s],reb [N],comp [N]\n0.1,12,5\n0.2,22,9\n"
    )
    numbers = "v [m/s],1,2\n-0.2,-9,-9\n-0.1,-5,-5\n0.1,10,12\n0.2,20,22\n"
    book = openpyxl.Workbook()
    for clicks, forces in ((1, (10, 20)), (2, (12, 22))):
        sheet = book.create_sheet(f"{clicks} clicks")
        for row in (("v [m/s]", "rebound [N]", "compression [N]"), (0.1, forces[0], 5), (0.2, forces[1], 9)):
            sheet.append(row)
    book.save(tmp_path / "book.xlsx")
    tables = [
        bench.read_table(written(tmp_path, rows, "rows.csv")),
        bench.read_table(written(tmp_path, blocks, "blocks.csv")),
        bench.read_table(written(tmp_path, numbers, "n.csv"), units={"force": "N"}, sign="rebound-positive"),
        bench.read_table(tmp_path / "book.xlsx"),
    ]
    for table in tables:
        assert table.settings == ("1", "2")
        assert np.allclose([c.force[c.velocity != 0] for c in table.curves], [[-9, -5, 10, 20], [-9, -5, 12, 22]]), (
            table.name
        )


def test_a_law_is_fitted_to_a_table(tmp_path):
    table = bench.read_table(written(tmp_path, "v [m/s],F [N]\n0.1,100\n0.2,200\n0.5,500\n"), side="symmetric")
    result = identify.fit(identify.default_ladder(table.runs(), ["linear"])["linear"], table.runs())
    assert float(get(result.law, "rate")) == pytest.approx(1000.0, rel=1e-3)


def test_a_table_without_slow_points_is_fitted_beside_an_offset_and_drawn_as_points(tmp_path):
    velocity = np.array([-0.5, -0.3, -0.1, 0.05, 0.3, 0.5])  # none below a tenth of the largest
    rows = "\n".join(f"{v},{2000.0 * v - 60.0}" for v in velocity)
    runs = bench.read_table(written(tmp_path, f"v [m/s],F [N]\n{rows}\n"), sign="rebound-positive").runs()
    result = identify.fit(dampers.Linear, runs, rig=["offset", "gas_stiffness"], freeze=["gas_stiffness"])
    assert result["force_offset"].value == pytest.approx(-60.0, abs=0.1)
    compared = identify.compare({"linear": dampers.Linear}, runs)
    for figure in (result.plot(), compared.plot("loops")):
        (axes,) = figure.axes
        points = next(line for line in axes.lines if line.get_label() == "points of the table")
        np.testing.assert_allclose(np.sort(points.get_xdata()), velocity)
    assert "noise" not in "".join(text.get_text() for text in compared.plot().findobj(Text))  # points have none
    with pytest.raises(ValueError, match=r"`low_pass` must be asked for of records over time, but is 20.0 for"):
        runs[0].process(low_pass=20.0)


def test_a_fit_to_a_table_knows_its_points_and_no_more(tmp_path):
    """Errors are those of least squares over the points, which are left out whole; free curves predict worse."""
    velocity = np.array([-1.048, -0.524, -0.262, -0.131, -0.052, 0.052, 0.131, 0.262, 0.524, 1.048])
    force = 2000.0 * velocity + np.random.default_rng(1).normal(0.0, 60.0, 10)
    rows = "\n".join(f"{v},{f}" for v, f in zip(velocity, force, strict=True))
    runs = bench.read_table(written(tmp_path, f"v [m/s],F [N]\n{rows}\n"), sign="rebound-positive").runs()
    result = identify.fit(dampers.Linear, runs, rig="offset")
    slope = np.polynomial.polynomial.polyfit(velocity, force, 1)
    left = force - np.polynomial.polynomial.polyval(velocity, slope)
    error = np.sqrt(np.sum(left**2) / 8 / np.sum((velocity - velocity.mean()) ** 2))
    assert result["rate"].value == pytest.approx(slope[1], rel=1e-6)
    assert result["rate"].standard_error == pytest.approx(error, rel=1e-6)
    ladder = identify.compare(identify.default_ladder(runs, ["linear", "polynomial", "piecewise_linear"]), runs)
    assert ladder.best.name == "linear" and "each quarter of the points" in ladder.verdict[0]
    held_out = {rung.name: rung.error for rung in ladder.rungs}
    assert held_out["polynomial"] > held_out["linear"] > np.sqrt(np.mean(left**2))
    assert not any("hysteresis" in sentence for sentence in ladder.verdict)
    assert identify.error_shares(result.law, runs) == (0.0, 0.0, 1.0)
    assert not bench.preflight(runs).findings  # nothing is wrong with a motion that there was not


SIGNED = "v [m/s],F [N]\n-0.2,-{0}\n-0.1,-20\n0.1,50\n0.2,70\n"
HALF = "v [m/s],F [N]\n0.1,20\n0.2,{0}\n"


@pytest.mark.parametrize(
    ("text", "files", "settings"),
    [
        (SIGNED, {"soft.csv": 30, "hard.csv": 90}, {"hard": -90, "soft": -30}),
        (SIGNED, {"fsd_a_0.5A.csv": 30, "fsd_a_1A.csv": 90}, {"0.5": -30, "1": -90}),
        (SIGNED, {"rear_L.csv": 30, "rear_R.csv": 90}, {"L": -30, "R": -90}),
        (SIGNED.replace("F", "4 clicks"), {"a.csv": 30, "b.csv": 90}, {"a 4": -30, "b 4": -90}),
        (HALF, {"rebound.csv": 70, "compression.csv": 30}, {"": -30}),
        (HALF, {"R_1.csv": 70, "R_2.csv": 75, "C_1.csv": 30, "C_2.csv": 90}, {"1": -30, "2": -90}),
        (HALF, {"rebound_1.csv": 70, "rebound_2.csv": 75, "compression.csv": 30}, {"1": -30, "2": -30}),
    ],
)
def test_files_of_one_direction_are_joined_and_others_are_settings(tmp_path, text, files, settings):
    for name, force in files.items():
        written(tmp_path, text.format(force), name)
    table = bench.read_table(tmp_path, sign="rebound-positive")
    assert {curve.setting: curve.force[0] for curve in table.curves} == settings
    assert all(name in str(table.notes) and name.removesuffix(".csv") in table.name for name in files)


def test_files_of_one_name_that_give_the_same_are_refused(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        written(tmp_path / folder, SIGNED.format(30))
    message = (
        r"a/sheet.csv, column .* and .*b/sheet.csv.* both give the force in .*names of files and sheets, or keep one"
    )
    with pytest.raises(ValueError, match=message):
        bench.read_table([tmp_path / "a", tmp_path / "b"], sign="rebound-positive")


@pytest.mark.parametrize("name", ["rear_R.csv", "left_c.csv"])
def test_a_letter_in_the_name_of_a_file_with_signs_is_a_side_of_the_car(tmp_path, name):
    (curve,) = bench.read_table(written(tmp_path, SIGNED.format(30), name), sign="rebound-positive").curves
    np.testing.assert_allclose(curve.force, [-30.0, -20.0, 50.0, 70.0])
    way = "rebound" if name == "rear_R.csv" else "compression"
    with pytest.raises(ValueError, match=f"the name of its file or sheet says is {way}: subtract .* or rename it"):
        bench.read_table(written(tmp_path, HALF.format(-30), name))


@pytest.mark.parametrize("head", ["v_in_s,F_lbf", "v_in_s,R_lbf,C_lbf", "v_in_s,rebound_lbf,compression_lbf"])
def test_a_unit_behind_an_underscore_is_no_setting(tmp_path, head):
    rows = "1,10,5\n5,40,15\n" if "," in head[7:] else "-1,-5\n1,10\n"
    table = bench.read_table(written(tmp_path, f"{head}\n{rows}"), sign="rebound-positive")
    assert table.settings == ("",)


def test_forces_at_rest_are_those_of_the_sheet_and_no_note_denies_them(tmp_path):
    table = bench.read_table(written(tmp_path, "v [m/s],rebound [N],compression [N]\n0,40,30\n0.1,400,200\n"))
    assert table.curves[0].force.tolist() == [-200.0, 5.0, 400.0]
    assert "points at the same velocity are averaged" in table.notes and "no force at rest" not in str(table.notes)


TIME = np.arange(400) / 200
WAVE = 20 * np.sin(9 * TIME), 0.5 * np.cos(9 * TIME)


def test_tests_in_one_file_are_split_and_said(tmp_path):
    one = [f"{t:.4f},{x:.5f},{f:.6f}" for t, x, f in zip(TIME, *WAVE, strict=True)]
    head = "t_s,x_mm,F_kN"
    restart = bench.read(written(tmp_path, "\n".join([head, *one, *one]), "restart.csv"))
    assert restart.names == ("restart/test 1", "restart/test 2") and "starts again" in restart[1].describe()
    column = [f"{k},{row}" for k in (7, 8) for row in one]
    numbered = bench.read(written(tmp_path, "\n".join([f"Test No.,{head}", *column]), "numbered.csv"))
    assert numbered.names == ("numbered/test 7", "numbered/test 8")
    short = [*column[:400], *(f"9,{row}" for row in one[:12]), *column[400:]]
    spared = bench.read(written(tmp_path, "\n".join([f"Test No.,{head}", *short]), "short.csv"))
    assert spared.names == ("short/test 7", "short/test 8")
    assert "test 9 of the file left out: 12 rows, and a record needs 20" in spared[0].notes
    blocks = bench.read(written(tmp_path, "\n".join(["Test 0.5A", head, *one, "Test 1A", head, *one]), "blocks.csv"))
    assert blocks.names == ("blocks/Test 0.5A", "blocks/Test 1A")
    assert [run.settings["current"] for run in blocks] == [0.5, 1.0] and "by its name" in blocks[0].describe()
    for runs in (restart, numbered, blocks):
        assert all(len(run) == 400 for run in runs)


def test_a_record_whose_time_only_stumbles_is_still_refused(tmp_path):
    times = TIME.copy()
    times[200:] -= 0.3
    rows = [f"{t:.4f},{x:.5f},{f:.6f}" for t, x, f in zip(times, *WAVE, strict=True)]
    with pytest.raises(ValueError, match="must increase"):
        bench.read(written(tmp_path, "\n".join(["t_s,x_mm,F_kN", *rows]), "a.csv"))


@pytest.mark.parametrize("headers", ["rebound [N],compression [N]", "4 clicks rebound [N],4 clicks compression [N]"])
def test_a_row_at_zero_velocity_belongs_to_both_directions(tmp_path, headers):
    file = tmp_path / "sheet.csv"
    file.write_text(f"velocity [m/s],{headers}\n0,0,0\n0.1,200,100\n0.2,300,150\n")
    (curve,) = bench.read_table(file).curves
    np.testing.assert_allclose(curve.velocity, [-0.2, -0.1, 0.0, 0.1, 0.2])
    np.testing.assert_allclose(curve.force, [-150.0, -100.0, 0.0, 200.0, 300.0])
