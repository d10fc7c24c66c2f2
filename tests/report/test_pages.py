"""Pages of fits, rides and tunings: what stands on them, without the command line."""

from pathlib import Path

import pytest

from jaxdamp import bench, identify, roads, simulate, tune, vehicles
from jaxdamp.bench import SineTest
from jaxdamp.dampers import Bilinear, FittedRange, Linear, with_fitted_range
from jaxdamp.identify import Comparison
from jaxdamp.report import fit_report, ride_report, tuning_report
from jaxdamp.simulation import Response


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=500.0, force_noise=2.0)
    runs = dyno.run([SineTest(0.01, f, name=f"10mm_{f:g}Hz") for f in (1.0, 2.0, 4.0)])
    return identify.compare({"linear": Linear, "bilinear": Bilinear}, runs[:2], held_out=runs[2:])


@pytest.fixture(scope="module")
def rides() -> dict[str, Response]:
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    firm = with_fitted_range(Linear(3000.0), FittedRange(velocity=(-0.1, 0.1)))
    laws = {"soft": Linear(1500.0), "firm": firm}
    cars = {name: vehicles.presets.quarter_car_000(law) for name, law in laws.items()}
    with pytest.warns(UserWarning, match="fitted to"):
        return {name: simulate(car, bump, duration=1.0, dt=0.002) for name, car in cars.items()}


def test_a_page_on_fits(comparison: Comparison, tmp_path: Path) -> None:
    page = fit_report(comparison, remarks=["positive stroke is rebound"], folder=tmp_path).to_html()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "best_law_held_out.png",
        "best_law_loops.png",
        "force_velocity.png",
        "ladder.png",
    ]
    assert page.count("data:image/png") == 4 and "could not be made" not in page
    for table in (comparison.table(), comparison["linear"].table(title="Parameters of linear")):
        assert table.to_html() in page
    order = [
        "Records",
        "<li>positive stroke is rebound",
        "How good the laws are",
        "The best law: bilinear",
        "<h2>linear",
    ]
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    assert all(sentence in page for sentence in comparison.verdict)


def test_a_page_on_one_ride_or_several(rides: dict[str, Response], tmp_path: Path) -> None:
    page = ride_report(rides, title="A bump", laws={"soft": Linear(1500.0)}, folder=tmp_path).to_html()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["damper.png", "ride.png"]
    assert "<h1>A bump</h1>" in page and "<p>soft: Linear(rate=1500.0)</p>" in page
    assert "Use of the dampers beside the records of their laws" in page and "<li>firm: damper: velocity" in page
    assert "change [%]" in page
    alone = ride_report(rides["soft"]).to_html()
    assert alone.count("data:image/png") == 2 and "Use of the dampers" not in alone and "change [%]" not in alone


def test_a_page_on_a_tuning(rides: dict[str, Response]) -> None:
    road = roads.white("C", 20.0)
    result = tune.minimise("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), road)
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    fresh = tune.rescore(result, [bump], duration=1.0, dt=0.002)
    page = tuning_report(result, rescored=fresh, rides=rides).to_html()
    assert page.count("data:image/png") == 2 and "could not be made" not in page
    tables = (result.table(), result.parameter_table(), fresh.table())
    assert all(table.to_html() in page for table in tables)
    assert fresh.summary in page and "not an optimum" not in page
