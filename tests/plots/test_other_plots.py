import re
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, StepPatch

import jaxdamp
from jaxdamp import metrics, plots, sweeps
from jaxdamp.bench import BenchSet, peak_velocity_points
from jaxdamp.dampers import Bilinear, Dahl, Lag, Linear
from jaxdamp.identify import Comparison
from jaxdamp.plots import _style
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


def _line(axes: Axes, label: str) -> np.ndarray:
    (found,) = [line for line in axes.get_lines() if line.get_label() == label]
    return np.asarray(found.get_xydata())


def _legend(figure: Figure) -> list[str]:
    legends = [*figure.legends, *(legend for axes in figure.axes if (legend := axes.get_legend()) is not None)]
    return [text.get_text() for text in legends[0].get_texts()]


# ---- force_velocity


def test_force_velocity_draws_each_law_where_asked() -> None:
    velocity = np.linspace(-0.5, 0.5, 11)
    laws = {"a": Linear(2000.0), "b": Bilinear(2000.0, 1000.0)}
    figure = plots.force_velocity(laws, velocity)
    (axes,) = figure.axes
    np.testing.assert_allclose(_line(axes, "a"), np.stack([velocity, 2000.0 * velocity], axis=1))
    np.testing.assert_allclose(_line(axes, "b")[:, 1], np.where(velocity > 0, 2000.0, 1000.0) * velocity)
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "velocity [m/s]   (+\N{NO-BREAK SPACE}rebound)",
        "force [N]   (+\N{NO-BREAK SPACE}resists extension)",
    )
    labels = {text.get_text(): text.get_color() for text in axes.texts}  # at the ends of the curves, in their colours
    assert labels == {line.get_label(): line.get_color() for line in axes.get_lines()[:2]}
    assert set(labels) == {"a", "b"} and axes.get_legend() is None


def test_a_law_with_states_is_drawn_settled() -> None:
    figure = plots.force_velocity(Lag(Linear(1000.0), 0.01), np.array([-0.2, 0.0, 0.2]))
    np.testing.assert_allclose(_line(figure.axes[0], "linear + lag (settled)")[:, 1], [-200.0, 0.0, 200.0], atol=1e-6)


def test_the_baseline_is_a_dashed_black_line() -> None:
    (axes,) = plots.force_velocity({"old": Linear(1000.0), "new": Linear(2000.0)}, baseline="old").axes
    (old,) = [line for line in axes.get_lines() if line.get_label() == "old"]
    (new,) = [line for line in axes.get_lines() if line.get_label() == "new"]
    assert (old.get_linestyle(), old.get_color()) == ("--", "#222222")
    assert new.get_linestyle() == "-" and new.get_color() != old.get_color()
    with pytest.raises(ValueError, match="Did you mean 'old'"):
        plots.force_velocity({"old": Linear(1000.0)}, baseline="odl")


def test_a_colour_means_the_same_in_every_figure(responses: dict[str, Response], tuned: TuneResult) -> None:
    def styles(figure: Figure) -> dict[str, tuple[str, str]]:
        lines = {str(line.get_label()): line for axes in figure.axes for line in axes.get_lines()}
        return {name.split(":")[0]: (str(line.get_color()), str(line.get_linestyle())) for name, line in lines.items()}

    laws = {"after": Linear(2e3), "before": Linear(1e3), "other": Linear(3e3)}
    before, after = ("#222222", "--"), ("#0072B2", "-")
    curves = styles(plots.force_velocity(laws, np.linspace(-1.0, 1.0, 5), baseline="before"))
    assert (curves["before"], curves["after"]) == (before, after) and curves["other"] not in (before, after)
    rides: dict[str, Response] = dict(zip(("before", "after"), responses.values(), strict=True))
    for figure in (plots.ride(rides), plots.damper_use(rides), plots.tuning(tuned)):
        drawn = styles(figure)
        assert (drawn["before"], drawn["after"]) == (before, after)
    many = _style.design_styles([str(i) for i in range(18)])
    assert len({(style["color"], style["linestyle"]) for style in many.values()}) == 18


def test_measured_points_lie_under_the_curves(runs: BenchSet) -> None:
    figure = plots.force_velocity(Bilinear(2600.0, 1200.0), runs=tuple(runs))
    (axes,) = figure.axes
    points = _line(axes, "measured at peak velocity")
    assert points.shape == (16, 2)
    peaks = peak_velocity_points(runs)
    np.testing.assert_array_equal(points, np.stack([peaks.velocity.ravel(), peaks.force.ravel()], axis=1))
    assert len(_line(axes, "measured, last cycles")) > 1000
    low, high = axes.get_xlim()
    assert low < min(run.velocity.min() for run in runs) and high > max(run.velocity.max() for run in runs)


def test_a_gap_in_a_curve_and_a_remark_stand_under_the_picture() -> None:
    law = Dahl(stiffness=2e5, friction_force=200.0)
    figure = plots.force_velocity({"dry": law}, np.array([-0.1, -1e-6, 0.0, 1e-6, 0.1]), note="Drawn is one law.")
    drawn = np.isfinite(_line(figure.axes[0], "dry (settled)")[:, 1])
    assert drawn.tolist() == [True, False, True, False, True]
    said = " ".join(figure.get_supxlabel().split())
    assert said.startswith("Drawn is one law. dry: No force at 2 of 5 velocities, at -1e-06 and at 1e-06 m/s")


def test_no_law_is_refused() -> None:
    with pytest.raises(ValueError, match="`laws` must hold at least one"):
        plots.force_velocity({})


# ---- ladder


def test_ladder_has_a_bar_for_each_error(comparison: Comparison) -> None:
    figure = plots.ladder(comparison)
    (axes,) = figure.axes
    widths = [bar.get_width() for bar in axes.patches if isinstance(bar, Rectangle)]
    rungs = sorted(comparison.rungs, key=lambda rung: rung.error)
    fitted = [rung.rmse for rung in rungs]
    held_out = [rung.held_out_rmse for rung in rungs]
    assert widths == pytest.approx([*fitted, *held_out])
    assert axes.get_xlabel().startswith("RMSE of the force [N]")
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        "bilinear (3)",
        "linear (2)",
    ]  # each with an offset
    bold = [label.get_text() for label in axes.get_yticklabels() if label.get_fontweight() == "bold"]
    assert bold == [f"{comparison.best.name} ({comparison.best.parameters})"]
    *bars, noise = _legend(figure)
    assert bars == ["fitted records", "held-out records"] and re.fullmatch(r"noise of the force, [\d.]+ N", noise)
    (line,) = axes.get_lines()
    assert float(np.asarray(line.get_xdata())[0]) == pytest.approx(5.0, rel=0.2)  # of the virtual sensor


# ---- ride


def test_ride_draws_channels_over_time_and_the_spectrum(responses: dict[str, Response]) -> None:
    figure = plots.ride(responses, window=(2.0, 4.0))
    acceleration, stroke, load, spectrum = figure.axes
    response = responses["firm"]
    time = np.asarray(response.time)
    seen = (time >= 2.0) & (time <= 4.0)
    for axes, channel, factor in (
        (acceleration, "sprung_acceleration", 1.0),
        (stroke, "stroke", 1e3),
        (load, "dynamic_tyre_load", 1.0),
    ):
        line = np.asarray(axes.get_lines()[1].get_xydata())
        np.testing.assert_allclose(line, np.stack([time[seen], factor * np.asarray(response[channel])[seen]], axis=1))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == [
        "body acceleration [m/s²]\n(+\N{NO-BREAK SPACE}up)",
        "stroke [mm]\n(+\N{NO-BREAK SPACE}rebound)",
        "dynamic tyre load [N]\n(+\N{NO-BREAK SPACE}more load)",
        "power spectral density [(m/s²)²/Hz]",
    ]
    assert (load.get_xlabel(), spectrum.get_xlabel()) == ("time [s]", "frequency [Hz]")
    assert (spectrum.get_xscale(), spectrum.get_yscale()) == ("log", "log")
    rms = float(metrics.rms(response["sprung_acceleration"]))
    assert _legend(figure)[1] == f"firm: RMS {rms:.3g} m/s²"


def test_the_area_under_the_spectrum_is_the_mean_square(responses: dict[str, Response]) -> None:
    figure = plots.ride(responses["soft"], frequencies=(0.3, 50.0))
    frequency, density = np.asarray(figure.axes[-1].get_lines()[0].get_xydata()).T
    area = float(np.sum(density) * (frequency[1] - frequency[0]))
    assert area == pytest.approx(float(metrics.rms(responses["soft"]["sprung_acceleration"])) ** 2, rel=0.15)


def test_of_a_long_run_the_three_seconds_about_its_peak_are_drawn(responses: dict[str, Response]) -> None:
    response = responses["soft"]
    low, high = plots.ride(response).axes[0].get_xlim()
    peak = float(response.time[int(np.argmax(np.abs(np.asarray(response["sprung_acceleration"]))))])
    assert high - low == pytest.approx(3.0) and low <= peak <= high


def test_ride_refuses_what_is_not_there(responses: dict[str, Response]) -> None:
    with pytest.raises(ValueError, match="Did you mean 'stroke'"):
        plots.ride(responses, channels=["strok"])
    with pytest.raises(ValueError, match="`window` must hold instants"):
        plots.ride(responses, window=(50.0, 60.0))
    with pytest.raises(ValueError, match="`responses`"):
        plots.ride({})


def test_other_channels_get_a_label_with_their_unit(responses: dict[str, Response]) -> None:
    figure = plots.ride(responses, channels=["damper_force", "relative_tyre_load"])
    assert figure.axes[0].get_ylabel() == "damper force [N]\n(+\N{NO-BREAK SPACE}resists extension)"
    assert figure.axes[1].get_ylabel() == "relative tyre load [–]"


# ---- tuning


def test_tuning_draws_laws_and_metrics(tuned: TuneResult) -> None:
    velocity = np.linspace(-0.3, 0.3, 7)
    figure = plots.tuning(tuned, velocity)
    bars, *spectra, curves = figure.axes
    assert len(spectra) == 3 and "body acceleration" in spectra[0].get_title(loc="left")
    after = tuned.parameters[0].after
    np.testing.assert_allclose(_line(curves, "before")[:, 1], 2500.0 * velocity, atol=1e-9)
    np.testing.assert_allclose(_line(curves, "after")[:, 1], after * velocity, atol=1e-9)
    change = [100 * (tuned.after[name] / tuned.before[name] - 1) for name in tuned.before]
    widths = [bar.get_width() for bar in bars.patches if isinstance(bar, Rectangle)]
    assert widths == pytest.approx(change)
    names, values = zip(*(label.get_text().split("\n") for label in bars.get_yticklabels()), strict=True)
    assert values[0].endswith(f"({change[0]:+.1f} %)".replace("-", "−"))
    assert "body acceleration, RMS (minimised)" in names and "suspension travel, peak–peak (limited)" in names
    assert bars.get_xlabel() == "change [%]"


def test_the_result_plots_itself(tuned: TuneResult) -> None:
    assert isinstance(tuned.plot(), Figure)


# ---- all


@pytest.mark.slow
def test_nothing_of_matplotlib_is_loaded_before_a_plot_is_drawn() -> None:
    code = (
        "import sys, jaxdamp.plots, jaxdamp.report\nassert 'matplotlib' not in sys.modules\n"
        "from jaxdamp.dampers import Linear\n"
        "jaxdamp.plots.force_velocity(Linear(1.0))\n"
        "assert 'matplotlib.figure' in sys.modules and 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# ---- what a ride makes a damper do


def test_damper_use_shows_the_ride_over_the_law_and_where_the_energy_goes(responses: dict[str, Response]) -> None:
    figure = plots.damper_use(responses)
    trace, time_share, energy_share = figure.axes
    soft = _line(trace, "soft")
    np.testing.assert_allclose(soft[:, 1], 1500.0 * soft[:, 0], atol=1e-6)
    for axes in (time_share, energy_share):
        totals = [float(np.sum(np.asarray(line.get_ydata()))) for line in axes.get_lines()]
        np.testing.assert_allclose(totals, 100.0, rtol=1e-6)
    assert _legend(figure) == ["soft", "firm"]
    with pytest.raises(ValueError, match="`damper` must be one of 'damper', but is 'front_damper'"):
        plots.damper_use(responses, damper="front_damper")


def test_ride_draws_the_weighted_acceleration_in_third_octaves(responses: dict[str, Response]) -> None:
    figure = plots.ride(responses["soft"], weighting="Wk")
    (stairs,) = (patch for patch in figure.axes[-1].patches if isinstance(patch, StepPatch))
    felt = float(responses["soft"].comfort()["sprung_acceleration"].weighted_rms)
    assert np.sqrt(np.sum(stairs.get_data()[0] ** 2)) == pytest.approx(felt, rel=0.02)
    assert f"weighted by Wk {felt:.3g} m/s²" in _legend(figure)[0]


# ---- roads


def test_roughness_by_segment_draws_each_one_and_the_whole() -> None:
    heights = 0.005 * np.sin(np.arange(1000) * 0.7) * np.linspace(0.2, 1.0, 1000)
    roughness = metrics.international_roughness_by_segment(heights, 0.25)
    figure = roughness.plot()
    (axes,) = figure.axes
    bars = [bar for bar in axes.patches if isinstance(bar, Rectangle)]
    np.testing.assert_allclose([bar.get_height() for bar in bars], 1e3 * np.asarray(roughness.segments))
    np.testing.assert_allclose([bar.get_x() for bar in bars], [0.0, 100.0, 200.0])
    assert bars[-1].get_width() == pytest.approx(49.75)
    assert _legend(figure) == ["segment", f"whole profile, {1e3 * float(roughness.whole):.3g} m/km"]


# ---- sweep


def _grid() -> xarray.Dataset:
    def paraboloid(point: dict) -> dict:
        return {"height": jnp.where(point["a"] < 0.0, jnp.nan, (point["a"] - 1.0) ** 2 + (point["b"] - 2.0) ** 2)}

    with pytest.warns(UserWarning, match="3 of 12 points"):
        return jaxdamp.sweep(paraboloid, {"a": [-1.0, 0.0, 1.0, 2.0], "b": [1.0, 2.0, 3.0]})


def test_a_sweep_over_two_axes_is_a_map_with_its_smallest_value_and_failures() -> None:
    figure = plots.sweep(_grid(), "height")
    axes, bar = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel(), bar.get_ylabel()) == ("a", "b", "height")
    np.testing.assert_array_equal(_line(axes, "smallest: 0"), [[1.0, 2.0]])
    np.testing.assert_array_equal(_line(axes, "failed"), [[-1.0, 1.0], [-1.0, 2.0], [-1.0, 3.0]])


def test_limits_hatch_a_map_and_ring_points_of_curves() -> None:
    data = _grid()
    figure = plots.sweep(data, "height", limits={"height": (0.5, 1.5)})
    least = "smallest within the limits: 1, at the edge: widen the grid"
    assert _legend(figure) == [least, "failed", "height below 0.5", "height above 1.5"]
    hatched = [c for c in figure.axes[0].collections if isinstance(c, QuadContourSet) and any(c.hatches)]
    assert len(hatched) == 2 and hatched[0].hatches != hatched[1].hatches
    (axes,) = plots.sweep(data.isel(b=0), "height", limits={"height": 1.5}).axes
    rings = next(c for c in axes.collections if c.get_label() == "height above 1.5")
    np.testing.assert_array_equal(rings.get_offsets(), [[0.0, 2.0], [2.0, 2.0]])
    with pytest.raises(ValueError, match=r"`limits` must be one of .*Did you mean 'height'"):
        plots.sweep(data, "height", limits={"hight": 1.0})


def test_axes_with_the_same_last_part_are_told_apart() -> None:
    def stiffness(p: dict) -> dict:
        return {"total": p["front.damper.rate"] + p["rear.damper.rate"]}

    data = jaxdamp.sweep(stiffness, {"front.damper.rate": [1.0, 2.0], "rear.damper.rate": [3.0, 4.0]})
    axes, _ = plots.sweep(data, "total").axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("front damper rate", "rear damper rate")
    assert axes.get_title(loc="left") == "Total over front damper rate and rear damper rate"


def test_a_sweep_over_one_axis_has_a_curve_for_each_value_of_another() -> None:
    data = _grid()
    (axes,) = plots.sweep(data, "height", over="a").axes
    np.testing.assert_array_equal(_line(axes, "b = 3")[1:], [[0.0, 2.0], [1.0, 1.0], [2.0, 2.0]])
    assert [line.get_label() for line in axes.get_lines()] == ["b = 1", "b = 2", "b = 3"]
    (alone,) = plots.sweep(data.isel(b=0), "height").axes
    assert len(alone.get_lines()) == 1
    with pytest.raises(ValueError, match="Did you mean 'height'"):
        plots.sweep(data, "hight")
    with pytest.raises(ValueError, match="be one number for each point of a grid"):
        plots.sweep(jaxdamp.sweep(lambda p: {"y": p["a"]}, sweeps.points({"a": [1.0, 2.0]})), "y")


@pytest.mark.filterwarnings("error")
def test_axes_of_one_value_are_named_and_not_drawn() -> None:
    def product(p: dict) -> dict:
        return {"y": p["a"] * p["b"], "z": p["a"] + p["b"]}

    data = jaxdamp.sweep(product, {"a": [3.0], "b": [1.0, 2.0]})
    (axes,) = plots.sweep(data, "y", limits={"y": 5.0}, present={"a": 3.0, "b": 1.5, "y": 4.5}).axes
    assert (axes.get_xlabel(), axes.get_title(loc="left")) == ("b", "Y over b, a 3")
    np.testing.assert_array_equal(axes.get_lines()[0].get_xydata(), [[1.0, 3.0], [2.0, 6.0]])
    assert len(plots.sweep(data, "y", against="z").axes) == 2
    point = data.isel(b=[0])
    figures = [plots.sweep(point, "y", present=present) for present in ({}, {"a": 3.0, "b": 1.0})]
    np.testing.assert_array_equal([f.axes[0].get_lines()[0].get_xydata() for f in figures], [[[3.0, 3.0]]] * 2)
    plots.sweep(point, "y", against="z").canvas.draw()


def test_a_reference_is_a_broad_line_beneath_the_others(responses: dict[str, Response]) -> None:
    axes = plots.ride(responses, reference="firm", window=(0.0, 12.0)).axes[0]
    firm = [line for line in axes.get_lines() if line.get_linewidth() == 3.5]
    np.testing.assert_allclose(
        np.max(firm[0].get_ydata()), np.max(np.asarray(responses["firm"]["sprung_acceleration"]))
    )
    assert len(firm) == 1
    with pytest.raises(ValueError, match="Did you mean 'firm'"):
        plots.ride(responses, reference="frm")
