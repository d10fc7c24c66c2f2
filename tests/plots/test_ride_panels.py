"""What sheets and sweeps show in numbers: gains, damping ratios, velocities of each damper, the present design."""

import re

import equinox as eqx
import numpy as np
import pytest
import xarray
from matplotlib.text import Text

from jaxdamp import plots, roads, simulate
from jaxdamp._display import Display, shown_in
from jaxdamp.dampers import Bilinear, Linear
from jaxdamp.plots import _ride_spectra, _rides
from jaxdamp.simulation import Response
from jaxdamp.vehicles import frequency_response
from jaxdamp.vehicles.presets import full_car_jazar, quarter_car_000


COMFORT, GRIP = "weighted_rms_sprung_acceleration", "rms_dynamic_tyre_load"


def test_gains_of_a_linear_car_are_those_of_its_frequency_response(responses: dict[str, Response]) -> None:
    soft = responses["soft"]
    shown = _rides.Rides.of_responses({"soft": soft}, None)
    channels = ("sprung_acceleration", "dynamic_tyre_load")
    found = _ride_spectra._gains(shown, 0, channels)
    for channel in channels:
        frequency, gain = found[channel]
        assert frequency[0] < 1.0 and 15.0 < frequency[-1] < 22.0  # the road has nothing beyond
        exact = np.abs(np.asarray(frequency_response(soft.vehicle, frequency)[channel]))
        exact = exact / ((2.0 * np.pi * frequency) ** 2 if channel == channels[0] else 1e3)
        inside = (frequency > 1.5) & (frequency < 19.0)  # below, segments of 4 s do not resolve the resonance
        np.testing.assert_allclose(gain[inside], exact[inside], rtol=0.12)


@pytest.mark.slow
def test_each_damper_of_a_full_car_has_its_own_velocity() -> None:
    road = roads.iso8608("C", speed=20.0, length=100.0, seed=1)
    ride = simulate(full_car_jazar(Bilinear(1500.0, 900.0)), road, duration=2.0)
    shown = _rides.Rides.of_responses({"ride": ride}, None)
    paths = shown.dampers()
    names = [_rides.element(shown, path, 0) for path in paths]
    assert names == ["front_left_damper", "rear_left_damper"]
    for path, name in zip(paths, names, strict=True):
        np.testing.assert_array_equal(_rides.damper_velocity(shown, path, 0), ride[f"{name}_velocity"])


def test_a_sheet_of_a_level_road_is_refused(responses: dict[str, Response]) -> None:
    soft = responses["soft"]
    still = eqx.tree_at(lambda response: response.road_rate, soft, np.zeros_like(soft.road_rate))
    with pytest.raises(ValueError, match=r"`rides` must be driven over a road that is not level .* but is still"):
        plots.ride_sheet({"soft": soft, "still": still})


@pytest.mark.parametrize("shop", [Display("imperial"), Display("metric", "compression-positive"), Display()])
def test_a_ride_sheet_of_a_shop_has_its_numbers(responses: dict[str, Response], shop: Display) -> None:
    """Ticks stand where their numbers belong, in every panel over velocity; amounts in words have the same units."""
    with shown_in(shop):
        figure = plots.ride_sheet(responses)
    over_velocity = [axes for axes in figure.axes if axes.get_xlabel().startswith("velocity")]
    assert len(over_velocity) == 1
    (axes,) = over_velocity
    figure.canvas.draw()
    unit, factor = shop.of("m/s").unit, shop.of("m/s", signed=True).factor
    if unit == "m/s":
        unit, factor = "mm/s", 1e3 * factor
    assert f"[{unit}]" in axes.get_xlabel()
    labels = [(text.get_position()[0], text.get_text()) for text in axes.get_xticklabels() if text.get_text()]
    assert len(labels) > 2
    for at, text in labels:
        assert float(text.replace("−", "-")) == pytest.approx(factor * at, rel=1e-3, abs=1e-6)
    words = " ".join(text.get_text() for text in figure.findobj(Text) if isinstance(text, Text))
    assert bool(re.search(r"\d N\b", words)) == (shop.units != "imperial")


def test_the_damping_ratio_is_the_secant_rate_over_critical_damping() -> None:
    cars = {"before": quarter_car_000(Linear(1500.0)), "after": quarter_car_000(Bilinear(4000.0, 2000.0))}
    figure = plots.damping_ratio(cars, np.linspace(-0.5, 0.5, 101))
    before, after = figure.axes[0].get_lines()
    critical = 2.0 * np.sqrt(60e3 * 1200.0)
    v, ratio = np.asarray(after.get_xdata()), np.asarray(after.get_ydata())
    np.testing.assert_allclose(ratio[v > 0.02], 4000.0 / critical)
    np.testing.assert_allclose(ratio[v < -0.02], 2000.0 / critical)
    np.testing.assert_allclose(np.asarray(before.get_ydata())[v > 0.02], 1500.0 / critical)
    with pytest.raises(ValueError, match="rear"):
        plots.damping_ratio(cars, damper="rear_damper")


def test_sweeps_mark_the_present_design_and_what_no_point_beats(swept: xarray.Dataset) -> None:
    present = {"damper.rate": 1800.0, "spring_rate": 21e3, COMFORT: 0.8, GRIP: 500.0}
    marks = {line.get_label(): line for line in plots.sweep(swept, COMFORT, present=present).axes[0].get_lines()}
    np.testing.assert_array_equal(marks["present"].get_xydata(), [[1800.0, 21e3]])
    outside = plots.sweep(swept, COMFORT, present=present | {"spring_rate": 50e3}).axes[0].get_lines()
    assert "present outside the grid: 1800 N s/m, 50 N/mm" in {line.get_label() for line in outside}
    plane = plots.sweep(swept, COMFORT, against=GRIP, limits={GRIP: 640.0}, present=present).axes[0]
    marks = {line.get_label(): line for line in plane.get_lines()}
    np.testing.assert_array_equal(marks["present"].get_xydata(), [[0.8, 500.0]])
    points = np.stack([swept[COMFORT].values.ravel(), swept[GRIP].values.ravel()], axis=1)
    beyond = np.asarray(marks["tyre load variation, RMS above 640 N"].get_xydata())
    assert len(beyond) == np.count_nonzero(points[:, 1] > 640.0) > 0
    allowed = points[points[:, 1] <= 640.0]
    beaten = [any(np.all(other <= one) and np.any(other < one) for other in allowed) for one in allowed]
    expected = allowed[~np.array(beaten)]
    np.testing.assert_array_equal(marks["no point is better in both"].get_xydata(), expected[expected[:, 0].argsort()])
    with pytest.raises(ValueError, match="against"):
        plots.sweep(swept, COMFORT, against="failed")
