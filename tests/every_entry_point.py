"""Every public entry point once, as numbers by name: run as a script without `configure()`, it prints them as JSON."""

import json
import sys
import tempfile

import numpy as np

import jaxdamp
from jaxdamp import bench, dampers, export, identify, metrics, parameters, plots, roads, sweeps, tune, vehicles


LAW = dampers.Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05)


def records():
    dyno = bench.VirtualDyno(LAW, force_noise=5.0, seed=1)
    made = dyno.run([bench.SineTest(0.02, f, cycles=3, name=f"sine_{f:g}Hz") for f in (1.0, 2.0, 4.0)])
    with tempfile.TemporaryDirectory() as folder:
        made.write(folder)
        return bench.read(folder, sign="rebound-positive")


def fits(runs):
    ladder = identify.compare(
        identify.default_ladder(runs, ["linear", "besinger"]),
        runs.without("sine_2Hz"),
        held_out=runs.select("sine_2Hz"),
    )
    lagged = identify.fit(dampers.Lag(dampers.Linear(1500.0), 0.003), runs)
    crossed = identify.cross_validate(identify.default_ladder(runs, ["linear"]), runs)
    start = dampers.Lag(dampers.Linear(2000.0), 0.002)
    trained = identify.train(start, runs.select("sine_1Hz"), held_out=runs.select("sine_2Hz"), steps=50)
    errors = ladder.best.result.covariance
    return {
        "fit, closed form": [e.value for e in ladder["linear"].parameters],
        "fit, search": [e.value for e in ladder["besinger"].parameters[:3]],
        "fit, standard errors": np.sqrt(np.diag(np.asarray(errors))[:3]),
        "fit, law with a state": lagged.parameters[0].value,
        "cross_validate": [fold.rmse for fold in crossed.folds],
        "train": trained.rmse,
        "export": float(parameters.get(export.from_json(export.to_json(ladder.best.result.law)), "rebound_rate")),
    }


def rides():
    car, bump = vehicles.presets.quarter_car_000(LAW), roads.cosine_bump(0.05, start=0.3, duration=0.25)
    run = jaxdamp.simulate(car, bump, duration=1.0)
    ride = jaxdamp.Ride(car, bump, metrics=["rms_sprung_acceleration", "working_space_rms"], duration=1.0)
    swept = jaxdamp.sweep(ride, {"rebound_rate": [2000.0, 4000.0]}, gradients=True)
    sampled = jaxdamp.sweep(ride, sweeps.sobol({"sprung_mass": (1000.0, 1400.0)}, 4))
    time = np.arange(0.0, 0.5, 1e-3)
    response = jaxdamp.respond(dampers.SeriesSpring(LAW, 1.5e6), time, 0.02 * np.sin(12.0 * time))
    for figure in (plots.ride(run), plots.damper_use(run), plots.law_card(LAW)):
        assert figure.axes
    return {
        "simulate": [float(run.metrics()[name]) for name in ("rms_sprung_acceleration", "peak_sprung_acceleration")],
        "Ride": [float(value) for value in ride().values()],
        "sweep": swept["rms_sprung_acceleration"].values,
        "sweep, derivatives": swept["d_rms_sprung_acceleration"].values,
        "sweep, Sobol": sampled["working_space_rms"].values,
        "respond": np.asarray(response)[::50],
    }


def tunings():
    soft = vehicles.presets.quarter_car_000()
    white = tune.minimise("rms_sprung_acceleration", soft, roads.white("C", 20.0))
    weighted = tune.minimise("weighted_rms_sprung_acceleration", soft, roads.white("C", 20.0))
    bump = roads.cosine_bump(0.05, start=0.1, duration=0.25)
    car = vehicles.presets.quarter_car_000(dampers.Bilinear(3000.0, 3000.0))
    driven = tune.minimise("rms_sprung_acceleration", car, bump, duration=1.0)
    found = (white, weighted, driven)
    assert all(result.converged for result in found), found
    again = tune.rescore(white, [bump], duration=1.0)
    return {
        "minimise": [result.after[result.metric] for result in found],
        "minimise, parameters": [change.after for result in found for change in result.parameters],
        "rescore": again.after["rms_sprung_acceleration"],
    }


def numbers_of_vehicles():
    found = {}
    for name in ("quarter_car_000", "golden_car", "half_car_002", "full_car_jazar", "truck_001", "m113_003"):
        car = getattr(vehicles.presets, name)()
        if name != "m113_003":  # whose wheels without dampers never come to rest
            rms = vehicles.stationary_rms(car, roads.white("C", 20.0).velocity_psd, speed=20.0)
            found[f"{name}, stationary_rms"] = float(rms[car.ride_metrics[0].channel])
        found[f"{name}, modes"] = np.sort(np.asarray(vehicles.modes(car).frequency))
        found[f"{name}, static_wheel_loads"] = car.static_wheel_loads()
        gain = vehicles.frequency_response(car, np.array([1.0, 5.0]), speed=20.0)[car.ride_metrics[0].channel]
        found[f"{name}, frequency_response"] = np.abs(np.asarray(gain))
    return found


def numbers_of_records():
    dt, rng = 0.0025, np.random.default_rng(1)
    record = 9.81 + rng.standard_normal(8000)
    weighted = [float(metrics.weighted_rms(record, dt, w)) for w in ("Wk", "Wd", "Wc", "We", "Wf", "Wj", "Wb")]
    x = np.arange(0.0, 300.0, 0.25)
    return {
        "weighted_rms": weighted,
        "dose": float(metrics.vibration_dose_value(record, dt, "Wk")),
        "max_transient_value": float(metrics.max_transient_value(record, dt, "Wk")),
        "roughness": float(metrics.international_roughness_index(0.01 * np.sin(x / 3.0), 0.25)),
        "dyno": np.asarray(records()[0].force)[::100],
    }


def every_entry_point() -> dict[str, list[float]]:
    found = fits(records()) | rides() | tunings() | numbers_of_vehicles() | numbers_of_records()
    return {name: np.ravel(np.asarray(values, dtype=np.float64)).tolist() for name, values in found.items()}


if __name__ == "__main__":
    json.dump(every_entry_point(), sys.stdout)
