"""Metrics of any channel, with weightings, windows and statistics of one's own: in a run and gathered."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, dampers, metrics, roads, simulate, vehicles
from jaxdamp.metrics import Metric
from jaxdamp.simulation import fixed_step as module


CAR = vehicles.presets.quarter_car_000()
ROUGH = roads.iso8608("C", speed=20.0, seed=1, length=100.0)
JERK = metrics.Statistic("jerk", of_record=lambda record, dt: metrics.rms(jnp.diff(record) / dt))
OWN = [
    Metric("sprung_acceleration", "rms", weighting="Wd"),
    Metric("sprung_acceleration", "rms", weighting="default"),
    Metric("sprung_acceleration", "rms", window=(0.2, 0.7)),
    Metric("stroke", "peak_to_peak", window=(0.5, 1.0)),
    Metric("stroke", "minimum", from_rest=True),
    Metric("damper_force", "mean", by="damper_velocity"),
    Metric("damper_force", "dissipated_power", by="damper_velocity", window=(0.1, 0.4)),
    Metric("damper_velocity", metrics.percentile(95)),
    Metric("sprung_acceleration", JERK, window=(0.2, 0.7)),
    Metric("sprung_acceleration", "max_transient_value", "Wk"),
    "working_space_rms",
]


@pytest.fixture(scope="module")
def run():
    return simulate(CAR, ROUGH, duration=1.2)


@pytest.fixture(scope="module")
def driven():
    return Ride(CAR, ROUGH, metrics=OWN, duration=1.2)


def test_gathered_and_of_the_channels_are_one(run, driven):
    values, expected = driven(), run.metrics(OWN)
    assert list(values) == list(expected) and len(values) == len(OWN)
    for name, value in expected.items():
        assert float(values[name]) == pytest.approx(float(value), rel=1e-9), name


@pytest.mark.slow
def test_from_rest_a_force_counts_from_the_static_one():
    """A gas spring pushes at rest, and the tyre's damping feels the first slope of the road."""
    gas = dampers.Linear(1500.0) + dampers.GasSpring(2e6, 6e-5, 1e-4)
    car = vehicles.QuarterCar(300.0, 40.0, 20e3, 180e3, gas, tyre_damping=300.0)
    wanted = [Metric(c, "peak", from_rest=True, name=c) for c in ("damper_force", "dynamic_tyre_load")]
    road = roads.sine(0.01, frequency=2.0)
    run, ride = simulate(car, road, duration=0.3), Ride(car, road, metrics=wanted, duration=0.3)
    found, expected = run.metrics(wanted), ride()
    for name, value in expected.items():
        assert float(found[name]) == pytest.approx(float(value), rel=1e-9), name
    part = run.between(0.1, 0.2)
    moved = np.asarray(part["damper_force"]) - float(run["damper_force"][0])
    value = part.metrics(wanted[:1])["damper_force"]
    assert float(value) == pytest.approx(np.max(np.abs(moved)), rel=1e-9)


def test_they_are_what_numpy_makes_of_the_channels(run, driven):
    values = {name: float(value) for name, value in driven().items()}
    a, force, v = (np.asarray(run[c]) for c in ("sprung_acceleration", "damper_force", "damper_velocity"))
    weighted = metrics.weighted_signal(a, 1e-3, "Wd", method="step", remove_mean=False)
    assert values["Wd_rms_sprung_acceleration"] == pytest.approx(np.sqrt(np.mean(np.asarray(weighted) ** 2)), rel=1e-9)
    assert values["weighted_rms_sprung_acceleration"] == pytest.approx(
        float(run.metrics()["weighted_rms_sprung_acceleration"]), rel=1e-9
    )
    assert values["rms_sprung_acceleration_0.2_to_0.7_s"] == pytest.approx(np.sqrt(np.mean(a[200:701] ** 2)), rel=1e-9)
    assert values["mean_damper_force_by_damper_velocity"] == pytest.approx(np.mean(force * v), rel=1e-9)
    assert values["percentile_95_damper_velocity"] == pytest.approx(np.percentile(v, 95), rel=1e-9)
    jerk = np.sqrt(np.mean((np.diff(a[200:701]) / 1e-3) ** 2))
    assert values["jerk_sprung_acceleration_0.2_to_0.7_s"] == pytest.approx(jerk, rel=1e-9)
    power = np.trapezoid(force[100:401] * v[100:401]) / 300
    assert values["dissipated_power_damper_force_by_damper_velocity_0.1_to_0.4_s"] == pytest.approx(power, rel=1e-9)
    assert driven.units["mean_damper_force_by_damper_velocity"] == "N m/s"


def test_a_part_of_a_run_has_windows_in_the_time_of_the_run(run):
    window = Metric("stroke", "peak_to_peak", window=(0.5, 1.0))
    part = run.between(0.4, 1.1)
    assert float(part.metrics([window])[window.name]) == float(run.metrics([window])[window.name])
    with pytest.raises(ValueError, match=r"must lie in 0\.6 to 1\.1 s"):
        run.between(0.6, 1.1).metrics([window])


@pytest.mark.slow
def test_derivatives_and_blocks_of_a_run_that_saves_its_channel(monkeypatch):
    """Forward and reverse slopes of a record's statistic and of a window, of a run in one piece and in several."""
    chosen = [Metric("sprung_acceleration", JERK), Metric("stroke", "standard_deviation", window=(0.1, 0.25))]
    names = [metric.name for metric in chosen]

    def slopes():
        ride = Ride(CAR, ROUGH, metrics=chosen, duration=0.3)
        return [jax.jit(d(lambda rate: ride({"damper.rate": rate})))(2500.0) for d in (jax.jacfwd, jax.jacrev)]

    whole = slopes()
    monkeypatch.setattr(module, "BLOCK", 64)
    jax.clear_caches()
    for name in names:
        values = [float(slope[name]) for slope in (*whole, *slopes())]
        assert values == pytest.approx([values[0]] * 4, rel=1e-9) and values[0] != 0.0


def test_what_a_vehicle_has_not_is_refused():
    with pytest.raises(ValueError, match=r"`channel of metrics` must be one of .* Did you mean 'stroke'"):
        Ride(CAR, ROUGH, metrics=[Metric("strok", "rms")])
    with pytest.raises(ValueError, match="`metrics` must weight an acceleration"):
        Ride(CAR, ROUGH, metrics=[Metric("stroke", "rms", "Wk")])
    with pytest.raises(ValueError, match="`metrics` must have one metric of each name"):
        Ride(CAR, ROUGH, metrics=[Metric("stroke", "rms", name="a"), Metric("stroke", "peak", name="a")])
    with pytest.raises(ValueError, match=r"window of .* must lie in 0 to 1 s"):
        Ride(CAR, ROUGH, metrics=[Metric("stroke", "rms", window=(0.5, 2.0))], duration=1.0)


def test_on_a_white_road_a_ride_is_stationary():
    white, sideways = roads.white("C", 20.0), Metric("sprung_acceleration", "rms", "Wd")
    chosen = ["rms_sprung_acceleration", Metric("stroke", "standard_deviation"), sideways]
    ride = Ride(CAR, white, metrics=chosen)

    @jax.jit
    def of_the_linear_car(rate: float) -> list[jax.Array]:
        car = vehicles.presets.quarter_car_000(dampers.Linear(rate))
        linear = vehicles.with_weightings(vehicles.linearise(car), [("sprung_acceleration", "Wd")])
        rms = vehicles.stationary_rms(linear, white.velocity_psd)
        return [rms[name] for name in ("sprung_acceleration", "stroke", "weighted_sprung_acceleration")]

    for rate in (2500.0, 4000.0):
        values = ride({"damper.rate": rate})
        names = ("rms_sprung_acceleration", "standard_deviation_stroke", sideways.name)
        assert [float(values[name]) for name in names] == pytest.approx(
            [float(x) for x in of_the_linear_car(rate)], rel=1e-9
        )
    everything = jax.eval_shape(Ride(CAR, white))
    assert "rms_sprung_acceleration" in everything and "peak_sprung_acceleration" not in everything
    with pytest.raises(ValueError, match="`metrics` must follow from an RMS on a white road, but is peak_sprung_acc"):
        Ride(CAR, white, metrics=["peak_sprung_acceleration"])
    with pytest.raises(ValueError, match="`duration` must not be given on a white road"):
        Ride(CAR, white, duration=3.0)
    with pytest.raises(ValueError, match="`dt` must not be given on a white road"):
        Ride(CAR, white, dt=3.0)
    exciting = vehicles.presets.quarter_car_000(dampers.Polynomial([0.0, -2000.0]))
    with pytest.raises(ValueError, match=r"come to rest .* One of its motions is not damped: `vehicles.modes"):
        Ride(exciting, white, metrics=chosen)()
    assert np.all(np.isinf([*jax.jit(Ride(exciting, white, metrics=chosen))().values()]))
