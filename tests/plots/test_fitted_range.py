"""Pictures show where a law is extrapolated: its curve goes on lighter, what lies beyond is shaded and named."""

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

from jaxdamp import plots, roads, simulate, vehicles
from jaxdamp.dampers import Bilinear, Linear, MotionRatio, OutsideFittedRangeWarning, with_fitted_range
from jaxdamp.plots import _style
from jaxdamp.plots.fitted_range import LABEL
from jaxdamp.simulation import Response


FITTED = with_fitted_range(Bilinear(2600.0, 1200.0), velocity=(-0.1, 0.2))
VELOCITY = np.linspace(-0.5, 0.5, 101)


def _legend(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def _shaded(axes: Axes, along: int = 0) -> list[tuple[float, float]]:
    """Lower and upper end of each shaded span, over x (0) or over y (1)."""
    boxes: list[Any] = [
        patch for patch in axes.patches if patch.get_facecolor()[:3] == pytest.approx(_colour(), abs=1e-6)
    ]
    ends = [np.asarray(box.get_xy()) for box in boxes]
    size = [box.get_width() if along == 0 else box.get_height() for box in boxes]
    return [(float(end[along]), float(end[along] + s)) for end, s in zip(ends, size, strict=True)]


def _colour() -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    return to_rgb(_style.SHADE)


def test_a_curve_is_dotted_and_shaded_beyond_the_records() -> None:
    figure = plots.force_velocity({"fitted": FITTED, "by hand": Linear(500.0)}, VELOCITY)
    (axes,) = figure.axes
    solid = next(line for line in axes.get_lines() if line.get_label() == "fitted")
    drawn = np.isfinite(np.asarray(solid.get_ydata(), dtype=float))
    np.testing.assert_array_equal(drawn, (VELOCITY > -0.1 - 1e-9) & (VELOCITY < 0.2 + 1e-9))
    (dotted,) = [line for line in axes.get_lines() if line.get_linestyle() == ":"]
    assert dotted.get_color() == solid.get_color() and dotted.get_alpha() == pytest.approx(0.6)
    np.testing.assert_allclose(_shaded(axes), [(-0.5, -0.1), (0.2, 0.5)], atol=1e-9)
    assert _legend(axes) == [LABEL]


def test_a_law_without_a_range_or_within_it_is_drawn_as_ever() -> None:
    for law in (Linear(500.0), with_fitted_range(Linear(500.0), velocity=(-0.5, 0.5))):
        figure = plots.force_velocity({"law": law}, VELOCITY)
        assert not _shaded(figure.axes[0])
        assert _legend(figure.axes[0]) == ["law"]


def test_only_what_lies_beyond_all_records_is_shaded() -> None:
    laws = {"fitted": FITTED, "at the wheel": MotionRatio(FITTED, 0.5)}
    (axes,) = plots.force_velocity(laws, VELOCITY).axes
    np.testing.assert_allclose(_shaded(axes), [(-0.5, -0.2), (0.4, 0.5)], atol=1e-9)


def test_a_card_is_shaded_over_velocity() -> None:
    figure = plots.law_card(FITTED, amplitude=0.05, frequencies=(0.2, 1.0))
    for axes in (figure.axes[0], figure.axes[2]):
        np.testing.assert_allclose(_shaded(axes), [(-0.1 * np.pi, -0.1), (0.2, 0.1 * np.pi)], atol=1e-3)
    assert not _shaded(figure.axes[1])
    labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert labels.count(LABEL) == 1


@pytest.fixture(scope="module")
def response() -> Response:
    """As long as the other rides of these tests, with which it shares its compiled run."""
    road = roads.band_limited(0.5, 20.0, rms=0.003, duration=12.0, dt=0.01, seed=3)
    with pytest.warns(OutsideFittedRangeWarning):
        return simulate(vehicles.presets.quarter_car_000(FITTED), road, dt=0.005)


def test_the_use_of_a_damper_is_shaded(response: Response) -> None:
    figure = plots.damper_use(response)
    reach = 1.02 * float(np.abs(np.asarray(response["damper_velocity"])).max())
    for axes in figure.axes:
        np.testing.assert_allclose(_shaded(axes), [(-reach, -0.1), (0.2, reach)], atol=1e-3)
    assert LABEL in [text.get_text() for text in figure.legends[0].get_texts()]


def test_a_ride_names_what_it_extrapolates(response: Response) -> None:
    figure = plots.ride({"fitted": response}, channels=["damper_velocity", "stroke"])
    text = figure.get_supxlabel()
    assert text.startswith("Beyond the records") and f"fitted: {response.notes[0]}" in text.replace("\n", " ")
    lower, upper = figure.axes[0].get_ylim()
    np.testing.assert_allclose(_shaded(figure.axes[0], along=1), [(lower, -0.1), (0.2, upper)], atol=2e-3)
    assert not _shaded(figure.axes[1], along=1)


def test_a_ride_without_ranges_has_no_words_below(responses: dict[str, Response]) -> None:
    assert plots.ride(responses).get_supxlabel() == ""
