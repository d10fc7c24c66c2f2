"""A page: what it escapes, what may fail, where its pictures go."""

import warnings
from pathlib import Path

import jax
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from PIL import Image

import jaxdamp
from jaxdamp import plots
from jaxdamp._display import Display, shown_in
from jaxdamp._tables import Column, Table
from jaxdamp.dampers import Bilinear, Linear, with_fitted_range
from jaxdamp.plots import _figure
from jaxdamp.report import Attempts, Report


def test_what_fails_is_named_and_the_rest_goes_on() -> None:
    attempts = Attempts()
    with attempts.part("The picture a.png"):
        raise KeyError("colour")
    with attempts.part("The table"):
        warnings.warn("b.csv: rows left out.", stacklevel=1)
    with attempts.part("The rest"):
        pass
    assert attempts.troubles == ["The picture a.png could not be made: 'colour'", "b.csv: rows left out."]


def test_a_report_escapes_what_it_is_told() -> None:
    report = Report("a < b")
    report.text("x", "& y")
    report.text("")
    report.points([])
    report.verdict("5 < 6", "")
    body = report.to_html("jaxdamp fit 'a & b'").partition("<body>")[2].partition("</body>")[0]
    verdict = '<div class="verdict"><p>5 &lt; 6</p></div>'
    assert body.split("\n")[:5] == ["", "<main>", "<h1>a &lt; b</h1>", "<p>x &amp; y</p>", verdict]
    footer = body.partition("<footer>")[2]
    assert f"by jaxdamp {jaxdamp.__version__} (jax {jax.__version__}" in footer
    assert "<pre>jaxdamp fit &#x27;a &amp; b&#x27;</pre>" in footer and "<pre>" not in report.to_html()


def test_remarks_have_the_words_of_tables_and_what_is_typed_stays() -> None:
    report = Report("title")
    report.table(Table("Parameters", (Column("parameter"),), (("law.rebound_rate",),)))
    report.points(
        ["law.knots[0] < law.rebound_rate and front.damper.rate are at -2 N s/m: `bounds={'law.rebound_rate': (1, 2)}`"]
    )
    report.points(["Take the damper's --law piecewise_linear,table, or --freeze law.rebound_rate."])
    named, path = '<span title="law.rebound_rate">rebound rate</span>', "law.rebound_rate"
    knots, rate = '<span title="law.knots">knots</span>', '<span title="front.damper.rate">front damper rate</span>'
    page = report.to_html()
    assert '<td title="law.rebound_rate">rebound rate</td>' in page
    assert (
        f"<li>{knots}[0] &lt; {named} and {rate} are at −2 N s/m: `bounds={{&#x27;{path}&#x27;: (1, 2)}}`</li>" in page
    )
    assert f"<li>Take the damper&#x27;s --law piecewise_linear,table, or --freeze {path}.</li>" in page


def test_letters_that_no_font_has_are_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    report = Report("title")
    monkeypatch.setattr(_figure, "EAST_ASIAN", ())
    for name in ("a.png", "b.png"):
        report.picture(plots.force_velocity({"减震器 前左": Linear(1000.0)}), "law", name)
    report.to_html()
    (told,) = report.attempts.troubles
    assert told.startswith("Letters that no font of this machine has are boxes in pictures: install ")


def test_letters_are_taken_from_another_font_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    letter, other = next(
        (chr(code), name)
        for name in ("STIXGeneral", "cmsy10")
        for code in get_font(findfont(name)).get_charmap()
        if code not in get_font(findfont("DejaVu Sans")).get_charmap()
    )
    monkeypatch.setattr(_figure, "EAST_ASIAN", ("No Such Font", other))
    report = Report("title")
    report.picture(plots.force_velocity({f"law {letter}": Linear(1000.0), "b": Linear(2000.0)}), "laws", "a.png")
    report.to_html()
    assert not report.attempts.troubles


def test_sections_are_linked_at_the_top() -> None:
    report = Report("title")
    report.heading("a & b")
    assert "<nav>" not in report.to_html()
    report.heading("c")
    assert '<nav><a href="#part-1">a &amp; b</a> · <a href="#part-2">c</a></nav>' in report.to_html()
    assert '<h2 id="part-2">c</h2>' in report.to_html()


def test_pictures_stand_in_the_page_and_in_the_folder(tmp_path: Path) -> None:
    report = Report("title", tmp_path)
    report.picture(Figure(), "a < b", "empty.png")
    report.picture(lambda: Figure(), "drawn", "drawn.png")
    assert Report("title").write(tmp_path / "other.html").read_text().count("<figure>") == 0
    text = report.to_html()
    assert text.count("data:image/png;base64,") == 2 and "<figcaption>a &lt; b</figcaption>" in text
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in ("empty.png", "drawn.png"))


def test_what_failed_in_a_part_is_named_on_the_page(tmp_path: Path) -> None:
    page, part = Report("title", tmp_path), Report("part", {})
    with part.part("The curve"):
        raise ValueError("no curve")
    part.heading("Laws")
    part.picture(Figure, "drawn", "drawn.png")
    page.include(part)
    text = page.to_html()
    assert "Laws</h2>" in text and "<li>The curve could not be made: no curve</li>" in text
    assert (tmp_path / "drawn.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_fails_is_named_at_the_end(tmp_path: Path) -> None:
    def broken() -> Figure:
        raise RuntimeError("no font")

    report = Report("title", tmp_path)
    report.picture(broken, "caption", "broken.png")
    report.text("The rest.")
    lines = report.to_html().split("\n")
    assert lines[lines.index("<p>The rest.</p>") + 1] == (
        "<ul><li>The picture broken.png could not be made: no font</li></ul>"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_stop_between_parts_is_not_taken_for_a_failure() -> None:
    class Stopped(BaseException):
        pass

    def check() -> None:
        raise Stopped

    attempts = Attempts(check)
    with pytest.raises(Stopped), attempts.part("The picture"):
        pass
    assert attempts.troubles == []


def test_the_words_of_a_page_are_those_of_its_reader() -> None:
    with shown_in(Display(wording=lambda text: text.replace("`rig`", "--rig"))):
        page = Report("Page")
        page.verdict("first `rig`")
        page.text("second", "`rig`")
        page.points(["third `rig`"])
        page.table(table := Table("Findings", (Column("remedy"),), (("fourth `rig`",),)))
        assert table.to_csv() == "remedy\nfourth --rig\n"
    assert page.to_html().count("--rig") == 4 and "`" not in page.to_html().partition("<h1>")[2]


def test_pictures_keep_the_colours_that_lines_have(tmp_path: Path) -> None:
    law = with_fitted_range(Bilinear(2000.0, 1000.0), velocity=(-0.3, 0.3))
    figure = plots.force_velocity({"new": law, "other": Linear(700.0), "old": Linear(300.0)}, baseline="old")
    Report("title", tmp_path).picture(figure, "laws", "laws.png")
    drawn = np.asarray(Image.open(tmp_path / "laws.png").convert("RGB"), int).reshape(-1, 3)
    roles = [plots.ROLES[name]["color"] for name in ("after", "before", "shade")]
    for colour in (*roles, "#D55E00", "#E6E6E6", "#FFFFFF"):  # lines, what is extrapolated, grid, paper
        away = np.abs(drawn - np.round(255.0 * np.array(to_rgb(colour)))).max(axis=1)
        assert np.sum(away <= 5.0) > 100, colour
