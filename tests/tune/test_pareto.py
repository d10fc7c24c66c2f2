import dataclasses
import json
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import jaxdamp
from jaxdamp import dampers, export, metrics, parameters, roads, tune, vehicles
from jaxdamp.tune.front import non_dominated


MS, MU, K, KT = 1200.0, 125.0, 60e3, 220e3  # of paper 000
M = MS + MU
COMFORT, TYRE, TRAVEL = "rms_sprung_acceleration", "rms_dynamic_tyre_load", "working_space_rms"
BEST_COMFORT = K * np.sqrt(M / KT)
BEST_TYRE = np.sqrt(M * K**2 / KT - 2 * MU * MS * K / M + MU * MS**2 * KT / M**2)
ROAD = roads.white("C", speed=20.0)
Q = 2 * np.pi**2 * 256e-6 * 0.1**2 * 20.0
CAR = vehicles.presets.quarter_car_000()


def exact(rate):
    """The three metrics of the quarter car on a white road, in closed form."""
    comfort = 0.5 * (KT * rate / MS**2 + M * K**2 / (rate * MS**2))
    tyre = KT**2 / 2 * (M**3 * K**2 / (KT**2 * rate * MS**2) - 2 * MU * M * K / (KT * rate * MS) + MU / rate)
    tyre += KT**2 / 2 * M**2 * rate / (KT * MS**2)
    return np.sqrt(Q * np.stack([comfort, tyre, M / (2 * rate)], axis=-1))


@pytest.fixture(scope="module")
def front():
    return tune.pareto([COMFORT, TYRE], CAR, ROAD, points=9)


def test_front_of_comfort_and_tyre_load_is_that_of_the_closed_forms(front):
    rates = front.designs[:, 0]
    assert front.converged and not front.warnings and len(front) == 9
    assert rates[[0, -1]] == pytest.approx([BEST_COMFORT, BEST_TYRE], rel=3e-4)
    assert front.objectives == pytest.approx(exact(rates)[:, :2], rel=1e-9)
    # every rate between the two optima is on the front, and the points divide the line between its ends evenly
    place = front.shares[:, 0] - front.shares[:, 1]
    assert place == pytest.approx(np.linspace(-1.0, 1.0, 9), abs=2e-3)
    assert front.evaluations < 40


def test_knee_hypervolume_and_reference(front):
    fine = exact(np.linspace(BEST_COMFORT, BEST_TYRE, 4001))[:, :2]
    shares = (fine - fine.min(axis=0)) / np.ptp(fine, axis=0)
    assert front.shares[front.knee].sum() == pytest.approx(shares.sum(axis=1).min(), abs=0.02)
    reference = np.array([front.reference[name] for name in front.names])
    assert reference == pytest.approx(fine.max(axis=0) + 0.1 * np.ptp(fine, axis=0), rel=3e-5)
    full = tune.hypervolume(fine, reference)
    assert 0.9 * full < front.hypervolume < full
    assert tune.hypervolume(front.objectives.tolist(), list(reference)) == pytest.approx(front.hypervolume)


def test_the_knee_is_farthest_from_the_plane_through_the_ends(front):
    """Ends of three objectives that are not the worst in all others: the sum of shares is no distance from them."""
    values = np.array([[0.0, 0.94, 1.0], [0.21, 0.0, 0.42], [1.0, 1.0, 0.0], [0.1, 0.45, 0.5], [0.3, 0.4, 0.3]])
    names = ("a", "b", "c")
    of_three = dataclasses.replace(front, names=names, values=dict(zip(names, values.T, strict=True)))
    normal = np.cross(values[1] - values[0], values[2] - values[0])
    distance = np.abs((values - values[0]) @ normal) / np.linalg.norm(normal)
    assert of_three.knee == np.argmax(distance) != np.argmin(values.sum(axis=1))


def test_every_point_is_a_vehicle_that_can_be_written(front):
    vehicle = front.point(front.knee)
    again = export.from_json(export.to_json(vehicle))
    assert float(again.damper.rate) == front.designs[front.knee, 0]
    found = front.metrics_of(vehicle)
    assert found[COMFORT] == pytest.approx(front.values[COMFORT][front.knee], rel=1e-9)
    with pytest.raises(ValueError, match=r"index.*0 to 8"):
        front.point(9)


def test_tables_dictionary_and_picture(front):
    assert json.loads(json.dumps(front.to_dict()))["knee"] == front.knee
    assert len(front.table().rows) == len(front.parameter_table().rows) == 10
    assert front.table().records()[front.knee]["note"] == "knee"
    assert "knee" in repr(front).lower() and "designs simulated" in front.summary
    figure = front.plot({"stiff": parameters.replace(CAR, {"damper.rate": 7000.0})}, velocities=[-1.0, 0.0, 1.0])
    assert len(figure.axes) == 2
    assert len(figure.axes[1].lines) >= 9 + 2  # laws, and lines through zero


def test_designs_between_the_points_fill_the_front(front):
    fine = tune.pareto([COMFORT, TYRE], CAR, ROAD, points=9, between=200)
    assert 190 < len(fine) <= 209 and fine.interpolated == 200
    assert fine.evaluations == front.evaluations
    full = tune.hypervolume(
        exact(np.linspace(BEST_COMFORT, BEST_TYRE, 4001))[:, :2], np.array([*fine.reference.values()])
    )
    assert fine.hypervolume == pytest.approx(full, rel=5e-3)
    assert fine.objectives == pytest.approx(exact(fine.designs[:, 0])[:, :2], rel=1e-9)


@pytest.mark.slow
def test_two_parameters_agree_with_a_search_under_a_limit():
    car = vehicles.presets.half_car_002(dampers.Linear(1000.0))
    chosen = ["rms_sprung_acceleration", "rms_front_dynamic_tyre_load"]
    options: dict[str, Any] = {"over": {"rate": (300.0, 9000.0)}}
    front = tune.pareto(chosen, car, ROAD, points=5, **options)
    inner = len(front) // 2
    limit = {chosen[1]: float(front.values[chosen[1]][inner])}
    alone = tune.minimise(chosen[0], front.point(inner), ROAD, limits=limit, **options)
    assert alone.after[chosen[0]] == pytest.approx(front.values[chosen[0]][inner], rel=2e-6)


def test_three_objectives_with_a_limit_and_a_function():
    def effort(m):
        return m[TYRE] / 1e3

    least = M / (2 * 0.0117**2) * Q  # rate at which the travel is 11.7 mm
    front = tune.pareto(
        [metrics.Metric("sprung_acceleration", "rms"), effort, TRAVEL], CAR, ROAD, points=12, limits={TRAVEL: 0.0117}
    )
    assert front.names == (COMFORT, "effort", TRAVEL)
    assert np.all(front.values[TRAVEL] <= 0.0117) and np.any(front.values[TRAVEL] > 0.01169)
    assert front.designs.min() == pytest.approx(least, rel=1e-3)
    assert front.designs.max() == pytest.approx(7500.0, rel=1e-4)  # the bound: less travel at any price
    assert any("upper bound" in text for text in front.warnings)
    assert len(front.plot().axes) == 4


@pytest.mark.slow
def test_scenarios_limits_shapes_ties_and_starts_are_those_of_a_tuning():
    """A front over two payloads: its ends are the results of `minimise` with the same arguments."""
    car = vehicles.presets.quarter_car_000(dampers.Bilinear(2500.0, 2500.0) + dampers.Linear(2500.0))
    loads = {"empty": tune.Condition(), "laden": tune.Condition({"sprung_mass": 1600.0})}
    scenarios = tune.Scenarios([ROAD], loads, risk="worst")
    highest, least = 0.0136, 0.0112  # of the travel, in each scenario
    options: dict[str, Any] = {
        "limits": {TRAVEL: (least, highest)},
        "shape": [tune.ratio(1.5, 3.0, velocity=0.5)],
        "over": {"damper.**rate": (500.0, 9000.0)},
        "tie": {"damper.terms.1.rate": "damper.terms.0.compression_rate"},
    }
    front = tune.pareto([COMFORT, TYRE], car, scenarios, points=3, starts=2, **options)
    assert front.converged and len(front.parameters) == 2
    each = [scenarios.ride(front.point(i), metrics=[TRAVEL]).each()[TRAVEL] for i in range(len(front))]
    assert np.max(each) == pytest.approx(highest, rel=1e-5) and np.max(each) <= highest
    assert np.min(each) == pytest.approx(least, rel=1e-5) and np.min(each) >= least
    alone = tune.minimise(COMFORT, front.start, scenarios, **options)
    assert alone.after[COMFORT] == pytest.approx(front.values[COMFORT][0], rel=1e-5)
    for i in range(len(front)):
        forces = [float(front.point(i).damper.force(0.0, v, jnp.zeros(0))) for v in (-0.5, 0.5)]
        assert 1.5 - 1e-6 < -forces[1] / forces[0] < 3.0 + 1e-6
    assert front.metrics_of(front.point(0))[TYRE] == pytest.approx(front.values[TYRE][0], rel=1e-9)
    assert front.to_dict()["limits"][TRAVEL]["value"] == [least, highest]


def test_a_limit_that_does_not_hold_on_fresh_roads_is_said():
    road = roads.iso8608("C", speed=20.0, seed=4712)  # smoother than the next one
    run: dict[str, Any] = {"duration": 0.5, "dt": 2e-3}
    limits = {metrics.Metric("sprung_acceleration", "peak"): 0.8}
    front = tune.pareto(
        [COMFORT, TYRE], CAR, road, points=3, limits=limits, over={"rate": (2500.0, 7000.0)}, fresh_roads=2, **run
    )
    (name,) = front.limits
    assert front.fresh[name].shape == (2, len(front)) and front.values[name].max() <= 0.8
    other = jaxdamp.Ride(front.point(0), road.reseeded(4711), metrics=[COMFORT], **run)()
    assert front.fresh[COMFORT][0, 0] == pytest.approx(float(other[COMFORT]), rel=1e-9)
    beyond = front.fresh[name] > 0.8
    assert beyond.any()
    note = next(text for text in front.warnings if "fresh roads" in text)
    assert f"On {beyond.any(axis=1).sum()} of 2 fresh roads {name} is beyond its limit at" in note


def test_a_limit_that_no_design_meets_is_named():
    front = tune.pareto([COMFORT, TYRE], CAR, ROAD, points=3, limits={TRAVEL: 0.005, COMFORT: 0.5})
    assert front.status is tune.Status.LIMIT_NOT_MET and len(front) == 1
    assert f"The limit {TRAVEL} ≤ 5 mm is not met: 9." in front.warnings[0]
    assert (
        f"Not met together: {TRAVEL}, {COMFORT}. The search is held by the bounds of damper.rate." in front.warnings[0]
    )
    assert front.designs[0, 0] == pytest.approx(7500.0, rel=1e-4)


def test_targets_met_at_the_start_do_not_cut_the_front_off():
    """The other end is the best design of the other objective, however small the first one is at the start."""
    comfort = float(exact(2500.0)[0])
    front = tune.pareto([tune.Targets({COMFORT: (1.0003 * comfort, 0.01)}), TYRE], CAR, ROAD, points=3)
    assert front.converged and front.designs[-1, 0] == pytest.approx(BEST_TYRE, rel=2e-3)


@pytest.mark.exhaustive
def test_metrics_without_conflict_have_one_best_design():
    front = tune.pareto([TYRE, "dynamic_load_coefficient"], CAR, ROAD, points=3)
    assert len(front) == 1 and "do not conflict" in front.warnings[0]
    assert front.designs[0, 0] == pytest.approx(BEST_TYRE, rel=1e-3)


def test_non_dominated_points_and_their_volume():
    values = np.array([[1.0, 3.0], [2.0, 2.0], [2.0, 2.0], [3.0, 2.0], [3.0, 1.0]])
    assert non_dominated(values).tolist() == [True, True, False, False, True]
    assert tune.hypervolume(values, np.array([4.0, 4.0])) == pytest.approx(6.0)
    cubes = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]])
    assert tune.hypervolume(cubes, np.full(3, 2.0)) == pytest.approx(4.0)
    assert tune.hypervolume(cubes, np.zeros(3)) == 0.0


@pytest.mark.parametrize(
    ("objectives", "options", "message"),
    [
        (COMFORT, {}, "objectives.*list of two or three"),
        ([COMFORT], {}, "objectives.*list of two or three"),
        ([COMFORT, COMFORT], {}, "different names"),
        ([COMFORT, "comfortable"], {}, "comfortable"),
        ([COMFORT, TYRE], {"points": 2}, "points.*3 or more"),
        ([COMFORT, TYRE], {"max_steps": 0}, "max_steps"),
        ([COMFORT, TYRE], {"limits": {"travelling": 0.1}}, "travelling"),
        ([COMFORT, TYRE], {"reference": {TRAVEL: 0.1}}, "reference"),
        ([COMFORT, TYRE], {"over": ["spring"]}, "spring"),
    ],
)
def test_wrong_calls_are_refused(objectives, options, message):
    with pytest.raises(ValueError, match=message):
        tune.pareto(objectives, CAR, ROAD, **options)


@pytest.mark.exhaustive
def test_simulated_front_is_better_than_a_grid():
    car = vehicles.presets.quarter_car_000(dampers.Bilinear(2600.0, 1400.0))
    road = roads.iso8608("C", speed=20.0, seed=1)
    over = {"rebound_rate": (1000.0, 8000.0), "compression_rate": (1000.0, 8000.0)}
    front = tune.pareto([COMFORT, TYRE], car, road, over=over, points=9, duration=4.0, dt=2e-3)
    ride = jaxdamp.Ride(car, road, metrics=[COMFORT, TYRE], duration=4.0, dt=2e-3)
    axis = np.linspace(1000.0, 8000.0, 41)
    data = jaxdamp.sweep(ride, {"damper.rebound_rate": axis, "damper.compression_rate": axis})
    grid = np.stack([data[name].values.ravel() for name in front.names], axis=1)
    reference = np.array([front.reference[name] for name in front.names])
    assert front.converged
    # no design of the grid beats a point of the front by more than the search leaves
    beats = np.all(grid[:, None] < front.objectives[None] - 1e-5 * np.ptp(front.objectives, axis=0), axis=2)
    assert not beats.any()
    assert front.hypervolume > 0.9 * tune.hypervolume(grid, reference)


def test_a_front_is_driven_with_the_substeps_that_its_ends_need():
    """Its points were by the one step of the start, with the advice to tune again."""
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.25)
    run: dict[str, Any] = {"duration": 0.5, "dt": 5e-3}
    front = tune.pareto([TRAVEL, COMFORT], CAR, bump, over={"damper.rate": (1000.0, 40000.0)}, points=3, **run)
    stiff = front.point(0)
    alone = jaxdamp.Ride(stiff, bump, **run)
    assert alone.substeps > 1 and not any("tune again" in note for note in front.warnings)
    assert front.values[TRAVEL][0] == pytest.approx(float(alone()[TRAVEL]), rel=1e-6)


@pytest.mark.slow
def test_a_front_of_a_peak_has_no_design_that_another_valley_beats():
    """Rebound rates near 2500 and 7000 N s/m are valleys of their own; a search stays in the one it begins in."""
    peak = "peak_sprung_acceleration"
    run: dict[str, Any] = {"duration": 2.5, "dt": 4e-3}
    car = vehicles.presets.quarter_car_000(dampers.Bilinear(2600.0, 1400.0))
    road = roads.iso8608("D", speed=20.0, seed=3, duration=3.0)
    span = (300.0, 9000.0)
    over = {"rebound_rate": span, "compression_rate": span}
    front = tune.pareto([peak, TYRE], car, road, over=over, points=9, fresh_roads=0, **run)
    axis = np.geomspace(*span, 61)
    grid = jaxdamp.sweep(
        jaxdamp.Ride(car, road, metrics=[peak, TYRE], **run),
        {"damper.rebound_rate": axis, "damper.compression_rate": axis},
    )
    others = np.stack([grid[name].values.ravel() for name in front.names], axis=1)
    gains = [np.min((point - others) / np.ptp(front.objectives, axis=0), axis=1).max() for point in front.objectives]
    assert max(gains) < 0.005
