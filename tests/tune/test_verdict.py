"""The first sentence of a tuning: better or not, by how much, at what price, within which limits."""

import dataclasses
import re
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, roads, tune
from jaxdamp.solve import SequentialQuadratic
from jaxdamp.tune import Outcome, Rescore, Status, TuneResult, minimising
from jaxdamp.tune.limits import Limit, decided, half_interval, limit_ranges
from jaxdamp.tune.ranges import Change
from jaxdamp.vehicles import presets


CAR = presets.quarter_car_000()
COMFORT, TYRE, TRAVEL = "rms_sprung_acceleration", "rms_dynamic_tyre_load", "working_space_peak_to_peak"
MEAN = "working_space_mean"
WHITE = roads.white("C", 20.0)


def made_up(comfort: list[float], tyre: list[float], travel: list[float], **more: Any) -> TuneResult:
    """A tuning whose metrics were 1 before, and these on the fresh roads after."""
    after = {COMFORT: np.array(comfort), TYRE: np.array(tyre), TRAVEL: np.array(travel)}
    units = {COMFORT: "m/s^2", TYRE: "N", TRAVEL: "m"}
    before = dict.fromkeys(after, 1.0)
    fresh = Rescore({name: np.ones(len(comfort)) for name in after}, after, units, COMFORT)
    values = {name: float(x.mean()) for name, x in after.items()}
    words: dict[str, Any] = dict(warnings=(), status=Status.CONVERGED, history=(1.0,), fresh=fresh, active_limits=())
    limits: dict[str, Any] = dict(limits={TYRE: 1.1}, allowed=limit_ranges({TYRE: "+10%"}, [TYRE]))
    parameters = more.pop("parameters", ())
    return TuneResult(CAR, CAR, COMFORT, parameters, before, values, units, **(limits | words | more))


CASES = [
    (
        ([0.89, 0.90, 0.91], [1.05] * 3, [1.02, 1.03, 1.04]),
        Outcome.BETTER,
        f"Better: {COMFORT} -10.0 ± 2.5 % on 3 fresh",
    ),
    (([0.95, 0.96, 0.97], [1.05] * 3, [1.29, 1.3, 1.31]), Outcome.TRADE, f"price: {TRAVEL} +30.0 %"),
    (([0.80, 0.99, 1.15], [1.05] * 3, [1.0] * 3), Outcome.NOT_SHOWN, "Not shown to be better"),
    (([1.04, 1.05, 1.06], [1.05] * 3, [1.0] * 3), Outcome.NOT_BETTER, "Not better"),
    (([1e7, 1.01e7, 1.02e7], [1.05] * 3, [1.0] * 3), Outcome.NOT_BETTER, f"Not better: {COMFORT} +1e+09 ± 2.5e+07 %"),
    (([0.89, 0.90, 0.91], [1.14, 1.15, 1.16], [1.0] * 3), Outcome.LIMIT_LOST, f"{TYRE} is 4.5 % beyond its limit"),
]


def test_a_verdict_outside_the_records_says_so_also_where_nothing_is_better():
    for metrics, outcome, words in CASES[2:]:
        result = made_up(*metrics, extrapolated=("damper at 5 times the velocity of its records, 60 % of the time",))
        assert result.verdict.outcome is outcome and words in result.verdict.sentence
        assert "by the law, but outside its records (damper at 5 times" in result.verdict.sentence


def test_every_fresh_road_beyond_a_limit_is_counted():
    """Also those by less than the percent within which a limit counts as held."""
    tyre = [1.095, 1.0999, 1.1004, 1.108, 1.2]
    result = made_up([0.9] * 5, tyre, [1.0] * 5, active_limits=(TYRE,))
    assert "at its limit, beyond it on 3 of 5 fresh roads" in result.verdict.sentence


@pytest.mark.parametrize(
    ("metrics", "outcome", "words"), CASES, ids=[f"{case[1].name}-{case[0][0][0]:g}" for case in CASES]
)
def test_the_verdict_is_that_of_the_fresh_roads(metrics, outcome, words):
    result = made_up(*metrics)
    assert result.verdict.outcome is outcome and words in result.verdict.sentence
    assert result.summary.startswith(result.verdict.sentence) and result.verdict.better == (outcome is Outcome.BETTER)
    data = result.to_dict()
    assert data["verdict"] == outcome.name


def test_what_changes_as_a_limited_metric_is_no_price_beside_it():
    """The coefficient of a tyre load has the mean load below it, which differs from run to run by parts in 10 000."""
    assert "price" not in made_up([0.9] * 3, [1.05] * 3, [1.05001] * 3).verdict.sentence
    assert f"price: {TRAVEL} +5.1 %" in made_up([0.9] * 3, [1.05] * 3, [1.051] * 3).verdict.sentence


def test_a_start_that_is_as_good_is_said_to_be():
    """Not that a gain of nothing is not shown, on however few roads."""
    for comfort in ([1.0] * 4, [1.0], [1.0003, 0.9998, 1.0001, 1.0]):
        result = made_up(comfort, [1.0] * len(comfort), [1.0] * len(comfort))
        assert result.verdict.outcome is Outcome.NOT_BETTER, comfort
        assert result.verdict.sentence.startswith(f"Not better, the start is as good: {COMFORT} "), comfort


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_metric_that_may_be_negative_is_judged_alike_in_every_unit(size):
    """8 % lower, for 2 % more of another metric: 0.2 mm on a bump of 5 mm are as much as 2 mm on one of 5 cm."""
    words: dict[str, Any] = dict(warnings=(), status=Status.CONVERGED, history=(1.0,), parameters=(), limits={})
    words |= dict(active_limits=(), units={MEAN: "m", COMFORT: ""})
    for after, outcome in ((0.92, Outcome.BETTER), (0.99, Outcome.TRADE), (1.01, Outcome.NOT_BETTER)):
        sides = {MEAN: size, COMFORT: 1.0}, {MEAN: after * size, COMFORT: 1.02}
        result = TuneResult(CAR, CAR, MEAN, before=sides[0], after=sides[1], **words)
        assert result.verdict.outcome is outcome, result.verdict.sentence
    words |= dict(units={MEAN: "m"})
    from_zero = TuneResult(CAR, CAR, MEAN, before={MEAN: 0.0}, after={MEAN: -size}, **words)
    assert from_zero.verdict.outcome is Outcome.BETTER


def test_metrics_that_may_be_negative_have_no_percent():
    """A limit of -5 % of a negative number lets it fall, whereas its quotient rises."""
    fresh = Rescore({MEAN: np.full(3, -0.02)}, {MEAN: np.array([-0.0209, -0.021, -0.0211])}, {MEAN: "m"}, MEAN)
    np.testing.assert_allclose(fresh.change(MEAN), [-0.045, -0.05, -0.055], rtol=1e-9)
    sides = {MEAN: -0.02, COMFORT: 1.0}, {MEAN: -0.021, COMFORT: 0.9}
    words: dict[str, Any] = dict(warnings=(), status=Status.CONVERGED, history=(1.0,), parameters=())
    allowed = limit_ranges({MEAN: ("-5%", None)}, [MEAN])
    words |= dict(limits={MEAN: (-0.021, np.inf)}, allowed=allowed, active_limits=(MEAN,))
    words["units"] = {MEAN: "m", COMFORT: ""}
    result = TuneResult(CAR, CAR, COMFORT, before=sides[0], after=sides[1], **words)
    assert f"limits: {MEAN} -21 mm, at its limit" in result.summary
    assert [row["change"] for row in result.table().records()] == [None, pytest.approx(-10.0)]
    words |= dict(limits={}, allowed={}, fresh=fresh)
    lowered = TuneResult(CAR, CAR, MEAN, before=sides[0], after=sides[1], **words)
    assert lowered.verdict.sentence.startswith(f"Better: {MEAN} -20 -> -21 mm on 3 fresh roads")


def test_what_is_maximised_gets_better_as_its_negative_falls():
    result = tune.minimise(lambda m: -m[COMFORT], CAR, WHITE, over={"damper.rate": (2000.0, 4000.0)})
    assert result.parameters[0].after == pytest.approx(2000.0)
    assert result.verdict.outcome in (Outcome.BETTER, Outcome.TRADE)
    change = (result.before[COMFORT] - result.after[COMFORT]) / result.before[COMFORT]
    assert f"objective {100.0 * change:+.1f} %" in result.verdict.sentence and change < 0.0


def test_outside_its_records_a_damper_is_not_called_better():
    result = made_up([0.89, 0.90, 0.91], [1.05] * 3, [1.0] * 3, extrapolated=("damper at 2 times the velocity",))
    assert result.verdict.outcome is Outcome.EXTRAPOLATED and "2 times" in result.verdict.sentence
    law = dampers.with_fitted_range(dampers.Linear(2500.0), velocity=(-0.02, 0.02))
    tuned = tune.minimise(COMFORT, presets.quarter_car_000(law), WHITE)
    assert tuned.verdict.outcome is Outcome.EXTRAPOLATED and tuned.after[COMFORT] < tuned.before[COMFORT]
    (outside,) = tuned.extrapolated
    assert outside.startswith("damper at ") and " times the velocity of its records, " in outside
    assert f"({outside})" in tuned.summary


def test_of_many_parameters_at_bounds_the_summary_says_how_many():
    notes = ["at its lower bound", "at its upper bound", "at its lower bound", ""]
    changes = tuple(Change(f"damper.{i}", 1.0, 2.0, "N", note, 0.5, 2.0, ()) for i, note in enumerate(notes))
    several = made_up([0.9] * 3, [1.0] * 3, [1.0] * 3, parameters=changes)
    assert "3 of 4 parameters at their bounds" in several.summary and "damper.0" not in several.summary


def test_a_violated_limit_is_said_first_with_its_number():
    result = tune.minimise(COMFORT, CAR, WHITE, limits={"working_space_rms": 1e-3})
    assert list(result.violated) == ["working_space_rms"] and result.active_limits == ()
    value = f"{1e3 * result.after['working_space_rms']:.4g} mm"
    assert result.summary.startswith(f"Limit not met: working_space_rms is {value}, and must be ≤ 1 mm")
    (row,) = [row for row in result.table().records() if row["metric"] == "working_space_rms"]
    assert row["note"] == "limit 1 mm, violated" and result.verdict.outcome is Outcome.LIMIT_NOT_MET
    labels = [label.get_text() for axes in result.plot().axes for label in axes.get_yticklabels()]
    assert any(label.startswith("suspension travel, RMS (LIMIT VIOLATED)") for label in labels)


def test_relative_limits_follow_the_start():
    soft = presets.quarter_car_000(dampers.Linear(6000.0))
    result = tune.minimise("working_space_rms", soft, WHITE, limits={TYRE: "+1%"})
    assert result.after[TYRE] == pytest.approx(1.01 * result.before[TYRE], rel=1e-5) and result.converged
    assert result.limits[TYRE] == pytest.approx(1.01 * result.before[TYRE]) and result.active_limits == (TYRE,)
    front = tune.pareto([COMFORT, "working_space_rms"], soft, WHITE, limits={TYRE: "+1%"}, points=3)
    assert front.values[TYRE].max() == pytest.approx(1.01 * front.before[TYRE], rel=1e-4)
    spans = tune.limit_spans({"a": ("-5%", "+10%"), "b": (-1.0, None)}, ["a", "b"], {"a": -2.0, "b": 0.0})
    assert spans == {"a": pytest.approx((-2.1, -1.8)), "b": (-1.0, np.inf)}


WRONG: list[tuple[dict[str, Any], str]] = [
    (dict(limits={TYRE: -5.0}), "not be negative, as the metric never is"),
    (dict(limits={TYRE: np.inf}), "be finite"),
    (dict(limits={TYRE: "10"}), "be the largest allowed value"),
    (dict(metric=lambda m: m[COMFORT] * 0.0 + 3.0), "must depend on what is free"),
]


@pytest.mark.parametrize(("change", "message"), WRONG, ids=[message for _, message in WRONG])
def test_what_cannot_be_meant_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        tune.minimise(**({"metric": COMFORT, "vehicle": CAR, "road": WHITE} | change))
    with pytest.raises(ValueError, match="be a number here"):
        tune.limit_spans({TYRE: "+10%"}, [TYRE])


def test_left_alone_a_tuning_moves_what_a_workshop_can_change():
    car = presets.quarter_car_000(dampers.Lag(dampers.Besinger(1000.0, 2000.0, 500.0, 0.2, 0.05), 0.004))
    road = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    run: dict[str, Any] = dict(duration=0.4, dt=2e-3, max_steps=1)
    result = tune.minimise(COMFORT, car, road, **run)
    names = ["compression_rate", "rebound_rate", "blow_off_rate", "limit_velocity"]
    assert [change.name for change in result.parameters] == [f"damper.law.{name}" for name in names]
    assert not any("workshop" in warning for warning in result.warnings)
    named = tune.minimise(COMFORT, car, road, over=["damper.law.rebound_rate", "damper.lag_time"], **run)
    assert any("No workshop can change damper.lag_time:" in warning for warning in named.warnings)
    friction = presets.quarter_car_000(dampers.CoulombFriction(100.0, 0.01))
    with pytest.raises(ValueError, match=r"no workshop can change.*friction_force"):
        tune.minimise(COMFORT, friction, road, **run)


def test_roads_are_added_until_the_interval_decides():
    fresh = made_up([0.89, 0.90, 0.91], [1.0] * 3, [1.0] * 3).fresh
    assert fresh is not None and decided(fresh, {})
    wide = dataclasses.replace(fresh, after=fresh.after | {COMFORT: np.array([0.8, 0.99, 1.1])})
    assert not decided(wide, {}) and wide.half_width(COMFORT) == half_interval(wide.after[COMFORT])
    tyre = limit_ranges({TYRE: "+10%"}, [TYRE])
    open_limit = dataclasses.replace(fresh, after=fresh.after | {TYRE: np.array([1.0, 1.1, 1.25])})
    assert decided(fresh, tyre) and not decided(open_limit, tyre)


def test_an_optimum_at_a_kink_is_an_optimum():
    def worse(m):
        return jnp.maximum(m[COMFORT] / 1.15, m["working_space_rms"] / 0.0125)

    car, bounds = presets.quarter_car_000(dampers.Linear(1500.0)), {"rate": None}
    result = tune.minimise(worse, car, WHITE, bounds=bounds)
    left, right = (result.after[name] / size for name, size in ((COMFORT, 1.15), ("working_space_rms", 0.0125)))
    assert left == pytest.approx(right, rel=1e-6) and result.converged and not result.warnings
    stopped = tune.minimise(worse, car, WHITE, bounds=bounds, max_steps=2)
    assert stopped.status is Status.STEP_LIMIT


def test_a_search_that_ends_before_an_optimum_is_started_again(monkeypatch):
    terminate, ended = SequentialQuadratic.terminate, []

    def early(solver, state, promised):
        if state.steps == 1 and not ended:
            state.open = False
            ended.append(state.y.copy())
            return True
        return terminate(solver, state, promised)

    monkeypatch.setattr(SequentialQuadratic, "terminate", early)
    result = tune.minimise(COMFORT, CAR, WHITE)
    assert result.parameters[0].after == pytest.approx(4656.4, abs=0.05) and result.converged
    assert len(ended) == 1 and len(result.history) > 2


def judged_beyond(monkeypatch, limit: float, excess: list[float]) -> list[range]:
    """Judgements on made-up roads, on which the tyre load is beyond a limit by these shares; the roads asked for."""
    asked = []

    def fresh(evaluator, sides, numbers, allowed):
        asked.append(numbers)
        units, start = evaluator.task.units, dict.fromkeys(evaluator.task.units, np.ones(3))
        return Rescore(start, start | {TYRE: np.full(3, limit * (1.0 + excess[len(asked) - 1]))}, units, TYRE)

    monkeypatch.setattr(minimising, "_on_fresh_roads", fresh)
    return asked


def test_a_limit_is_tightened_until_new_roads_keep_it(monkeypatch):
    asked = judged_beyond(monkeypatch, 1.01, [0.03, 0.02, 0.0])
    stiff = presets.quarter_car_000(dampers.Linear(12000.0))
    seen: list[float] = []
    told = {"progress": lambda step, value: seen.append(value), "fresh_roads": 4}
    result = tune.minimise("working_space_rms", stiff, WHITE, limits={TYRE: "+1%"}, **told)
    assert list(result.history) == seen and f"after {len(seen)} steps" in result.summary
    assert asked == [range(4), range(4, 8), range(8, 12)]
    assert result.after[TYRE] == pytest.approx(0.95 * 1.01 * result.before[TYRE], rel=1e-4)


def test_a_limit_that_only_other_roads_break_is_tightened_from_the_value_reached(monkeypatch):
    """A fifth above what the search reaches on its road, it would hold there however often it is tightened alone."""
    stiff = presets.quarter_car_000(dampers.Linear(12000.0))
    reached = tune.minimise("working_space_rms", stiff, WHITE, fresh_roads=0).after[TYRE]
    asked = judged_beyond(monkeypatch, 1.2 * reached, [0.03, 0.0])
    result = tune.minimise("working_space_rms", stiff, WHITE, limits={TYRE: 1.2 * reached}, fresh_roads=4)
    assert asked == [range(4), range(4, 8)]
    assert result.after[TYRE] == pytest.approx((1.0 - 0.03 * 1.2) * reached, rel=1e-4)
    for words in (result.verdict.sentence, result.ending):  # nowhere near the limit itself
        assert "at its tightened limit" in words and "at its limit" not in words
    assert result.active[0].endswith("N (tightened)") and "tightened, reached" in result.table().to_text()


def test_the_end_of_a_limit_that_is_nearer_is_tightened():
    limit = Limit("load", "load", 1.0, 3.0, 2.0)
    assert limit.tightened(0.1, 2.9)[2:4] == pytest.approx((1.0, 2.7))
    assert limit.tightened(0.1, 1.2)[2:4] == pytest.approx((1.4, 3.0))
    assert limit.tightened(0.1, 3.4)[2:4] == pytest.approx((1.0, 2.8))
    assert limit.tightened(0.0, 2.9) == limit


def test_combinations_are_those_of_the_tightened_limit(monkeypatch):
    """The best with 1241 N, which 1242 N allow and 1.15 % less does not, comes after the next one with 1226 N."""
    judged_beyond(monkeypatch, 1242.0, [0.0115, 0.0])
    over = {"damper.rate": tune.Choice([1500.0, 4400.0, 5200.0])}
    result = tune.minimise(COMFORT, CAR, WHITE, over=over, limits={TYRE: 1242.0})
    combinations = result.combinations
    assert combinations is not None and combinations.met.tolist() == [True, False, False]
    assert combinations.choices["damper.rate"].tolist() == [5200.0, 4400.0, 1500.0]
    assert result.parameters[0].after == 5200.0


@pytest.mark.slow
def test_limits_that_other_roads_break_are_tightened():
    road = roads.iso8608_filtered("C", speed=20.0, duration=2.2, seed=3)
    run: dict[str, Any] = dict(duration=2.0, dt=2.5e-3, limits={TYRE: "+5%"}, bounds={"rate": (500.0, 9000.0)})
    once = tune.minimise("weighted_rms_sprung_acceleration", CAR, road, fresh_roads=0, **run)
    result = tune.minimise("weighted_rms_sprung_acceleration", CAR, road, **run)
    assert once.fresh is None and "tried on no other" in once.verdict.sentence
    assert result.fresh is not None and result.fresh.roads >= 4
    assert result.verdict.outcome is not Outcome.LIMIT_LOST


def moved_limit(result: Any) -> float:
    """The one number that a relaxation proposes."""
    (text,) = re.findall(r"[≤≥] ([0-9.e+-]+)", result.relaxation)
    return float(text)


def test_the_cheapest_relaxation_gives_one_percent():
    """By its price: run again with the limit that the result proposes."""
    soft = presets.quarter_car_000(dampers.Linear(6000.0))
    result = tune.minimise("working_space_rms", soft, WHITE, limits={TYRE: "+1%"})
    assert result.relaxation.startswith(f"Cheapest for 1 % less working_space_rms: {TYRE} ≤ ")
    assert result.summary.endswith(result.relaxation)
    again = tune.minimise("working_space_rms", soft, WHITE, limits={TYRE: moved_limit(result)})
    assert again.after["working_space_rms"] / result.after["working_space_rms"] == pytest.approx(0.99, abs=1e-3)
    assert tune.minimise(COMFORT, CAR, WHITE, limits={TYRE: "+90%"}).relaxation == ""
    nearly = tune.minimise(TYRE, CAR, WHITE, limits={"working_space_rms": 0.01097})  # 0.010997 without it
    assert nearly.active_limits and nearly.relaxation == ""  # no relaxation gives one percent


def test_of_limits_that_are_not_met_those_within_reach_are_said():
    """They are met, and 1 % less is not."""
    result = tune.minimise(COMFORT, CAR, WHITE, limits={"working_space_rms": 1e-3})
    reach = 1e-3 * moved_limit(result)
    assert result.relaxation.startswith("Within reach: working_space_rms ≤ ") and " instead of 1 mm." in result.summary
    for factor, met in ((1.0, True), (0.99, False)):
        again = tune.minimise(COMFORT, CAR, WHITE, limits={"working_space_rms": factor * reach})
        assert (not again.violated) is met


def test_percentiles_over_fresh_roads():
    fresh = made_up([1.0, 4.0, 2.0], [1.0] * 3, [1.0] * 3).fresh
    assert fresh is not None
    assert fresh.percentile(COMFORT, 50.0) == (1.0, 2.0) and fresh.percentile(COMFORT, 75.0) == (1.0, 3.0)
    with pytest.raises(ValueError, match="`percent`"):
        fresh.percentile(fresh.metric, 101.0)


@pytest.mark.slow
def test_the_optimum_of_one_road_that_is_not_better_on_others_names_what_is():
    road = [roads.iso8608("C", speed=20.0, length=100.0, seed=seed) for seed in range(4)]
    one, four = (tune.minimise("comfort", CAR, r, dt=2e-3) for r in (road[0], tune.Scenarios(road)))
    assert one.verdict.outcome is Outcome.NOT_BETTER and "Tune on four together" in one.warnings[0]
    assert "fresh roads" in one.summary and "Tune on four" not in str(four.warnings)
    assert "fresh draws of the roads" in four.summary and one.fresh is not None and four.fresh is not None
    assert four.fresh.change(four.metric).mean() < one.fresh.change(one.metric).mean()
