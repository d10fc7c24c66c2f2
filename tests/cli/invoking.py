"""The command line, called as a user does."""

import functools
import io
from pathlib import Path

import matplotlib.figure
import pytest
from typer.testing import CliRunner, Result

from jaxdamp.cli import app
from jaxdamp.report import page


def jaxdamp(*words: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == code, (result.output, result.exception)
    return result


def refused(folder: Path, *words: str | Path) -> str:
    """The message of a command that must fail and leave nothing behind."""
    before = sorted(folder.rglob("*"))
    output = " ".join(jaxdamp(*words, code=2).output.split())
    assert "Traceback" not in output
    assert sorted(folder.rglob("*")) == before
    return output


@functools.cache
def _blank() -> bytes:
    return page.png(matplotlib.figure.Figure(figsize=(0.1, 0.1)))


def draw_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """From here on files of pictures are empty."""
    blank = _blank()
    monkeypatch.setattr(page, "png", lambda figure: blank)
    monkeypatch.setattr(matplotlib.figure.Figure, "savefig", not_drawn)


def not_drawn(figure: matplotlib.figure.Figure, target: str | Path | io.BytesIO, **_: object) -> None:
    """A file without a picture."""
    if not isinstance(target, io.BytesIO):
        Path(target).write_bytes(b"")
