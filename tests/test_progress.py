import io
import sys

from jaxdamp._progress import Progress


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def test_shows_nothing_before_its_delay(monkeypatch):
    stream = _Terminal()
    monkeypatch.setattr("sys.stderr", stream)
    with Progress("Fitting", delay=60.0) as progress:
        progress("linear")
    assert stream.getvalue() == ""


def test_writes_over_one_line_and_wipes_it(monkeypatch):
    stream = _Terminal()
    monkeypatch.setattr("sys.stderr", stream)
    with Progress("Fitting", delay=0.0) as progress:
        progress("segmented polynomial")
        progress("table")
    assert stream.getvalue().startswith("\rFitting: segmented polynomial\rFitting: table   ")
    assert stream.getvalue().rstrip(" \r").endswith("table")
    assert "\n" not in stream.getvalue()


def test_is_silent_where_nobody_watches(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    with Progress("Fitting", delay=0.0) as progress:
        progress("linear")
    assert stream.getvalue() == ""


def test_a_notebook_shows_the_line_and_does_not_store_it(monkeypatch):
    shown = []

    class Output:
        def update(self, content, *, raw):
            assert raw
            shown.append(content["text/plain"])

    def display(content, *, raw, display_id):
        assert raw and display_id
        shown.append(content["text/plain"])
        return Output()

    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    monkeypatch.setattr("IPython.display.display", display)
    with Progress("Fitting", delay=0.0) as progress:
        progress("linear")
        progress("table")
    assert shown == ["Fitting: linear", "Fitting: table", ""]
    with Progress("Fitting", delay=0.0):
        pass
    assert len(shown) == 3
