"""Sums of squares with several minima: the best is found, the others are told, and nothing false is certain."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import SineTest, VirtualDyno, programmes
from jaxdamp.dampers import Besinger, Bilinear, BoucWen, Lag, Linear, MotionRatio, PiecewiseLinear
from jaxdamp.dampers.base import Reach
from jaxdamp.dampers.inside import margins
from jaxdamp.export import from_json, to_json
from jaxdamp.identify import fit, several
from jaxdamp.identify.several import other_starts
from jaxdamp.parameters import free_parameters


PUBLISHED = Besinger(14_400.0, 15_600.0, 3_600.0, limit_velocity=0.125, transition_velocity=0.7)  # paper 001
BAD = Besinger(1_000.0, 20_000.0, 300.0, limit_velocity=2.0, transition_velocity=0.01)
REACH = Reach(stroke=0.02, velocity=0.3)


def records(seed, tests=None, law=PUBLISHED):
    dyno = VirtualDyno(law, force_noise=20.0, stroke_noise=1e-5, seed=seed)
    return list(dyno.run(programmes.qct_545() if tests is None else tests))


def errors(result, truth):
    """Errors in standard errors."""
    values = zip(free_parameters(truth).values, result.parameters, strict=True)
    return np.array([(e.value - float(true)) / e.standard_error for true, e in values])


@pytest.fixture(scope="module")
def first_records():
    """Records on which the start from the data leads into a minimum whose chi-square is 187 above the best."""
    return records(0)


@pytest.mark.slow
def test_the_published_set_is_found_where_one_start_ends_elsewhere(first_records):
    alone = fit(Besinger, first_records, starts=1)
    assert alone.starts == 1 and len(alone.minima) == 1
    assert alone["transition_velocity"].value < 0.05 and np.abs(errors(alone, PUBLISHED)).max() > 30.0
    result = fit(Besinger, first_records)
    assert result.converged and np.all(np.abs(errors(result, PUBLISHED)) < 3.0), result
    best, *others = result.minima
    assert best.chi_square == 0.0 and best.values["rebound_rate"] == result["rebound_rate"].value
    assert any(150.0 < m.chi_square < 220.0 and m.values["transition_velocity"] < 0.05 for m in others)
    assert 2 <= best.starts < result.starts and sum(m.starts for m in result.minima) <= result.starts
    assert f"{result.starts} starts: {best.starts} ended here" in repr(result)
    again = fit(Besinger, first_records)
    assert np.array_equal(again.covariance, result.covariance) and again.minima == result.minima


@pytest.mark.slow
def test_a_bad_instance_ends_where_the_truth_does(first_records):
    from_bad, from_truth = fit(BAD, first_records), fit(PUBLISHED, first_records)
    for one, other in zip(from_bad.parameters, from_truth.parameters, strict=True):
        assert abs(one.value - other.value) < 0.05 * other.standard_error
    assert max(m.chi_square for m in from_bad.minima) > 1e5  # that of the bad start alone
    few = fit(BAD, first_records, starts=2)
    assert few.starts == 2
    with pytest.raises(ValueError, match="`starts` must be 1 or more"):
        fit(BAD, first_records, starts=0)


@pytest.mark.slow
def test_the_best_of_several_starts_is_followed_to_its_end(monkeypatch):
    monkeypatch.setattr(several, "FIRST_LOOK", 3)
    monkeypatch.setattr(several, "FOLLOWED_STEPS", 1)
    result = fit(BAD, records(3))
    assert result.converged and np.all(np.abs(errors(result, PUBLISHED)) < 3.0)


@pytest.mark.parametrize("seed", [3, 28, 30])
@pytest.mark.exhaustive_cases("3")
def test_the_published_set_is_found(seed):
    """Of seed 28 the first start ends 180 in chi-square above the best, from where a part of the records leads on."""
    assert np.all(np.abs(errors(fit(Besinger, records(seed)), PUBLISHED)) < 3.0)


@pytest.mark.exhaustive
def test_the_published_set_is_found_for_forty_seeds():
    z = np.array([errors(fit(Besinger, records(seed)), PUBLISHED) for seed in range(40)])
    assert np.all(np.abs(z) < 3.0)
    assert 0.6 < np.std(z) < 1.2  # errors that hold far away are larger than those at the minimum


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_slope_beyond_what_a_record_shows_is_not_called_certain(seed):
    """10 mm at 2 Hz goes 0.7 mm/s beyond the knee: any blow-off rate fits, if only the knee moves."""
    result = fit(Besinger, records(seed, [SineTest(0.01, 2.0)]))
    blow_off = result["blow_off_rate"]
    assert blow_off.note == "not identifiable"
    for estimate, true in zip(result.parameters, free_parameters(PUBLISHED).values, strict=True):
        assert estimate.note == "not identifiable" or abs(estimate.value - true) < 4.0 * estimate.standard_error, result


def test_a_search_stays_inside_the_conditions_of_a_law():
    """The chi-square falls towards a compression rate that is too soft for a force that grows everywhere."""
    result = fit(Besinger, records(2, [SineTest(0.01, 2.0)]))
    compression, rebound = result["compression_rate"], result["rebound_rate"]
    assert compression.value == pytest.approx(0.0067 * rebound.value, rel=1e-3)
    assert np.all(np.asarray(margins(result.law)) > 0)
    law = from_json(to_json(result.law))
    assert isinstance(law, Besinger) and isinstance(result.law, Besinger)
    assert law.force_velocity(0.1) == result.law.force_velocity(0.1)
    assert {compression.note, rebound.note, result["transition_velocity"].note} == {"not identifiable"}
    together = [w for w in result.warnings if w.startswith("These records cannot distinguish")]
    assert len(together) == 1 and "compression_rate" in together[0] and "rebound_rate" in together[0]
    assert any("transition_velocity" in w and "is outside the records" in w for w in result.warnings)


def test_starts_are_what_a_law_and_those_inside_propose():
    law = Lag(PUBLISHED, 0.004)
    free = free_parameters(law, freeze=["limit_velocity"], bounds={"transition_velocity": (0.1, 2.0)})
    starts = other_starts(free, REACH)
    column = {name: [float(values[i]) for values in starts] for i, name in enumerate(free.names)}
    assert column["lag_time"][:2] == [0.001, 0.016] and set(column["lag_time"][2:]) == {0.004}
    alphas = column["law.transition_velocity"]
    assert alphas[:2] == [0.7, 0.7] and min(alphas) > 0.1 and max(alphas) == pytest.approx(1.2)
    assert all(set(column[name]) == {float(v)} for name, v in (("law.blow_off_rate", 3600.0),))


def test_what_is_linear_or_ordered_proposes_no_starts():
    assert Bilinear(1.0, 1.0).other_starts(REACH) == [] == Linear(1.0).other_starts(REACH)
    assert PiecewiseLinear([-0.3, 0.05], [1.0, 2.0, 3.0]).other_starts(REACH) == []


def test_proposals_stay_within_the_reach_of_the_records():
    (low, high) = BoucWen(900.0, 3000.0, 400.0, 1e-2).other_starts(REACH)
    assert low == {"yield_displacement": 2.5e-3} and high == {"yield_displacement": REACH.stroke}


def test_starts_that_break_a_condition_are_left_out():
    law = Besinger(14_400.0, 500.0, 3_600.0, limit_velocity=0.1, transition_velocity=0.2)
    starts = other_starts(free_parameters(law), REACH)
    assert 0 < len(starts) < len(law.other_starts(REACH))
    assert all(np.all(np.asarray(margins(free_parameters(law).build(jnp.asarray(values)))) > 0) for values in starts)


def test_one_number_is_to_be_frozen_where_one_direction_is_open():
    law = MotionRatio(Bilinear(2600.0, 1200.0), 0.7)
    runs = VirtualDyno(law, sampling_rate=200.0, force_noise=5.0).run(SineTest(0.02, 2.0, cycles=2))
    (said,) = (w for w in fit(law, runs).warnings if w.startswith("These records cannot distinguish"))
    assert "law.compression_rate and ratio: " in said and ". Freeze one of them, or add" in said
    assert all(e.note == "" for e in fit(law, runs, freeze=["ratio"]).parameters)
