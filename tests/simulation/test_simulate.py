import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

from jaxdamp import dampers, metrics, roads, simulate
from jaxdamp.parameters import replace
from jaxdamp.simulation import Adaptive, Exponential
from jaxdamp.simulation.observer import recorded
from jaxdamp.simulation.run import sampled
from jaxdamp.vehicles.presets import quarter_car_000


BESINGER = dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
LAWS = {
    "linear": dampers.Linear(2500.0),
    "bilinear": dampers.Bilinear(3000.0, 1500.0),
    "power": dampers.PowerLaw(1800.0, 0.6, 900.0, 0.6, knee_width=0.01),
    "besinger": BESINGER,
    "lag": dampers.Lag(dampers.Linear(2500.0) + dampers.CoulombFriction(80.0, 0.02), 0.004),
    "series spring": dampers.SeriesSpring(BESINGER, 1e6, 1e9),
    "stiff series spring": dampers.SeriesSpring(dampers.Linear(15_000.0), 1.5e7),
    "motion ratio": dampers.MotionRatio(BESINGER, 1.3),
}
PLAIN = ("linear", "power", "lag")
BUMP = roads.cosine_bump(0.06, start=0.1, duration=0.25)
MS, MU, K, KT = 1200.0, 125.0, 60e3, 220e3


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=[pytest.mark.slow] * (name not in PLAIN)) for name in LAWS]
)
def run(request):
    return simulate(quarter_car_000(LAWS[request.param]), BUMP, duration=1.0)


def test_momentum_comes_from_the_tyre_alone(run):
    """m_s z_s'' + m_u z_u'' = -k_t (z_u - z_r) for any law, at every instant."""
    force = MS * run["sprung_acceleration"] + MU * run["unsprung_acceleration"]
    np.testing.assert_allclose(force, -KT * (run["z_unsprung"] - run["z_road"]), atol=1e-9 * KT * 0.06)


def test_channels_are_consistent_and_have_units(run):
    channels = run.channels
    assert set(channels) == set(run.units)
    np.testing.assert_allclose(channels["stroke"], channels["z_sprung"] - channels["z_unsprung"], atol=1e-15)
    held = 0.5 * (channels["damper_velocity"][1:] + channels["damper_velocity"][:-1])
    assert np.abs(np.diff(channels["stroke"]) / 1e-3 - held).max() < 2e-3 * np.abs(held).max()
    mean = 0.5 * (channels["sprung_acceleration"][1:] + channels["sprung_acceleration"][:-1])
    np.testing.assert_allclose(np.diff(run.motion[:, 2]) / 1e-3, mean, atol=5e-3 * np.abs(mean).max())


def test_energy_balance_closes(run):
    parts = run.energy_balance()
    total = float(parts["stored"] + parts["absorbed"] + parts["dashpots"])
    assert float(parts["road_work"]) == pytest.approx(total, rel=4e-4)
    assert float(parts["road_work"]) > 0 and float(parts["absorbed"]) > 0


@pytest.mark.parametrize("tyre_damping", [0.0, 300.0])
@pytest.mark.parametrize(
    "name", [*(pytest.param(n, marks=pytest.mark.slow) for n in ("besinger", "series spring")), "lag"]
)
def test_energy_error_falls_with_the_square_of_the_step(name, tyre_damping):
    car = replace(quarter_car_000(LAWS[name]), {"tyre_damping": tyre_damping})
    errors = []
    for dt in (2e-3, 1e-3, 5e-4):  # as many instants in each, so that they share one compilation
        parts = simulate(car, BUMP, duration=1200 * dt, dt=dt).energy_balance()
        assert (float(parts["dashpots"]) > 0) == (tyre_damping > 0)
        errors.append(abs(float(parts["error"] / parts["road_work"])))
    assert errors[0] > 3.3 * errors[1] > 3.3 * 3.3 * errors[2]


@pytest.mark.exhaustive_cases("linear", "besinger", "bilinear", "lag", "motion ratio", "series spring")
def test_the_two_engines_agree(run):
    reference = simulate(run.vehicle, BUMP, duration=1.0, engine=Adaptive())
    for channel, share in (("sprung_acceleration", 6e-3), ("stroke", 1e-3), ("dynamic_tyre_load", 1e-3)):
        difference = np.abs(run[channel] - reference[channel]).max()
        assert difference < share * np.abs(reference[channel]).max(), channel


@pytest.mark.parametrize(
    "name", ["linear", "lag", *(pytest.param(n, marks=pytest.mark.slow) for n in ("power", "series spring"))]
)
def test_the_error_falls_with_the_step(name):
    car, finest = quarter_car_000(LAWS[name]), 1.25e-4
    strokes = {}
    for parts in (32, 16, 8, 1):  # as many instants in each, so that they share one compilation
        run = simulate(car, BUMP, duration=4000 * parts * finest, dt=parts * finest)
        strokes[parts] = np.asarray(run["stroke"])[: 4000 // parts + 1]
    errors = [np.abs(strokes[parts] - strokes[1][::parts]).max() for parts in (32, 16, 8)]
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]


@pytest.mark.slow
def test_tyre_damping_is_the_same_in_both_engines_and_in_the_channels():
    car = replace(quarter_car_000(), {"tyre_damping": 2000.0})
    run, reference = (simulate(car, BUMP, duration=0.6, engine=engine) for engine in (Exponential(), Adaptive()))
    np.testing.assert_allclose(run["stroke"], reference["stroke"], atol=3e-6)
    force = MS * run["sprung_acceleration"] + MU * run["unsprung_acceleration"]
    np.testing.assert_allclose(force, run["dynamic_tyre_load"], atol=1e-9 * KT * 0.06)


def test_agrees_with_equations_written_by_hand():
    """SciPy at tight tolerance on the textbook equations, with random cars, laws and bumps."""
    rng = np.random.default_rng(3)
    car, worst = quarter_car_000(LAWS["bilinear"]), []
    for _ in range(12):
        ms, mu, k, kt = rng.uniform([200, 25, 1e4, 1e5], [900, 90, 6e4, 3e5])
        ct, cr, cc, height = rng.uniform([0, 800, 400, 0.02], [400, 4000, 3000, 0.08])
        width = rng.uniform(0.15, 0.5)

        def road(t, height=height, width=width):
            s = np.clip((t - 0.1) / width, 0, 1)
            return 0.5 * height * (1 - np.cos(2 * np.pi * s)), np.pi * height / width * np.sin(2 * np.pi * s)

        def field(t, y, p=(ms, mu, k, kt, ct, cr, cc), road=road):
            ms, mu, k, kt, ct, cr, cc = p
            z, slope = road(t)
            v = y[2] - y[3]
            force = k * (y[0] - y[1]) + (cr * max(v, 0.0) + cc * min(v, 0.0))
            tyre = kt * (y[1] - z) + ct * (y[3] - slope)
            return [y[2], y[3], -force / ms, (force - tyre) / mu]

        time = np.linspace(0, 1, 1001)
        exact = scipy.integrate.solve_ivp(field, (0, 1), np.zeros(4), "DOP853", time, rtol=1e-10, atol=1e-12).y
        drawn = replace(
            car,
            {
                "sprung_mass": ms,
                "unsprung_mass": mu,
                "spring_rate": k,
                "tyre_stiffness": kt,
                "tyre_damping": ct,
                "damper.rebound_rate": cr,
                "damper.compression_rate": cc,
            },
        )
        bump = roads.cosine_bump(height, start=0.1, duration=width)
        found = np.asarray(simulate(drawn, bump, duration=1.0).motion).T
        worst.append(np.abs(found - exact).max(axis=1) / np.abs(exact).max(axis=1))
    assert np.max(worst) < 3e-3
    assert np.median(worst) < 1e-3


@pytest.mark.parametrize("frequency", [0.6, 1.0, 3.0, 7.5, 15.0])
@pytest.mark.exhaustive_cases("0.6", "3.0", "15.0")
def test_steady_sine_is_the_transfer_function(frequency):
    """H(s) = s² k_t (c s + k)/D(s), D = (m_s s² + c s + k)(m_u s² + c s + k + k_t) − (c s + k)²."""
    c, s = 2500.0, 2j * np.pi * frequency
    d = (MS * s**2 + c * s + K) * (MU * s**2 + c * s + K + KT) - (c * s + K) ** 2
    response = simulate(quarter_car_000(), roads.sine(0.01, frequency=frequency), duration=40.0 / frequency + 15.0)
    last = np.asarray(response.time) > 20.0 / frequency + 15.0
    turning = np.exp(-s * np.asarray(response.time[last]))
    found = 2 * np.mean(np.asarray(response["sprung_acceleration"])[last] * turning) / 0.01
    assert abs(found) == pytest.approx(abs(s**2 * KT * (c * s + K) / d), rel=3e-3)


def test_stands_still_on_a_raised_flat_road():
    road = roads.from_profile(np.linspace(0, 2, 2001), np.full(2001, 0.3))
    response = simulate(quarter_car_000(BESINGER), road, duration=1.0)
    np.testing.assert_allclose(response["z_sprung"], 0.3, atol=1e-12)
    np.testing.assert_allclose(response["sprung_acceleration"], 0.0, atol=1e-10)


def test_motion_is_unchanged_when_all_masses_and_forces_are_scaled():
    car = quarter_car_000(dampers.Scaled(BESINGER, 1.0))
    names = ["sprung_mass", "unsprung_mass", "spring_rate", "tyre_stiffness"]
    scaled = replace(car, {n: 3.0 * getattr(car, n) for n in names} | {"damper.factor": 3.0})
    one, three = (simulate(c, BUMP, duration=0.6) for c in (car, scaled))
    np.testing.assert_allclose(one.motion, three.motion, atol=1e-11)
    np.testing.assert_allclose(3 * one["damper_force"], three["damper_force"], atol=1e-6)


@pytest.mark.slow
def test_batches_equal_loops_and_both_modes_of_differentiation_agree():
    car = quarter_car_000(LAWS["power"])
    heights = BUMP.height(jnp.arange(401.0) * 1e-3)
    forces = jnp.array([700.0, 900.0, 1500.0])

    @jax.jit
    def square(force):
        system = replace(car, {"damper.compression_force": force}).system()
        run, _ = recorded(Exponential(), system, heights, jnp.asarray(1e-3), None, 1, None)
        return jnp.mean(run.motion[:, 2] ** 2)

    np.testing.assert_allclose(jax.vmap(square)(forces), [square(f) for f in forces], rtol=1e-12)
    forward, reverse = jax.jacfwd(square)(forces[1]), jax.grad(square)(forces[1])
    assert float(forward) == pytest.approx(float(reverse), rel=1e-10)
    near, far = ((float(square(900.0 + h)) - float(square(900.0 - h))) / (2 * h) for h in (4.0, 8.0))
    assert float(forward) == pytest.approx((4 * near - far) / 3, rel=1e-7)


def test_metrics_are_those_of_the_channels():
    response = simulate(quarter_car_000(BESINGER), roads.iso8608("C", 20.0, seed=2), duration=5.0)
    found, acceleration = response.metrics(), np.asarray(response["sprung_acceleration"])
    stroke, load = np.asarray(response["stroke"]), np.asarray(response["dynamic_tyre_load"])
    moved = np.asarray(response["z_sprung"]) - float(response["z_sprung"][0])  # it starts at rest
    expected = {
        "rms_sprung_acceleration": np.sqrt(np.mean(acceleration**2)),
        "peak_sprung_acceleration": np.abs(acceleration).max(),
        "working_space_rms": np.std(stroke),
        "working_space_mean": np.mean(stroke),
        "working_space_peak_to_peak": np.ptp(stroke),
        "rms_sprung_displacement": np.sqrt(np.mean(moved**2)),
        "peak_sprung_displacement": np.abs(moved).max(),
        "rms_dynamic_tyre_load": np.sqrt(np.mean(load**2)),
        "dynamic_load_coefficient": np.std(load) / (1325.0 * 9.80665),
        "peak_damper_velocity": np.abs(response["damper_velocity"]).max(),
        "damper_dissipated_power": response.absorbed_by()["damper"] / 5.0,
        "road_stress_factor": np.mean((1.0 + load / (1325.0 * 9.80665)) ** 4),
        "lift_off_fraction": np.mean(load <= -1325.0 * 9.80665),
    }
    felt = response.comfort()["sprung_acceleration"]
    expected["weighted_rms_sprung_acceleration"] = felt.weighted_rms
    expected["vibration_dose_value_sprung_acceleration"] = felt.vibration_dose_value
    assert set(found) == set(response.metric_units()) == set(expected)
    for name, value in expected.items():
        rel = 0.05 if name == "road_stress_factor" else 1e-9  # that is for a Gaussian load
        assert float(found[name]) == pytest.approx(float(value), rel=rel), name


def test_to_xarray_carries_units_and_time():
    response = simulate(quarter_car_000(), BUMP, duration=0.5)
    dataset = response.to_xarray()
    assert dataset["sprung_acceleration"].attrs["units"] == "m/s^2"
    assert dataset["damper_force"].attrs["description"] == "force of damper, positive where it resists extension"
    assert dataset["time"].attrs["units"] == "s"
    np.testing.assert_array_equal(dataset["damper_force"], response["damper_force"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"dt": 0.01},
            r"`dt` must not be longer than the road's grid of 0.005 s, but is 0.01. Pass `dt=0.005` or less",
        ),
        ({"duration": -1.0}, r"`duration` must be positive and finite, but is -1"),
        ({"dt": 0.0}, r"`dt` must be positive"),
        ({"every": 0}, r"`every` must be a whole number of instants, 1 or more, but is 0"),
        ({"every": 7}, r"`every` must divide the 200 steps.*Pass `duration=0.98` or `duration=1.015`"),
        ({"dt": 2.0}, r"`dt` must be shorter than the run"),
        (
            {"road": roads.sine(0.01, frequency=1.0), "duration": None},
            r"`duration` must be given.*Pass `duration=10.0`",
        ),
        (
            {"road": roads.from_profile(np.arange(400) * 5e-3, np.zeros((400, 2)))},
            r"`road` must have a column for each of 1",
        ),
        (
            {"road": roads.iso8608("C", 400.0, seed=1), "duration": 10.0, "dt": 1e-3},
            r"`duration` must not be longer than the random road, which repeats after 2.5 s, .* with `duration=10`",
        ),
        (
            {"road": roads.superposed(roads.cosine_bump(0.01, start=0.1023, duration=4e-4), roads.step(0.01))},
            r"`dt` must be at most half the time over the shortest bump, 0.0004 s.*is 0.005 s. Pass `dt=5e-05`",
        ),
        ({"start": [0.1, 0.0]}, r"`start` must be coordinates by name, such as \{.z_sprung.: 0.1\}, but is a list"),
        ({"start": {"z_sprung": np.array([0.1])}}, r"`start\['z_sprung'\]` must be one number, but is of shape \(1,\)"),
    ],
)
def test_refuses_runs_that_make_no_sense(change, message):
    sampled = roads.from_profile(np.arange(400) * 5e-3, np.zeros(400))
    arguments = {"road": sampled, "duration": 1.0, "dt": 5e-3} | change
    with pytest.raises(ValueError, match=message):
        simulate(quarter_car_000(), **arguments)


def test_a_traced_road_that_would_repeat_or_be_skipped_is_refused():
    """Speeds of a derivative or a batch are known, so that its roads are checked as others are."""

    def at(speed):
        return sampled(quarter_car_000(), roads.iso8608("C", speed, seed=1, length=100.0), 5.0, 1e-2)[1][-1, 0]

    def over(width):
        return sampled(quarter_car_000(), roads.cosine_bump(0.1, start=0.1, duration=width), 1.0, 1e-2)[1][-1, 0]

    with pytest.raises(ValueError, match=r"`duration` must not be longer than the random road.* after 4 s"):
        jax.vmap(at)(jnp.array([10.0, 25.0]))
    with pytest.raises(ValueError, match=r"`dt` must be at most half the time over the shortest bump, 0.01 s"):
        jax.grad(over)(0.01)


class Driving(dampers.AbstractMemoryless):
    """A law that puts energy in."""

    def force_velocity(self, v):
        return jnp.asarray(-1e5 * v)


def test_a_run_that_diverges_says_so():
    with pytest.raises(ValueError, match=r"must have a finite response.*shorter step than 0.001 s"):
        simulate(quarter_car_000(Driving()), BUMP, duration=2.0)
    with pytest.raises(ValueError, match=r"`substeps` must keep every law stable, but is 1.*needs 8\d\d\d in 0.001 s"):
        simulate(quarter_car_000(dampers.Linear(1e9)), BUMP, duration=2.0, substeps=1)


def test_unknown_channel_suggests_the_nearest():
    with pytest.raises(ValueError, match="Did you mean 'sprung_acceleration'"):
        simulate(quarter_car_000(), BUMP, duration=0.2)["sprung_aceleration"]


def test_the_adaptive_engine_gives_up_where_it_would_take_for_ever():
    car = quarter_car_000(dampers.Linear(1e9))
    with pytest.raises(ValueError, match=r"must have a finite response.*maximum number of solver steps.*Kvaerno5"):
        simulate(car, BUMP, duration=0.3, engine=Adaptive())


@pytest.mark.exhaustive
def test_an_implicit_solver_takes_a_law_with_kinks_in_series_with_a_spring():
    car = quarter_car_000(dampers.SeriesSpring(LAWS["bilinear"], 5e6))
    implicit = simulate(car, BUMP, duration=0.4, engine=Adaptive(diffrax.Kvaerno3(), 1e-6, 1e-8))
    explicit = simulate(car, BUMP, duration=0.4, engine=Adaptive())
    np.testing.assert_allclose(implicit["stroke"], explicit["stroke"], atol=1e-6)


def test_responses_of_a_linear_car_add_up():
    car, time = quarter_car_000(), np.arange(1001) * 1e-3
    one, two = BUMP.height(time), 0.01 * jnp.sin(20.0 * jnp.asarray(time))[:, None]
    runs = [simulate(car, roads.from_profile(time, h)).motion for h in (one, two, one - 3.0 * two)]
    np.testing.assert_allclose(runs[0] - 3.0 * runs[1], runs[2], atol=1e-13)


def test_comfort_is_what_the_metrics_say_of_the_channel():
    response = simulate(quarter_car_000(), roads.cosine_bump(0.05, start=0.1, duration=0.3), duration=2.0)
    felt = response.comfort()["sprung_acceleration"]
    record = np.asarray(response["sprung_acceleration"])
    options = {"method": "step", "remove_mean": False}
    weighted = metrics.weighted_signal(record, 1e-3, "Wk", **options)
    np.testing.assert_allclose(felt.weighted_rms, metrics.rms(weighted), rtol=1e-9)
    np.testing.assert_allclose(felt.vibration_dose_value, np.sum(np.asarray(weighted) ** 4 * 1e-3) ** 0.25, rtol=1e-9)
    np.testing.assert_allclose(felt.max_transient_value, metrics.max_transient_value(weighted, 1e-3, None), rtol=1e-9)
    # independently: the analogue filter over the spectrum of the record and zeros behind it
    spectrum = metrics.weighted_rms(record, 1e-3, "Wk", remove_mean=False)
    np.testing.assert_allclose(felt.weighted_rms, spectrum, rtol=1e-3)
