"""A page in a browser: nothing to scroll sideways on a desk or a phone, two pages of paper, no request."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from jaxdamp import bench, identify
from jaxdamp.bench import SineTest
from jaxdamp.dampers import Bilinear, Linear
from jaxdamp.report import fit_report


BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
PROBE = "<script>addEventListener('load', () => document.title = document.documentElement.scrollWidth)</script>"

pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="no Chromium")]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), 500.0, force_noise=2.0).run(
        [SineTest(0.01, f) for f in (1.0, 2.0, 4.0)]
    )
    comparison = identify.compare({"linear": Linear, "bilinear": Bilinear}, runs)
    written = fit_report(comparison).write(tmp_path_factory.mktemp("page") / "fit.html", "jaxdamp fit *.csv")
    framed = written.read_text().replace("</body>", PROBE + "</body>")
    written.with_name("probe.html").write_text(framed)
    return written


def browse(*arguments: str) -> str:
    always = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=2000"]
    command = [str(BROWSER), *always, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


@pytest.mark.parametrize("width", [1280, 500])  # a window of Chromium is at least 500 wide
def test_nothing_is_wider_than_the_window(page: Path, width: int) -> None:
    shown = browse(f"--window-size={width},900", "--dump-dom", f"file://{page.with_name('probe.html')}")
    title = re.search(r"<title>(\d+)</title>", shown)
    assert title is not None and int(title[1]) <= width


def test_nothing_is_wider_than_a_phone(page: Path) -> None:
    frame = page.with_name("phone.html")
    wide = "document.title = this.contentDocument.documentElement.scrollWidth"
    frame.write_text(f'<title>-</title><iframe src="fit.html" width="390" height="800" onload="{wide}"></iframe>')
    shown = browse("--allow-file-access-from-files", "--dump-dom", f"file://{frame}")
    title = re.search(r"<title>(\d+)</title>", shown)
    assert title is not None and int(title[1]) <= 390


def test_it_prints_the_sheet_and_little_else(page: Path) -> None:
    pdf = page.with_name("fit.pdf")
    browse(f"--print-to-pdf={pdf}", "--no-pdf-header-footer", f"file://{page}")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf.read_bytes())) <= 3


def test_no_request_leaves_the_machine(page: Path) -> None:
    assert not re.findall(r'(?:src|href)="(?!data:|#)[^"]*"|url\(|@import', page.read_text())
