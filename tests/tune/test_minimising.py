import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, dampers, parameters, roads, simulate, tune, vehicles
from jaxdamp.tune.ranges import search_range
from jaxdamp.tune.task import step_notes


CAR = vehicles.presets.quarter_car_000()
MS, MU, K, KT = 1200.0, 125.0, 60e3, 220e3
M = MS + MU
PARTS = ("sprung_mass", "unsprung_mass", "spring_rate", "tyre_stiffness")
BEST_ACCELERATION = K * np.sqrt(M / KT)
BEST_TYRE = np.sqrt(M * K**2 / KT - 2 * MU * MS * K / M + MU * MS**2 * KT / M**2)


@pytest.mark.parametrize("start", [600.0, 2500.0, 15_000.0])
@pytest.mark.parametrize(
    ("metric", "best"),
    [
        ("rms_sprung_acceleration", BEST_ACCELERATION),
        ("rms_dynamic_tyre_load", BEST_TYRE),
        ("dynamic_load_coefficient", BEST_TYRE),
    ],
)
def test_finds_the_closed_form_optimum_on_a_white_road(metric, best, start):
    car = vehicles.presets.quarter_car_000(dampers.Linear(start))
    result = tune.minimise(metric, car, roads.white("C", speed=20.0), bounds={"damper.rate": None})
    assert float(parameters.get(result.vehicle, "damper.rate")) == pytest.approx(best, rel=1e-6)
    assert result.converged and not result.warnings
    assert result.after[metric] < result.before[metric]


def _closed_forms(car) -> dict[str, float]:
    """Optimal rates of a quarter car on white noise (two-sided velocity spectrum) without tyre damping."""
    ms, mu, k, kt = (float(getattr(car, name)) for name in PARTS)
    m = ms + mu
    return {
        "rms_sprung_acceleration": k * np.sqrt(m / kt),
        "rms_dynamic_tyre_load": np.sqrt(m * k**2 / kt - 2 * mu * ms * k / m + mu * ms**2 * kt / m**2),
    }


@pytest.mark.parametrize("preset", ["quarter_car_mathworks", "golden_car"])
@pytest.mark.exhaustive_cases("quarter_car_mathworks")
def test_finds_the_closed_form_optima_of_other_cars(preset):
    car = getattr(vehicles.presets, preset)()
    for metric, best in _closed_forms(car).items():
        result = tune.minimise(metric, car, roads.white("B", speed=15.0), bounds={"damper.rate": None})
        assert result.parameters[0].after == pytest.approx(best, rel=1e-6) and result.converged


def test_closed_form_optima_are_those_of_paper_000():
    assert pytest.approx(4656.4, abs=0.05) == BEST_ACCELERATION
    assert pytest.approx(5536.5, abs=0.05) == BEST_TYRE


@pytest.mark.exhaustive
@pytest.mark.parametrize("preset", ["quarter_car_000", "quarter_car_mathworks", "golden_car"])
def test_simulated_roads_find_the_optimum_within_their_sampling_error(preset):
    """Roads that repeat after the run hold every wave whole times; their optima scatter little."""
    car, found = getattr(vehicles.presets, preset)(), []
    best = _closed_forms(car)["rms_sprung_acceleration"]
    for seed in range(4):
        road = roads.iso8608("C", speed=20.0, seed=seed, length=1000.0, amplitudes="fixed")
        result = tune.minimise("rms_sprung_acceleration", car, road, duration=50.0, dt=2e-3, fresh_roads=0)
        assert result.converged
        found.append(float(parameters.get(result.vehicle, "damper.rate")))
    spread = np.std(found, ddof=1)
    assert 0 < spread < 0.05 * best
    assert abs(np.mean(found) - best) < 3.0 * spread / np.sqrt(len(found))


@pytest.mark.slow
def test_gradient_through_the_simulation_agrees_with_differences():
    law = dampers.Bilinear(2600.0, 1400.0, knee_width=0.02)
    car = vehicles.presets.quarter_car_000(law)
    ride = Ride(car, roads.iso8608("C", speed=20.0, seed=1), metrics=["rms_sprung_acceleration"], duration=3.0)

    def metric(rates):
        changed = parameters.replace(
            car, {"damper.rebound_rate": rates[0], "damper.compression_rate": rates[1], "sprung_mass": rates[2]}
        )
        return ride.of_vehicle(changed)()["rms_sprung_acceleration"]

    at = np.array([2600.0, 1400.0, 1200.0])
    slope = np.asarray(jax.jacfwd(metric)(jnp.asarray(at)))
    for i, h in enumerate(1e-3 * at):
        step = np.eye(3)[i] * h
        far = (metric(jnp.asarray(at + 2 * step)) - metric(jnp.asarray(at - 2 * step))) / (4 * h)
        near = (metric(jnp.asarray(at + step)) - metric(jnp.asarray(at - step))) / (2 * h)
        assert slope[i] == pytest.approx(float((4 * near - far) / 3), rel=1e-7)


def test_hard_limit_is_met_and_active():
    road = roads.cosine_bump(0.06, start=0.2, duration=0.25)
    car = vehicles.presets.quarter_car_000(dampers.Bilinear(2500.0, 2500.0))
    free = tune.minimise("rms_sprung_acceleration", car, road, duration=2.0)
    top = 0.93 * free.after["working_space_peak_to_peak"]
    result = tune.minimise(
        "rms_sprung_acceleration", car, road, limits={"working_space_peak_to_peak": top}, duration=2.0
    )
    assert result.converged, result
    assert result.after["working_space_peak_to_peak"] == pytest.approx(top, rel=1e-5)
    assert result.after["rms_sprung_acceleration"] > free.after["rms_sprung_acceleration"]
    again = simulate(result.vehicle, road, duration=2.0).metrics(list(result.after))
    assert {k: float(v) for k, v in again.items()} == pytest.approx(result.after, rel=1e-9)
    assert "limit" in repr(result) and "working_space_peak_to_peak" in repr(result)


def test_limit_that_cannot_be_met_is_said():
    road = roads.cosine_bump(0.06, start=0.2, duration=0.25)
    result = tune.minimise(
        "rms_sprung_acceleration", CAR, road, limits={"working_space_peak_to_peak": 1e-3}, duration=1.0
    )
    assert not result.converged
    assert any("working_space_peak_to_peak ≤ 1 mm is not met" in w for w in result.warnings)


def test_bounds_hold_and_are_said():
    result = tune.minimise(
        "rms_sprung_acceleration", CAR, roads.white("C", 20.0), bounds={"damper.rate": (1000.0, 4000.0)}
    )
    assert float(parameters.get(result.vehicle, "damper.rate")) == pytest.approx(4000.0, rel=1e-5)
    assert result.parameters[0].note == "at its upper bound"
    (warning,) = result.warnings
    assert "damper.rate ended at its upper bound, 4000 N s/m (as given)" in warning
    assert result.converged


def test_slopes_of_a_curve_are_tuned_and_many_at_bounds_are_counted():
    law = dampers.PiecewiseLinear(knots=[-0.2, 0.2], slopes=[900.0, 1500.0, 1200.0])
    car = vehicles.presets.quarter_car_000(law)
    bump, bounds = roads.cosine_bump(0.1, start=0.05, duration=0.2), {"damper.slopes": (850.0, 1510.0)}
    result = tune.minimise("rms_dynamic_tyre_load", car, bump, duration=0.5, bounds=bounds)
    assert {change.name.partition("[")[0] for change in result.parameters} == {"damper.slopes"}
    (warning,) = [text for text in result.warnings if "bound" in text]
    assert warning.startswith("3 parameters ended at their bounds: 3 of damper.slopes (as given).")


def test_a_mapping_of_parameters_gives_their_bounds():
    road = roads.white("C", 20.0)
    bounds = {"damper.rate": (1000.0, 4000.0)}
    result = tune.minimise("rms_sprung_acceleration", CAR, road, over=bounds)
    assert result.parameters == tune.minimise("rms_sprung_acceleration", CAR, road, bounds=bounds).parameters
    assert result.parameters[0].after == pytest.approx(4000.0, rel=1e-5)
    assert (result.parameters[0].lower, result.parameters[0].upper) == (1000.0, 4000.0)
    half_open = tune.minimise("rms_sprung_acceleration", CAR, road, over={"*.rate": (None, 9000.0)})
    assert half_open.parameters[0].after == pytest.approx(BEST_ACCELERATION, rel=1e-6)


@pytest.mark.parametrize(("start", "side", "best"), [(1200.0, "upper", 3600.0), (18_000.0, "lower", 6000.0)])
def test_left_alone_a_rate_stays_within_a_third_and_three_times_its_start(start, side, best):
    car = vehicles.presets.quarter_car_000(dampers.Linear(start))
    result = tune.minimise("rms_sprung_acceleration", car, roads.white("C", 20.0))
    assert result.parameters[0].after == pytest.approx(best, rel=1e-5)
    assert result.parameters[0].note == f"at its {side} bound"
    assert f"damper.rate at its {side} bound" in result.summary and result.summary in repr(result)
    (warning,) = result.warnings
    assert "by default" in warning and "`bounds={'damper.rate': (lower, upper)}`" in warning


def test_default_bounds_follow_the_domain_of_each_number():
    law = dampers.PiecewiseLinear(jnp.array([-0.2, 0.0, 0.3]), jnp.array([900.0, 2500.0, 2600.0, 1500.0]))
    spring = dampers.Spring(1500.0, -90.0)
    car = vehicles.presets.quarter_car_000(law + dampers.BoucWen(1000.0, 500.0, 2e5, 300.0) + spring)
    space = search_range(car, ["damper.**"], [], None)
    found = dict(zip(space.free.names, zip(space.lower, space.upper, strict=True), strict=True))
    assert found["damper.terms.0.slopes[1]"] == pytest.approx((2500 / 3, 7500.0))
    assert found["damper.terms.0.knots[0]"] == pytest.approx((-0.6, -0.2 / 3))
    assert found["damper.terms.0.knots[1]"] == (-np.inf, np.inf)
    assert found["damper.terms.1.exponent"] == pytest.approx((1.0, 6.0), abs=1e-5)
    preload = next(p.path for p in parameters.parameters(car) if p.unit == "N" and float(np.max(p.value)) < 0)
    assert found[preload] == pytest.approx((-270.0, 90.0))
    free = search_range(car, ["damper.**"], [], {"*": None})
    assert np.isinf(free.upper[:7]).all() and (free.lower[3:7] > 0.0).all()


def test_without_double_precision_a_search_still_ends_at_the_optimum():
    narrow = jax.tree.map(lambda x: x.astype(jnp.float32) if isinstance(x, jax.Array) else x, CAR)
    with jax.enable_x64(False):
        result = tune.minimise("rms_sprung_acceleration", narrow, roads.white("C", 20.0))
    assert result.converged and result.vehicle.damper.rate.dtype == jnp.float32
    assert result.parameters[0].after == pytest.approx(BEST_ACCELERATION, rel=2e-3)


def test_a_search_that_runs_out_of_steps_says_so():
    car = vehicles.presets.quarter_car_000(dampers.Linear(600.0))
    bounds = {"damper.rate": None}
    result = tune.minimise("rms_sprung_acceleration", car, roads.white("C", 20.0), bounds=bounds, max_steps=1)
    assert not result.converged and len(result.history) == 1
    assert any("stopped after 1 steps, before an optimum" in w and "`max_steps`" in w for w in result.warnings)
    assert "terminated successfully" not in " ".join(result.warnings)


def test_several_parameters_of_any_kind_can_be_free():
    result = tune.minimise(
        "rms_sprung_acceleration",
        CAR,
        roads.white("C", 20.0),
        over=["rate", "spring_rate"],
        bounds={"spring_rate": (30e3, 90e3)},
    )
    # without a limit on travel the softest spring is best, and then c* = k sqrt(M/k_t)
    assert float(parameters.get(result.vehicle, "spring_rate")) == pytest.approx(30e3, rel=1e-4)
    assert float(parameters.get(result.vehicle, "damper.rate")) == pytest.approx(30e3 * np.sqrt(M / KT), rel=1e-3)


@pytest.mark.slow
def test_knots_stay_in_order():
    law = dampers.PiecewiseLinear(jnp.array([-0.2, 0.05, 0.3]), jnp.array([900.0, 2500.0, 2600.0, 1500.0]))
    car = vehicles.presets.quarter_car_000(law)
    road = roads.cosine_bump(0.05, start=0.1, duration=0.2)
    result = tune.minimise("rms_sprung_acceleration", car, road, duration=1.0, max_steps=15)
    assert np.diff(np.asarray(parameters.get(result.vehicle, "damper.knots"))).min() > 0
    assert np.asarray(parameters.get(result.vehicle, "damper.slopes")).min() > 0
    assert result.after["rms_sprung_acceleration"] < result.before["rms_sprung_acceleration"]


def test_progress_and_history_follow_the_search():
    seen = []
    result = tune.minimise(
        "rms_sprung_acceleration", CAR, roads.white("C", 20.0), progress=lambda step, value: seen.append((step, value))
    )
    assert [value for _, value in seen] == list(result.history)
    assert [step for step, _ in seen] == list(range(1, len(seen) + 1))
    assert result.history[-1] == pytest.approx(result.after["rms_sprung_acceleration"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"metric": "rms_acceleration"}, "Did you mean 'rms_sprung_acceleration'"),
        ({"metric": "working_space_peak_to_peak"}, "must be one of 'rms_sprung_acceleration'"),
        ({"limits": {"travelling": 0.1}}, "`limits` must be one of .* but is 'travelling'"),
        ({"over": ["damper.rat"]}, "did you mean 'damper.rate'"),
        ({"bounds": {"damper.rate": (3000.0, 9000.0)}}, "Start inside the bounds or widen them"),
        (
            {"over": {"damper.rate": (5000, 9000)}},
            r"`damper\.rate` must start between 5000 and 9000 \[N s/m\], but is 2500",
        ),
        ({"over": {"damper.rate": 5000.0}}, r"over\['damper\.rate'\]` must be a lower and an upper bound.*`freeze`"),
        ({"over": {"damper.rate": (9000.0, 2000.0)}}, "have a lower bound below the upper one"),
        ({"over": {"damper.rate": ("1", "x")}}, "Use None for a side without a bound"),
        ({"over": {"damper.rat": (1.0, 2.0)}}, "did you mean 'damper.rate'"),
        ({"over": {"damper.rate": (1.0, 1e4)}, "bounds": {"rate": (1.0, 1e4)}}, "Give the bounds in one place"),
        ({"bounds": {"sprung_mass": (1e3, 2e3)}}, r"`bounds\['sprung_mass'\]` must bound a parameter that is free"),
        ({"max_steps": 0}, "`max_steps` must be 1 or more"),
    ],
)
def test_refuses_names_and_starts_that_do_not_fit(change, message):
    arguments = {"metric": "rms_sprung_acceleration", "vehicle": CAR, "road": roads.white("C", 20.0)} | change
    with pytest.raises(ValueError, match=message):
        tune.minimise(**arguments)


@pytest.mark.slow
def test_on_a_white_road_the_rear_axle_follows_the_front():
    car, road = vehicles.presets.half_car_002(), roads.white("C", 15.0)
    result = tune.minimise("rms_pitch_acceleration", car, road, max_steps=1)
    expected = vehicles.stationary_rms(car, road.velocity_psd, speed=15.0)["pitch_acceleration"]
    together = vehicles.stationary_rms(car, road.velocity_psd, in_phase=True)["pitch_acceleration"]
    assert float(result.before["rms_pitch_acceleration"]) == pytest.approx(float(expected), rel=1e-9)
    assert abs(float(together / expected) - 1.0) > 0.05


@pytest.mark.slow
def test_what_people_feel_can_be_tuned_on_both_kinds_of_road():
    car, felt = vehicles.presets.quarter_car_000(dampers.Linear(2500.0)), "weighted_rms_sprung_acceleration"
    white = roads.white("C", 20.0)
    result = tune.minimise(felt, car, white)
    assert result.converged, result
    linear = vehicles.linearise(result.vehicle)
    weighted = vehicles.with_weightings(linear, [("sprung_acceleration", "Wk")])
    rms = vehicles.stationary_rms(weighted, white.velocity_psd)["weighted_sprung_acceleration"]
    assert result.after[felt] == pytest.approx(float(rms), rel=1e-12)
    assert not {m for m in result.after if "dose" in m}
    plain = tune.minimise("rms_sprung_acceleration", car, white)
    assert result.parameters[0].after != pytest.approx(plain.parameters[0].after, rel=0.01)
    driven = tune.minimise(felt, car, roads.iso8608("C", 20.0, seed=1), duration=2.0)
    assert driven.converged and driven.after[felt] < driven.before[felt]
    assert driven.units[felt] == "m/s^2"


def test_counts_have_no_slope_to_follow():
    with pytest.raises(ValueError, match="must have a slope, but is 'lift_off_fraction', a count"):
        tune.minimise("lift_off_fraction", CAR, roads.cosine_bump(0.06, start=0.2, duration=0.25), duration=1.0)


def test_an_old_name_of_a_metric_still_tunes_and_limits():
    road = roads.cosine_bump(0.06, start=0.1, duration=0.25)
    with pytest.warns(FutureWarning, match="'working_space_peak' is now called 'working_space_peak_to_peak'"):
        result = tune.minimise(
            "working_space_peak", CAR, road, limits={"working_space_peak": 1.0}, duration=0.5, max_steps=2
        )
    assert result.metric == "working_space_peak_to_peak" and list(result.limits) == ["working_space_peak_to_peak"]
    with pytest.warns(FutureWarning, match="is now called"):
        assert result.after["working_space_peak"] == result.after["working_space_peak_to_peak"]
    assert "working_space_mean" not in result.after and "peak_sprung_displacement" in result.after


def test_a_displacement_is_tuned_on_a_bump_and_refused_on_a_white_road():
    road = roads.cosine_bump(0.06, start=0.1, duration=0.25)
    result = tune.minimise("peak_sprung_displacement", CAR, road, duration=0.5, max_steps=3)
    assert result.after["peak_sprung_displacement"] < result.before["peak_sprung_displacement"]
    with pytest.raises(ValueError, match="must be one of 'rms_sprung_acceleration'"):
        tune.minimise("rms_sprung_displacement", CAR, roads.white("C", 20.0))


def test_a_tuned_vehicle_that_the_step_does_not_suit_is_noted():
    start, road = vehicles.presets.quarter_car_000(), roads.cosine_bump(0.05, start=0.1, duration=0.25)

    def ride_of(car, dt=1e-3):
        return Ride(car, road, metrics=["rms_sprung_acceleration"], duration=0.5, dt=dt)

    notes = [
        step_notes(start, parameters.replace(start, change), ride_of)
        for change in ({"damper.rate": 2000.0}, {"damper.rate": 1e6}, {"tyre_stiffness": 1e9})
    ]
    assert notes[0] == []
    assert "need 9 steps between two instants, and the search took 1" in notes[1][0]
    assert "is not simulated like the start" in notes[2][0]
    (coarse,) = step_notes(start, start, lambda car: ride_of(car, 0.02))
    assert "coarse" in coarse


def test_the_elastic_part_of_a_damper_moves_only_if_it_is_named():
    car = vehicles.presets.quarter_car_000(dampers.Linear(1500.0) + dampers.Spring(1e3, 50.0))
    for over, moved in ((None, ["damper.terms.0.rate"]), (["stiffness"], ["damper.terms.1.stiffness"])):
        result = tune.minimise("rms_sprung_acceleration", car, roads.white("C", 20.0), over=over, max_steps=2)
        assert [change.name for change in result.parameters] == moved


def test_a_parameter_without_effect_is_named_and_not_called_optimal():
    car = vehicles.presets.quarter_car_000(dampers.Linear(1500.0) + dampers.Spring(1e3, 50.0))
    both = ["damper.terms.0.rate", "damper.terms.1.preload"]
    result = tune.minimise("rms_sprung_acceleration", car, roads.white("C", 20.0), over=both)
    assert result.without_effect == ("damper.terms.1.preload",) and result.converged
    assert "no effect of damper.terms.1.preload" in result.summary
    assert any(
        note.startswith("No effect on rms_sprung_acceleration: damper.terms.1.preload") for note in result.warnings
    )
    with pytest.raises(ValueError, match="must depend on what is free, but is rms_sprung_acceleration = "):
        tune.minimise("rms_sprung_acceleration", car, roads.white("C", 20.0), over=both[1:])
