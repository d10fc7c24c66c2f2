"""The page of `jaxdamp explore` in headless Chromium: how soon it opens, how fast it follows a slider, how large it is.

    python -m benchmarks.explorer [NAME...]    laws of the contract; all of them if left out

A page holds a 10 s quarter car at 1 kHz and three loops. "opens" is from the address to the first picture, on the
second opening; "follows" is what a moved slider starts: loops, ride, metrics, spectrum and drawing, the median of nine.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from jaxdamp import configure


configure(cache=False)

from benchmarks._timing import report  # noqa: E402
from jaxdamp.export import to_explorer  # noqa: E402
from tests.dampers.test_contract import LAWS  # noqa: E402
from tests.export.browser import NAMES, Browser, started  # noqa: E402


MOVED = (
    "(() => { const ms = []; for (let i = 0; i < 9; ++i) { refresh(); ms.push(state.milliseconds); } return ms; })()"
)


def measured(browser: Browser, name: str, folder: Path) -> list[Any]:
    """Seconds to open, milliseconds of a slider, steps between instants, kilobytes."""
    file = to_explorer(LAWS[name](), folder / "law.html")
    browser.open(file)
    opening = browser.open(file)
    browser.evaluate(MOVED)
    milliseconds = sorted(browser.evaluate(MOVED))
    return [name, opening, milliseconds[4], browser.evaluate("state.substeps"), file.stat().st_size // 1000]


def main() -> None:
    if not any(map(shutil.which, NAMES)):
        print("No Chromium or Chrome is installed.")
        return
    names = sys.argv[1:] or list(LAWS)
    with tempfile.TemporaryDirectory() as folder, started() as browser:
        rows = [measured(browser, name, Path(folder)) for name in names]
    rows.sort(key=lambda row: -row[2])
    report("explorer", "Explorer pages", ["law", "opens, s", "follows, ms", "substeps", "kB"], rows)


if __name__ == "__main__":
    main()
