from pathlib import Path

import pytest

from jaxdamp import bench
from jaxdamp.bench import BenchSet, SineTest
from jaxdamp.dampers import Bilinear

from .invoking import draw_nothing


@pytest.fixture(autouse=True)
def pictures_where_looked_at(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing takes half the time of a command: figures are made in all tests, drawn in `pictures` and long ones."""
    if not any(request.node.get_closest_marker(kind) for kind in ("pictures", "slow", "exhaustive")):
        draw_nothing(monkeypatch)


@pytest.fixture(scope="session")
def runs() -> BenchSet:
    """Three records of a damper with 2600 N s/m in rebound and 1200 in compression."""
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=500.0, force_noise=2.0)
    return dyno.run([SineTest(0.01, f, name=f"10mm_{f:g}Hz") for f in (1.0, 2.0, 4.0)])


@pytest.fixture(scope="session")
def records(tmp_path_factory: pytest.TempPathFactory, runs: BenchSet) -> Path:
    """A folder with the records as the library writes them."""
    folder = tmp_path_factory.mktemp("records")
    runs.write(folder)
    return folder


@pytest.fixture
def lab_file(tmp_path: Path, runs: BenchSet) -> Path:
    """A record as a lab writes it: compression positive, mm and kN."""
    run = runs[1]
    rows = [f"{t},{-1e3 * x},{-1e-3 * f}" for t, x, f in zip(run.time, run.stroke, run.force, strict=True)]
    path = tmp_path / "lab.csv"
    path.write_text("\n".join(["time [s],position [mm],load [kN]", *rows]) + "\n")
    return path
