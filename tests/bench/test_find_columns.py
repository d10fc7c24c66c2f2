from pathlib import Path

import numpy as np
import pint
import pytest

from jaxdamp import bench
from jaxdamp.bench import units
from jaxdamp.bench.columns import Choice, find_columns as find
from jaxdamp.bench.headers import role_of
from jaxdamp.bench.raw import RawColumn, RawTable
from jaxdamp.bench.units import conversion


def _table(*names: str, units: tuple[str, ...] = (), count: int = 0) -> RawTable:
    names = names or ("",) * count
    units = units or ("",) * len(names)
    return RawTable(Path("run.csv"), tuple(RawColumn(n, np.zeros(30), u) for n, u in zip(names, units, strict=True)))


def find_columns(table, columns=None, units=None, gains=None):
    return find(table, Choice(columns or {}, units or {}, gains or {}))[0]


@pytest.mark.parametrize(
    ("header", "role"),
    [
        ("t_s", "time"),
        ("T_degC", "temperature"),
        ("x_mm", "stroke"),
        ("Displacement, in", "stroke"),
        ("v/(m/s)", "velocity"),
        ("v_mm_s", "velocity"),
        ("F/N", "force"),
        ("Load cell temperature [°C]", "temperature"),
        ("Damper force (kN)", "force"),
        ("StrokeVelocity [mm/s]", "velocity"),
        ("Load, lbs", "force"),
        ("Zeit [s]", "time"),
        ("s [mm]", "stroke"),
        ("Dämpferkraft [daN]", "force"),
        ("Temps (s)", "time"),
        ("Course (mm)", "stroke"),
        ("Déplacement (mm)", "stroke"),
        ("Vitesse [mm/s]", "velocity"),
        ("Effort (N)", "force"),
        ("Corsa [mm]", "stroke"),
        ("Forza [N]", "force"),
        ("Consigne de déplacement (mm)", None),
        ("Weg Sollwert [mm]", None),
        ("Displacement setpoint [mm]", None),
        ("Acceleration [m/s^2]", None),
        ("cycle", None),
    ],
)
def test_role_of_a_header(header, role):
    assert role_of(header) == role


def test_units_from_headers_rows_and_arguments():
    found = find_columns(_table("t_s", "Displacement, in", "Velocity (in/s)", "force lbf", "temp [degC]"))
    assert {role: column.unit for role, column in found.items()} == {
        "time": "s",
        "stroke": "in",
        "velocity": "in/s",
        "force": "lbf",
        "temperature": "degC",
    }
    found = find_columns(_table("time", "stroke", "force", units=("ms", "mm", "kN")))
    assert found["force"].unit == "kN"
    found = find_columns(_table("time [s]", "stroke", "force [N]"), units={"stroke": "mm", "force": "kN"})
    assert (found["stroke"].unit, found["force"].unit) == ("mm", "kN")


def test_columns_by_name_number_and_none():
    table = _table("t_s", "LVDT_mm", "string pot_mm", "x_mm", "F_N", "v_m_s")
    found = find_columns(table, {"stroke": "LVDT_mm", "velocity": None, "force": 4})
    assert (found["stroke"].index, found["force"].index, "velocity" in found) == (1, 4, False)
    units = {"time": "s", "stroke": "mm", "force": "N"}
    assert len(find_columns(_table(count=3), {"time": 0, "stroke": 1, "force": 2}, units)) == 3


def test_a_header_is_named_without_its_unit():
    table = _table("t_s", "Hub [mm]", "X [mm]", "F_N")
    assert find_columns(table, {"stroke": "hub"})["stroke"].index == 1
    with pytest.raises(ValueError, match=r"has 2 columns of that name.*columns=\{\"stroke\": 1\}"):
        find_columns(_table("t_s", "x [mm]", "x [mm]", "F_N"), {"stroke": "x"})


def test_two_columns_for_one_role():
    with pytest.raises(ValueError, match=r"'LVDT_mm' and 'x_mm' could all be the stroke\. Choose one: columns="):
        find_columns(_table("t_s", "LVDT_mm", "x_mm", "F_N"))


def test_no_unit_is_an_error_with_the_remedy():
    with pytest.raises(ValueError, match=r"column 'stroke' \(stroke\) names no unit.*units=\{\"stroke\": \"mm\"\}"):
        find_columns(_table("time [s]", "stroke", "force [N]"))


def test_unknown_unit_suggests():
    with pytest.raises(
        ValueError, match=r"column 'stroke \[mmm\]': 'mmm' is no known unit of stroke\. Did you mean 'mm'"
    ):
        find_columns(_table("time [s]", "stroke [mmm]", "force [N]"))
    with pytest.raises(ValueError, match="'mm' is a unit of stroke, not of force"):
        find_columns(_table("time [s]", "stroke [mm]", "force [N]"), units={"force": "mm"})


def test_missing_column_and_header():
    with pytest.raises(ValueError, match=r"no column for the force: its columns are 't_s', 'x_mm'"):
        find_columns(_table("t_s", "x_mm"))
    with pytest.raises(ValueError, match=r"no header row.*columns=\{\"time\": 0"):
        find_columns(_table(count=3))


def test_wrong_names():
    with pytest.raises(ValueError, match="Did you mean 'x_mm'"):
        find_columns(_table("t_s", "x_mm", "F_N"), {"stroke": "x_m"})
    with pytest.raises(ValueError, match=r"has columns 0 to 2"):
        find_columns(_table("t_s", "x_mm", "F_N"), {"stroke": 3})
    with pytest.raises(ValueError, match="Did you mean 'stroke'"):
        find_columns(_table("t_s", "x_mm", "F_N"), {"strok": 1})
    with pytest.raises(ValueError, match="`units` must be one of"):
        find_columns(_table("t_s", "x_mm", "F_N"), units={"displacement": "mm"})


@pytest.mark.parametrize(
    ("role", "unit", "value", "si"),
    [
        ("stroke", "in", 1.0, 0.0254),
        ("stroke", "cm", 1.0, 0.01),
        ("stroke", "µm", 1.0, 1e-6),
        ("velocity", "in/s", 10.0, 0.254),
        ("velocity", "mm/sec", 1.0, 1e-3),
        ("force", "lbf", 1.0, 4.4482216152605),
        ("force", "kgf", 1.0, 9.80665),
        ("force", "kN", 2.0, 2000.0),
        ("time", "ms", 5.0, 0.005),
        ("time", "Sec", 5.0, 5.0),
        ("temperature", "degC", 20.0, 293.15),
        ("temperature", "°F", 212.0, 373.15),
    ],
)
def test_conversion_to_si(role, unit, value, si):
    found = conversion(role, unit)
    assert found is not None
    assert found(np.array([value]))[0] == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("role", "unit"), [("stroke", "N"), ("force", "kg"), ("time", ""), ("force", "-"), ("time", "3 s")]
)
def test_what_is_no_unit(role, unit):
    assert conversion(role, unit) is None


def test_the_factors_of_usual_units_are_those_of_pint():
    registry = pint.UnitRegistry()
    for role, factors in units._KNOWN.items():
        for unit, factor in factors.items():
            assert factor == pytest.approx(
                registry.Quantity(1.0, unit).to(units.SI.get(role, "V")).magnitude, rel=1e-15
            )
            others = set(units.SI) - {role, "command" if role == "signal" else role}
            assert not any(conversion(other, unit) for other in others)


def written(tmp_path, head):
    """A record of ten seconds below the lines of a header."""
    rows = [f"{i / 100},{np.sin(i / 10):.6f},{np.cos(i / 10):.6f}" for i in range(1000)]
    path = tmp_path / "record.csv"
    path.write_text("\n".join([*head, *rows]))
    return path


@pytest.mark.parametrize(
    "head",
    [["t_s,x_mm,F_N"], ["time [s],stroke [mm],force [kN]"], ["Time,Displacement,Load", "s,in,N"], ["Zeit,Weg,Kraft_V"]],
)
def test_usual_headers_are_read_without_pint(head, tmp_path, monkeypatch):
    def refused():
        raise AssertionError("pint takes half a second to load")

    for cached in (units.conversion, units.is_unit, units.ratio):
        cached.cache_clear()
    monkeypatch.setattr("jaxdamp._unit_registry.unit_registry", refused)
    more: dict = (
        {"units": {"time": "s", "stroke": "mm"}, "gains": {"force": "500 N/V"}} if "Zeit,Weg,Kraft_V" in head else {}
    )
    run = bench.read(written(tmp_path, head), sign="rebound-positive", **more)[0]
    assert len(run) == 1000


def test_a_row_of_unusual_units_is_one(tmp_path):
    head = ["Time,Velocity,Load", "s,km/h,kip"]
    run = bench.read(written(tmp_path, head), sign="rebound-positive", stroke_from_velocity=True)[0]
    assert np.max(np.abs(run.velocity)) == pytest.approx(1 / 3.6, rel=1e-3)
    assert np.max(np.abs(run.force)) == pytest.approx(4448.22, rel=1e-3)


@pytest.mark.parametrize(("written", "hint"), [("-", ""), ("–", ""), ("bananas", ""), ("lbff", "Did you mean 'lbf'? ")])
def test_a_unit_is_proposed_only_where_it_is_near(written, hint):
    with pytest.raises(ValueError) as refused:
        find_columns(_table("t", "x", "F", units=("s", "mm", written)))
    assert f"{written!r} is no known unit of force. {hint}Usual ones are N, kN" in str(refused.value)
    assert f'pass units={{"force": "{"lbf" if hint else "N"}"}}' in str(refused.value)


@pytest.mark.parametrize("read", [bench.read, bench.read_table])
@pytest.mark.parametrize(("name", "value"), [("columns", 5), ("units", ["mm"])])
def test_columns_that_are_no_mapping_are_refused_by_name(tmp_path, read, name, value):
    (tmp_path / "a.csv").write_text("time [s],stroke [m],force [N]\n0,0,1\n")
    with pytest.raises(ValueError, match=f"`{name}` must be a mapping of quantities.*Write a dictionary"):
        read(tmp_path / "a.csv", **{name: value})
