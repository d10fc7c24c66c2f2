"""Pictures of rides, sweeps and tunings in the sign of a shop: what has the direction of the damper turns, no more."""

import dataclasses
import re

import numpy as np
import pytest
import xarray

from jaxdamp import plots, roads, simulate, vehicles
from jaxdamp._display import Display, shown_in
from jaxdamp._types import Axes
from jaxdamp.bench import SineTest
from jaxdamp.dampers import Linear, with_fitted_range
from jaxdamp.identify import ExperimentDesign
from jaxdamp.metrics import MetricValues
from jaxdamp.parameters import free_parameters
from jaxdamp.plots import _ride_panels, _ride_spectra, _rides, _style, tunings
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult
from jaxdamp.vehicles import ChannelKind
from tests.vehicles import fleet


SHOP = Display("imperial", "compression-positive")
DIRECTED = (ChannelKind.STROKE, ChannelKind.DAMPER_VELOCITY, ChannelKind.FORCE)
MEAN = "front_working_space_mean"


def numbers(axes: Axes) -> tuple[np.ndarray, np.ndarray]:
    """Where ticks of the ordinate are, and what is written there."""
    at = axes.yaxis.get_major_locator()()
    texts = axes.yaxis.get_major_formatter().format_ticks(list(at))
    assert len(at) > 2
    return np.asarray(at), np.array([float(text.replace("−", "-")) for text in texts])


@pytest.fixture(scope="module")
def half_car() -> Response:
    car = vehicles.presets.half_car_002(with_fitted_range(Linear(1500.0), velocity=(-0.01, 0.01)))
    with pytest.warns(UserWarning, match="fitted to"):
        return simulate(car, roads.cosine_bump(0.05, start=0.1, length=2.0, speed=10.0), duration=0.5, dt=0.005)


def test_channels_turn_by_their_kind(half_car: Response) -> None:
    known = half_car.system.layout.by_name
    channels = list({channel.kind: name for name, channel in known.items()}.values())
    with shown_in(SHOP):
        figure = plots.ride(half_car, channels=channels)
    (said,) = [figure.get_supxlabel()]
    assert "in/s" in said and not re.search(r"\d m/s", said)  # of the range of the law
    for axes, name in zip(figure.axes, channels, strict=False):
        directed, label = known[name].kind in DIRECTED, " ".join(axes.get_ylabel().split())
        assert axes.yaxis_inverted() == directed == bool(re.search(r"\(\+ (compression|resists compression)\)", label))
        at, shown = numbers(axes)
        factor = 1e-3 if known[name].unit == "m" else 1.0  # strokes are drawn in mm
        expected = factor * SHOP.of(known[name].unit, signed=directed).factor
        np.testing.assert_allclose(shown, expected * at, rtol=1e-3, atol=1e-9)


def test_numbers_beside_a_map_have_the_unit_and_the_sign_of_its_label(swept: xarray.Dataset) -> None:
    grip = swept["rms_dynamic_tyre_load"]
    mean = (1e-5 * (grip - 480.0)).assign_attrs(units="m")
    data = swept.assign({MEAN: mean})
    with shown_in(SHOP):
        for name, turned in (("rms_dynamic_tyre_load", False), (MEAN, True)):
            figure = plots.sweep(data, name, limits={MEAN: (-1e-4, 1e-3)})
            at, shown = numbers(figure.axes[1])
            unit = SHOP.of(data[name].attrs["units"], signed=turned)
            np.testing.assert_allclose(shown, unit.factor * at, rtol=1e-3, atol=1e-9)
            assert f"[{unit.unit}]" in figure.axes[1].get_ylabel() and figure.axes[1].yaxis_inverted() == turned
            legend = [text.get_text() for text in figure.legends[0].get_texts()]
            assert "front suspension travel, mean below −0.0394 in" in legend
            assert "front suspension travel, mean above 0.00394 in" in legend
            best = float(data[name].where((mean >= -1e-4) & (mean <= 1e-3)).min())
            word = "largest" if turned else "smallest"
            assert f"{word} within the limits: {_style.short(unit(best))} {unit.unit}" in legend[0]


def test_logarithmic_axes_are_numbered_in_their_unit(responses: dict[str, Response]) -> None:
    law = Linear(1500.0)
    tests = tuple(SineTest(stroke, 1.0) for stroke in (0.001, 0.1))
    design = ExperimentDesign(law, tests, free_parameters(law), np.eye(1), "D")
    body, gains = _style.new_figure(8.0, 3.0).subplots(1, 2)
    with shown_in(SHOP):
        _ride_spectra.gains([body, gains], _rides.Rides.of_responses({"": responses["soft"]}, None))
        runs = plots.experiment(design).axes[0]
    for axes, unit, said in ((gains, "N/mm", "[lbf/in]"), (runs, "m/s", "peak velocity [in/s]")):
        at, shown = numbers(axes)
        assert axes.get_ylabel() == said and axes.get_yscale() == "log"
        np.testing.assert_allclose(shown, SHOP.of(unit).factor * at, rtol=2e-3)


def test_the_sheet_of_a_bump_draws_the_height_of_the_body(half_car: Response) -> None:
    assert all(f"z_{car.frame().main_body.name}" in car.units for car in fleet.vehicles().values())
    axes = _style.new_figure(8.0, 3.0).subplots()
    with shown_in(SHOP):
        _ride_spectra.event(axes, _rides.Rides.of_responses({"": half_car}, None))
    height = 1e3 * np.asarray(half_car["z_sprung"])
    line = axes.get_lines()[0]
    np.testing.assert_allclose(np.asarray(line.get_ydata(), float), height - height[0])
    assert axes.get_ylabel().startswith("[in]")
    assert f"up {_style.short(height.max() / 25.4)} in" in str(line.get_label())


def test_a_metric_that_may_be_negative_has_no_change_in_percent(
    tuned: TuneResult, responses: dict[str, Response]
) -> None:
    name = "working_space_mean"
    before, after = (MetricValues({name: mean}) for mean in (-0.002, 0.001))
    changed = dataclasses.replace(tuned, before=before, after=after, units={name: "m"})
    panels = _style.new_figure(8.0, 3.0).subplots(1, 2)
    with shown_in(Display("metric", "compression-positive")):
        tunings._bars(panels[0], changed)
        _ride_panels._bar(panels[1], _rides.Rides.of_responses(responses, {name: (-0.05, 0.05)}), 0, name)
    (label,), (text,) = panels[0].get_yticklabels(), panels[1].texts
    assert label.get_text() == "suspension travel, mean\n2 mm → −1 mm"
    means = [-1e3 * float(response.metrics()[name]) for response in responses.values()]
    assert text.get_text().endswith(":  " + " → ".join(f"{_style.short(mean)} mm" for mean in means))
    assert not panels[1].patches and not panels[1].get_lines()
