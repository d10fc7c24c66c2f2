"""The house style: colours that everybody can tell, words for people, text inside the page."""

import itertools
import re
from collections.abc import Iterator

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

from jaxdamp import bench, plots, roads, simulate
from jaxdamp.bench import BenchSet
from jaxdamp.control import Controlled, Skyhook
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.identify import Comparison
from jaxdamp.plots import _style
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult
from jaxdamp.vehicles import QuarterCar


# Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB.
VISIONS = {
    "normal": np.eye(3),
    "protanopia": np.array([[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0520]]),
    "deuteranopia": np.array([[0.3674, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]]),
    "tritanopia": np.array([[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]]),
}
TO_XYZ = np.array([[0.4125, 0.3576, 0.1804], [0.2127, 0.7152, 0.0722], [0.0193, 0.1192, 0.9503]])


def linear(colour: object) -> np.ndarray:
    rgb = np.array(to_rgb(colour))  # pyright: ignore[reportArgumentType]
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast(colour: object) -> float:
    """To white paper, of WCAG 2."""
    return 1.05 / (float(linear(colour) @ TO_XYZ[1]) + 0.05)


def lab(rgb: np.ndarray) -> np.ndarray:
    x = TO_XYZ @ np.clip(rgb, 0.0, 1.0) / np.array([0.9505, 1.0, 1.0888])
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


@pytest.fixture(scope="module")
def figures(
    runs: BenchSet, comparison: Comparison, responses: dict[str, Response], tuned: TuneResult
) -> dict[str, Figure]:
    evaluation = bench.evaluate(runs)
    return {
        "damper sheet": comparison.plot("sheet", evaluation=evaluation),
        "bench sheet": evaluation.plot("sheet"),
        "ride sheet": plots.ride_sheet(responses),
        "tuning sheet": tuned.plot("sheet"),
        "one ride": responses["soft"].plot("sheet"),
        "ladder": comparison.plot(),
        "loops": comparison.best.result.plot(),
        "cycles": evaluation.plot(),
        "ride": plots.ride(responses, weighting="Wk"),
        "damper use": plots.damper_use(responses),
        "tuning": tuned.plot(),
        "curves": plots.force_velocity({"besinger_lag": comparison.best.result.law}, runs=list(runs)),
    }


def texts(figure: Figure) -> Iterator[Text]:
    figure.draw_without_rendering()
    beyond = set()  # labels of ticks outside the axes, which are not drawn
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        beyond |= {id(tick.label1) for tick in ticks if not low <= tick.get_loc() <= high}
    every = (text for text in figure.findobj(Text) if isinstance(text, Text) and id(text) not in beyond)
    return (text for text in every if text.get_visible() and text.get_text().strip())


def test_colours_differ_for_everybody_and_stand_out_from_paper() -> None:
    palette = [*_style.COLOURS, _style.BLACK]
    for matrix in VISIONS.values():
        seen = [lab(matrix @ linear(colour)) for colour in palette]
        assert min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2)) > 15.0
    meant = [_style.GREY, _style.GOOD, _style.DOUBT, _style.BAD, _style.REFERENCE["color"]]
    ordered = [_style.graded(i, 8) for i in range(8)]
    assert all(contrast(colour) >= 3.0 for colour in [*palette, *meant])
    assert all(contrast(colour) >= 2.5 for colour in ordered)  # labelled at their ends, or in a legend


def test_a_sheet_of_a_controlled_car_shows_its_damper_at_all_levels() -> None:
    damper = Scheduled((Linear(300.0), Linear(900.0), Linear(3900.0)), levels=[0.0, 1.0, 2.0], command=0.0)
    car = Controlled(QuarterCar(400.0, 50.0, 20e3, 250e3, damper), Skyhook())
    figure = simulate(car, roads.iso8608("C", speed=20.0, seed=1), duration=1.0).plot("sheet")
    printed = [text.get_text().replace("\n", " ") for text in texts(figure)]
    assert any(re.search(r"tyre load variation [\d.]+ N$", text) for text in printed)  # "n" when it was capitalised
    assert any(text.startswith("Controlled quarter car") for text in printed)
    (curves,) = (axes for axes in figure.axes if "all levels" in axes.get_title(loc="left"))
    slopes = {round(float(np.ptp(line.get_ydata()) / np.ptp(line.get_xdata()))) for line in curves.get_lines()[:3]}
    assert slopes == {300, 900, 3900}


def test_lines_that_have_a_name_stand_out(figures: dict[str, Figure]) -> None:
    for name, figure in figures.items():
        for line in (line for axes in figure.axes for line in axes.get_lines()):
            if not str(line.get_label()).startswith("_") and line.get_linestyle() not in ("None", ""):
                assert contrast(line.get_color()) >= 2.5, (name, line.get_label())


def test_no_code_is_printed(figures: dict[str, Figure], runs: BenchSet) -> None:
    files = re.compile("|".join(re.escape(run.name) for run in runs))  # the reader's names stay as they are
    for name, figure in figures.items():
        printed = [text.get_text() for text in texts(figure)]
        mathtext = re.compile(r"\$.*?\$")  # a power of ten of a logarithmic axis
        bad = [text for text in printed if re.search(r"\w_\w|\^|->|`", mathtext.sub("", files.sub("", text)))]
        assert not bad, (name, bad)


def test_no_text_leaves_the_page(figures: dict[str, Figure]) -> None:
    for name, figure in figures.items():
        if "sheet" in name or name == "one ride":
            page = figure.bbox
            for text in texts(figure):
                box = text.get_window_extent()
                assert box.x0 >= page.x0 - 1 and box.x1 <= page.x1 + 1, (name, text.get_text())
                assert box.y0 >= page.y0 - 1 and box.y1 <= page.y1 + 1, (name, text.get_text())


def test_a_sheet_says_the_verdict_that_the_result_has(comparison: Comparison, tuned: TuneResult) -> None:
    said = " ".join(" ".join(t.get_text() for t in texts(comparison.plot("sheet"))).split())
    assert " ".join(_style.typeset(comparison.verdict[0]).split())[:60] in said
    said = " ".join(t.get_text() for t in texts(tuned.plot("sheet")))
    assert tuned.verdict.outcome.value in said
    with pytest.raises(ValueError, match="sheet"):
        tuned.plot("sheat")
