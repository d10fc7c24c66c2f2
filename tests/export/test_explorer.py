"""The page of a law: written for every law, and driven in a browser, where its numbers are those of the library."""

import itertools
import json
import re

import jax
import numpy as np
import pytest

from jaxdamp import Ride, plots, respond, simulate
from jaxdamp._display import Display, shown_in
from jaxdamp._types import Number
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import (
    AbstractMemoryless,
    Besinger,
    CoulombFriction,
    GasSpring,
    Lag,
    Linear,
    MotionRatio,
    Scheduled,
    with_command,
)
from jaxdamp.export import from_json, to_explorer, to_json
from jaxdamp.export._law_program import LawProgram
from jaxdamp.export._ride_program import RideProgram
from jaxdamp.export.explorer_page import _of_car
from jaxdamp.metrics import power_spectral_density
from jaxdamp.parameters import parameter, replace, with_values
from jaxdamp.roads import cosine_bump, from_profile, iso8608
from jaxdamp.vehicles import presets
from jaxdamp.vehicles.channels import OF_LINK
from tests.dampers.test_contract import LAWS
from tests.export.browser import started


DURATION, CLOSE = 4.0, 1e-9
VALVE = Besinger(900.0, 2800.0, 700.0, 0.25, 0.05)
RUN_OVER = from_profile(np.linspace(0.0, 100.0, 401), 0.01 * np.sin(np.linspace(0.0, 60.0, 401)), 10.0)


@pytest.fixture(scope="module")
def browser():
    with started() as browser:
        yield browser


def page(law, folder, browser=None, *, duration: float | None = DURATION, **options):
    file = to_explorer(law, folder / "law.html", duration=duration, **options)
    if browser is not None:
        browser.open(file)
    return file


def cells(browser, side=0):
    """The metrics that the page shows, by name."""
    rows = "[...document.querySelectorAll('tr[data-metric]')]"
    value = f"Number(row.querySelectorAll('[data-value]')[{side}].dataset.value)"
    return dict(browser.evaluate(f"{rows}.map((row) => [row.dataset.metric, {value}])"))


def number(browser, path):
    return float(browser.evaluate(f"document.querySelector('[data-path=\"{path}\"]').dataset.value"))


def is_ride(shown, vehicle, road, **options):
    expected = Ride(vehicle, road, metrics=list(shown), duration=DURATION, **options)()
    for name, value in shown.items():
        np.testing.assert_allclose(value, float(expected[name]), CLOSE, 1e-12, err_msg=name)


def is_moving(browser, vehicle, road):
    """The picture in motion has the heights and forces of the library."""
    substeps = browser.evaluate("state.substeps")
    response = simulate(vehicle, road, duration=DURATION, substeps=substeps)
    shown = browser.evaluate("state.results.law.moving.map((values) => [...values])")
    coordinates = len(vehicle.coordinates)
    expected = np.asarray(response.motion)[::10, :coordinates].T
    np.testing.assert_allclose(shown[:coordinates], expected, CLOSE, CLOSE * np.abs(expected).max())
    forces = np.array([response[f"{name}_force"][::10] for name in response.dampers])
    np.testing.assert_allclose(shown[coordinates:], forces, CLOSE, CLOSE * np.abs(forces).max())
    upper = browser.evaluate("DATA.drawing.dampers[0].ends[0]")
    point = browser.evaluate(f"DATA.drawing.points[{upper}]")
    height = response["z_sprung"] + (point["ahead"] * response["pitch"] if "pitch" in response.units else 0.0)
    drawn = browser.evaluate(f"[...film.designs[1].points[{upper}].height]")
    np.testing.assert_allclose(drawn, 1e4 * np.asarray(height)[::10], 1e-6, 1e-6)
    road_drawn = browser.evaluate("film.designs[1].wheels.map((wheel) => [...wheel.road])")
    np.testing.assert_allclose(road_drawn, 1e4 * np.asarray(response.road)[::10].T, CLOSE, 1e-6)


def record(law, name="measured", time=None):
    time = np.arange(0.0, 1.5, 1e-3) if time is None else time
    turn = 2.0 * np.pi * 2.0 * time
    x, v = 0.02 * np.sin(turn), 0.02 * 4.0 * np.pi * np.cos(turn)
    return BenchRun.from_arrays(name, time, x, np.asarray(respond(law, time, x, v)) + 5.0 * np.sin(50.0 * turn), v)


def test_a_moved_slider_is_followed_by_the_numbers_of_the_library(tmp_path, browser):
    car = presets.quarter_car_000
    page(VALVE, tmp_path, browser)
    road = iso8608("C", 20.0, DURATION, seed=0)
    before = cells(browser)
    assert {"weighted_rms_sprung_acceleration", "dynamic_load_coefficient", "working_space_rms"} < set(before)
    is_ride(before, car(VALVE), road)
    browser.click('[data-slider="rebound_rate"]')
    browser.press("ArrowRight", 39, times=40)
    rebound = number(browser, "rebound_rate")
    assert rebound > 3000.0
    changed = replace(VALVE, {"rebound_rate": rebound})
    is_ride(cells(browser), car(changed), road)
    is_moving(browser, car(changed), road)
    assert cells(browser, side=1) == before  # the baseline stays
    browser.type('[data-path="sprung_mass"]', "900")
    is_ride(cells(browser), replace(car(changed), {"sprung_mass": 900.0}), road)
    is_ride(cells(browser, side=1), replace(car(VALVE), {"sprung_mass": 900.0}), road)
    browser.type('[data-path="compression_rate"]', "10")
    assert "compression_rate must be greater than" in browser.evaluate(
        "document.getElementById('lawError').textContent"
    )
    browser.click('[data-reset="rebound_rate"]')
    assert number(browser, "rebound_rate") == 2800.0
    browser.click("#reset")
    assert cells(browser) == before and number(browser, "sprung_mass") == 1200.0
    assert browser.evaluate("document.getElementById('lawError').textContent") == ""
    assert not browser.troubles()


def test_the_other_laws_of_the_vehicle_keep_their_conditions(tmp_path, browser):
    law = Linear(1500.0)
    page(law, tmp_path, browser, vehicle=with_values(presets.half_car_002(law), {"rear.damper": VALVE}), duration=0.5)
    text = "document.getElementById('lawError').textContent"
    assert browser.evaluate(text) == ""
    browser.type('[data-path="rear.damper.compression_rate"]', "10")
    assert browser.evaluate(text).startswith("rear.damper.compression_rate must be greater than")
    assert not browser.troubles()


def test_a_number_changed_before_the_check_of_the_step_leaves_the_step(tmp_path, browser):
    page(VALVE, tmp_path, browser)
    substeps = browser.evaluate("state.substeps")
    later = "window.requestAnimationFrame = (draw) => setTimeout(draw, 3 * CHECK_AFTER);"
    change = "const box = document.querySelector('[data-path=\"sprung_mass\"]'); box.value = 600;"
    wait = "new Promise((done) => setTimeout(() => done(state.substeps), 2 * CHECK_AFTER))"
    browser.evaluate(f"{later} {change} box.dispatchEvent(new Event('input'))")
    assert browser.evaluate(wait) == substeps
    browser.evaluate("state.substeps *= 2")
    browser.click("#reset")
    assert browser.evaluate("state.substeps") == substeps


@pytest.mark.slow
def test_roads_spectra_and_channels(tmp_path, browser):
    law = Lag(VALVE, 0.004) + GasSpring(2e6, 6e-5, 1e-4, 1.3)  # its rest depends on its numbers
    page(law, tmp_path, browser, road=RUN_OVER, seed=3)
    car = presets.quarter_car_000(law)
    is_ride(cells(browser), car, RUN_OVER)
    browser.choose("#roadKind", "D")
    browser.choose("#seed", "1")
    browser.type("#speed", "12.5")
    road = iso8608("D", 12.5, DURATION, seed=4)
    is_ride(cells(browser), car, road)
    response = simulate(car, road, duration=DURATION)
    channel = np.asarray(response["sprung_acceleration"])
    place = browser.evaluate("DATA.channels.findIndex((channel) => channel.name === 'sprung_acceleration')")
    shown = browser.evaluate(f"[...state.results.law.records[{place}]]")
    np.testing.assert_allclose(shown, channel, CLOSE, CLOSE * np.abs(channel).max())
    frequency, density = power_spectral_density(channel, 1e-3, 2048)
    ours = browser.evaluate(f"(() => {{ const d = density(state.results.law.records[{place}], 1e-3, 2048);"
                            " return [[...d.frequency], [...d.psd]]; })()")  # fmt: skip
    np.testing.assert_allclose(ours[0], frequency, CLOSE)
    np.testing.assert_allclose(ours[1], density, 1e-6, CLOSE * float(np.max(density)))
    browser.choose("#roadKind", "bump")
    is_ride(cells(browser), car, cosine_bump(0.06, start=1.0, length=5.0, speed=12.5))
    browser.type("#bumpLength", "0")
    assert "must be positive" in browser.evaluate("document.getElementById('roadError').textContent")
    assert not browser.troubles()


def test_channels_turn_where_their_meaning_has_the_direction():
    law = Linear(1500.0)
    car = RideProgram(LawProgram(law, member="."), presets.half_car_002(law), 0.001, 1001)
    kinds = car.vehicle.layout.by_name
    with shown_in(Display(sign="compression-positive")):
        channels = _of_car(car)["channels"]
    assert {"front_stroke", "front_damper_velocity", "front_dynamic_tyre_load"} <= {one["name"] for one in channels}
    for one in channels:
        assert one["signed"] == (kinds[one["name"]].kind in OF_LINK), one
        assert "extension positive" not in one["meaning"]


def test_units_and_sign_of_a_shop(tmp_path, browser):
    measured = record(VALVE)
    with shown_in(Display("imperial", "compression-positive")):
        page(VALVE, tmp_path, browser, records=[measured])
    x, y = browser.evaluate("[charts.loopVelocity.axes.x, charts.loopVelocity.axes.y]")
    assert (x["unit"], y["unit"]) == ("in/s", "lbf")
    np.testing.assert_allclose([x["scale"], y["scale"]], [1.0 / 0.0254, 1.0 / 4.4482216152605])
    drawn = browser.evaluate("[charts.loopVelocity.series[0].x[9], charts.loopVelocity.series[0].y[9]]")
    np.testing.assert_allclose(drawn, [-measured.velocity[9], -measured.force[9]])
    assert browser.evaluate("charts.loopStroke.axes.x.unit") == "in"
    rmse = browser.evaluate("get('fits').querySelector('td').textContent")
    np.testing.assert_allclose(float(rmse.removesuffix(" lbf")), 5.0 / 2**0.5 / 4.448, rtol=0.02)
    box = "document.querySelector('[data-path=rebound_rate]')"
    assert float(browser.evaluate(f"{box}.value")) == pytest.approx(2800.0 * 0.0254 / 4.4482216, rel=1e-3)
    browser.type("[data-path=rebound_rate]", "20")
    assert number(browser, "rebound_rate") == pytest.approx(20.0 * 4.4482216152605 / 0.0254)
    units = browser.evaluate("[...document.querySelectorAll('#metrics .unit')].map((cell) => cell.textContent)")
    assert {"in", "lbf", "m/s²"} <= set(units)
    assert "positive in compression" in browser.evaluate("document.body.textContent")
    assert not browser.troubles()


@pytest.mark.slow
def test_the_saved_law_is_read_back_exactly(tmp_path, browser):
    valve = LAWS["slopes, rounded"]()
    schedule = Scheduled((valve, valve), [0.0, 1.0], 0.3)
    law = MotionRatio(schedule, 0.7) + CoulombFriction(30.0, 0.01)
    page(law, tmp_path, browser, records=[record(VALVE)])
    assert from_json(browser.evaluate("lawDocument()")) == law
    command = next(n for n in browser.evaluate("DATA.law.numbers") if n["kind"] == "command")
    browser.type(f'[data-path="{command["path"]}"]', "0.625")
    slope = "terms.0.law.laws.1.slopes[2]"
    browser.type(f'[data-path="{slope}"]', "1234.5678901234567")
    download = {"behavior": "allow", "downloadPath": str(tmp_path)}
    browser.call("Page.setDownloadBehavior", **download)
    browser.click("#export")
    saved = tmp_path / "law_changed.json"
    for _ in itertools.takewhile(lambda _: not saved.exists(), range(200)):
        browser.evaluate("new Promise((done) => setTimeout(done, 50))")
    changed = from_json(saved)
    slopes = np.array(valve.slopes)
    slopes[2] = 1234.5678901234567
    expected = with_command(replace(law, {"terms.0.law.laws.1.slopes": slopes}), 0.625)
    assert json.loads(to_json(changed)) == json.loads(to_json(expected))
    browser.type(f'[data-path="{slope}"]', "-1")
    typed = browser.evaluate(f"document.querySelector('[data-path=\"{slope}\"]').value")
    assert typed == "-1" and number(browser, slope) == 1234.5678901234567  # what counts stays
    assert json.loads(browser.evaluate("lawDocument()")) == json.loads(saved.read_text())
    assert "must be" in browser.evaluate("document.querySelector('.control .error:not(:empty)').textContent")
    assert not browser.troubles()


def test_a_page_is_the_same_every_time_and_needs_nothing_else(tmp_path):
    text = page(LAWS["sum of lags"](), tmp_path).read_text(encoding="utf-8")
    assert "{{" not in text and "http" not in text.replace("http-equiv", "") and "src=" not in text
    assert text == page(LAWS["sum of lags"](), tmp_path).read_text(encoding="utf-8")


class Sorted(AbstractMemoryless):
    """A law that cannot be printed."""

    rate: Number = parameter("N s/m", "damping coefficient")

    def force_velocity(self, v):
        return jax.numpy.sort(jax.numpy.stack([self.rate * v, 2.0 * self.rate * v]))[0]


def test_a_road_that_does_not_last_whole_steps_is_driven_to_its_last_step(tmp_path):
    at = np.linspace(0.0, 12.2, 62)
    text = page(VALVE, tmp_path, duration=None, road=from_profile(at, 0.01 * np.sin(at), 24.5)).read_text("utf-8")
    assert '"count": 498' in text  # of 0.49796 s


def test_refusals(tmp_path):
    with pytest.raises(NotImplementedError, match="'sort'"):
        to_explorer(Sorted(1000.0), tmp_path / "law.html")
    with pytest.raises(ValueError, match=r"NAME\.html"):
        to_explorer(VALVE, tmp_path)
    with pytest.raises(ValueError, match="hold the law as a damper"):
        to_explorer(VALVE, tmp_path / "law.html", vehicle=presets.quarter_car_000(Linear(1.0)))
    with pytest.raises(ValueError, match="road_class"):
        to_explorer(VALVE, tmp_path / "law.html", road="Z")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["series spring, sum", "LuGre", "mono-tube", "neural hysteresis", "stroke table"])
def test_laws_of_all_kinds_have_a_page(tmp_path, name):
    page(LAWS[name](), tmp_path, duration=0.5)


@pytest.mark.slow
def test_it_speaks_the_words_and_has_the_colours_of_the_pictures(tmp_path, browser):
    law = Lag(Besinger(878.877123, 2804.4567, 700.0, 0.091589123, 0.05), 1.5e-3)
    file = page(law, tmp_path, browser)
    assert browser.evaluate("document.querySelector('h1').textContent") == "Besinger + lag"
    words = browser.evaluate("document.body.innerText")
    assert "in a quarter car" in words and "body acceleration, weighted RMS" in words
    assert not re.search(r"[a-z]_[a-z]|QuarterCar", words)
    boxes = browser.evaluate("[...document.querySelectorAll('input[data-path]')].map((box) => box.value)")
    assert "878.9" in boxes and "0.09159" in boxes and number(browser, "law.compression_rate") == 878.877123
    seen = "['law', 'baseline', 'measured', 'bad', 'curve0', 'curve1', 'curve2', 'curve3'].map((name) => colour(name))"
    roles = [plots.ROLES[name]["color"] for name in ("after", "before", "measured", "limit")]
    palette = re.findall("#[0-9A-F]{6}", str(plots.STYLE["axes.prop_cycle"]))[:4]
    assert [each.upper() for each in browser.evaluate(seen)] == [each.upper() for each in (*roles, *palette)]
    browser.open(file, width=390, height=844)
    assert browser.evaluate("document.documentElement.scrollWidth") <= 390
    browser.call("Emulation.setEmulatedMedia", media="print")
    whole = "(() => { const list = document.querySelector('aside'); return list.scrollHeight - list.clientHeight; })()"
    assert browser.evaluate(whole) <= 1  # nothing of it in a scroll box
    assert browser.evaluate("getComputedStyle(document.querySelector('.buttons')).display") == "none"
    browser.call("Emulation.setEmulatedMedia", media="")
