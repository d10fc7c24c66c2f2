"""The page of a law under the motion of records: RMSE and fit, what the page follows, files dropped onto it."""

import dataclasses

import numpy as np
import pytest

from jaxdamp import respond
from jaxdamp._display import Display, shown_in
from jaxdamp.dampers import Besinger, BoucWen, Lag, Linear, Scheduled, with_command
from jaxdamp.identify import fit_percent
from tests.export.browser import started
from tests.export.test_explorer import CLOSE, VALVE, page, record


@pytest.fixture(scope="module")
def browser():
    with started() as browser:
        yield browser


@pytest.mark.slow
def test_loops_records_and_their_fit(tmp_path, browser):
    law = 0.9 * Lag(BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5), 0.003)
    measured = record(Linear(1500.0))
    page(law, tmp_path, browser, records=[measured], baseline=VALVE)
    force = np.asarray(respond(law, measured.time, measured.stroke, measured.velocity))
    fits = browser.evaluate("[state.fits.law, state.fits.baseline]")
    first = browser.evaluate("firstCounted(records[0], DATA.law.states)")  # a cycle of 2 Hz
    assert first in (500, 501)
    assert fits[0]["fit"] == pytest.approx(fit_percent([measured.force[first:]], [force[first:]]), CLOSE)
    other = np.asarray(respond(VALVE, measured.time, measured.stroke, measured.velocity))
    assert fits[1]["rmse"] == pytest.approx(np.sqrt(np.mean((other - measured.force) ** 2)), CLOSE)
    assert "every sample of 1500" in browser.evaluate("document.getElementById('fitNote').textContent")
    browser.choose("#motion", "sines")
    browser.type("#frequencies", "2, 8")
    motion, shown = browser.evaluate(
        "(() => { const m = sine(0.025, 8, DATA.law.states); return [[m.dt, [...m.x], [...m.v], m.first],"
        " [...state.loops[3].loop.force]]; })()"
    )
    dt, x, v, start = motion
    np.testing.assert_allclose(v, np.gradient(x, dt), atol=1e-2)
    expected = np.asarray(respond(law, dt * np.arange(len(x)), np.array(x), np.array(v)))[start:]
    np.testing.assert_allclose(shown, expected, CLOSE, 1e-9)
    browser.type("#frequencies", "fast")
    assert "positive numbers" in browser.evaluate("document.getElementById('loopError').textContent")
    assert not browser.troubles()


@pytest.mark.slow
def test_records_are_compared_where_the_page_follows_what_they_state(tmp_path, browser):
    """A held command drives law and baseline; of what only a fit follows the page draws the record alone."""
    law = Scheduled((VALVE, Besinger(1800.0, 5600.0, 1400.0, 0.25, 0.05)), [0.0, 1.0], 0.25)
    held = dataclasses.replace(record(with_command(law, 0.8)), command=0.8)
    stated = dataclasses.replace(held, settings={"rebound_rate": "2500 N s/m", "series": "A"})
    commands = {"command": None, "command_channel": np.linspace(0.0, 1.0, len(held)), "command_unit": "A"}
    runs = [held, stated, dataclasses.replace(held, **commands)]
    with shown_in(Display(sign="compression-positive")):
        page(law, tmp_path, browser, records=runs, duration=1.0)
    fits = browser.evaluate("[state.fits.law.rmse, state.fits.baseline.rmse]")
    np.testing.assert_allclose(fits, 5.0 / 2**0.5, rtol=0.02)
    beyond = ["", "the rebound rate", "the varying command"]
    assert browser.evaluate("DATA.records.map((record) => record.beyond)") == beyond
    browser.choose("#motion", "2")
    assert "does not follow the varying command" in browser.evaluate("get('fitNote').textContent")
    assert browser.evaluate("[state.loops.length, Object.keys(state.fits).length]") == [1, 0]
    row = "document.querySelector('tr[data-metric=working_space_mean] [data-value]')"
    mean, shown = browser.evaluate(f"[Number({row}.dataset.value), {row}.textContent]")
    assert mean != 0.0 and float(shown.replace("\u2212", "-")) * mean < 0.0
    assert browser.evaluate("charts.spectrum.series[0].y.some((y) => y > 0)")
    assert not browser.troubles()


@pytest.mark.slow
def test_a_file_dropped_onto_the_page(tmp_path, browser):
    page(VALVE, tmp_path, browser)
    measured = record(VALVE)
    file = tmp_path / "run.csv"

    def drop(header, columns):
        np.savetxt(file, np.stack(columns, 1), fmt="%.17g", delimiter=",", header=header, comments="")
        browser.drop(file)
        browser.wait("state.text !== undefined")
        browser.evaluate("new Promise((done) => setTimeout(done, 100))")
        return browser.evaluate("document.getElementById('dropError').textContent")

    assert "like: time [s],stroke [mm]" in drop("a,b,c", [measured.stroke] * 3)
    columns = [-1e3 * measured.stroke, -measured.velocity, -1e-3 * measured.force]
    assert "no unit" in drop("stroke,velocity [m/s],force [kN]", columns)
    assert '"furlong"' in drop("stroke [furlong],velocity [m/s],force [kN]", columns)
    assert "no column of force" in drop("stroke [mm],velocity [m/s],sensor 1", columns)
    header = "time (ms),stroke [mm],velocity_m/s,Force [kN]"
    assert "drive the machine" in drop(header, [1e3 * measured.time, *columns[:2], -columns[2]])
    assert drop(header, [1e3 * measured.time, *columns]) == ""
    browser.choose("#dropSign", "compression")
    assert browser.evaluate("document.getElementById('motion').value") == "dropped"
    force = np.asarray(respond(VALVE, measured.time, measured.stroke, measured.velocity))
    expected = np.sqrt(np.mean((force - measured.force) ** 2))
    assert browser.evaluate("state.fits.law.rmse") == pytest.approx(expected, CLOSE)
    file.write_text(file.read_text().replace("\n", "\nx,1,2,3\n", 1))
    browser.drop(file)
    browser.wait("document.getElementById('dropError').textContent.includes('line 2, time: \"x\" is not a number')")
    assert not browser.troubles()
