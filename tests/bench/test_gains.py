import numpy as np
import pytest

from jaxdamp._unit_registry import unit_registry
from jaxdamp.bench import read, units
from jaxdamp.bench.units import gain_conversion


@pytest.mark.parametrize(
    ("role", "gain", "unit", "value", "si"),
    [
        ("force", "500 N/V", "V", 2.0, 1000.0),
        ("force", "500 N/V", "mV", 2.0, 1.0),
        ("force", "500 N/V", "", 2.0, 1000.0),
        ("force", "0.5 kN / V + 20 N", "V", 2.0, 1020.0),
        ("stroke", "10 mm/V - 2.5 mm", "V", 1.0, 0.0075),
        ("velocity", "0.5 m/s/V", "V", 2.0, 1.0),
        ("velocity", "0.5 (m/s)/V", "V", 2.0, 1.0),
        ("stroke", "0.01 mm/digits", "digits", 100.0, 0.001),
        ("temperature", "100 K/V", "V", 3.0, 300.0),
        ("temperature", "100 degC/V", "V", 0.5, 323.15),
        ("temperature", "100 degC/V - 10 degC", "V", 0.5, 313.15),
    ],
)
def test_gain_and_offset(role, gain, unit, value, si):
    assert gain_conversion(role, gain, unit, "run")(np.array([value]))[0] == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("gain", "unit", "message"),
    [
        ("500", "V", r"the gain '500' does not read like '500 N/V'.*gains=\{\"force\": \"500 N/V\"\}"),
        ("500 mm/V", "V", r"must give a force, but 'mm' is no unit of force"),
        ("500 N/V + 2 mm", "V", r"'mm' is no unit of force"),
        ("500 N/V", "mm", r"the column is in 'mm', but the gain '500 N/V' divides by 'V'.*\"500 N/mm\""),
    ],
)
def test_wrong_gains(gain, unit, message):
    with pytest.raises(ValueError, match=message):
        gain_conversion("force", gain, unit, "run")


def test_volts_are_asked_for_their_gain(write):
    path = write(header="t_s,x [V],F_mV", scale=(1, 1e2, 2.0))
    with pytest.raises(
        ValueError, match=r"(?s)2 problems.*'V' is the unit of a sensor's signal.*gains=\{\"stroke\": \"10 mm/V\"\}"
    ):
        read(path)
    run = read(path, gains={"stroke": "10 mm/V", "force": "500 N/V"})[0]
    plain = read(write("plain.csv"))[0]
    np.testing.assert_allclose(run.stroke, plain.stroke, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(run.force, plain.force, rtol=1e-7, atol=1e-5)
    assert "stroke from 'x [V]' in V at 10 mm/V, force from 'F_mV' in mV at 500 N/V" in run.notes[0]


def test_units_decide_between_candidates(write):
    volts = 2 * np.sin(3 * np.pi * np.arange(600) / 300)
    path = write(header="t_s,Displacement (mm),F_N,Displacement (V)", extra=[volts])
    run = read(path)[0]
    assert run.amplitude == pytest.approx(0.02, rel=1e-3)
    assert any("stroke from 'Displacement (mm)' rather than 'Displacement (V)', by their units" in n for n in run.notes)
    run = read(path, gains={"stroke": "1 mm/V"})[0]
    assert run.amplitude == pytest.approx(0.002, rel=1e-3)


def test_a_broken_library_of_units_is_no_unknown_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the library raises when it starts is shown: with pint 0.24 and a newer flexparser no unit was known."""

    def broken(**_: object) -> None:
        raise TypeError("cannot inherit frozen dataclass from a non-frozen one")

    monkeypatch.setattr("pint.UnitRegistry", broken)
    unit_registry.cache_clear()
    try:
        for convert in (lambda: units.conversion("force", "hectonewton"), lambda: units.ratio("hectovolt", "V")):
            with pytest.raises(TypeError, match="frozen dataclass"):
                convert()
    finally:
        unit_registry.cache_clear()
