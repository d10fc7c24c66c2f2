import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from jaxdamp import plots
from jaxdamp._display import Display, shown_in
from jaxdamp.bench import BenchRun, BenchSet, last_steady_cycle
from jaxdamp.identify import Comparison
from jaxdamp.plots.loops import loops_by_law, spread


def test_axes_say_what_they_show_with_unit_and_sign(comparison: Comparison) -> None:
    figure = plots.fit_loops(comparison["bilinear"])
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
    velocity, force = (
        "velocity [m/s]   (+\N{NO-BREAK SPACE}rebound)",
        "force [N]   (+\N{NO-BREAK SPACE}resists extension)",
    )
    assert labels == [
        (velocity, force),
        ("stroke [mm]   (+\N{NO-BREAK SPACE}rebound)", force),
        (velocity, "fitted − measured [N]"),
        ("time in the cycle, over its period [–]", "fitted − measured [N]"),
    ]


def test_pictures_in_the_units_and_the_sign_of_a_shop(comparison: Comparison) -> None:
    with shown_in(Display("imperial", "compression-positive")):
        panel = loops_by_law(comparison).axes[0]
        loops = plots.fit_loops(comparison["bilinear"])
        steps = [np.diff(np.sort(axes.get_xticks() / 0.0254))[0] for axes in (panel, loops.axes[0])]
        sheet = comparison.plot("sheet")
    assert all(axes.xaxis_inverted() and axes.yaxis_inverted() for axes in (panel, *loops.axes[:3]))
    assert all(f"{step:.4e}"[:6] in ("1.0000", "2.0000", "2.5000", "4.0000", "5.0000") for step in steps), steps
    said = [panel.get_title(loc="left"), loops.get_suptitle(), *(t.get_text() for t in sheet.findobj(Text))]
    panels = [axes for axes in sheet.axes if axes.get_ylabel().startswith("force")]
    assert len(panels) > 1 and all(axes.xaxis_inverted() and axes.yaxis_inverted() for axes in panels)
    assert any(text.endswith("+ compression") for text in said)
    table = next(axes for axes in sheet.axes if any("Forces of the law" in t.get_text() for t in axes.texts))
    cells = [t.get_text() for t in table.texts]
    assert cells[5].startswith("−") and not cells[6].startswith("−")  # in rebound and in compression
    assert sum("lbf" in text for text in said) > 6
    assert not [text for text in said if re.search(r"\[N\]|\d\s+k?N\b|N s/m|mm/s", text)]


def test_lines_are_the_measured_and_the_fitted_last_steady_cycle(runs: BenchSet, comparison: Comparison) -> None:
    result, run = comparison["bilinear"], runs[3]
    figure = plots.fit_loops(result, run)
    loops, football, over_velocity, over_time = figure.axes
    part = np.arange(len(run))[last_steady_cycle(run)]
    part = np.append(part, part[0])  # closed
    fitted = result.respond(run)
    measured_line, fitted_line = loops.get_lines()[:2]
    np.testing.assert_array_equal(measured_line.get_xydata(), np.stack([run.velocity[part], run.force[part]], axis=1))
    np.testing.assert_array_equal(fitted_line.get_xydata(), np.stack([run.velocity[part], fitted[part]], axis=1))
    np.testing.assert_allclose(np.asarray(football.get_lines()[0].get_xdata()), 1e3 * run.stroke[part])
    np.testing.assert_array_equal(football.get_lines()[1].get_ydata(), fitted[part])
    residual = fitted[part] - run.force[part]
    np.testing.assert_array_equal(over_velocity.get_lines()[0].get_ydata(), residual)
    means = residual[: (len(part) - 1) // (size := (len(part) - 1) // 40) * size].reshape(-1, size).mean(axis=1)
    np.testing.assert_allclose(np.asarray(over_time.get_lines()[0].get_ydata()), means)
    phase = np.asarray(over_time.get_lines()[0].get_xdata())
    assert phase[0] == pytest.approx(0.0, abs=0.02) and phase[-1] == pytest.approx(1.0, abs=0.05)


def test_the_residual_of_a_slow_record_is_drawn_in_means_over_the_cycle(comparison: Comparison) -> None:
    result = comparison["bilinear"]
    slow = BenchRun.from_arrays(
        "slow",
        np.arange(8000) / 500,
        0.01 * np.sin(2 * np.pi * np.arange(8000) / 2000),
        np.random.default_rng(0).normal(size=8000),
    )
    part, every = last_steady_cycle(slow), 50
    residual = result.respond(slow)[part] - slow.force[part]
    over_time = np.asarray(plots.fit_loops(result, slow).axes[3].get_lines()[0].get_ydata())
    assert len(over_time) == len(residual) // every == 40
    assert over_time[5] == pytest.approx(residual[250:300].mean())


def test_of_many_records_some_are_shown_and_the_title_says_so(runs: BenchSet, comparison: Comparison) -> None:
    result = comparison["linear"]
    title = plots.fit_loops(result, most=3).get_suptitle()
    assert "on 7 records" in title and "3 of them shown" in title and "RMSE" in title
    assert "shown" not in plots.fit_loops(result, most=7).get_suptitle()
    assert f"on {runs[7].name} not fitted" in plots.fit_loops(result, runs[7]).get_suptitle()


def test_the_records_shown_are_spread_over_the_peak_velocities(runs: BenchSet) -> None:
    shown = [run.name for run in spread(list(runs), 3)]
    assert shown[0] == runs[0].name and shown[-1] == runs[-1].name and len(set(shown)) == 3
    assert spread(list(runs), 20) == sorted(runs, key=lambda run: run.peak_velocity)


def test_every_record_shown_stands_in_the_legend(comparison: Comparison) -> None:
    figure = plots.fit_loops(comparison["linear"], most=4)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:2] == ["measured", "fitted"] and len(texts) == 6
    assert texts[2].endswith("m/s)")


def test_the_result_plots_itself(comparison: Comparison) -> None:
    assert isinstance(comparison["linear"].plot(), Figure)


def test_no_record_is_refused(comparison: Comparison) -> None:
    with pytest.raises(ValueError, match="`runs` must hold at least one record"):
        plots.fit_loops(comparison["linear"], [])


def test_some_of_the_fitted_records_are_not_called_new(comparison: Comparison, runs: BenchSet) -> None:
    title = plots.fit_loops(comparison["linear"], [runs[2], runs[4]]).get_suptitle()
    assert "on 2 records" in title and "not fitted" not in title
