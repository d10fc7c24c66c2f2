"""Pictures of what is unusual: long names, many curves, small numbers, curves over one another, nothing that moves."""

import dataclasses
import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

from jaxdamp import bench, plots, roads, simulate, vehicles
from jaxdamp._display import Display, shown_in
from jaxdamp.bench import BenchSet
from jaxdamp.dampers import Linear
from jaxdamp.plots import _rides, _style
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


COMFORT, GRIP = "weighted_rms_sprung_acceleration", "rms_dynamic_tyre_load"
LONG = "Dämpfer vorne links, Müller & Söhne, Prüfung № 12345 bei −20 °C, final_v2"


def check_room(figure: Figure, least: float = 0.5) -> None:
    """Legends and names are within the page, and leave this share of its width to the axes."""
    figure.draw_without_rendering()
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0.0 and box.y1 <= figure.bbox.y1
    for name in figure.axes[0].texts:
        assert name.get_window_extent().y1 <= figure.bbox.y1
    assert max(axes.bbox.width for axes in figure.axes) >= least * figure.bbox.width


@pytest.mark.filterwarnings("error")
def test_long_names_leave_room_for_curves(runs: BenchSet, responses: dict[str, Response]) -> None:
    laws = {f"{LONG} {number}": Linear(1000.0 * number) for number in (1, 2)}
    figure = plots.force_velocity(laws, np.linspace(-1.0, 1.0, 11))
    check_room(figure)
    assert {name.get_text()[-6:] for name in figure.axes[0].texts} == {"l v2 1", "l v2 2"}  # the ends, which differ
    records = [dataclasses.replace(run, name=f"{LONG} {number}") for number, run in enumerate(runs)]
    check_room(plots.records(records))
    check_room(plots.ride({f"{LONG} {name}": one for name, one in responses.items()}, weighting="Wk"))


def test_a_small_panel_of_a_sheet_has_no_legend_over_its_curves(figures: dict[str, Figure]) -> None:
    (panel,) = [axes for axes in figures["ride sheet"].axes if axes.get_title(loc="left").startswith("Transmiss")]
    assert panel.get_legend() is None and len(panel.get_lines()) >= 2


def test_many_laws_and_frequencies_have_a_legend_within_the_page() -> None:
    laws = {f"law {number}": Linear(1000.0 + 50.0 * number) for number in range(60)}
    figure = plots.force_velocity(laws, np.linspace(-1.0, 1.0, 11))
    check_room(figure)
    assert figure.legends[0].get_texts()[-1].get_text().startswith("and ")
    card = plots.law_card(Linear(1000.0), frequencies=np.linspace(0.5, 10.0, 30).tolist())
    check_room(card, 0.2)
    boxes = [legend.get_window_extent() for legend in card.legends]
    assert not boxes[0].overlaps(boxes[1])


def test_names_at_the_ends_of_curves_stay_beside_the_axes() -> None:
    laws = {f"law {number}": Linear(1000.0 + number) for number in range(10)}
    axes = plots.force_velocity(laws, np.linspace(-1.0, 1.0, 11)).axes[0]
    heights = np.sort([name.xyann[1] for name in axes.texts if isinstance(name, Annotation)])
    assert heights[0] >= 0.0 and heights[-1] <= 1.0 and np.diff(heights).min() >= 0.049


@pytest.mark.parametrize("largest", [3.3e-4, 0.009, 5.0])
def test_numbers_along_an_axis_have_room(largest: float) -> None:
    figure = _style.new_figure(4.6, 3.0)
    axes = figure.subplots()
    axes.plot([-largest, largest], [-1.0, 1.0])
    _style.dress(axes, _style.VELOCITY, _style.FORCE)
    check_numbers_along(axes)


@pytest.mark.parametrize("ends", [(0.5, 0.7), (3.0, 4.2), (0.1, 30.0), (2.0, 90.0)])
@pytest.mark.parametrize("units", ["SI", "imperial"])
def test_numbers_along_a_logarithmic_axis_have_room(ends: tuple[float, float], units: str) -> None:
    figure = _style.new_figure(9.0, 3.0)
    axes = figure.subplots(1, 4)[0]
    axes.loglog(ends, [1.0, 10.0])
    _style.plain_log_axis(axes.xaxis)
    with shown_in(Display(units)):
        _style.dress(axes, "velocity [m/s]", "")
    check_numbers_along(axes)


def check_numbers_along(axes: Axes) -> None:
    """The labels of two or more ticks of an abscissa, none over another."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    low, high = axes.get_xlim()
    labels: list[Text] = [t.label1 for t in axes.xaxis.get_major_ticks() if low <= t.get_loc() <= high]
    boxes = [label.get_window_extent() for label in labels]
    assert len(boxes) > 1 and all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))


def test_curves_that_hide_one_another_are_named() -> None:
    laws = {"one": Linear(1000.0), "other": Linear(1001.0), "third": Linear(1500.0)}
    figure = plots.force_velocity(laws, np.linspace(-1.0, 1.0, 11))
    assert figure.get_supxlabel().strip() == "Curves over one another, within 0.5 % of the largest force: one, other."
    assert not plots.force_velocity({"one": Linear(1000.0), "third": Linear(1500.0)}).get_supxlabel()


def test_curves_of_a_sweep_are_named_in_words_and_limits_are_red(swept: xarray.Dataset) -> None:
    data = swept.isel(spring_rate=slice(0, 9, 2))
    figure = plots.sweep(data, COMFORT, over="damper.rate", limits={GRIP: 480.0, COMFORT: 0.9})
    curves = figure.legends[0]
    assert curves.get_texts()[0].get_text() == "spring rate = 10 N/mm"
    rings = [c for c in figure.axes[0].collections if len(c.get_edgecolor())]
    red = to_rgba(_style.BAD)
    assert len(rings) == 2 and all(np.allclose(ring.get_edgecolor(), red) for ring in rings)
    figure.draw_without_rendering()
    assert not curves.get_window_extent().overlaps(figure.axes[0].bbox)  # not over the curves


def test_a_map_of_equal_numbers_says_which(swept: xarray.Dataset) -> None:
    equal = swept.assign({COMFORT: xarray.full_like(swept[COMFORT], 0.75)})
    (legend,) = plots.sweep(equal, COMFORT).legends
    assert legend.get_texts()[0].get_text() == "0.75 m/s² at 99 of 99 points"


@pytest.mark.filterwarnings("error")
def test_a_plane_of_failed_points_says_so(swept: xarray.Dataset) -> None:
    lost = {name: xarray.full_like(swept[name], np.nan) for name in (COMFORT, GRIP)}
    figure = plots.sweep(swept.assign(lost | {"failed": ~swept["failed"]}), COMFORT, against=GRIP)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["99 of 99 points failed"]
    np.testing.assert_allclose(figure.axes[1].get_ylim(), [500.0, 3000.0])  # of the bar of colours


@pytest.fixture(scope="module")
def still(responses: dict[str, Response]) -> Response:
    """On a level road of the shape of another one."""
    road = roads.band_limited(0.5, 20.0, rms=0.003, duration=12.0, dt=0.01, seed=3)
    level = eqx.tree_at(lambda one: one.samples, road, jnp.zeros_like(road.samples))
    return simulate(responses["soft"].vehicle, level, dt=0.005)


@pytest.mark.filterwarnings("error")
def test_a_car_that_does_not_move_has_pictures_that_say_so(still: Response) -> None:
    figure = plots.ride(still, weighting="Wk")
    figure.draw_without_rendering()
    assert "no motion" in [text.get_text() for axes in figure.axes for text in axes.texts]
    _, time, energy = plots.damper_use(still).axes
    assert np.max(time.get_lines()[0].get_ydata()) == 100.0 and np.ptp(time.get_xlim()) > 1.0
    assert np.isnan(np.asarray(energy.get_lines()[0].get_ydata(), float)).all()


def test_spectra_of_a_bump_end_where_their_window_begins(tuned: TuneResult) -> None:
    spectra = [axes for axes in tuned.plot().axes if "Spectrum" in axes.get_title(loc="left")]
    assert spectra and all(high / low <= 1.01e6 for low, high in (axes.get_ylim() for axes in spectra))


def test_a_preflight_without_findings_has_no_colours(runs: BenchSet) -> None:
    clean = dataclasses.replace(bench.preflight(runs), findings=())
    assert not plots.preflight(clean).legends


@pytest.mark.slow
def test_a_sheet_of_a_truck_shows_dampers_that_move() -> None:
    road = roads.iso8608("D", speed=10.0, duration=2.0, seed=1)
    shown = _rides.Rides.of_responses({"": simulate(vehicles.presets.truck_001(), road, dt=0.005)}, None)
    assert shown.dampers() == ["front.damper"]
