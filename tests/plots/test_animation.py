"""A vehicle in motion, as a page for the browser."""

import json
import re

import numpy as np
import pytest

from jaxdamp import plots, roads, simulate
from jaxdamp.dampers import Linear
from jaxdamp.vehicles import presets
from tests.export.browser import is_played_and_set, started


ROAD = roads.cosine_bump(0.05, start=0.1, length=3.0, speed=15.0)


def data_of(path):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', path.read_text(), re.DOTALL)
    assert found
    return json.loads(found[1])


@pytest.fixture(scope="module")
def half_car():
    return simulate(presets.half_car_002(damper=Linear(1500.0)), ROAD, duration=0.5)


def test_the_page_holds_the_heights_and_forces_of_the_response(half_car, tmp_path):
    data = data_of(half_car.animate(tmp_path / "car.html"))
    design, run = data["designs"][0], half_car
    assert data["step"] == pytest.approx(0.01) and len(design["signal"]) == 51
    upper, lower = (design["points"][k] for k in design["dampers"][0]["ends"])
    ahead = upper["ahead"]
    assert ahead == lower["ahead"] > 0.5
    expected = np.asarray(run["z_sprung"] + ahead * run["pitch"])[::10]
    np.testing.assert_allclose(1e-4 * np.array(upper["height"]), expected, atol=6e-5)
    np.testing.assert_allclose(1e-4 * np.array(lower["height"]), np.asarray(run["z_front_unsprung"])[::10], atol=6e-5)
    assert [damper["name"] for damper in design["dampers"]] == ["front damper", "rear damper"]
    np.testing.assert_allclose(design["dampers"][0]["force"], np.asarray(run["front_damper_force"])[::10], atol=0.51)
    np.testing.assert_allclose(1e-4 * np.array(design["wheels"][1]["road"]), np.asarray(run.road)[::10, 1], atol=6e-5)
    assert design["speed"] == 15.0


@pytest.mark.parametrize(
    "make",
    [presets.full_car_jazar, *(pytest.param(m, marks=pytest.mark.slow) for m in (presets.m113_003, presets.truck_001))],
)
def test_every_damper_and_wheel_is_drawn(make, tmp_path):
    car = make()
    run = simulate(car, ROAD, duration=0.2)
    design = data_of(run.animate(tmp_path / "car.html"))["designs"][0]
    assert len(design["wheels"]) == len(car.wheel_names) and design["bodies"]
    assert {damper["name"].replace(" ", "_") for damper in design["dampers"]} >= set(run.dampers)
    for damper in design["dampers"]:
        upper, lower = damper["ends"]
        place = design["wheels"][-1 - lower]["point"] if lower < 0 else lower
        assert all(
            design["points"][upper][key] == pytest.approx(design["points"][place][key]) for key in ("ahead", "left")
        )


def test_of_a_long_run_the_first_minute_is_shown(tmp_path):
    run = simulate(presets.quarter_car_000(), roads.sine(0.01, frequency=1.0), duration=70.0, every=10)
    data = data_of(run.animate(tmp_path / "car.html"))
    assert len(data["designs"][0]["signal"]) == 6001 and data["cut"] == " The first 60 of 70 s."


def test_what_cannot_be_shown_is_refused(half_car, tmp_path):
    with pytest.raises(ValueError, match=r"be a file NAME.html"):
        half_car.animate(tmp_path / "car.gif")
    with pytest.raises(ValueError, match=r"`responses\['after'\]` must have the instants of the first one"):
        half_car.between(0.0, 0.4).animate(tmp_path / "car.html", before=half_car)
    with pytest.raises(ValueError, match="at least one"):
        plots.animation({}, tmp_path / "car.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_it_plays_in_a_browser(half_car, tmp_path):
    page = tmp_path / "car.html"
    plots.animation({"before": half_car, "</script><b>": half_car}, page, title="<i>bump</i>")
    with started() as browser:
        browser.open(page)
        assert browser.evaluate("document.querySelector('h1').textContent") == "<i>bump</i>"
        is_played_and_set(browser, "0.25", "0.25 of 0.50 s")
        for width in (390, 1280):
            browser.open(page, width=width)
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
        assert browser.evaluate("document.querySelectorAll('h2')[1].textContent") == "</script><b>"
        assert not browser.troubles()
