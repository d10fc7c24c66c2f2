"""Units and sign in which tables, sentences and pictures are shown."""

import numpy as np
import pytest

from jaxdamp._display import Display, display, shown_in
from jaxdamp._tables import Column, Shown, Table
from jaxdamp.bench import Finding, Preflight
from jaxdamp.plots import _style


SHOP = Display("imperial", "compression-positive")


@pytest.mark.parametrize(
    ("unit", "shown", "factor"),
    [
        ("N", "lbf", 1 / 4.4482216152605),
        ("mm", "in", 1 / 25.4),
        ("N s/m", "lbf s/in", 0.0254 / 4.4482216152605),
        ("kN", "lbf", 1e3 / 4.4482216152605),
        ("N s^0.5/m^0.5", "lbf s^0.5/in^0.5", 0.0254**0.5 / 4.4482216152605),
        ("J", "in lbf", 1 / (0.0254 * 4.4482216152605)),
        ("m/s^2", "m/s^2", 1.0),
        ("m^3", "m^3", 1.0),
        ("Hz", "Hz", 1.0),
        ("", "", 1.0),
    ],
)
def test_units_are_converted_by_what_they_are_made_of(unit, shown, factor):
    assert SHOP.of(unit).unit == shown and SHOP.of(unit).factor == pytest.approx(factor)
    assert Display().of(unit) == (unit, 1.0)


def test_a_table_is_shown_in_shop_units_and_its_plain_data_stay():
    columns = (Column("quantity"), Column("unit"), Column("value"), Column("scatter"), Column("count", spec="d"))
    rows = (("rebound force", "N", Shown(444.822, "444.8 ± 4.4"), 4.44822, 3), ("ratio", "–", 2.0, 0.1, 3))
    table = Table("Forces at 0.254 m/s (positive in rebound)", columns, rows)
    with shown_in(SHOP):
        assert table.texts()[0] == ("rebound force", "lbf", "-100.00 ± 0.99", "1", "3")
        assert table.texts()[1] == ("ratio", "–", "2", "0.1", "3")
        assert table.to_csv().splitlines()[1].startswith("rebound force,lbf,-99.99")
        assert "positive in compression" in table.to_html()
    assert table.texts()[0][2] == "444.8 ± 4.4" and display().plain
    assert table.records()[0]["value"] == 444.822


@pytest.mark.parametrize("display", [Display("imperial"), Display(sign="compression-positive")])
def test_columns_of_one_heading_keep_their_cells(display):
    """Each parameter of a line of dampers has its ±."""
    columns = (Column("damper"), Column("rate", "N s/m"), Column("±", "N s/m"), Column("force", "N"), Column("±", "N"))
    table = Table("T", (*columns, Column("remark")), (("A", 100.0, 1.0, 200.0, 2.0, "unusual"),))
    with shown_in(display):
        rows = table.shown().rows
    assert len(rows[0]) == 6 and rows[0][-1] == "unusual"


def test_lowest_and_highest_change_places_with_the_sign():
    ends = Table("", (Column("run"), Column("least force", "N"), Column("largest force", "N")), (("a", -300.0, 700.0),))
    rows = (("velocity", "m/s", -0.5, 0.9), ("frequency", "Hz", 1.0, 5.0))
    spans = Table("", (Column("quantity"), Column("unit"), Column("lowest"), Column("highest")), rows)
    metrics = (("front_working_space_mean", "m", -0.01, 0.02), ("rms_stroke", "m", 0.01, 0.01))
    ride = Table("", (Column("metric"), Column("unit"), Column("before"), Column("after")), metrics)
    with shown_in(Display("SI", "compression-positive")):
        assert ride.shown().rows == (("front_working_space_mean", "m", 0.01, -0.02), metrics[1])
        assert ends.shown().rows == (("a", -700.0, 300.0),)
        assert spans.shown().rows == (("velocity", "m/s", -0.9, 0.5), ("frequency", "Hz", 1.0, 5.0))


def test_times_and_distances_keep_their_ends_and_findings_are_turned_by_their_names():
    found = [
        Finding("warning", "rest before", ("a",), "", 1.1, "s", (0.0, 1.1)),
        Finding("note", "gas force", ("a",), "", -150.0, "N"),
    ]
    columns = (Column("velocity", "m/s"), *(Column(name, "N") for name in ("force", "from", "to")))
    band = Table("", columns, ((0.1, 200.0, 150.0, 260.0),))
    roughness = Table("", (Column("from", "m"), Column("to", "m")), ((0.0, 100.0),))
    with shown_in(Display(sign="compression-positive")):
        rows = (
            Preflight(tuple(found), ("a",)).table().only(columns=["from", "to", "finding", "size", "unit"]).shown().rows
        )
        assert rows == ((0.0, 1.1, "rest before", 1.1, "s"), (None, None, "gas force", 150.0, "N"))
        assert band.shown().rows == ((-0.1, -200.0, -260.0, -150.0),) and roughness.shown() == roughness


@pytest.mark.parametrize("display", [SHOP, Display("imperial"), Display(sign="compression-positive")])
def test_a_number_whose_unit_stays_keeps_its_text(display):
    """Only what is converted is written anew."""
    rows = (("friction", "N", Shown(11.2024, "11 ± 22")), ("bleed", "Hz", Shown(3.14159, "3.1416")))
    table = Table("t", (Column("quantity"), Column("unit"), Column("value")), rows)
    with shown_in(display):
        (_, _, friction), (_, _, bleed) = table.texts()
        assert bleed == "3.1416" and friction == ("11 ± 22" if display.units == "SI" else "2.5 ± 4.9")


def test_sentences_have_the_unit_and_names_in_them_stay():
    text = "RMSE 44.48 N at −0.254 to 0.508 m/s of '20 mm_a', from 'F [N]', 3 m/s^2"
    assert SHOP.words(text) == "RMSE 10 lbf at -10 to 20 in/s of '20 mm_a', from 'F [N]', 3 m/s^2"


def test_large_numbers_in_sentences_are_written_out():
    said = "like a spring of 1.1e+03 N/m, a jump of +2e+03 N"
    assert Display().words(said) == "like a spring of 1100 N/m, a jump of +2000 N"
    assert Display("imperial").words(said) == "like a spring of 6.281 lbf/in, a jump of 449.6 lbf"
    assert Display("imperial").words("rear -4.45 kN of 2.67 kN") == "rear -1000 lbf of 600 lbf"
    assert Display().words("between 1e-05 and 2.5e+07") == "between 1e-05 and 2.5e+07"


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("751.8 ± 3.3 N in rebound", "169.01 ± 0.74 lbf in rebound"),
        ("(1e+08 ± 5.7e+08 N/m)", "(600000 ± 3300000 lbf/in)"),
        ("known to 254 ± inf mm", "known to 10 ± inf in"),
        ("stroke noise 1e-05 m", "stroke noise 0.000394 in"),
        ("2.54 m, 4.54 kg and 11.3 J per cycle", "100 in, 10 lb and 100 in lbf per cycle"),
        ("axles (0, 0.667, -1.33 m) and 5, 10 s", "axles (0, 26.3, -52.4 in) and 5, 10 s"),
        ("at 1, 2 to 3 N", "at 0.225, 0.45 to 0.674 lbf"),
        ("3e16 ± 1e19 N/m³, 3 kg m^2, 3 N m, 2 N/s, 5 W", "3e16 ± 1e19 N/m³, 3 kg m^2, 3 N m, 2 N/s, 5 W"),
    ],
)
def test_all_numbers_of_a_unit_in_a_sentence_are_converted(said, shown):
    """A value keeps no other unit than its error."""
    assert Display("imperial").words(said) == shown and Display().words(said) == said


def test_the_speed_of_a_vehicle_is_no_velocity_of_a_damper():
    assert Display("metric").speed(20.0) == "20 m/s" and Display("imperial").speed(20.0) == "44.7 mph"


def test_a_picture_has_ticks_in_the_unit_and_runs_the_other_way():
    figure = _style.new_figure(4, 3)
    axes = figure.subplots()
    axes.plot([-0.5, 0.5], [-500.0, 800.0])
    with shown_in(SHOP):
        _style.dress(axes, _style.VELOCITY, _style.FORCE)
    axes.set_xlim(-0.5, 0.5)
    assert " ".join(axes.get_xlabel().split()) == "velocity [in/s] (+ compression)" and axes.xaxis_inverted()
    ticks = np.sort(-axes.get_xticks() / 0.0254)
    assert np.allclose(ticks, np.round(ticks)) and axes.yaxis.get_major_formatter()(-444.8221615) == "100"


def test_unknown_words_are_refused():
    with pytest.raises(ValueError, match="Did you mean 'imperial'"):
        Display("imperal")
    with pytest.raises(ValueError, match="`sign` must be one of"):
        Display("SI", "up")
