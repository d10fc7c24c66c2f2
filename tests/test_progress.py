import io

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
