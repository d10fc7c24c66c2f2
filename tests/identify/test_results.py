"""What `fit` and `compare` hand back, and what they refuse."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractMemoryless, Besinger, Bilinear, Lag, SeriesSpring, Table
from jaxdamp.identify import LAWS, compare, default_ladder, fit, fit_percent
from jaxdamp.parameters import get, parameter, positive


TRUTH = Bilinear(2600.0, 1200.0)


def test_fit_percent_is_that_of_the_system_identification_toolbox():
    y, p = np.array([1.0, 2.0, 3.0, 6.0]), np.array([1.5, 2.0, 2.5, 6.0])
    expected = 100 * (1 - np.linalg.norm(y - p) / np.linalg.norm(y - y.mean()))
    assert fit_percent([y], [p]) == pytest.approx(expected)
    assert fit_percent([y[:2], y[2:]], [p[:2], p[2:]]) == pytest.approx(expected)
    assert fit_percent([y], [y]) == 100.0
    assert fit_percent([y], [np.full(4, y.mean())]) == pytest.approx(0.0)
    assert fit_percent([np.ones(3)], [np.ones(3)]) == 100.0
    assert fit_percent([np.ones(3)], [np.zeros(3)]) == -np.inf


def test_scores_by_record_and_on_new_records(sines):
    runs = sines(TRUTH, noise=10.0)
    result = fit(Bilinear, runs)
    assert [s.name for s in result.scores] == [r.name for r in runs]
    for score, run, force in zip(result.scores, runs, result.respond(runs), strict=True):
        error = force - run.force
        assert score.rmse == pytest.approx(np.sqrt(np.mean(error**2)))
        assert score.largest_error == pytest.approx(np.max(np.abs(error)))
        assert score.fit_percent == pytest.approx(fit_percent([run.force], [force]))
    together = np.concatenate(result.respond(runs)) - np.concatenate([r.force for r in runs])
    assert result.rmse == pytest.approx(np.sqrt(np.mean(together**2)))
    new = sines(TRUTH, noise=10.0, seed=9)
    percent, rmse, rows = result.score(new)
    assert rmse == pytest.approx(10.0, rel=0.1) and percent < 100.0 and len(rows) == 3
    one = result.respond(new[0])
    c_r, c_c = result["rebound_rate"].value, result["compression_rate"].value
    v = new[0].velocity
    assert np.allclose(one, np.where(v > 0, c_r * v, c_c * v))


def test_one_record_and_a_function_as_start(sines):
    (run, *_) = sines(TRUTH, noise=1.0)
    result = fit(lambda v, f: Bilinear(float(np.abs(f).max()), 100.0), run)
    assert result.runs == (run,)
    assert result["rebound_rate"].value == pytest.approx(2600.0, rel=0.01)


def test_reads_like_a_table(sines):
    result = fit(Bilinear, sines(TRUTH, noise=10.0))
    lines = repr(result).splitlines()
    assert lines[0].startswith("Bilinear on 3 records: ") and "RMSE" in lines[0]
    assert "rebound_rate" in lines[1] and lines[1].endswith("N s/m") and "±" in lines[1]
    low, high = result["rebound_rate"].interval
    error = result["rebound_rate"].standard_error
    assert high - low == pytest.approx(2 * 1.961 * error, rel=1e-3)
    with pytest.raises(KeyError, match="No parameter is named 'rate'"):
        result["rate"]


def test_compare_finds_the_right_law_on_held_out_records(sines):
    truth = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
    runs, held_out = sines(truth, noise=20.0), sines(truth, noise=20.0, seed=1)
    seen = []
    ladder = default_ladder(runs, ["linear", "bilinear", "polynomial", "besinger"])
    result = compare(ladder, runs, held_out=held_out, progress=seen.append)
    assert sorted(seen) == sorted(ladder)
    assert result.best.name == "besinger" and result.best.held_out_rmse == pytest.approx(20.0, rel=0.05)
    assert [r.parameters for r in result.rungs] == [2, 3, 6, 6]  # each with an offset
    assert result["linear"].fit_percent == result.rungs[0].fit_percent < result.rungs[1].fit_percent
    assert repr(result).splitlines()[-1] == "best: besinger" and "held-out" in repr(result)
    assert result.best_fit is min(result.rungs, key=lambda rung: rung.rmse)
    with pytest.raises(KeyError, match="No law is named 'cubic'"):
        result["cubic"]


def test_every_rung_of_the_ladder_starts_inside_its_domain(maxwell_runs):
    ladder = default_ladder(maxwell_runs)
    assert tuple(ladder) == LAWS
    assert float(get(ladder["besinger_lag"], "lag_time")) == pytest.approx(0.004, rel=0.05)
    series = ladder["besinger_series_spring"]
    assert isinstance(series, SeriesSpring) and float(series.cubic_stiffness) > 0


@pytest.mark.parametrize(
    ("law", "options", "message"),
    [
        (Bilinear, {"runs": []}, "`runs` must hold at least one record"),
        (Bilinear, {"freeze": ["rebound_rat"]}, "did you mean 'rebound_rate'"),
        (Bilinear, {"bounds": {"compresion_rate": (1.0, 2.0)}}, "did you mean 'compression_rate'"),
        (Bilinear, {"bounds": {"rebound_rate": (5.0, 1.0)}}, "two finite numbers in increasing order"),
        (Bilinear, {"bounds": {"rebound_rate": (5.0, None)}}, "two finite numbers in increasing order"),
        (Bilinear, {"freeze": ["*"]}, "All parameters are frozen"),
        (Bilinear, {"weighting": "run"}, "Did you mean 'runs'"),
        (Bilinear, {"weighting": [1.0, 2.0]}, "one number for each of 3 records"),
        (Bilinear, {"weighting": [1.0, 2.0, 0.0]}, "`weighting` must be positive"),
        (Bilinear, {"force_noise": -1.0}, "`force_noise` must be positive"),
        (Bilinear, {"max_steps": 0}, "`max_steps` must be 1 or more"),
        (Lag, {}, "be a class that defines `guess`, but is the class Lag.*Pass an instance"),
        (eqx.tree_at(lambda b: b.rebound_rate, TRUTH, jnp.array(jnp.nan)), {}, "`law` must be finite"),
    ],
    ids=lambda p: None if isinstance(p, str) else "",
)
def test_refuses(sines, law, options, message):
    with pytest.raises(ValueError, match=message):
        fit(law, **({"runs": sines(TRUTH)} | options))


def test_refuses_records_without_force(sines):
    silent = [BenchRun(r.name, r.time, r.stroke, r.velocity, np.zeros(len(r))) for r in sines(TRUTH)]
    with pytest.raises(ValueError, match="a force that varies"):
        fit(Bilinear(2000.0, 1000.0), silent)
    with pytest.raises(ValueError, match="A record without force"):
        fit(Bilinear(2000.0, 1000.0), [*sines(TRUTH), silent[0]], weighting="runs", bad_records="keep")


class Rootlike(AbstractMemoryless):
    """A law that nobody could make on purpose: no force in compression."""

    rate: Any = parameter("N", "force at 1 m/s", positive)

    def force_velocity(self, v):
        return self.rate * jnp.sqrt(v)


def test_refuses_a_law_without_finite_forces(sines):
    with pytest.raises(ValueError, match="give finite forces and derivatives"):
        fit(Rootlike(1000.0), sines(TRUTH))


def test_refuses_unknown_rungs_and_no_laws(sines):
    with pytest.raises(ValueError, match="Did you mean 'besinger_lag'"):
        default_ladder(sines(TRUTH), ["besinger_lagg"])
    with pytest.raises(ValueError, match="`laws` must hold at least one law"):
        compare({}, sines(TRUTH))


def test_a_curve_that_drives_the_motion_is_named(rng):
    time = np.arange(2000) / 1000
    velocity = 0.25 * np.cos(12 * time)
    force = np.where(velocity > 0, 900.0, 700.0) * velocity / 0.25  # compression counted as pushing
    run = BenchRun.from_arrays("a", time, 0.25 / 12 * np.sin(12 * time), np.abs(force) + rng.normal(0.0, 1.0, 2000))
    (warning,) = [text for text in fit(Table, [run]).warnings if "adds energy to the motion" in text]
    assert "at velocities from -0.2" in warning and "Check the sign of the force" in warning
    honest = BenchRun.from_arrays("b", time, run.stroke, force + rng.normal(0.0, 1.0, 2000))
    assert not any("adds energy to the motion" in text for text in fit(Table, [honest]).warnings)
