"""`jaxdamp explore`: a law file and records in, one page out."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from jaxdamp.dampers import Besinger, Linear
from jaxdamp.export import to_json

from .invoking import jaxdamp, refused


def test_a_page_of_a_law_with_a_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    to_json(Besinger(900.0, 2800.0, 700.0, 0.25, 0.05), tmp_path / "front.json")
    to_json(Linear(1500.0), tmp_path / "old.json")
    time = np.arange(0.0, 2.0, 2e-3)
    stroke, velocity = 20.0 * np.sin(6.0 * time), 0.12 * np.cos(6.0 * time)
    columns, header = np.stack([time, stroke, 1500.0 * velocity], 1), "time [s],stroke [mm],force [N]"
    np.savetxt("run.csv", columns, delimiter=",", header=header, comments="")
    options = "--sign rebound-positive --road iso:D --speed 15 --duration 2 --baseline old.json".split()
    assert "front.html" in jaxdamp("explore", "front.json", "run.csv", *options).output
    text = Path("front.html").read_text(encoding="utf-8")
    found = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    assert data["shown"] == {"units": {"N/m": ["N/mm", 1e-3], "m": ["mm", 1e3]}, "turned": False}
    assert (data["road"]["class"], data["road"]["speed"], data["count"]) == ("D", 15.0, 2001)
    assert [record["name"] for record in data["records"]] == ["run"]
    assert data["baseline"]["numbers"][0]["start"] == [1500.0]
    assert "--replace" in refused(tmp_path, "explore", "front.json")
    options += ["--units", "imperial", "--show-sign", "compression-positive", "--replace"]
    jaxdamp("explore", "front.json", "run.csv", *options)
    assert '"turned": true' in Path("front.html").read_text(encoding="utf-8")
    jaxdamp("explore", "front.json", "--vehicle", "half_car_002", "--duration", "1", "--file", "other.html")
    for command in ("explore", "export"):  # as in every command, it is a folder
        assert "name it with --file" in refused(tmp_path, command, "front.json", "--out", "other")
