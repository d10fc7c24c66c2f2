"""What is wrong with the words of a command is said before JAX is loaded."""

import subprocess
import sys
from pathlib import Path


PROGRAM = """
import sys
from jaxdamp.cli import app

for line in sys.stdin.read().splitlines():
    try:
        app(line.split(), prog_name="jaxdamp")
    except SystemExit as end:
        assert end.code == 2, (line, end.code)
    else:
        raise AssertionError(line)
    assert "jax" not in sys.modules, line
"""


def test_a_wrong_path_is_answered_without_jax(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes").write_text("mine")
    (tmp_path / "full" / "setting_1").mkdir()
    (tmp_path / "full" / "setting_1" / "best_law.json").write_text("{}")
    (tmp_path / "a.csv").write_text("1")
    (tmp_path / "deep.json").write_text('{"a":' + "[" * 5000 + "]" * 5000 + "}")
    (tmp_path / "deep.toml").write_text(".".join("a" * 30_000) + " = 1\n")
    (tmp_path / "latin.toml").write_bytes('preset = "Stoßdämpfer"'.encode("latin-1"))
    lines = {
        "fit nosuch.csv": "There is no file 'nosuch.csv'",
        "fit-vehicle nosuch.toml a.csv": "VEHICLE must be a file that is there, but is nosuch.toml",
        "bench full": "Folder full holds no *.csv",
        "ride broken.json": "VEHICLE must be a vehicle as JSON, but is broken.json, which is no JSON: Expecting",
        "tune quarter_car_000 iso_C": "ROAD must be iso:CLASS, bump:HEIGHT:LENGTH or a file that is there",
        "sweep quarter_car_000 iso:C --over damper.rate=1:2:3 --law x.json": "Option --law must be a file",
        "report a.csv --manifest no.toml": "Option --manifest must be a file that is there, but is no.toml",
        "export no.json --to c": "LAW must be a file that is there, but is no.json",
        "ride full/best_law.json": "Did you mean full/setting_1/best_law.json?",
        "ride deep.json": "VEHICLE must be a vehicle as JSON, but is deep.json, which is no JSON: it is nested",
        "tune deep.toml iso:C": "deep.toml, which is no valid TOML: a key has more than 20 parts",
        "tune latin.toml iso:C": "latin.toml, which is no TOML in UTF-8",
        "fit a.csv --out full": "The folder 'full' is not empty and was not written by jaxdamp",
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input="\n".join(lines), text=True, capture_output=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    for said in lines.values():
        assert said in done.stderr, done.stderr
