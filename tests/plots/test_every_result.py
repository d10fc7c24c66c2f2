"""Every result has a picture of its own, with a title and units."""

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from jaxdamp import bench, identify, plots, roads, tune, vehicles
from jaxdamp._guesses import shared_names
from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.dampers import Bilinear
from jaxdamp.identify import Posterior, Spread, TargetFit
from jaxdamp.identify.targets import Met
from jaxdamp.tune import Rescore


@pytest.fixture(scope="module")
def runs() -> BenchSet:
    dyno = VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=200.0, force_noise=5.0)
    return dyno.run([SineTest(0.02, f, name=f"{f:g}Hz") for f in (0.5, 1.0, 2.0)])


def titles(figure: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


def test_records(runs: BenchSet) -> None:
    figure = runs.plot()
    assert titles(figure) == ["Last full cycle: force over velocity", "Force over stroke", "Whole records", ""]
    (slow, *_), run = figure.axes[0].get_lines(), runs["0.5Hz"]
    cycle = run.force[bench.last_steady_cycle(run)]
    np.testing.assert_array_equal(np.asarray(slow.get_ydata(), float), [*cycle, cycle[0]])  # closed
    assert [len(f.axes[3].get_lines()) for f in (runs[0].plot(), figure)] == [2, 4]  # and the line through zero
    assert all("[" in axes.get_ylabel() for axes in figure.axes)


def test_modes() -> None:
    modes = vehicles.modes(vehicles.presets.quarter_car_000())
    figure = modes.plot()
    assert [t.split(" Hz")[0] for t in titles(figure)] == [f"{f:.3g}" for f in modes.frequency]
    widths = [bar.get_width() for bar in figure.axes[1].patches if isinstance(bar, Rectangle)]
    np.testing.assert_allclose(np.abs(widths), np.abs(modes.damped_shapes[:, 1]))
    rows = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert rows == ["body displacement", "unsprung displacement"]


def test_roughness_of_a_road() -> None:
    road = roads.iso8608("C", speed=20.0, duration=60.0, seed=3, ramp=0.0)
    found = roads.assess_roughness(np.asarray(road.height(0.005 * np.arange(12_000.0)))[:, 0], 0.1)
    figure = found.plot()
    (axes,) = figure.axes
    assert titles(figure) == ["Road of class C"] and {"B", "C"} <= {text.get_text() for text in axes.texts}
    line = next(line for line in axes.get_lines() if str(line.get_label()).startswith("straight line"))
    x, y = np.log(np.asarray(line.get_xydata(), float)).T
    assert (y[1] - y[0]) / (x[1] - x[0]) == pytest.approx(-found.waviness)


def test_targets() -> None:
    met = [Met("frequency", 1.2, 0.01, 1.215), Met("ratio", 0.3, 0.1, 0.28)]
    ended = {"warnings": (), "status": identify.Status.CONVERGED, "steps": 3}
    result = TargetFit(model=None, parameters=(), covariance=np.zeros((0, 0)), targets=tuple(met), **ended)
    (axes,) = result.plot().axes
    np.testing.assert_allclose(np.asarray(axes.get_lines()[0].get_xdata(), float), [1.5, -0.2])


def test_fits_of_many_dampers_and_a_posterior(runs: BenchSet) -> None:
    many = identify.fit_many(Bilinear, {"one": runs[:1], "two": runs[1:2], "three": runs[2:]})
    figure = many.plot()
    assert titles(figure) == ["rebound rate", "compression rate", "root of the mean squared force error"]
    np.testing.assert_allclose(np.asarray(figure.axes[0].get_lines()[0].get_xdata(), float), many.values[:, 0])
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["one", "two", "three"]
    long = dataclasses.replace(many, names=tuple(f"damper of the second prototype, front left, {n}" for n in range(3)))
    figure = long.plot()
    figure.draw_without_rendering()
    assert all(axes.bbox.height > 0.6 * figure.bbox.height for axes in figure.axes)
    assert all(axes.bbox.width > 0.2 * figure.bbox.width for axes in figure.axes)
    settings = dataclasses.replace(many, settings=(1.0, 2.0, 4.0)).plot()
    np.testing.assert_allclose(np.asarray(settings.axes[0].get_lines()[0].get_xdata(), float), [1.0, 2.0, 4.0])

    fit = identify.fit(Bilinear, runs)
    assert fit.evidence is not None
    samples = np.random.default_rng(0).normal(2600.0, 5.0, (400, 1))
    spread = Spread("law.rebound_rate", "N s/m", 2600.0, 5.0, (2590.0, 2610.0), 1.0, 400.0)
    (axes,) = Posterior(fit.evidence, samples, (spread,), 0).plot().axes
    assert (
        sum(bar.get_height() for bar in axes.patches if isinstance(bar, Rectangle)) == 400
        and axes.get_xlabel() == "rebound rate [N s/m]"
    )


def test_a_tuning_on_other_roads() -> None:
    before = {"grip": np.array([100.0, 200.0]), "mean": np.array([-1.0, 1.0])}
    after = {"grip": np.array([90.0, 190.0]), "mean": np.array([0.0, 1.0])}
    figure = Rescore(before, after, {"grip": "N", "mean": "m"}, "grip").plot()
    (axes,) = figure.axes
    np.testing.assert_allclose(np.asarray(axes.get_lines()[0].get_xdata(), float), [-10.0, -5.0])
    assert titles(figure) == ["Ride metrics on 2 other roads"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["grip (minimised)"]


def test_every_result_with_a_table_has_a_picture() -> None:
    words = {"LimitCheck", "Table", "Report", "MetricValues"}  # drawn by the evaluation, or numbers of other results
    for package in (bench, identify, roads, tune, vehicles):
        for name in [*package.__all__, *shared_names(package)]:
            kind = getattr(package, name)
            if isinstance(kind, type) and hasattr(kind, "table") and name not in words:
                assert hasattr(kind, "plot"), f"{name} has a table and no picture"


def test_figures_say_what_they_show(runs: BenchSet) -> None:
    law = Bilinear(2600.0, 1200.0)
    assert titles(plots.force_velocity(law, runs=list(runs)[:1])) == ["Force over velocity: bilinear, 0.5Hz"]
    assert titles(plots.force_velocity({"a": law}, runs=list(runs))) == ["Force over velocity: 3 records"]
    assert titles(plots.force_velocity(law, title="Twin")) == ["Twin"]


@pytest.mark.slow
def test_a_figure_of_compared_dampers_says_what_it_shows() -> None:
    pair = {"A": Bilinear(2600.0, 1200.0), "B": Bilinear(3000.0, 1500.0)}
    compared = tune.compare_dampers(pair, vehicles.presets.quarter_car_000, roads.white("C", 20.0))
    assert titles(compared.plot()) == ["Ride metrics beside those of A, on a white road"]
