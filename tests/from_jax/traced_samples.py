"""Calls of public functions with a traced number x, which `traced_calls.py` tries."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

import jaxdamp
from jaxdamp import bench, dampers, identify, roads, simulate
from jaxdamp.dampers import Lag, Linear
from jaxdamp.vehicles.presets import quarter_car_000


jaxdamp.configure()

T = 1e-3 * np.arange(2001)
X, V = 0.02 * np.sin(12.0 * T), 0.24 * np.cos(12.0 * T)
W = 0.3 * np.random.default_rng(0).normal(size=T.size)
F = np.linspace(0.5, 20.0, 40)
RUN = bench.BenchRun("sine", T, X, V, 1500.0 * V)
BUMP = roads.cosine_bump(0.03, start=0.0, duration=0.05)
RIDE: dict[str, Any] = {"duration": 0.1, "dt": 1e-3}
RMS = "rms_sprung_acceleration"
LIMITS = identify.MachineLimits(stroke=0.05, velocity=1.0)
FOLDER = Path(tempfile.mkdtemp())
Call = Callable[[Any, Any], Any]


def law(x: Any) -> Any:
    return Lag(Linear(1500.0 * x), 0.004)


def car(x: Any) -> Any:
    return quarter_car_000(Linear(1500.0 * x))


def run(x: Any) -> Any:
    return bench.BenchRun("sine", T, X, V, 1500.0 * V * x)


def response(x: Any) -> Any:
    return simulate(car(x), BUMP, substeps=1, **RIDE)


def of_signal(*more: Any, **options: Any) -> list[Call]:
    """A signal that is traced, and the numbers after it."""
    return [lambda f, x: f(W * x, *more, **options)]


STEP = [lambda f, x: f(W, 1e-3 * x)]
SAMPLES: dict[str, dict[str, list[Call]]] = {
    "": {
        "respond": [
            lambda f, x: f(law(x), T, X, V),
            lambda f, x: f(law(1.0), T * x, X, V),
            lambda f, x: f(law(1.0), T, X * x),
            lambda f, x: f(law(1.0), T, X, V, state=x[None], return_state=True),
            lambda f, x: f(law(1.0), T, X, V, substeps=x),
        ],
        "simulate": [
            lambda f, x: f(car(x), BUMP, **RIDE).metrics(),
            lambda f, x: f(car(1.0), roads.cosine_bump(0.03 * x, duration=0.05), **RIDE),
            lambda f, x: f(car(1.0), BUMP, duration=x),
            lambda f, x: f(car(1.0), BUMP, duration=0.1, dt=1e-3 * x),
            lambda f, x: f(car(1.0), BUMP, substeps=x, **RIDE),
            lambda f, x: f(car(1.0), BUMP, every=x, **RIDE),
            lambda f, x: f(car(1.0), BUMP, start={"z_sprung": 0.01 * x}, **RIDE),
            lambda f, x: f(car(x), BUMP, engine=jaxdamp.simulation.Adaptive(), **RIDE),
            lambda f, x: f(car(x), BUMP, return_state=True, **RIDE),
            lambda f, x: response(x).between(0.0, 0.05),
            lambda f, x: (response(x).energy_balance(), response(x).comfort(), response(x).channels),
            lambda f, x: response(x).to_dict(),
            lambda f, x: response(x).table(),
            lambda f, x: repr(response(x)) + str(response(x).notes),
        ],
        "sweep": [
            lambda f, x: f(jaxdamp.Ride(car(1.0), BUMP, **RIDE), {"rate": 1500.0 * x * np.ones(2)}),
            lambda f, x: f(jaxdamp.Ride(car(x), BUMP, substeps=1, **RIDE), {"sprung_mass": [300.0, 310.0]}),
        ],
    },
    "bench": {
        "estimate_velocity": [lambda f, x: f(T, X * x), lambda f, x: f(T * x, X)],
        "low_pass_gain": [lambda f, x: f(x, 10.0, 1000.0)],
        **{
            name: [lambda f, x: f([run(x)])]
            for name in ("contradictions", "evaluate", "peak_velocity_points", "preflight")
        },
        **{
            name: [lambda f, x: f(run(x))]
            for name in (
                "continuous_velocity_loop",
                "separate_gas_and_friction",
            )
        },
    },
    "dampers": {
        "with_command": [lambda f, x: f(dampers.Scheduled((Linear(1.0), Linear(2.0)), [0, 1], 0.5), x)],
        "with_fitted_range": [lambda f, x: f(law(1.0), velocity=(-x, x)), lambda f, x: f(law(x), velocity=(-1.0, 1.0))],
    },
    "export": {
        "to_json": [lambda f, x: f(law(x))],
        "to_c": [lambda f, x: f(law(x), FOLDER / "law.c"), lambda f, x: f(car(x), FOLDER / "car.c")],
        "to_fmu": [lambda f, x: f(law(x), FOLDER / "law.fmu", compiler=None)],
        "to_matlab": [lambda f, x: f(law(x), FOLDER / "law.mat", F)],
        "to_explorer": [lambda f, x: f(law(x), FOLDER / "law.html")],
        **{
            name: [lambda f, x: f(law(x), FOLDER / "law", F), lambda f, x: f(law(1.0), FOLDER / "law", F * x)]
            for name in ("to_adams", "to_assetto_corsa", "to_carsim", "to_csv")
        },
    },
    "identify": {
        "compare": [lambda f, x: f({"lag": law(x)}, [RUN]), lambda f, x: f({"lag": law(1.0)}, [run(x)])],
        "control_charts": [lambda f, x: f({"force": [x * i for i in range(30)]}, 25)],
        "cross_validate": [lambda f, x: f({"lag": law(x)}, [RUN, RUN])],
        "default_ladder": [lambda f, x: f([run(x)])],
        "design_experiment": [
            lambda f, x: f(law(x), LIMITS, force_noise=5.0),
            lambda f, x: f(law(1.0), LIMITS, force_noise=5.0 * x),
        ],
        "error_shares": [lambda f, x: f(law(x), [RUN])],
        "fit": [
            lambda f, x: f(law(x), [RUN]),
            lambda f, x: f(law(1.0), [run(x)]),
            lambda f, x: x * f(Linear(1000.0), [RUN]).rmse,
            lambda f, x: f(law(1.0), [RUN], bounds={"lag_time": (1e-4 * x, 0.1)}),
        ],
        "fit_many": [lambda f, x: f(law(x), [[RUN], [RUN]])],
        "fit_scheduled": [lambda f, x: f(law(x), {0.0: [RUN], 1.0: [RUN]})],
        "fit_targets": [
            lambda f, x: f(lambda law: {"a": law.force_velocity(1.0)}, Linear(1500.0 * x), {"a": (1.0, 1.0)}),
            lambda f, x: f(lambda law: {"a": law.force_velocity(1.0)}, Linear(1500.0), {"a": (x, 1.0)}),
        ],
        "fit_vehicle": [lambda f, x: f(car(x), [])],
        "friction_ladder": [lambda f, x: f(car(x))],
        "prepare": [
            lambda f, x: f(law(x), [RUN]),
            lambda f, x: identify.prepare(law(1.0), [RUN]).residual(x * np.ones(2)),
        ],
        "solve": [lambda f, x: f(identify.prepare(law(x), [RUN]))],
        "train": [lambda f, x: f(law(x), [RUN], held_out=[RUN], steps=2)],
        "virtual_ride": [lambda f, x: f(car(x), BUMP, {"sprung_acceleration": 0.1}, duration=0.1)],
    },
    "metrics": {
        "aggregate_force": [
            lambda f, x: f(1e4 + np.stack([W, W]) * x, [0.0, 0.1], 1e-3),
            lambda f, x: f(1e4 + np.stack([W, W]), jnp.stack([0.0 * x, 0.1 * x]), 1e-3),
        ],
        "aggregate_force_percentile": of_signal(),
        "coherence": [lambda f, x: f(W * x, X, 1e-3), lambda f, x: f(W, X, 1e-3 * x), lambda f, x: f(W, X, 1e-3, x)],
        "comfort_reaction": [lambda f, x: f(x)],
        "crest_factor": of_signal(),
        "damper_temperature": [lambda f, x: f(W * x, 1e-3, 5e3, 10.0 * x, 293.0)],
        "damping_ratio": [lambda f, x: f(x)],
        "dissipated_energy": [lambda f, x: f(W * x, V, 1e-3 * x)],
        "dissipated_power": [lambda f, x: f(W * x, V)],
        "dissipation_histogram": [lambda f, x: f(W * x, V, [-1.0, 0.0, 1.0]), lambda f, x: f(W, V, np.arange(3.0) * x)],
        "dynamic_load_coefficient": [lambda f, x: f(W * x, 3e3 * x)],
        "equivalent_damping": [lambda f, x: f(W * x, V)],
        "estimated_vibration_dose_value": [lambda f, x: f(x, 60.0 * x)],
        "evaluation_method": [lambda f, x: f(W * x, 1e-3, "Wk"), lambda f, x: f(W, 1e-3 * x, "Wk")],
        "gaussian_exceedance": [lambda f, x: f(x, x, -1.0, 1.0)],
        "international_roughness_by_segment": [
            lambda f, x: f(W * x, 0.1),
            lambda f, x: f(W, 0.1 * x, segment=20.0 * x),
        ],
        "international_roughness_index": [lambda f, x: f(W * x, 0.1), lambda f, x: f(W, 0.1 * x)],
        "lift_off_fraction": [lambda f, x: f(W * x, 0.1 * x)],
        "logarithmic_decrement": [lambda f, x: f(W * x, final=0.1 * x)],
        "percentile": [lambda f, x: f(90.0 * x)],
        "peak": of_signal(),
        "power_spectral_density": [lambda f, x: f(W * x, 1e-3), *STEP, lambda f, x: f(W, 1e-3, overlap=0.5 * x)],
        "rainflow_cycles": of_signal(),
        "rms": of_signal(),
        "road_stress_factor": [lambda f, x: f(W * x, 3e3 * x)],
        "settling_time": [lambda f, x: f(W * x, 1e-3, 0.05 * x)],
        "smooth_peak": [lambda f, x: f(W * x, 16 * x)],
        "smooth_settling_time": [lambda f, x: f(W * x, 1e-3, 0.05 * x)],
        "spectral_damage": [lambda f, x: f(F * x, F * x, 4.0), lambda f, x: f(F, F, 4.0 * x)],
        "spectral_moments": [lambda f, x: f(F, F * x)],
        "temperature_rise": [lambda f, x: f(x, x, 5e3, 10.0)],
        "total_vibration": [lambda f, x: f({"seat_x": W * x}, 1e-3), lambda f, x: f({"seat_x": W}, 1e-3 * x)],
        "third_octave_rms": [lambda f, x: f(F, F * x), lambda f, x: f(F * x, F)],
        "transmissibility": [lambda f, x: f(W * x, X, 1e-3), lambda f, x: f(W, X, 1e-3 * x)],
        "velocity_histogram": [lambda f, x: f(V * x, [-1.0, 0.0, 1.0]), lambda f, x: f(V, np.arange(3.0) * x)],
        "vibration_total_value": [lambda f, x: f({"seat_x": x, "seat_z": x})],
        "weighting_factor": [lambda f, x: f(F * x, "Wk")],
        "working_space_exceedance": [lambda f, x: f(W * x, -x, x)],
        **{name: of_signal() for name in ("working_space_mean", "working_space_peak_to_peak", "working_space_rms")},
        **{
            name: [
                lambda f, x: f(W * x, 1e-3, "Wk"),
                lambda f, x: f(W, 1e-3 * x, "Wk"),
            ]
            for name in (
                "max_transient_value",
                "motion_sickness_dose",
                "shock_ratios",
                "vibration_dose_value",
                "weighted_rms",
                "weighted_signal",
            )
        },
        "motion_sickness_percentage": [lambda f, x: f(x, x)],
        "running_rms": [lambda f, x: f(W * x, 1e-3), lambda f, x: f(W, 1e-3 * x, 0.5 * x)],
    },
    "parameters": {
        "free_parameters": [
            lambda f, x: f(law(x)).values,
            lambda f, x: f(law(1.0)).build(x * np.ones(2)),
            lambda f, x: f(law(1.0), bounds={"lag_time": (1e-4 * x, 1.0)}).values,
        ],
        "get": [lambda f, x: f(law(x), "lag_time")],
        "interval": [lambda f, x: f(0.0, x)],
        "replace": [lambda f, x: f(law(1.0), {"lag_time": x})],
        "parameters": [lambda f, x: f(law(x))],
    },
    "plots": {
        "force_velocity": [lambda f, x: f(law(x))],
        "law_card": [lambda f, x: f(law(x))],
        "records": [lambda f, x: f([run(x)])],
        "ride": [lambda f, x: f(response(x))],
        "damper_use": [lambda f, x: f(response(x))],
        "damping_ratio": [lambda f, x: f(car(x)), lambda f, x: f(car(1.0), W * x)],
    },
    "rig": {
        "dynamic_stiffness": [
            lambda f, x: f(law(x), F, 0.01).stiffness,
            lambda f, x: f(law(1.0), F * x, 0.01).stiffness,
        ],
        "quasi_static": [lambda f, x: f(law(x), F), lambda f, x: f(law(1.0), F * x)],
    },
    "roads": {
        "assess_roughness": [lambda f, x: f(W * x, 0.1), lambda f, x: f(W, 0.1 * x)],
        "band_limited": [
            lambda f, x: f(1.0, rms=0.01 * x, duration=1.0, dt=0.005, seed=0).height(0.5),
            lambda f, x: f(high=50.0 * x, rms=0.01, duration=1.0, dt=0.005, seed=0).height(0.5),
            lambda f, x: f(1.0, rms=0.01, duration=x, dt=0.005, seed=0),
        ],
        "coherency": [lambda f, x: f(F * x, 1.5 * x)],
        "contact_patch": [lambda f, x: f(BUMP, length=0.1 * x, speed=10.0 * x).height(0.5)],
        "delayed": [lambda f, x: f(BUMP, positions=[0.0, 2.0], speed=10.0 * x).height(0.5)],
        "from_profile": [
            lambda f, x: f(np.arange(5.0), np.arange(5.0) * x, speed=10.0 * x).height(0.1),
            lambda f, x: f(np.arange(5.0) * x, np.arange(5.0)).height(0.1),
        ],
        "iso8608": [
            lambda f, x: f("C", 20.0 * x, length=200.0, seed=0).height(0.5),
            lambda f, x: f(64e-6 * x, 20.0, 1.0, seed=0).height(0.5),
            lambda f, x: f("C", 20.0, x, seed=0),
            lambda f, x: f("C", 20.0, 1.0, seed=x.astype(int)).height(0.5),
        ],
        "iso8608_filtered": [
            lambda f, x: f("C", 20.0 * x, length=200.0, seed=0).height(0.5),
            lambda f, x: f("C", 20.0, x, seed=0),
        ],
        "joined": [lambda f, x: f(BUMP, BUMP, at=x).height(0.5)],
        "in_phase": [lambda f, x: f(roads.cosine_bump(x, duration=0.1)).height(0.5)],
        "road_class": [lambda f, x: f(64e-6 * x)],
        "rolling_disc": [lambda f, x: f(BUMP, radius=0.3 * x, speed=10.0).height(0.5)],
        "sine": [lambda f, x: f(0.01 * x, frequency=2.0 * x).height(0.5)],
        "step": [lambda f, x: f(0.01 * x, start=x, ramp=0.01 * x).height(0.5)],
        "superposed": [lambda f, x: f(BUMP, roads.cosine_bump(x, duration=0.1)).height(0.5)],
        "sweep_sine": [
            lambda f, x: f(x, 20.0, duration=5.0, amplitude=0.01).height(0.5),
            *[lambda f, x: f(1.0, 20.0, duration=5.0 * x, amplitude=0.01).height(0.5)],
        ],
        "two_track": [
            lambda f, x: f(BUMP, roads.cosine_bump(x, duration=0.1)).height(0.5),
            *[lambda f, x: f(roads.iso8608("C", 20.0, 1.0, seed=0), track_width=1.5 * x, seed=1).height(0.5)],
        ],
        "wave_course": [lambda f, x: f(0.1 * x, 5.0 * x, 10.0 * x).height(0.5)],
        "white": [lambda f, x: f("C", 20.0 * x).velocity_psd, lambda f, x: f(64e-6 * x, 20.0).velocity_psd],
        "pothole": [lambda f, x: f(0.05 * x, length=1.0 * x, speed=10.0 * x).height(0.5)],
        **{
            name: [lambda f, x: f(0.05 * x, start=x, duration=x).height(0.5)]
            for name in ("cosine_bump", "half_sine_bump", "trapezoid_bump", "triangular_bump")
        },
    },
    "simulation": {
        **{name: [lambda f, x: f(response(x))] for name in ("comfort", "energy_balance", "ride_metrics")},
        "harmonic_response": [
            lambda f, x: f(car(x), F, 0.01, substeps=8).gain("z_sprung"),
            lambda f, x: f(car(1.0), F * x, 0.01 * x).gain("z_sprung"),
        ],
        "settled": [lambda f, x: f(car(x).system(), x[None])],
        "substeps_needed": [lambda f, x: f(car(x), 1e-3), lambda f, x: f(car(1.0), 1e-3 * x)],
    },
    "sweeps": {
        "points": [lambda f, x: f({"a": x * np.ones(2)})],
        "block_program": [lambda f, x: f(lambda point: {"y": point["a"]}, {"a": [1.0, x]})],
        "random": [lambda f, x: f({"a": (0.0, x)}, 2)],
        "sobol": [lambda f, x: f({"a": (0.0, x)}, 2)],
    },
    "tune": {
        "compare_dampers": [lambda f, x: f({"a": law(x), "b": law(1.0)}, quarter_car_000, [BUMP])],
        "knee": [lambda f, x: f(0.1, x)],
        "monotone": [lambda f, x: f(reach=x)],
        "ratio": [lambda f, x: f(0.1, 10.0, velocity=x)],
        "slope": [lambda f, x: f(0.1, x)],
        "minimise": [
            lambda f, x: f(RMS, car(x), BUMP, **RIDE),
            lambda f, x: f(RMS, car(1.0), roads.cosine_bump(x, duration=0.1)),
        ],
        "pareto": [lambda f, x: f([RMS, "rms_tyre_load_variation"], car(x), BUMP, **RIDE)],
        "robust": [lambda f, x: f(RMS, car(x), jaxdamp.tune.Scenarios([BUMP]), **RIDE)],
        "samples": [lambda f, x: f({"rate": x * np.ones(3)})],
        "sensitivity": [lambda f, x: f(RMS, car(x), BUMP, **RIDE)],
        "tolerance_effects": [
            lambda f, x: f(RMS, car(x), BUMP, {"rate": 0.1}, **RIDE),
            lambda f, x: f(RMS, car(1.0), BUMP, {"rate": 0.1 * x}, **RIDE),
        ],
        "tolerances": [lambda f, x: f({"rate": 0.1 * x}, 2)],
        "valving": [lambda f, x: f(law(x), dampers.MonoTube.reference())],
    },
    "vehicles": {
        "critical_damping": [lambda f, x: f(car(x))],
        "equivalent_dampers": [lambda f, x: f(car(x)), lambda f, x: f(car(1.0), x)],
        "frequency_response": [lambda f, x: f(car(x), F), lambda f, x: f(car(1.0), F * x)],
        "linearise": [
            lambda f, x: f(car(x)),
            lambda f, x: f(car(1.0), amplitude=0.01 * x, frequency=2.0 * x),
            lambda f, x: f(car(1.0), velocity_psd=1e-3 * x),
        ],
        "modes": [lambda f, x: f(car(x))],
        "oscillations": [lambda f, x: f(car(x))],
        "spectral_rms": [lambda f, x: f(car(x), F, F), lambda f, x: f(car(1.0), F * x, F * x)],
        "static_equilibrium": [lambda f, x: f(car(x)), lambda f, x: f(car(1.0), x[None])],
        "stationary_rms": [lambda f, x: f(car(x)), lambda f, x: f(car(1.0), x)],
    },
}
SAMPLES["rig"]["respond"] = SAMPLES[""]["respond"]
SAMPLES["simulation"]["simulate"] = SAMPLES[""]["simulate"]
SAMPLES["sweeps"]["sweep"] = SAMPLES[""]["sweep"]
