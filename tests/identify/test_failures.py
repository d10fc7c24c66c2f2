"""A law that cannot be fitted costs a comparison that law alone; a wrong call costs the whole of it."""

from typing import final

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp._types import Number, Scalar, ScalarLike
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import AbstractDamper, AbstractMemoryless, Bilinear, Linear
from jaxdamp.identify import Rung, compare, default_ladder, fit, fit_each, fit_many, ladder
from jaxdamp.parameters import get, parameter, positive


TRUTH = Bilinear(2600.0, 1200.0)


def _no_start(velocity: np.ndarray, force: np.ndarray) -> AbstractDamper:
    raise ZeroDivisionError("no velocity")


def _overflow(velocity: np.ndarray, force: np.ndarray) -> AbstractDamper:
    raise OverflowError("too stiff")


def test_the_others_are_fitted_and_the_failure_is_named(sines):
    runs = sines(TRUTH, noise=5.0)
    laws = {"bad": _overflow, "linear": Linear, "none": _no_start, "bilinear": Bilinear}
    comparison = compare(laws, runs, held_out=runs[:1])
    assert [rung.name for rung in comparison.rungs] == ["linear", "bilinear"] and comparison.best.name == "bilinear"
    assert [failure.name for failure in comparison.failed] == ["bad", "none"]
    assert comparison.failed[1].reason == "no velocity"
    assert "none" in repr(comparison) and "failed: no velocity" in repr(comparison)
    with pytest.raises(KeyError, match="none failed: no velocity"):
        comparison["none"]


def test_each_fit_is_there_as_soon_as_it_is_done(sines):
    seen: list[str] = []
    fits = fit_each({"linear": Linear, "bilinear": Bilinear}, sines(TRUTH, noise=5.0), progress=seen.append)
    first = next(fits)
    assert isinstance(first, Rung) and first.name == "linear" and seen == ["linear"]


def test_laws_side_by_side_have_the_precision_of_their_caller(sines):
    runs = sines(TRUTH, noise=5.0)
    with jax.enable_x64(False):
        single = compare({"linear": Linear}, runs)["linear"]
    double = compare({"linear": Linear}, runs)["linear"]
    assert get(single.law, "rate").dtype == np.float32 and get(double.law, "rate").dtype == np.float64


def test_a_comparison_without_any_fit_says_why(sines):
    with pytest.raises(ValueError, match=r"None of 2 laws could be fitted\. a: no velocity b: too stiff"):
        compare({"a": _no_start, "b": _overflow}, sines(TRUTH, noise=5.0))
    with pytest.raises(ValueError, match=r"The law linear could not be fitted\. Argument `weighting` must be one of"):
        compare({"linear": Linear}, sines(TRUTH, noise=5.0), weighting="records")
    with pytest.raises(TypeError, match="did you mean 'weighting'"):
        compare({"linear": Linear}, sines(TRUTH, noise=5.0), wieghting="runs")  # pyright: ignore
    with pytest.raises(ValueError, match=r"`scheduled` must be True with `common` or `blend`, but is False"):
        compare({"linear": Linear}, sines(TRUTH, noise=5.0), common=["rate"])


def test_a_start_that_cannot_be_made_is_a_failure_of_that_law(sines, monkeypatch):
    monkeypatch.setitem(ladder._MEMORYLESS, "table", _no_start)
    runs = sines(TRUTH, noise=5.0)
    comparison = compare(default_ladder(runs, ["table", "linear"]), runs)
    assert [rung.name for rung in comparison.rungs] == ["linear"]
    assert comparison.failed[0].reason == "No start can be computed from these records: no velocity"
    with pytest.raises(ValueError, match="No start can be computed"):
        fit(default_ladder(runs, ["table"])["table"], runs)


@final
class Seized(AbstractMemoryless):
    """F = c v, which nobody knows beyond 0.3 m/s."""

    rate: Number = parameter("N s/m", "c", positive)

    def force_velocity(self, v: ScalarLike) -> Scalar:
        return jnp.where(jnp.abs(v) < 0.3, self.rate * v, jnp.nan)


@pytest.mark.filterwarnings("ignore:1 of 2 dampers were left out")
@pytest.mark.parametrize(
    ("rate", "alone"),  # Hz, without and with means of samples; then each damper by a fit of its own
    [(150.0, {}), (1000.0, {}), (150.0, {"per_record": ["rate"]}), (150.0, {"input_noise": (1e-5, 2e-3)})],
)
def test_one_damper_of_many_where_the_law_has_no_force_is_left_out(rate, alone):
    """It stopped the others, or had the start as its numbers, with which no damper stood out any more."""
    dyno = VirtualDyno(Linear(1500.0), sampling_rate=rate, force_noise=5.0)
    slow, fast = (list(dyno.run(SineTest(0.02, f, cycles=3))) for f in (1.0, 3.0))
    many = fit_many(Seized(1000.0), {"slow": slow, "fast": fast}, **alone)
    assert float(get(many["slow"], "rate")) == pytest.approx(1500.0, rel=0.01)
    assert many.warnings == (f"fast: it was left out: {many.reasons[1]}",) and "no finite force" in many.reasons[1]
    assert "1 of them left out: mean fit 9" in many.summary
    with pytest.raises(ValueError, match="fast"):
        many["fast"]
    with pytest.raises(ValueError, match=r"over the records of all dampers, but is Seized.* does not for fast"):
        fit_many(Seized(1000.0), {"fast": fast}, **alone)
    if not alone:
        with pytest.raises(ValueError, match=r"over the records of all dampers, but is Seized.* does not for fast"):
            fit_many(Seized(1000.0), {"slow": slow, "fast": fast}, shared=["rate"])
