import base64
import copy
import io
import os
import re
from itertools import zip_longest
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from PIL import Image

from tests.test_shown import share_changed


ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
EXECUTED = ROOT / "build" / "notebooks"
# Studies of papers and of measured data, which are kept with the results of their short versions.
KEPT = ["cx7_shock_absorber", "half_car_hybrid", "heavy_vehicle_besinger", "m113_tracked_vehicle", "magnetorheological"]
KEPT += ["tuned_dampers", "vehicles_and_roads"]
LARGEST = 300 * 1024  # bytes of a kept notebook
NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def test_outputs_of_studies_are_stored_and_no_others():
    assert {path.stem for path in NOTEBOOKS} > set(KEPT)
    for path in NOTEBOOKS:
        cells = [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]
        if path.stem in KEPT:
            assert all(cell.execution_count for cell in cells), path.name
            assert len(_pictures(cells)) >= 3 and path.stat().st_size <= LARGEST, path.name
        else:
            assert not any(cell.outputs for cell in cells), f"strip the outputs of {path.name} before committing"


@pytest.mark.notebook
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("default")
def test_runs_from_start_to_end(path, request, monkeypatch):
    """`JAXDAMP_REDRAW=1 pytest -m notebook` stores the outputs of studies anew: look at each."""
    notebook, before = (nbformat.read(path, as_version=4) for _ in range(2))
    if any("JAXDAMP_DATA" in cell.source for cell in notebook.cells):
        monkeypatch.setenv("JAXDAMP_DATA", str(request.getfixturevalue("data")))
    resources = {"metadata": {"path": path.parent}}
    NotebookClient(notebook, timeout=None, kernel_name="python3", resources=resources, record_timing=False).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert len(_pictures(notebook.cells)) >= 3
    assert not any("\r" in output.get("text", "") for output in outputs), "a line of progress is stored"
    if path.stem in KEPT and os.environ.get("JAXDAMP_NOTEBOOKS") != "full":
        if os.environ.get("JAXDAMP_REDRAW"):
            _keep(notebook, before, path)
        _is_what_is_kept(notebook, nbformat.read(path, as_version=4), path.name)
    EXECUTED.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, EXECUTED / path.name)  # for the documentation site


def _pictures(cells):
    outputs = [output for cell in cells for output in cell.get("outputs", [])]
    found = [output["data"]["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    return [base64.b64decode(picture) for picture in found]


def _texts(cells):
    """The text that each cell prints or shows, in one."""
    for cell in cells:
        outputs = cell.get("outputs", [])
        texts = (output.get("text", "") or output.get("data", {}).get("text/plain", "") for output in outputs)
        yield "".join(texts)


def _keep(notebook, before, path):
    """Write the outputs into the file of the notebook, with pictures of 64 colours, small enough for the file."""
    for scale in (1.0, 0.8, 0.65, 0.5):
        for cell, done in zip(before.cells, notebook.cells, strict=True):
            if cell.cell_type == "code":
                cell.outputs, cell.execution_count = copy.deepcopy(done.outputs), done.execution_count
                for data in (output.data for output in cell.outputs if "image/png" in output.get("data", {})):
                    data["image/png"] = _small(data["image/png"], scale)
        nbformat.write(before, path)
        if path.stat().st_size <= LARGEST:
            break


def _small(encoded, scale):
    picture, small = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB"), io.BytesIO()
    picture = picture.resize([round(scale * size) for size in picture.size], Image.Resampling.LANCZOS)
    picture.quantize(64, dither=Image.Dither.NONE).save(small, "png", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


def _is_what_is_kept(notebook, kept, name):
    """Words are equal, numbers within 5 % or two of their last digits, pictures within what fonts change."""
    remedy = f"{name} gives other results than are stored: JAXDAMP_REDRAW=1 pytest -m notebook, and look at them"
    for text, stored in zip(_texts(notebook.cells), _texts(kept.cells), strict=True):
        plain, plain_stored = (re.sub(r"\s+", " ", NUMBER.sub("#", each)) for each in (text, stored))
        assert plain == plain_stored, remedy
        for new, old in zip(NUMBER.findall(text), NUMBER.findall(stored), strict=True):
            a, b = (float(each.replace("−", "-")) for each in (new, old))
            assert abs(a - b) <= 0.05 * abs(b) + 2.1 * _last_digit(old), (new, old, remedy)
    for drawn, stored in zip_longest(_pictures(notebook.cells), _pictures(kept.cells)):
        assert share_changed(io.BytesIO(stored), io.BytesIO(drawn)) < 0.02, remedy


def _last_digit(number):
    """What one in the last digit of a printed number is worth."""
    digits, _, power = number.partition("e")
    return 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
