"""The command line, called as a user does."""

from pathlib import Path

from typer.testing import CliRunner, Result

from jaxdamp.cli import app


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
