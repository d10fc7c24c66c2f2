"""Tables: for reading, for files, as plain data."""

import copy
import json
import pickle

import numpy as np
import pytest

from jaxdamp._tables import Column, Compared, Shown, Table, comparison_table, percent_change, plain, typeset_unit


def test_tables_are_written_with_all_digits_and_read_with_few() -> None:
    table = Table("T", (Column("name"), Column("force", "N", ".1f")), (("a, b", np.pi), ("<c>", None)))
    assert table.to_csv() == 'name,force [N]\n"a, b",3.141592653589793\n<c>,\n'
    assert table.texts() == [("a, b", "3.1"), ("<c>", "")]
    shown = Table("T", (Column("force", "N", ".1f"),), ((Shown(np.pi, "3"),),))
    for again in (pickle.loads(pickle.dumps(shown)), copy.deepcopy(shown)):
        assert again == shown and again.texts() == [("3",)]
    assert "&lt;c&gt;" in table.to_html() and '<td class="number">3.1</td>' in table.to_html()


def test_plain_data_hold_units_and_no_number_that_json_does_not_know() -> None:
    table = Table("T", (Column("name"), Column("force", "N")), (("a", np.float64(2.0)), ("b", np.nan)))
    data = json.loads(json.dumps(table.to_dict(), allow_nan=False))
    assert data == {
        "title": "T",
        "columns": [{"name": "name", "unit": ""}, {"name": "force", "unit": "N"}],
        "rows": [["a", 2.0], ["b", None]],
    }
    found = plain({"a": np.arange(2), 1: (np.float32(0.5), np.inf), "b": np.bool_(True), "c": np.array(2.0)})
    assert found == {"a": [0, 1], "1": [0.5, None], "b": True, "c": 2.0} and found["b"] is True
    with pytest.raises(TypeError, match="A object is no number, word"):
        plain({"a": object()})


def test_text_stands_in_columns() -> None:
    table = Table("T", (Column("name"), Column("force", "N", ".1f"), Column("note")), (("long name", 3.14, ""),))
    assert str(table) == repr(table) == "T\nname       force [N]  note\nlong name        3.1"


def test_numbers_below_a_heading_of_names_keep_their_points_on_a_page():
    """A ride has a column "law" of numbers beside those of the baseline."""
    table = Table("Ride", (Column("metric"), Column("law")), (("rms_sprung_acceleration", 1.137), ("peak", 2.678)))
    assert '<td class="number">1.137</td>' in table.to_html(words=True)
    names = Table("Laws", (Column("law"), Column("rmse")), (("series_spring.rate", 1.137),))
    assert 'title="series_spring.rate"' in names.to_html(words=True)


def test_comparisons_have_a_change_only_of_several() -> None:
    rows = [Compared("travel", "m", (2.0, 3.0), percent_change(2.0, 3.0)), Compared("jerk", "m/s^2", (0.0, 1.0), None)]
    table = comparison_table("T", "metric", ("before", "after"), rows)
    assert [column.heading for column in table.columns] == ["metric", "unit", "before", "after", "change [%]"]
    assert table.texts() == [("travel", "mm", "2000", "3000", "+50.0"), ("jerk", "m/s²", "0", "1", "")]
    assert table.to_csv().splitlines()[1] == "travel,m,2.0,3.0,50.0"  # for programs, as the library computes
    alone = comparison_table("T", "metric", ("value",), [Compared("lift off", "", (0.1,), None)])
    assert alone.rows == (("lift off", "–", 0.1),)
    assert percent_change(0.0, 1.0) is None and percent_change(4.0, 3.0) == pytest.approx(-25.0)
    assert typeset_unit("m/s^2") == "m/s²" and typeset_unit("", "–") == "–" and typeset_unit("m/s^1.75") == "m/s^1.75"


def test_a_text_is_no_formula_in_a_csv_file():
    table = Table("t", (Column("name"), Column("x")), (("=HYPERLINK(1)", -1.5), ("@a", None), ("-b", 2.0), ("c", 3.0)))
    assert table.to_csv() == "name,x\n'=HYPERLINK(1),-1.5\n'@a,\n'-b,2.0\nc,3.0\n"
