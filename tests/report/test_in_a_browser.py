"""A page in a browser: nothing to scroll sideways on a desk or a phone, two pages of paper, no request."""

import re
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from jaxdamp import bench, identify, roads, simulate, simulation, tune, vehicles
from jaxdamp.bench import SineTest
from jaxdamp.dampers import Bilinear, Linear
from jaxdamp.report import Report, bench_report, chain_report, fit_report, ride_report, tuning_report


BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
PROBE = "<script>addEventListener('load', () => document.title = document.documentElement.scrollWidth)</script>"
pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="no Chromium")]


@cache
def runs() -> bench.BenchSet:
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), 500.0, force_noise=2.0)
    return dyno.run([SineTest(0.01, f) for f in (1.0, 2.0, 4.0)])


@cache
def ride() -> simulation.Response:
    bump = roads.cosine_bump(0.05, start=0.2, duration=0.3)
    return simulate(vehicles.presets.quarter_car_000(), bump, duration=2.0, dt=0.005)


@cache
def tuned() -> tune.TuneResult:
    car, road = vehicles.presets.quarter_car_000(), roads.cosine_bump(0.05, start=0.2, duration=0.3)
    return tune.minimise("rms_sprung_acceleration", car, road, over=["damper.rate"], duration=2.0, dt=0.005)


@cache
def comparison() -> identify.Comparison:
    return identify.compare({"linear": Linear, "bilinear": Bilinear}, runs())


PAGES: dict[str, Callable[[], Report]] = {
    "fit": lambda: fit_report(comparison()),
    "bench": lambda: bench_report(bench.evaluate(runs())),
    "ride": lambda: ride_report({"as it is": ride()}),
    "tune": lambda: tuning_report(tuned()),
    "report": lambda: chain_report(comparison(), {"a bump": {"as it is": ride()}}, tuned()),
}


@pytest.fixture(scope="module", params=PAGES)
def page(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    written = PAGES[request.param]().write(tmp_path_factory.mktemp("page") / "page.html", "jaxdamp fit *.csv")
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
    frame.write_text(f'<title>-</title><iframe src="page.html" width="390" height="800" onload="{wide}"></iframe>')
    shown = browse("--allow-file-access-from-files", "--dump-dom", f"file://{frame}")
    title = re.search(r"<title>(\d+)</title>", shown)
    assert title is not None and int(title[1]) <= 390


def test_it_prints_the_sheet_and_little_else(page: Path) -> None:
    assert re.search(r'<main>\s*<h1>[^<]*</h1>\s*<figure class="sheet">', page.read_text())  # ends the first page
    pdf = page.with_name("page.pdf")
    browse(f"--print-to-pdf={pdf}", "--no-pdf-header-footer", f"file://{page}")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf.read_bytes())) <= 3


def test_no_request_leaves_the_machine(page: Path) -> None:
    assert not re.findall(r'(?:src|href)="(?!data:|#)[^"]*"|url\(|@import', page.read_text())
