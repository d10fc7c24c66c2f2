"""The page of a law: the car in motion, which is that of the library."""

import pytest

from jaxdamp.dampers import Linear
from jaxdamp.parameters import replace
from jaxdamp.roads import cosine_bump, iso8608
from jaxdamp.vehicles import presets
from tests.export.browser import is_played_and_set, started
from tests.export.test_explorer import DURATION, RUN_OVER, VALVE, cells, is_moving, is_ride, page


@pytest.fixture(scope="module")
def browser():
    with started() as browser:
        yield browser


@pytest.mark.slow
def test_a_half_car_of_two_axles_in_motion(tmp_path, browser):
    car = presets.half_car_002
    page(VALVE, tmp_path, browser, vehicle=car(VALVE))
    road = iso8608("C", 20.0, DURATION, seed=0)
    is_ride(cells(browser), car(VALVE), road, substeps=browser.evaluate("state.substeps"))
    is_moving(browser, car(VALVE), road)
    assert browser.evaluate("DATA.vehicle.fixed") == ["front distance", "rear distance"]
    assert browser.evaluate("document.querySelector('[data-path=\"front_distance\"]')") is None
    browser.choose("#roadKind", "bump")
    browser.type('[data-path="rebound_rate"]', "1900")
    changed = car(replace(VALVE, {"rebound_rate": 1900.0}))
    is_moving(browser, changed, cosine_bump(0.06, start=1.0, length=5.0, speed=20.0))
    assert not browser.troubles()


@pytest.mark.slow
def test_the_film_plays_and_is_set_to_a_time(tmp_path, browser):
    file = page(VALVE, tmp_path, browser, baseline=Linear(1500.0), road=RUN_OVER)
    browser.evaluate("get('filmLaw').scrollIntoView()")
    is_played_and_set(browser, "1.25", "1.25 of 4.00 s")
    pixels = "get('{}').getContext('2d').getImageData(0, 0, 400, 200).data.join()"
    before, after = (browser.evaluate(pixels.format(name)) for name in ("filmBaseline", "filmLaw"))
    force = browser.evaluate("film.designs[0].dampers[0].force")
    assert before != after and set(before.split(",")) != {"0"}
    browser.type('[data-path="rebound_rate"]', "9000")
    assert browser.evaluate(pixels.format("filmLaw")) != after  # as the sliders are set
    assert browser.evaluate("film.designs[0].dampers[0].force") == force
    assert "drawn as at 20 m/s" not in browser.evaluate("get('filmNote').textContent")
    for dark in (False, True):
        browser.open(file, width=390, height=844, dark=dark)
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390
        assert browser.evaluate("get('filmLaw').getBoundingClientRect().right") <= 390
    assert not browser.troubles()
