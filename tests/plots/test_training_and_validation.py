"""The course of a training, the scores of a cross-validation, the card of a law."""

import numpy as np
import pytest

from jaxdamp import identify, plots
from jaxdamp.bench import BenchSet
from jaxdamp.dampers import BoucWen, Lag, Linear, PiecewiseLinear, SeriesSpring


@pytest.mark.slow
def test_training_history(runs: BenchSet) -> None:
    result = identify.train(Lag(Linear(1500.0), 0.002), runs[0], held_out=runs[1], steps=50)
    (axes,) = result.plot().axes
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in axes.get_lines()}
    np.testing.assert_allclose(lines["training records"], np.stack([result.steps, result.history], axis=1))
    np.testing.assert_allclose(lines["held-out records"][:, 1], result.held_out_history)
    assert np.all(lines["result"][:, 0] == result.best_step)
    assert axes.get_title(loc="left") == "after all 50 steps"


@pytest.mark.exhaustive
def test_cross_validation(runs: BenchSet) -> None:
    laws = {"linear": Linear, "slopes": PiecewiseLinear}
    result = identify.cross_validate(laws, runs[:4], by=lambda run: "slow" if run.frequency < 2.5 else "fast")
    (axes,) = result.plot().axes
    assert [text.get_text() for text in axes.get_yticklabels()] == sorted(laws, key=result.fit_percent)
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in axes.get_lines()}
    slow = [fold.fit_percent for fold in result.folds if fold.group == "slow"]
    np.testing.assert_allclose(lines["slow"][:, 0], slow)
    np.testing.assert_allclose(lines["mean"][:, 0], sorted(map(result.fit_percent, laws)))


def test_law_card_shows_loops_and_effects() -> None:
    figure = plots.law_card(Lag(Linear(2000.0), 0.005), amplitude=0.01, frequencies=(1.0, 5.0), title="A lag")
    loops, football, effects = figure.axes
    omega = 2 * np.pi * 5.0
    lag = np.exp(-1j * np.arctan(omega * 0.005)) * np.cos(np.arctan(omega * 0.005))  # force over 2000 N s/m v
    slow, fast = (np.asarray(line.get_xydata()) for line in loops.get_lines()[:2])
    assert np.max(slow[:, 0]) == pytest.approx(2 * np.pi * 0.01, rel=1e-6)
    assert np.max(fast[:, 1]) == pytest.approx(2000.0 * omega * 0.01 * abs(lag), rel=1e-3)
    assert np.max(np.asarray(football.get_lines()[0].get_xydata())[:, 0]) == pytest.approx(10.0, rel=1e-6)
    curves = {str(line.get_label()): np.asarray(line.get_xydata())[:, 1] for line in effects.get_lines()}
    # the force is proportional to c, so that c ∂F/∂c is the force itself; τ ∂F/∂τ = |iωτ/(1 + iωτ)²| c v
    np.testing.assert_allclose(curves["law rate"], fast[:, 1], rtol=1e-9)
    expected = 2000.0 * omega * 0.01 * omega * 0.005 / (1 + (omega * 0.005) ** 2)
    assert np.max(curves["lag time"]) == pytest.approx(expected, rel=2e-3)
    assert figure.get_suptitle() == "A lag"


def test_law_card_draws_the_largest_effects_of_many_and_leaves_zeros_out() -> None:
    law = SeriesSpring(PiecewiseLinear([-0.2, -0.1, 0.1, 0.2], [500.0, 900.0, 2000.0, 1500.0, 800.0], 0.02), 1e6)
    figure = plots.law_card(law + BoucWen(100.0, 0.0, 50.0, 1e-3), frequencies=(2.0,))
    names = {str(line.get_label()) for line in figure.axes[2].get_lines()} - {"_child0", "_child1"}
    assert "terms 1 stiffness" not in names and "terms 0 cubic stiffness" not in names
    assert sum(not name.startswith("_") for name in names) == 8
    assert any("more" in str(legend.get_title().get_text()) for legend in figure.legends)


def test_refusals() -> None:
    with pytest.raises(ValueError, match="`amplitude` must be positive"):
        plots.law_card(Linear(1.0), amplitude=0.0)
    with pytest.raises(ValueError, match="`frequencies` must be positive"):
        plots.law_card(Linear(1.0), frequencies=(1.0, -2.0))
