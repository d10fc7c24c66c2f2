"""The pictures of README.md and of the home page are what the library gives."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image


ROOT = Path(__file__).parents[1]
SHOWN = ROOT / "docs" / "shown"


def test_readme_and_home_page_show_them():
    for page in ("README.md", "docs/index.md"):
        text = (ROOT / page).read_text()
        assert all(f"shown/{picture.name}" in text for picture in SHOWN.glob("*.png")), page


@pytest.mark.slow
@pytest.mark.users_flags
def test_they_are_drawn_alike_today(tmp_path):
    """Within what another version of the fonts or of the compiler changes; `python docs/_shown.py` draws them anew."""
    done = subprocess.run([sys.executable, ROOT / "docs" / "_shown.py", tmp_path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    names = sorted(path.name for path in SHOWN.glob("*.png"))
    assert names == sorted(path.name for path in tmp_path.iterdir()) and names
    for name in names:
        changed = share_changed(SHOWN / name, tmp_path / name)
        assert changed < 0.01, (name, changed)


def share_changed(*files):
    """The share of squares of 8 × 8 pixels whose means differ between two pictures, which may have other sizes."""
    one, other = (Image.open(file).convert("L") for file in files)
    wide, high = np.divide(other.size, one.size)
    if abs(wide / high - 1.0) > 0.02:  # letters of another version widen a picture a little
        return 1.0
    size = [side // 8 for side in min(one.size, other.size)]
    one, other = (np.asarray(each.resize(size, Image.Resampling.BOX), float) for each in (one, other))
    return float(np.mean(np.abs(one - other) > 25.0))
