"""A page: what it escapes, what may fail, where its pictures go."""

import warnings
from pathlib import Path

import jax
import pytest
from matplotlib.figure import Figure

import jaxdamp
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
    attempts = Attempts(words=lambda text: text.replace("`rig`", "--rig"))
    page = Report("Page", attempts=attempts)
    page.verdict("first `rig`")
    page.text("second", "`rig`")
    page.points(["third `rig`"])
    assert page.to_html().count("--rig") == 3 and "`" not in page.to_html().partition("<h1>")[2]
