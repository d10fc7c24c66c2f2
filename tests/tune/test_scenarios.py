"""Scenarios: many roads and conditions as one ride, and tunings over them."""

import itertools
import re
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from jaxdamp import Ride, dampers, parameters, roads, sweep, tune, vehicles
from jaxdamp.metrics import Metric
from jaxdamp.simulation import ride as ride_module
from jaxdamp.tune import rescoring
from jaxdamp.tune.descending import balanced
from jaxdamp.tune.limits import in_each, limit_ranges, lost_limits


LAW = dampers.TemperatureScaled(dampers.Bilinear(2500.0, 1500.0), temperature=293.15)
CAR = vehicles.presets.quarter_car_000(LAW)
ACCELERATION, TYRE = "rms_sprung_acceleration", "dynamic_load_coefficient"
DRIVEN = {"C": roads.iso8608("C", 20.0, seed=1), "bump": roads.cosine_bump(0.05, start=0.1, duration=0.2)}
HOT = tune.Condition({"temperature": 350.0, "sprung_mass": 1500.0}, {"damper.**_rate": 0.8}, weight=3.0)
AS_IT_IS = tune.Condition()
WHITE = {"C": roads.white("C", 20.0), "D": roads.white("D", 10.0)}
LINEAR = vehicles.presets.quarter_car_000()
WILD = vehicles.presets.quarter_car_000(dampers.Polynomial([0.0, 2000.0, 0.0, -5000.0]))


def test_each_scenario_is_the_ride_of_that_vehicle_on_that_road() -> None:
    scenarios = tune.Scenarios(DRIVEN, {"cold": tune.Condition(), "hot": HOT}, weights={"bump": 1.0, "C": 2.0})
    ride = scenarios.ride(CAR, metrics=[ACCELERATION, TYRE], duration=0.5)
    assert ride.names == ("C, cold", "C, hot", "bump, cold", "bump, hot")
    np.testing.assert_allclose(ride.weights, np.array([2.0, 6.0, 1.0, 3.0]) / 12.0)
    warm = dampers.TemperatureScaled(dampers.Bilinear(2000.0, 1200.0), temperature=350.0)
    hot = parameters.replace(vehicles.presets.quarter_car_000(warm), {"sprung_mass": 1500.0})
    pairs = [(car, road) for road in DRIVEN.values() for car in (CAR, hot)]
    alone = [Ride(car, road, metrics=[ACCELERATION, TYRE], duration=0.5)() for car, road in pairs]
    each, joined, together = ride.each(), ride(), ride.side_by_side()
    assert ride.in_turn and not together.in_turn
    batch = jax.vmap(lambda mass: ride({"sprung_mass": mass}))(jnp.full(2, CAR.sprung_mass))
    for name in (ACCELERATION, TYRE):
        np.testing.assert_allclose(each[name], [run[name] for run in alone], rtol=1e-12)
        np.testing.assert_allclose(together.each()[name], each[name], rtol=1e-11)
        assert float(batch[name][1]) == pytest.approx(float(together({"sprung_mass": CAR.sprung_mass})[name]))
        assert float(joined[name]) == pytest.approx(float(np.sum(ride.weights * each[name])))


@pytest.mark.slow
def test_scenarios_are_swept_and_differentiated_as_a_ride() -> None:
    ride = tune.Scenarios(WHITE, [tune.Condition(), tune.Condition(factors={"rate": 0.9})]).ride(
        LINEAR, metrics=[ACCELERATION]
    )
    data = sweep(ride, {"damper.rate": [2000.0, 3000.0]}, gradients=True)
    value = lambda rate: ride({"damper.rate": rate})[ACCELERATION]  # noqa: E731
    assert float(data[ACCELERATION][0]) == pytest.approx(float(value(2000.0)), rel=1e-12)
    difference = (value(3000.1) - value(2999.9)) / 0.2
    assert float(data[f"d_{ACCELERATION}"][1, 0]) == pytest.approx(float(difference), rel=1e-6)
    assert data[ACCELERATION].attrs["units"] == "m/s^2"


def test_risks_join_values() -> None:
    values, weights = jnp.array([1.0, 4.0, 2.0, 3.0]), jnp.array([0.4, 0.1, 0.3, 0.2])
    tail = tune.CVaR(0.2)
    assert float(tail(values, weights)) == pytest.approx((0.1 * 4.0 + 0.1 * 3.0) / 0.2)
    np.testing.assert_allclose(jax.grad(tail)(values, weights), [0.0, 0.5, 0.0, 0.5])
    assert float(tune.CVaR(1.0)(values, weights)) == pytest.approx(float(jnp.sum(values * weights)))
    worst = tune.Scenarios(WHITE, risk="worst").risk
    assert float(worst(values, weights)) == 4.0
    np.testing.assert_array_equal(jax.grad(worst)(values, weights), [0.0, 1.0, 0.0, 0.0])


def test_the_mean_over_white_roads_has_the_closed_form_optimum_and_the_worst_case_that_of_its_road() -> None:
    """The mean of RMS values on roads of one spectrum is proportional to one of them: the same c* = k sqrt(M/k_t)."""
    best = 60e3 * np.sqrt(1325.0 / 220e3)
    for risk in ("mean", "worst"):
        result = tune.minimise(ACCELERATION, LINEAR, tune.Scenarios(WHITE, risk=risk))
        assert result.parameters[0].after == pytest.approx(best, rel=1e-5), risk
        assert f"% in the {risk} of 2 scenarios;" in result.summary
    assert result.scenarios is not None and result.scenarios.names == ("C", "D")
    assert result.scenario_table().records()[1]["scenario"] == "D"
    shown = [row["metric"] for row in result.table().records()]
    assert shown == [m.name for m in LINEAR.ride_metrics if m.name in shown] and len(shown) > 3  # as of one road


def test_limits_hold_in_every_scenario() -> None:
    laden = tune.Condition({"sprung_mass": 1500.0})
    scenarios = tune.Scenarios(WHITE, {"empty": tune.Condition(), "laden": laden})
    result = tune.minimise("rms_dynamic_tyre_load", LINEAR, scenarios, limits={ACCELERATION: 1.204})
    assert result.converged and result.active_limits == (ACCELERATION,)
    assert result.scenarios is not None
    assert np.max(result.scenarios.after[ACCELERATION]) == pytest.approx(1.204, rel=1e-5)
    (held,) = result.active
    assert held == "rms_sprung_acceleration ≤ 1.204 m/s², in 'D, empty'"


def test_a_limit_in_scenarios_is_judged_in_each_of_them_on_fresh_roads() -> None:
    """A scenario that keeps its limit easily does not make up for one that does not."""
    scenarios = tune.Scenarios([DRIVEN["C"]], {"light": tune.Condition({"sprung_mass": 800.0}), "as it is": AS_IT_IS})
    metrics = [m for m in LINEAR.ride_metrics if m.name in (ACCELERATION, TYRE)]
    drive = rescoring.driver((LINEAR, LINEAR), metrics, None, {"duration": 0.3}, [ACCELERATION])
    each = scenarios.ride(LINEAR, metrics=metrics, duration=0.3).each()[ACCELERATION]
    ranges = limit_ranges({ACCELERATION: 0.5 * float(each[0] + each[1])}, [ACCELERATION])
    allowed = in_each(ranges, ["road 1, light", "road 1, as it is"])
    units = {m.name: "" for m in metrics}
    fresh = rescoring.rescored(drive, [scenarios] * 3, units, TYRE, (), allowed)
    np.testing.assert_allclose([fresh.after[name] for name in allowed], np.tile(each, (3, 1)).T, rtol=1e-12)
    assert list(lost_limits(fresh, allowed)) == [f"{ACCELERATION} in 'road 1, light'"]
    assert set(fresh.content()["metrics"]) == set(units)


@pytest.mark.slow
def test_the_numbers_of_the_worst_case_are_the_true_ones() -> None:
    """Eight equal roads count as one of them: no number is above the largest value."""
    scenarios = tune.Scenarios([WHITE["C"]] * 8, risk="worst")
    limits, over = {"rms_dynamic_tyre_load": "-5%"}, ["damper.rate"]
    result = tune.minimise(ACCELERATION, LINEAR, scenarios, limits=limits, over=over)
    alone = Ride(LINEAR, WHITE["C"])()
    load = float(alone["rms_dynamic_tyre_load"])
    assert result.before["rms_dynamic_tyre_load"] == pytest.approx(load, rel=1e-9)
    assert result.limits == {"rms_dynamic_tyre_load": pytest.approx(0.95 * load, rel=1e-9)}
    front = tune.pareto([ACCELERATION, "rms_dynamic_tyre_load"], LINEAR, scenarios, points=3, limits=limits, over=over)
    assert front.before[ACCELERATION] == pytest.approx(float(alone[ACCELERATION]), rel=1e-9)
    assert front.limits == result.limits
    first = float(Ride(front.point(0), WHITE["C"])()[ACCELERATION])
    assert front.values[ACCELERATION][0] == pytest.approx(first, rel=1e-9)


@pytest.mark.slow
def test_the_smallest_largest_value_is_at_a_kink() -> None:
    """Front and rear rates for worn and cold dampers, by a search without derivatives: two cases are equal there."""
    over, states = ["front.damper.rate", "rear.damper.rate"], (0.6, 1.0, 1.5)
    factors = [dict(zip(over, pair, strict=True)) for pair in itertools.product(states, states)]
    scenarios = tune.Scenarios([WHITE["C"]], [tune.Condition(factors=one) for one in factors], risk="worst")
    car = vehicles.presets.half_car_002()
    tuned = tune.minimise(ACCELERATION, car, scenarios, over=over)
    each = jax.jit(lambda rates: scenarios.ride(car).each(dict(zip(over, rates, strict=True)))[ACCELERATION])
    found = minimize(lambda rates: float(each(rates).max()), [1500.0, 700.0], method="Nelder-Mead", tol=1e-7)
    assert tuned.converged and tuned.after[ACCELERATION] == pytest.approx(found.fun, rel=1e-6)
    ends = [change.after for change in tuned.parameters]
    np.testing.assert_allclose(ends, found.x, rtol=1e-3)
    first, second, third, *_ = np.sort(each(jnp.array(ends)))[::-1]
    assert first - second < 1e-9 * first < first - third


def test_a_slope_is_balanced_by_weights_that_are_not_negative() -> None:
    """Scenarios that are as bad balance each other only where no direction is better for all of them."""
    ahead, back, wall = np.array([[1.0, 0.0]]), np.array([[-2.0, 0.0]]), np.array([[-4.0, 0.0]])
    none = np.zeros((0, 2))
    assert balanced(np.concatenate([ahead, 3.0 * ahead]), none)[0] == pytest.approx(1.0, rel=1e-5)
    assert balanced(np.concatenate([ahead, back]), none)[0] == pytest.approx(0.0, abs=1e-9)
    left, multipliers = balanced(ahead, np.concatenate([wall, -wall]))
    assert left == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(multipliers, [0.25, 0.0], rtol=1e-5)
    assert balanced(np.zeros((1, 2)), wall)[0] == 0.0 and balanced(np.zeros((2, 0)), np.zeros((1, 0)))[0] == 0.0


def test_a_sweep_over_scenarios_takes_the_steps_of_its_steepest_end() -> None:
    """With those of the start, the travel of stiff dampers at coarse steps was no number."""
    bump, light = roads.step(0.02, start=0.05), {"unsprung_mass": 30.0}
    scenarios = tune.Scenarios([bump], [tune.Condition(light), tune.Condition(factors={"sprung_mass": 1.2})])
    run: dict[str, Any] = {"metrics": ["working_space_rms"], "duration": 0.3, "dt": 2e-3}
    ride, rates = scenarios.ride(LINEAR, **run), {"damper.rate": np.array([1500.0, 200e3, 9e5])}
    data = sweep(ride, {"damper.rate": rates["damper.rate"][:2]})
    alone = scenarios.ride(parameters.replace(LINEAR, {"damper.rate": 200e3}), **run)
    assert ride.reaching({"damper.rate": rates["damper.rate"][:2]}).ride.substeps == alone.ride.substeps
    assert float(data["working_space_rms"][1]) == pytest.approx(float(alone()["working_space_rms"]), rel=1e-9)
    steepest = Ride(parameters.replace(LINEAR, light), bump, **run)
    np.testing.assert_array_equal(ride.out_of_domain(rates) == "", steepest.out_of_domain(rates) == "")


def test_white_roads_without_a_stationary_motion_are_refused_after_one_computation(monkeypatch) -> None:
    """The road that has none was driven again by itself, which took as long as all of them."""
    driven, drive = [], ride_module._drive
    monkeypatch.setattr(ride_module, "_drive", lambda *args: driven.append(args) or drive(*args))
    scenarios = tune.Scenarios(WHITE).ride(WILD, metrics=[ACCELERATION])
    with pytest.raises(ValueError, match=r"have a stationary motion .* none was found: damper"):
        scenarios.each()
    assert len(driven) <= 1  # traced, for all roads at once


def test_tolerances_and_samples_are_conditions() -> None:
    made = tune.tolerances({"damper.rate": 0.1, "sprung_mass": 0.02}, 256, seed=3)
    factors = np.array([list(condition.factors.values()) for condition in made.values()])
    np.testing.assert_allclose(factors.mean(axis=0), 1.0, atol=2e-3)
    np.testing.assert_allclose(factors.std(axis=0), [0.1, 0.02], rtol=0.03)
    assert abs(np.corrcoef(factors.T)[0, 1]) < 0.1
    values = tune.samples({"rate": [2400.0, 2600.0], "slopes": np.ones((2, 3))})
    assert values["sample 2"].values["rate"] == 2600.0 and np.shape(values["sample 1"].values["slopes"]) == (3,)


WRONG_SCENARIOS = [
    (lambda: tune.Scenarios([]), "`roads` must hold one or more"),
    (lambda: tune.Scenarios([*WHITE.values(), DRIVEN["C"]]), "must be all white or all driven over"),
    (lambda: tune.Scenarios(WHITE, weights=[1.0]), "be one for each road"),
    (lambda: tune.Scenarios(WHITE, weights=[1.0, -1.0]), "be 0 or more"),
    (lambda: tune.Scenarios(WHITE, risk="median"), "`risk` must be one of 'mean', 'worst'"),
    (lambda: tune.CVaR(0.0), "`share` must be positive and finite"),
    (lambda: tune.tolerances({}, 2), "be a mapping of one or more parameters"),
    (lambda: tune.tolerances({"rate": 5.0}, 2), "0.05 is a standard deviation of 5 %"),
    (lambda: tune.tolerances({"rate": 0.1}, 0), "`count` must be 1 or more"),
    (lambda: tune.samples({"rate": [1.0], "mass": [1.0, 2.0]}), "equally many samples"),
    (lambda: tune.Scenarios(WHITE, [tune.Condition({"rat": 1.0})]).ride(LINEAR), "did you mean 'rate'"),
    (lambda: tune.Scenarios(WHITE, [tune.Condition({"rate": -1.0})]).ride(LINEAR), "must be positive"),
    (lambda: tune.Scenarios(WHITE, [tune.Condition({"rate": 1.0}, {"rate": 2.0})]).ride(LINEAR), "a value or a factor"),
    (
        lambda: tune.minimise(ACCELERATION, LINEAR, tune.Scenarios(WHITE, [tune.Condition({"rate": 2e3})])),
        "must not free damper.rate, which a condition of the scenarios sets",
    ),
    (
        lambda: tune.Scenarios([roads.iso8608("C", 20.0, seed=1)], [tune.Condition({"front_distance": 1.1})]).ride(
            vehicles.presets.half_car_002(), duration=0.1
        ),
        "must not move an axle in scenarios",
    ),
    (lambda: tune.minimise(ACCELERATION, LINEAR, WHITE["C"], limits={TYRE: (2.0, 1.0)}), "in increasing order"),
    (
        lambda: tune.minimise(ACCELERATION, LINEAR, WHITE["C"], limits={TYRE: (1e6, "-5%")}),
        "1e.06 to .* is relative to",
    ),
    (lambda: tune.minimise(ACCELERATION, LINEAR, WHITE["C"], starts=0), "`starts` must be 1 or more"),
    (lambda: tune.minimise(ACCELERATION, LINEAR, WHITE["C"], fresh_roads=-1), "`fresh_roads` must be 0 or more"),
    (
        lambda: tune.minimise(ACCELERATION, LINEAR, WHITE["C"], shape=tune.monotone().at("rear.*")),
        r"name a damper of the vehicle \(damper\)",
    ),
    (lambda: tune.slope(), "one of them given"),
    (lambda: tune.slope(2.0, 1.0), "be below `upper`"),
    (lambda: tune.ratio(1.0, velocity=0.0), "`velocity` must be positive"),
    (lambda: tune.knee(0.1, side="up"), "`side` must be one of 'rebound', 'compression'"),
    (lambda: tune.Targets({}), "one or more metrics to a value and a tolerance"),
    (lambda: tune.minimise(Metric(ACCELERATION, "rms"), LINEAR, WHITE["C"]), "channel of metric"),
]


@pytest.mark.parametrize(("call", "message"), WRONG_SCENARIOS, ids=[message[:30] for _, message in WRONG_SCENARIOS])
def test_wrong_uses_are_refused(call, message) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_fresh_roads_of_fixed_amplitudes_keep_the_spectrum_and_the_coherence_of_tracks() -> None:
    road = roads.iso8608("C", 20.0, seed=1, amplitudes="fixed")
    other = road.reseeded(5)
    np.testing.assert_allclose(other.amplitude, road.amplitude)
    assert not np.allclose(other.phase, road.phase)
    tracks: Any = roads.two_track(road, track_width=1.5, seed=2)
    again: Any = tracks.reseeded(5)
    for one in (tracks, again):
        shift = (one.roads[1].phase - one.roads[0].phase) % (2 * np.pi)
        np.testing.assert_allclose(shift, (tracks.roads[1].phase - tracks.roads[0].phase) % (2 * np.pi), atol=1e-9)
    assert DRIVEN["bump"].reseeded(1) is None
    others = tune.Scenarios(DRIVEN).on_other_roads(3)
    assert others is not None and eqx.tree_equal(others.scenarios[1].road, DRIVEN["bump"])


def test_the_limit_that_is_to_be_relaxed_is_one_that_holds_the_search() -> None:
    ways = {name: roads.iso8608(name, speed, seed=1, duration=1.0) for name, speed in (("C", 20.0), ("D", 10.0))}
    conditions = {"empty": AS_IT_IS, "laden": tune.Condition({"sprung_mass": 1500.0})}
    car, limits = vehicles.presets.quarter_car_000(dampers.Bilinear(3000.0, 1500.0)), {"rms_dynamic_tyre_load": "+2%"}
    result = tune.minimise(
        ACCELERATION, car, tune.Scenarios(ways, conditions), limits=limits, fresh_roads=0, duration=1.0
    )
    words = re.fullmatch(
        r".*: (\w+) in ('.*') ≤ .* instead of (.*), and all others of this limit alike\.", result.relaxation
    )
    assert words is not None and "{0} ≤ {2}, in {1}".format(*words.groups()) in result.active
    assert not any("'C, empty'" in active for active in result.active)  # the first scenario
