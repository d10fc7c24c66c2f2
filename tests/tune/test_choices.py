"""Numbers that can only take some values: clicks, springs and shims of a catalogue."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from jaxdamp import Ride, dampers, roads, sweep, tune, vehicles
from jaxdamp.parameters import free_parameters, get, replace


COMFORT, TYRE = "rms_sprung_acceleration", "rms_dynamic_tyre_load"
CAR, WHITE = vehicles.presets.quarter_car_000(), roads.white("C", 20.0)
RATES = [1500.0, 3000.0, 4400.0, 5200.0, 7000.0]


def test_the_best_choice_is_that_of_all_of_them() -> None:
    result = tune.minimise(COMFORT, CAR, WHITE, over={"damper.rate": tune.Choice(RATES)})
    swept = sweep(Ride(CAR, WHITE, metrics=[COMFORT]), {"damper.rate": RATES})[COMFORT].values
    assert result.parameters[0].after == RATES[int(np.argmin(swept))] == float(get(result.vehicle, "damper.rate"))
    assert result.after[COMFORT] == pytest.approx(swept.min(), rel=1e-9) == result.history[-1]
    assert result.converged and not result.parameters[0].note


@pytest.mark.slow
def test_what_is_free_beside_a_choice_is_best_for_it() -> None:
    """Two catalogues and a bound, with a limit: against all combinations, of which one is the best."""
    car = vehicles.presets.quarter_car_000(dampers.Linear(1500.0) + dampers.Linear(1500.0))
    choices = {"spring_rate": [40e3, 60e3, 75e3], "damper.terms.0.rate": [1000.0, 1500.0, 3600.0]}
    free = {"damper.terms.1.rate": (500.0, 1800.0)}
    limits = {TYRE: 1300.0}
    found = tune.minimise(
        COMFORT, car, WHITE, over={name: tune.Choice(values) for name, values in choices.items()} | free, limits=limits
    )
    assert found.after[TYRE] <= 1300.0 * (1 + 1e-6) and found.converged
    values = {change.name: change.after for change in found.parameters}
    assert all(values[name] in given for name, given in choices.items())
    axes = {name: given for name, given in choices.items()} | {"damper.terms.1.rate": np.linspace(500.0, 1800.0, 131)}
    points = np.array(list(itertools.product(*axes.values())))
    swept = sweep(Ride(car, WHITE, metrics=[COMFORT, TYRE]), axes)
    allowed = swept[TYRE].values.ravel() <= 1300.0
    best = points[allowed][np.argmin(swept[COMFORT].values.ravel()[allowed])]
    assert [values[name] for name in choices] == best[:2].tolist()
    assert found.after[COMFORT] <= swept[COMFORT].values.ravel()[allowed].min() * (1 + 1e-9)


def test_a_combination_without_a_number_comes_last() -> None:
    def steep(metrics):
        return jnp.where(metrics[COMFORT] > 1.1, jnp.nan, metrics[COMFORT])

    result = tune.minimise(steep, CAR, WHITE, over={"damper.rate": tune.Choice([1500.0, 3000.0, 4400.0])})
    assert result.combinations is not None and float(get(result.vehicle, "damper.rate")) == 4400.0
    assert result.combinations.choices["damper.rate"].tolist() == [4400.0, 3000.0, 1500.0]
    assert result.combinations.met.tolist() == [True, True, False]
    assert "is the best of 3 combinations, of which 1 without a number, beside" in result.summary
    assert [row[-1] for row in result.combinations.table().rows] == ["met", "met", "no number"]


def test_a_choice_that_needs_more_steps_than_the_start_is_driven_with_them() -> None:
    """With the single step of the start the travel at 200 000 N s/m was no number, and 60 000 N s/m gave 1e149 m."""
    bump, travel = roads.cosine_bump(0.05, start=0.1, duration=0.25), "working_space_rms"
    run, rates = tune.Run(duration=0.5, dt=5e-3), (2500.0, 60e3, 200e3)
    scenarios = tune.Scenarios([bump], [tune.Condition({"unsprung_mass": 30.0})])  # a wheel that needs more steps
    result = tune.minimise(travel, CAR, scenarios, over={"damper.rate": tune.Choice(rates)}, **run)
    assert float(get(result.vehicle, "damper.rate")) == 200e3 and result.combinations is not None
    assert result.combinations.at(0) == "damper.rate = 200000 N s/m"
    light = replace(CAR, {"unsprung_mass": 30.0, "damper.rate": 200e3})
    alone = Ride(light, bump, metrics=[travel], **run)
    assert alone.substeps > 1 and result.after[travel] == pytest.approx(float(alone()[travel]), rel=1e-9)


def test_a_tuned_vehicle_is_driven_with_the_substeps_that_it_needs() -> None:
    """Its numbers, and those before, were by the one step of the start, and the advice was to tune again."""
    road, run = roads.cosine_bump(0.05, start=0.1, duration=0.25), tune.Run(duration=0.5, dt=5e-3)
    result = tune.minimise("travel", CAR, road, over={"damper.rate": (1000.0, 40000.0)}, **run)
    alone, travel = Ride(result.vehicle, road, **run), result.metric
    assert alone.substeps > Ride(CAR, road, **run).substeps and not any("tune again" in w for w in result.warnings)
    assert result.after[travel] == pytest.approx(float(alone()[travel]), rel=1e-6)
    before = Ride(CAR, road, substeps=alone.substeps, **run)
    assert result.before[travel] == pytest.approx(float(before()[travel]), rel=1e-6)


def test_clicks_are_chosen_and_swept() -> None:
    """A valley between two hills: every click is driven, where a descent would end at the nearer hill."""
    rates = [900.0, 2500.0, 1200.0, 300.0, 7000.0, 3500.0]
    clicks = np.arange(1.0, 7.0)
    law = dampers.Scheduled(tuple(map(dampers.Linear, rates)), levels=clicks, command=1.0)
    car = vehicles.presets.quarter_car_000(law)
    each = [Ride(vehicles.presets.quarter_car_000(dampers.Linear(rate)), WHITE)() for rate in rates]
    comfort, tyre = (np.array([float(ride[name]) for ride in each]) for name in (COMFORT, TYRE))
    swept = sweep(Ride(car, WHITE, metrics=[COMFORT]), {"command": clicks})
    np.testing.assert_allclose(swept[COMFORT], comfort, rtol=1e-9)
    with pytest.warns(UserWarning, match="damper.command must be between 1 and 6"):
        assert sweep(Ride(car, WHITE, metrics=[COMFORT]), {"command": [0.5, 1.0]}).failed.values.sum() == 1
    limit = float(np.sort(tyre)[2]) * 1.001  # three clicks meet it
    over = {"damper.command": tune.Choice(clicks)}
    result = tune.minimise(COMFORT, car, WHITE, over=over, limits={TYRE: limit})
    order = [i for i in np.argsort(comfort) if tyre[i] <= limit] + [i for i in np.argsort(tyre) if tyre[i] > limit]
    combinations = result.combinations
    assert combinations is not None and combinations.choices["damper.command"].tolist() == clicks[order].tolist()
    np.testing.assert_allclose(combinations.metrics[COMFORT], comfort[order], rtol=1e-9)
    assert combinations.met.tolist() == [True] * 3 + [False] * 3
    assert f"{COMFORT} [m/s²]" in combinations.table().headings()  # as in the other tables of the tuning
    assert float(get(result.vehicle, "damper.command")) == order[0] + 1
    gain = 100.0 * (comfort[order[0]] / comfort[order[1]] - 1.0)
    beside = f"beside the next, damper.command = {order[1] + 1}: {gain:+.1f} %"
    best = f"damper.command = {order[0] + 1} is the best of 6 combinations, of which 3 within the limits, {beside}"
    assert best in result.summary and result.converged
    assert result.to_dict()["combinations"]["rows"][0]["limits"] == "met"
    with pytest.raises(ValueError, match=r"No parameter is named 'damper.comand': did you mean 'damper.command'"):
        tune.minimise(COMFORT, car, WHITE, over=["damper.comand"])
    two = vehicles.presets.half_car_002(law)
    tie, named = {"front.*.command": "rear.*.command"}, ["rear.damper.command"]
    assert free_parameters(two, over=["**.command"], tie=tie).names == named
    patterns = [free_parameters(two, over=over, tie=ties).names for over in (["**"], None) for ties in (tie, None)]
    assert patterns == [patterns[0]] * 4 and not any("command" in name for name in patterns[0])
    changed = replace(car, {"damper.command": 3.0, "damper.**": 500.0})  # whatever the order
    assert float(get(changed, "damper.command")) == 3.0 and float(get(changed, "damper.laws.2.rate")) == 500.0
    between = tune.minimise(COMFORT, car, WHITE, over=["damper.command"])  # any current between two
    assert between.parameters[0].lower == 1.0 and between.parameters[0].upper == 6.0


def test_combinations_that_a_law_refuses_are_left_out_and_counted() -> None:
    law = dampers.PiecewiseLinear(np.array([-0.3, 0.1]), np.array([1500.0, 2500.0, 1500.0]))
    car = vehicles.presets.quarter_car_000(law)
    bump, run = roads.cosine_bump(0.03, start=0.02, duration=0.1), tune.Run(duration=0.3, dt=2e-3)
    result = tune.minimise(COMFORT, car, bump, over={"knots": tune.Choice([-0.5, 0.2, 0.5])}, **run)  # knots increase
    assert result.combinations is not None and len(result.combinations.met) == 3
    assert "is the best of 3 combinations (6 more are impossible)" in result.summary
    three = dampers.PiecewiseLinear(np.array([-0.3, 0.1, 0.2]), np.array([1500.0, 2500.0, 1500.0, 900.0]))
    car = vehicles.presets.quarter_car_000(three)
    with pytest.raises(ValueError, match=r"`over` must have a combination of damper.knots.* that the vehicle can have"):
        tune.minimise(COMFORT, car, bump, over={"knots": tune.Choice([-0.5, 0.5])}, **run)


@pytest.mark.slow
def test_choices_without_effect_at_the_start_are_driven() -> None:
    """A stop that the stroke does not reach has no slope by its clearance, and yet another clearance has an effect."""
    stop = dampers.BumpStop(clearance=0.5, stiffness=2e5)
    car = vehicles.presets.quarter_car_000(dampers.Linear(1500.0) + stop)
    bump, run = roads.cosine_bump(0.03, start=0.02, duration=0.1), tune.Run(duration=0.3, dt=2e-3)
    travel = "working_space_peak_to_peak"
    result = tune.minimise(travel, car, bump, over={"clearance": tune.Choice([0.001, 0.5, 0.6])}, **run)
    assert result.parameters[0].after == 0.001 and result.after[travel] < 0.95 * result.before[travel]
    assert not result.without_effect
    with pytest.raises(ValueError, match="`metric` must depend on what is free"):
        tune.minimise(travel, car, bump, over={"clearance": tune.Choice([0.5, 0.6])}, **run)


def test_wrong_choices_are_refused() -> None:
    for values in ([1.0], [1.0, np.nan], 3.0, [1.0, 1.0], ["a", "b"]):
        with pytest.raises(ValueError, match="`values` must be two or more finite numbers"):
            tune.Choice(values)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="must start between 3000 and 4000"):
        tune.minimise(COMFORT, CAR, WHITE, over={"rate": tune.Choice([3000.0, 4000.0])})
    with pytest.raises(ValueError, match="`over` must have bounds along a front"):
        tune.pareto([COMFORT, TYRE], CAR, WHITE, over={"rate": tune.Choice([2000.0, 4000.0])})
    law = dampers.PiecewiseLinear(np.array([-0.3, 0.1]), np.array([1500.0, 2500.0, 1500.0]))
    many = dampers.PiecewiseLinear(np.linspace(-0.3, 0.3, 11), np.full(12, 2000.0))
    car, over = vehicles.presets.quarter_car_000(law), {"slopes": tune.Choice([1000.0, 3000.0])}
    bump = roads.cosine_bump(0.03, start=0.02, duration=0.1)
    result = tune.minimise(COMFORT, car, bump, over=over, max_steps=1, duration=0.3, dt=2e-3)
    assert {change.after for change in result.parameters} <= {1000.0, 3000.0}
    with pytest.raises(ValueError, match="or choices alone with 2000 combinations, but is 12"):
        tune.minimise(COMFORT, vehicles.presets.quarter_car_000(many), WHITE, over={"slopes": tune.Choice([1e3, 3e3])})


def test_the_worst_case_of_combinations_is_the_true_one():
    """Of a combination and of a search, also where eight of nine scenarios are alike: its optimum is a kink."""
    car, road = vehicles.presets.quarter_car_000(), roads.white("C", 20.0)
    conditions = {"worn": tune.Condition(factors={"damper.rate": 0.7})}
    conditions |= {f"cold {i}": tune.Condition(factors={"damper.rate": 1.4}) for i in range(8)}
    scenarios = tune.Scenarios([road], conditions, risk="worst")
    name, rates = "rms_sprung_acceleration", [4400.0, 4700.0]
    tuned = tune.minimise(
        name, replace(car, {"damper.rate": 4700.0}), scenarios, over={"damper.rate": tune.Choice(rates)}
    )

    def worst(rate: float) -> float:
        return max(float(Ride(replace(car, {"damper.rate": rate * f}), road)()[name]) for f in (0.7, 1.4))

    assert get(tuned.vehicle, "damper.rate") == 4700.0 and tuned.combinations is not None
    np.testing.assert_array_equal(tuned.combinations.choices["damper.rate"], rates[::-1])
    np.testing.assert_allclose(tuned.combinations.metrics[name], [worst(4700.0), worst(4400.0)], rtol=1e-6)
    descended = tune.minimise(name, tuned.vehicle, scenarios, over=["damper.rate"], starts=2)
    best = minimize(lambda rates: worst(rates[0]), [4000.0], method="Nelder-Mead", tol=1e-7)
    assert descended.converged and descended.after[name] == pytest.approx(best.fun, rel=1e-6)
    assert get(descended.vehicle, "damper.rate") == pytest.approx(best.x[0], rel=1e-5)
    (end, *_), of_starts = descended.starts[0].end, [attempt.metric for attempt in descended.starts]
    assert of_starts[0] == pytest.approx(worst(end), rel=1e-6) and float(descended.after[name]) == min(of_starts)
