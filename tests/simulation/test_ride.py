"""`Ride`: the metrics of `simulate`, gathered on the way, and their derivatives."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from jaxdamp import Ride, dampers, metrics, roads, simulate, sweep, vehicles
from jaxdamp.metrics.weighted import discrete_weighting
from jaxdamp.simulation import fixed_step
from jaxdamp.simulation.observer import Filter
from jaxdamp.vehicles import Body, Frame, Link, LumpedVehicle, Wheel
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000, quarter_car_mathworks


pytestmark = pytest.mark.users_flags

BESINGER = dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
ROUGH = roads.iso8608("F", speed=20.0, seed=3)


def lifting_car():
    law = dampers.Lag(BESINGER, 0.004) + dampers.CoulombFriction(80.0, 1e-3)
    return vehicles.QuarterCar(1200.0, 125.0, 60e3, 220e3, law, tyre_damping=400.0, tyre_lifts=True)


@pytest.fixture(scope="module")
def half_car():
    car = half_car_002(BESINGER)
    return car, roads.delayed(ROUGH, positions=car.axle_positions, speed=20.0)


@pytest.mark.parametrize("kind", ["lifting quarter car", pytest.param("half car", marks=pytest.mark.slow)])
def test_gathers_what_simulate_finds(kind, half_car):
    car, road = half_car if kind == "half car" else (lifting_car(), ROUGH)
    ride, response = Ride(car, road, duration=2.0), simulate(car, road, duration=2.0)
    found, expected = ride(), response.metrics()
    assert set(found) == set(expected) == {m.name for m in car.ride_metrics}
    for metric, value in expected.items():
        assert float(found[metric]) == pytest.approx(float(value), rel=1e-9, abs=1e-12), metric
    assert kind != "half car" or float(found["rms_pitch_acceleration"]) > 0


def test_the_lifting_car_lifts_and_steps_are_divided():
    ride = Ride(lifting_car(), ROUGH, duration=2.0, metrics=["lift_off_fraction"])
    assert 0 < float(ride()["lift_off_fraction"]) < 0.2
    longer = Ride(lifting_car(), ROUGH, duration=2.0, dt=2e-3, metrics=["lift_off_fraction"])
    assert (ride.substeps, longer.substeps) == (1, 2)


def hop(height):
    """A bump that throws the wheel off the road for some ms."""
    return roads.cosine_bump(height, start=0.3, length=1.0, speed=12.0)


@pytest.mark.parametrize("lifts", [True, False])
def test_a_wheel_is_lifted_off_while_it_is_above_the_road(lifts):
    """A linear tyre pulls there, by which it comes down earlier."""
    car, counts = quarter_car_mathworks(tyre_lifts=lifts), []
    for height in (0.018, 0.02, 0.025, 0.03):
        run = simulate(car, hop(height), duration=0.8)
        clearance = np.asarray(run["z_unsprung"]) - np.asarray(run["z_road"]) - 360.0 * 9.80665 / 190e3
        counts.append(round(801 * float(run.metrics()["lift_off_fraction"])))
        assert counts[-1] == pytest.approx(np.sum(clearance > 0.0), abs=1)
    assert counts == pytest.approx([8, 16, 27, 35] if lifts else [8, 15, 23, 27], abs=1)


def test_lift_off_is_the_same_in_a_run_a_ride_a_sweep_and_single_precision():
    """The ride metric, and one of a user: the sweep prints its loop as C, where a compiler is at hand."""
    wanted = ["lift_off_fraction", metrics.Metric("relative_tyre_load", "lift_off_fraction", name="own")]

    def ride():
        return Ride(quarter_car_mathworks(tyre_lifts=True), hop(0.02), duration=0.8, metrics=wanted)

    swept = sweep(ride(), {"sprung_mass": [300.0, 330.0]}, chunk=2).isel(sprung_mass=0)
    found = [simulate(ride().vehicle, hop(0.02), duration=0.8).metrics(wanted), ride()(), swept]
    with jax.enable_x64(False):
        found.append(ride()())
    assert [round(801 * float(values[m])) for values in found for m in ("lift_off_fraction", "own")] == [16] * 8


def test_every_statistic_is_the_same_gathered_and_at_once(rng):
    record = jnp.asarray(3.0 * rng.normal(size=200) - 0.4)
    for name, statistic in metrics.STATISTICS.items():
        if statistic.needs_record:
            continue
        kept = statistic.begin(record[0])
        for sample in record[1:]:
            kept = statistic.add(kept, sample)
        gathered = statistic.end(kept, record.size, 0.01)
        assert float(gathered) == pytest.approx(float(statistic.of(record, 0.01)), rel=1e-12), name
        assert (statistic.unit("m/s^2") != "m/s^2") == (
            name in ("road_stress_factor", "lift_off_fraction", "vibration_dose_value")
        )


def test_divided_steps_are_shorter_steps():
    """A road straight over 4 ms: four steps between instants are steps of 1 ms."""
    profile = roads.from_profile(np.arange(101) * 4e-3, ROUGH.height(jnp.arange(101.0) * 4e-3))
    car = quarter_car_000(BESINGER)
    divided = simulate(car, profile, duration=0.4, dt=4e-3, substeps=4)
    shorter = simulate(car, profile, duration=0.4, dt=1e-3)
    np.testing.assert_allclose(divided.motion, shorter.motion[::4], rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("weighting", ["Wb", "Wc", "Wd", "We", "Wf", "Wj", "Wk"])
def test_weighting_in_modes_is_the_exact_filter(weighting, rng):
    record = rng.normal(size=60)
    expected = metrics.weighted_signal(record, 0.002, weighting, method="step", remove_mean=False)
    filter_ = Filter(*discrete_weighting(weighting, 0.002))
    assert np.count_nonzero(filter_.phi) <= 2 * filter_.output.size
    state, found = (jnp.zeros(()),) * filter_.output.size, [0.0]
    for before, after in itertools.pairwise(record):
        state = filter_(state, jnp.asarray(before), jnp.asarray(after))
        found.append(float(filter_.of(state)))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
def test_derivatives_forward_reverse_and_by_differences():
    """Of a nonlinear law and of a mass, through a batch too; the two modes share no code but the step."""
    names = ["damper.law.rebound_rate", "damper.lag_time", "sprung_mass"]
    ride = Ride(quarter_car_000(dampers.Lag(BESINGER, 0.004)), ROUGH, duration=1.0)

    def level(values):
        found = ride(dict(zip(names, values, strict=True)))
        return found["weighted_rms_sprung_acceleration"] + 1e-3 * found["damper_dissipated_power"]

    at = jnp.array([4200.0, 0.004, 1200.0])
    derived = jax.jit(lambda at: (*jax.value_and_grad(level)(at), jax.jacfwd(level)(at)))
    _, reverse, forward = derived(at)
    np.testing.assert_allclose(forward, reverse, rtol=1e-10)
    steps = 2e-4 * at[:, None] * jnp.eye(3)
    near, far = ([derived(at + k * step)[0] - derived(at - k * step)[0] for step in steps] for k in (1, 2))
    differences = [(8.0 * a - b) / (12.0 * 2e-4 * x) for a, b, x in zip(near, far, at, strict=True)]
    np.testing.assert_allclose(forward, differences, rtol=1e-6)
    batch = jnp.stack([at, 1.1 * at])
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.grad(level)))(batch)[0], reverse, rtol=1e-9)


@pytest.mark.slow
def test_a_run_of_several_blocks_is_the_same_run_and_has_the_same_derivatives(monkeypatch):
    """Reverse derivatives of long runs drive each block again from its beginning; the last one is shorter."""
    monkeypatch.setattr(fixed_step, "BLOCK", 64)
    car, metric = quarter_car_000(dampers.Lag(BESINGER, 0.004)), "rms_sprung_acceleration"
    ride = Ride(car, ROUGH, duration=0.73, metrics=[metric])
    level = lambda rate: ride({"damper.law.rebound_rate": rate})[metric]  # noqa: E731
    expected = simulate(car, ROUGH, duration=0.73).metrics([metric])[metric]
    assert float(level(4200.0)) == pytest.approx(float(expected), rel=1e-12)
    forward, reverse = jax.jacfwd(level)(4200.0), jax.grad(level)(4200.0)
    assert float(forward) == pytest.approx(float(reverse), rel=1e-10)


def test_derivative_of_a_linear_car_is_that_of_the_closed_form():
    """With a dashpot for a damper the step is exact: a complex step through SciPy's exponential gives the slope."""
    body, wheel = Body("sprung", 1200.0), Body("unsprung", 125.0)
    link = Link("", body.at() - wheel.at(), stiffness=60e3, damping=2500.0)
    car = LumpedVehicle(Frame((body, wheel), (link,), (Wheel("", wheel.at(), 220e3),)))
    ride = Ride(car, ROUGH, duration=2.0, metrics=["rms_sprung_acceleration"])
    path = "parts.links.0.damping"

    def level(c):
        return ride({path: c})["rms_sprung_acceleration"]

    def exact(c, dt=1e-3):
        mass, row = np.diag([1200.0, 125.0]), np.array([[1.0, -1.0]])
        stiffness, ground = 60e3 * row.T @ row + np.diag([0.0, 220e3]), np.array([0.0, 220e3])
        a = np.zeros((4, 4), complex)
        a[:2, 2:] = np.eye(2)
        a[2:, :2], a[2:, 2:] = -np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, c * row.T @ row)
        b = np.concatenate([np.zeros(2), np.linalg.solve(mass, ground)])
        big = np.zeros((6, 6), complex)
        big[:4, :4], big[:4, 4], big[4, 5] = a * dt, b * dt, 1.0
        step, z = scipy.linalg.expm(big), np.asarray(ride.heights)[:, 0]
        x = np.array([z[0], z[0], 0.0, 0.0], complex)
        total = (a @ x + b * z[0])[2] ** 2
        for low, high in itertools.pairwise(z):
            x = step[:4, :4] @ x + step[:4, 4] * low + step[:4, 5] * (high - low)
            total += (a @ x + b * high)[2] ** 2
        return np.sqrt(total / z.size)

    reference = exact(2500.0 + 1e-30j)
    value, slope = jax.jit(jax.value_and_grad(level))(2500.0)
    assert float(value) == pytest.approx(reference.real, rel=1e-10)
    assert float(slope) == pytest.approx(reference.imag / 1e-30, rel=1e-8)
    assert float(jax.jit(jax.jacfwd(level))(2500.0)) == pytest.approx(float(slope), rel=1e-10)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_run():
    ride = Ride(quarter_car_000(BESINGER), ROUGH, duration=1.0, metrics=["rms_sprung_acceleration"])

    def needs(instants, mode):
        def level(heights, rate):
            longer = eqx.tree_at(lambda ride: ride.heights, ride, heights)
            return longer({"damper.rebound_rate": rate})["rms_sprung_acceleration"]

        compiled = jax.jit(mode(level)).lower(jnp.zeros((instants, 1)), jnp.zeros(())).compile()
        size = compiled.memory_analysis()
        assert size is not None
        return size.temp_size_in_bytes / 8

    forward = lambda f: lambda heights, rate: jax.jvp(lambda r: f(heights, r), (rate,), (jnp.ones(()),))  # noqa: E731
    reverse = lambda f: jax.grad(f, argnums=1)  # noqa: E731
    for mode in (lambda f: f, forward, reverse):
        assert needs(90_001, mode) - needs(10_001, mode) < 2.5 * 80_000  # copies of the road, nothing of the car


def test_refuses_what_is_not_there():
    car = quarter_car_000()
    with pytest.raises(ValueError, match=r"must be one of.*Did you mean 'rms_sprung_acceleration'"):
        Ride(car, ROUGH, duration=1.0, metrics=["rms_sprung_aceleration"])
    with pytest.raises(ValueError, match=r"did you mean 'damper.rate'"):
        Ride(car, ROUGH, duration=1.0)({"damper.rates": 1.0})
    with pytest.raises(ValueError, match=r"a slope that 64 steps in 0.001 s can follow.*widen the velocity"):
        Ride(quarter_car_000(dampers.CoulombFriction(1e3, 1e-6)), ROUGH, duration=1.0)
    units = Ride(car, ROUGH, duration=1.0).units
    assert units["rate"] == units["damper.rate"] == "N s/m" and units["rms_sprung_acceleration"] == "m/s^2"


@pytest.mark.slow
def test_working_space_is_the_deviation_from_the_mean_in_a_ride_and_of_a_record():
    """An asymmetric damper pulls the body down: the two numbers are one, and the mean has a name of its own."""
    car = quarter_car_000(dampers.Bilinear(5000.0, 1000.0))
    names = ["working_space_rms", "working_space_mean"]
    stroke = simulate(car, ROUGH, duration=2.0)["stroke"]
    ride = Ride(car, ROUGH, duration=2.0, metrics=names)
    found = ride()
    assert float(found["working_space_rms"]) == pytest.approx(float(metrics.working_space_rms(stroke)), rel=1e-10)
    assert float(found["working_space_rms"]) == pytest.approx(float(jnp.std(stroke)), rel=1e-10)
    assert float(found["working_space_mean"]) == pytest.approx(float(jnp.mean(stroke)), rel=1e-10)
    assert float(found["working_space_mean"]) < -0.3 * float(found["working_space_rms"])

    def spread(rate):
        return ride({"damper.rebound_rate": rate})["working_space_rms"]

    slope = float(jax.jit(jax.grad(spread))(5000.0))
    assert float(jax.jit(jax.jacfwd(spread))(5000.0)) == pytest.approx(slope, rel=1e-9)
    spread = jax.jit(spread)
    assert slope == pytest.approx(float(spread(5005.0) - spread(4995.0)) / 10.0, rel=1e-4)


@pytest.mark.parametrize(("name", "exact"), [("standard_deviation", np.std), ("mean", np.mean)])
def test_the_working_space_keeps_its_digits_in_single_precision(name, exact, rng):
    """A small motion far from zero, as of a body that a road has lifted: sums of squares alone would lose it."""
    record = jnp.asarray((3.0 + 1e-3 * rng.normal(size=20_000)).astype(np.float32))
    statistic = metrics.STATISTICS[name]
    last, _ = jax.lax.scan(lambda kept, y: (statistic.add(kept, y), None), statistic.begin(record[0]), record[1:])
    found = statistic.end(last, record.size, 0.01)
    assert found.dtype == jnp.float32
    assert float(found) == pytest.approx(exact(np.asarray(record, float)), rel=1e-4)


def test_displacements_count_from_the_static_equilibrium():
    """Of a car on a gas spring that waits on a road 0.3 m high; and of a run that is released elsewhere."""
    gas = dampers.GasSpring(8e6, 1e-4, 3e-4)
    car = vehicles.QuarterCar(300.0, 40.0, 20e3, 180e3, dampers.Linear(1500.0), extra_spring=gas)
    level = roads.from_profile(np.arange(3) * 0.1, np.full(3, 0.3))
    names = ["rms_sprung_displacement", "peak_sprung_displacement", "working_space_mean"]
    still = Ride(car, level, duration=0.2, metrics=names)()
    assert [float(still[name]) for name in names] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    rest = vehicles.static_equilibrium(car, [0.3])
    released = simulate(car, level, duration=0.2, start={"z_sprung": float(rest["z_sprung"]) + 0.02}).metrics(names)
    assert float(released["peak_sprung_displacement"]) == pytest.approx(0.02, rel=1e-9)


def test_old_and_wrong_names_of_metrics():
    car, bump = half_car_002(), roads.cosine_bump(0.05, start=0.1, length=2.0, speed=20.0)
    with pytest.warns(FutureWarning, match="'rear_working_space_peak' is now called 'rear_working_space_peak_to_peak'"):
        ride = Ride(car, bump, metrics=["rear_working_space_peak"], duration=0.3)
    found = ride()
    assert list(found) == ["rear_working_space_peak_to_peak"]
    with pytest.warns(FutureWarning, match="is now called"):
        assert found["rear_working_space_peak"] == found["rear_working_space_peak_to_peak"]
    with pytest.raises(ValueError, match=r"`metrics` must be one of .* Did you mean 'rms_sprung_acceleration'"):
        Ride(car, bump, metrics=["rms_sprung_accel"], duration=0.3)
    with pytest.raises(ValueError, match=r"Write `metrics=\['rms_sprung_acceleration'\]`"):
        Ride(car, bump, metrics="rms_sprung_acceleration", duration=0.3)
    with pytest.raises(ValueError, match=r"`metrics` must name one or more, but is empty. Write \['rms_sprung_acc"):
        Ride(car, bump, metrics=[], duration=0.3)
    response = simulate(car, bump, duration=0.3)
    with pytest.raises(KeyError, match="did you mean 'rms_sprung_acceleration'"):
        response.metrics()["rms_sprung_accel"]
    with pytest.warns(FutureWarning, match="is now called"):
        assert response.metrics(["front_working_space_peak"])["front_working_space_peak_to_peak"] > 0
    with pytest.raises(ValueError, match=r"`channel` must be one of .* Did you mean 'front_stroke'"):
        response["front_strok"]
