"""Shape constraints, several starts, smooth metrics, targets and fresh roads of a tuning."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, dampers, metrics, parameters, roads, tune, vehicles
from jaxdamp.control import Controlled, Skyhook
from jaxdamp.metrics import Metric
from jaxdamp.tune import smooth as smooth_metrics
from jaxdamp.tune.ranges import search_range, start_points
from jaxdamp.tune.shape import held_force
from jaxdamp.tune.verdict import bound_notes


def exact_counterpart(metric: Metric) -> Any:
    """The true metric; Any, since it is None for metrics that are not smooth."""
    return smooth_metrics.exact_counterpart(metric)


KNOTS, SLOPES = np.array([-0.3, 0.1, 0.3]), np.array([1500.0, 2500.0, 2500.0, 1500.0])
CAR = vehicles.presets.quarter_car_000(dampers.PiecewiseLinear(KNOTS, SLOPES))
ROAD = roads.iso8608("C", 20.0, seed=1)
RUN: dict[str, Any] = {"duration": 0.6, "dt": 2e-3}


def test_shapes_hold_and_are_named() -> None:
    shape = [tune.slope(1600.0, 2900.0), tune.ratio(1.2, 3.0, velocity=0.5)]
    result = tune.minimise("rms_sprung_acceleration", CAR, ROAD, freeze=["*knots"], shape=shape, fresh_roads=1, **RUN)
    assert result.status is not tune.Status.LIMIT_NOT_MET
    slopes = np.asarray(parameters.get(result.vehicle, "damper.slopes"))
    assert slopes.min() >= 1600.0 * (1 - 1e-5) and slopes.max() <= 2900.0 * (1 + 1e-5)
    back, rest, out = np.asarray(held_force(result.vehicle.damper, jnp.array([-0.5, 0.0, 0.5])))
    assert 1.2 * (1 - 1e-5) <= (out - rest) / (rest - back) <= 3.0 * (1 + 1e-5)
    assert any(words.startswith("slope of damper") for words in result.active)
    assert result.fresh is not None and result.fresh.roads == 1
    assert "on fresh roads" in [column.name for column in result.table().columns]


def test_shapes_that_contradict_each_other_are_named() -> None:
    shape = [tune.slope(3000.0, 3100.0), tune.ratio(1.5, velocity=0.5)]
    result = tune.minimise("rms_sprung_acceleration", CAR, ROAD, freeze=["*knots"], shape=shape, **RUN)
    assert result.status is tune.Status.LIMIT_NOT_MET
    assert any("Not met together: " in w and "slope of damper" in w and "ratio" in w for w in result.warnings)


def test_numbers_of_curves() -> None:
    law = dampers.PiecewiseLinear(np.array([-0.2, 0.0, 0.3]), np.array([1000.0, 2000.0, 4000.0, 1000.0]))
    for shape, expected in (
        (tune.knee(0.1, 0.4), 0.3),
        (tune.knee(0.1, side="compression"), 0.2),
        (tune.ratio(1.0, velocity=0.1), 2.0),
    ):
        velocities = jnp.array(shape.velocities)
        (number,) = np.asarray(shape.numbers(velocities, held_force(law, velocities)))
        assert number == pytest.approx(expected, abs=0.011), shape.name
    lagged = dampers.Lag(law, lag_time=0.01)
    np.testing.assert_allclose(held_force(lagged, velocities), held_force(law, velocities), rtol=1e-9)


@pytest.mark.slow
def test_several_starts_find_the_same_optimum_as_one() -> None:
    car, road = vehicles.presets.quarter_car_000(dampers.Linear(600.0)), roads.white("C", 20.0)
    seen = []
    result = tune.minimise(
        "rms_sprung_acceleration",
        car,
        road,
        bounds={"rate": (100.0, 2e4)},
        starts=3,
        progress=lambda step, value: seen.append((step, value)),
    )
    assert result.parameters[0].after == pytest.approx(60e3 * np.sqrt(1325.0 / 220e3), rel=1e-6)
    assert len(result.starts) == 3 and all(attempt.converged for attempt in result.starts)
    assert not result.warnings and [step for step, _ in seen] == list(range(1, len(seen) + 1))
    assert min(value for _, value in seen) == pytest.approx(result.after["rms_sprung_acceleration"])


def test_numbers_that_left_zero_are_said_to_have_had_no_range() -> None:
    law = dampers.Scheduled((dampers.Linear(300.0), dampers.Linear(4000.0)), levels=[0.0, 1.0], command=0.3)
    car = Controlled(vehicles.presets.quarter_car_000(law), Skyhook(1500.0))
    space = search_range(car, ["policy.**"], [], None)
    (note,) = bound_notes(space, space.changes(np.array([1500.0, 254.0])))
    assert note.startswith("policy.lead ended at 254 s: zero, where a search starts, gives no range in proportion.")
    assert note.endswith("Pass `bounds={'policy.lead': (lower, upper)}`.")
    assert not space.notes_without_range(space.changes(space.start))
    bounded = search_range(car, ["policy.**"], [], {"policy.lead": (0.0, 0.1)})
    assert not bound_notes(bounded, bounded.changes(np.array([1500.0, 0.05])))


def test_starts_lie_inside_the_bounds_and_in_order() -> None:
    space = search_range(CAR, ["damper.*"], [], None)
    points = start_points(space, 9, seed=1)
    assert points.shape == (9, 7) and np.array_equal(points[0], space.start)
    assert np.all(points >= space.lower) and np.all(points <= space.upper)
    assert np.all(np.diff(points[:, :3], axis=1) >= 0)


def test_an_error_inside_a_search_reaches_the_user() -> None:
    def stop(step: int, value: float) -> None:
        raise RuntimeError("enough")

    car, road = vehicles.presets.quarter_car_000(dampers.Linear(700.0)), roads.white("C", 20.0)
    with pytest.raises(RuntimeError, match="enough"):
        tune.minimise("rms_sprung_acceleration", car, road, bounds={"rate": (100.0, 2e4)}, starts=3, progress=stop)


def test_smooth_metrics_stay_close_to_the_true_ones() -> None:
    time = jnp.arange(4000.0) * 1e-3
    peak = tune.smooth_peak("stroke", window=(0.0, 1.0))
    for record in (jnp.sin(20.0 * time), -3.0 * jnp.exp(-((time - 1.0) ** 2) / 0.01)):
        smooth, true = (float(m.statistic.of(record, 1e-3)) for m in (peak, exact_counterpart(peak)))
        assert 0.98 * true < smooth <= true * (1 + 1e-12) and true == pytest.approx(np.abs(record).max())
    assert float(peak.statistic.of(jnp.zeros(5), 1e-3)) == 0.0
    assert exact_counterpart(peak).name == "peak_stroke_0_to_1_s"
    named = tune.smooth_settling("stroke", from_rest=True, name="quiet")
    assert exact_counterpart(named).name == "exact_quiet" and exact_counterpart(named).from_rest
    assert exact_counterpart(Metric("stroke", "rms")) is None
    assert metrics.Metric("stroke", "peak").statistic is exact_counterpart(peak).statistic


def test_the_true_peak_stands_beside_the_smooth_one() -> None:
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    smooth = tune.smooth_peak("sprung_acceleration", window=(0.1, 0.5))
    result = tune.minimise("rms_sprung_acceleration", CAR, bump, freeze=["*knots"], limits={smooth: 3.0}, **RUN)
    true = result.after["peak_sprung_acceleration_0.1_to_0.5_s"]
    assert result.fresh is None and result.after[smooth.name] <= 3.0 * (1 + 1e-5)
    said = any("the true peak_sprung_acceleration_0.1_to_0.5_s is" in w for w in result.warnings)
    assert said == (true > 3.0)


def test_targets_are_met_and_noted() -> None:
    """Two targets of one car at 3000 N s/m are found again from another start."""
    road = roads.white("C", 20.0)
    names = ("rms_sprung_acceleration", "rms_dynamic_tyre_load")
    car = vehicles.presets.quarter_car_000(dampers.Linear(3000.0))
    of_car = Ride(car, road, metrics=names)()
    wanted: dict[Any, Any] = {name: (float(value), 0.01 * float(value)) for name, value in of_car.items()}
    result = tune.minimise(tune.Targets(wanted), vehicles.presets.quarter_car_000(dampers.Linear(2000.0)), road)
    assert result.parameters[0].after == pytest.approx(3000.0, rel=1e-3)
    notes = {row["metric"]: row["note"] for row in result.table().records()}
    assert notes["targets"] == "minimised" and all(str(notes[name]).endswith(", met") for name in names)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("size", [0.0, 1e-4, 0.03, 2e3, 3e5])  # of a stroke to a load, in SI
def test_a_smooth_peak_is_near_the_peak_in_any_unit_and_precision(precision, size):
    statistic = tune.smooth_peak("stroke").statistic
    wave = (size * np.sin(np.linspace(0.0, 20.0, 401))).astype(precision)
    gathered = jax.lax.scan(lambda so_far, y: (statistic.add(so_far, y), None), statistic.begin(wave[0]), wave[1:])[0]
    exact = wave.astype(float)
    expected = np.sum(np.abs(exact) ** 33) / np.sum(exact**32) if size else 0.0
    for value in (statistic.of(jnp.asarray(wave), 0.05), statistic.end(gathered, 401, 0.05)):
        np.testing.assert_allclose(value, expected, rtol=1e-4 if precision is np.float32 else 1e-11)
    slopes = jax.grad(lambda y: statistic.of(y, 0.05))(jnp.asarray(wave))
    assert np.all(np.isfinite(slopes))


@pytest.mark.parametrize("inside", [False, True])
def test_a_tuned_curve_through_points_drives_no_motion(inside):
    """Its force rises with the velocity from the same static force, unless another shape is asked for."""
    velocity = np.array([-0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6])
    points = velocity, np.array([-950.0, -800.0, -400.0, -30.0, 500.0, 1300.0, 1700.0])
    law = dampers.MotionRatio(dampers.SplineTable(*points), 0.8) if inside else dampers.Table(*points)
    car = vehicles.presets.quarter_car_000(law)
    result = tune.minimise("comfort", car, ROAD, fresh_roads=0, max_steps=30, **RUN)
    forces = np.asarray(parameters.get(result.vehicle.damper, "law.force_points" if inside else "force_points"))
    assert np.all(np.diff(forces) > -1e-2) and forces[3] == pytest.approx(-30.0)
    assert result.after[result.metric] < 0.99 * result.before[result.metric]


def test_a_tuned_law_keeps_the_conditions_between_its_parameters():
    """The force of Besinger must not fall as the velocity grows: no constructor takes a law of which it does."""
    law = dampers.Besinger(4200.0, 1200.0, 900.0, limit_velocity=0.1445, transition_velocity=0.05)
    car = vehicles.presets.quarter_car_000(law)
    result = tune.minimise("comfort", car, ROAD, over=["damper.rebound_rate"], bounds={"*": None}, fresh_roads=0, **RUN)
    assert dampers.keeps_conditions(result.vehicle)
    assert any("rate beyond" in words for words in result.active), result.active
