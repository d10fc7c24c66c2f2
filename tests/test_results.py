"""The contract of results: status, warnings, summary, table, plot, plain data, report, of every result class."""

import copy
import importlib
import inspect
import json
import pkgutil
from types import ModuleType
from typing import Any, cast

import equinox as eqx
import matplotlib.figure
import numpy as np
import pytest

import jaxdamp
from jaxdamp import bench, dampers, identify, rig, roads, tune, vehicles
from jaxdamp._guesses import shared_names
from jaxdamp._results import AbstractResult, worst_status
from jaxdamp._status import Status
from jaxdamp._tables import Table
from jaxdamp.parameters import free_parameters
from jaxdamp.tune.decisions import Difference
from jaxdamp.tune.front import FrontParameter
from jaxdamp.tune.measuring import Measurement
from jaxdamp.tune.ranges import Change
from jaxdamp.tune.result import ScenarioValues
from jaxdamp.tune.valving_result import OutOfReach, ValveParameter


CAR = vehicles.presets.quarter_car_000()
# They have a table, but are records, a dictionary or a tuple of numbers.
NO_RESULTS = {"BenchSet", "ForceVelocityTable", "MetricValues", "RoughnessBySegment", "Report"}


def result_classes() -> list[type[AbstractResult]]:
    """Every result class of the package that can be made."""
    for module in pkgutil.walk_packages(jaxdamp.__path__, "jaxdamp."):
        if not module.name.startswith(("jaxdamp.cli", "jaxdamp.__main__")):
            importlib.import_module(module.name)
    found, waiting = [], [AbstractResult]
    while waiting:
        below = waiting.pop().__subclasses__()
        waiting += below
        found += [each for each in below if not inspect.isabstract(each) and each.__module__.startswith("jaxdamp.")]
    return sorted(dict.fromkeys(found), key=lambda each: each.__name__)


def _runs() -> list[bench.BenchRun]:
    dyno = bench.VirtualDyno(dampers.Bilinear(2600.0, 1200.0), force_noise=5.0, seed=1)
    tests = [bench.SineTest(amplitude=0.02, frequency=f, cycles=6) for f in (1.0, 2.0)]
    return [bench.BenchRun.from_arrays(r.name, r.time, r.stroke, r.force, command=c)
            for r, c in zip(dyno.run(tests), (1.0, 2.0), strict=True)]  # fmt: skip


def _bench_results() -> list[AbstractResult]:
    evaluation = bench.evaluate(_runs())
    (gas, *_) = evaluation.gas_and_friction.values()
    limits = [bench.Limit("friction", maximum=50.0), bench.Limit("gas force", minimum=100.0)]
    return [evaluation, gas, evaluation.check(limits), bench.preflight(_runs())]


def _fits() -> list[AbstractResult]:
    runs = _runs()
    fit = identify.fit(dampers.Bilinear(2000.0, 1000.0), runs)
    evidence, law, by_setting = fit.evidence, fit.law, cast(Any, identify.fit)
    assert evidence is not None
    spread = identify.Spread("rebound_rate", "N s/m", 1.0, 0.1, (0.8, 1.2), 1.2, 50.0)
    design = identify.ExperimentDesign(law, (bench.SineTest(0.02, 1.0),), free_parameters(law), np.eye(2), "D")
    training = identify.Training(
        law=law, runs=fit.runs, fit_percent=90.0, rmse=5.0, scores=fit.scores, warnings=(), status=Status.ALL_STEPS,
        held_out=(), held_out_fit_percent=90.0, held_out_rmse=5.0, steps=np.arange(2.0), history=np.ones(2),
        held_out_history=np.ones(2), best_step=1, stopped="all steps taken",
    )  # fmt: skip
    return [
        fit,
        fit.profile("rebound_rate"),
        fit.band(np.array([-0.1, 0.1])),
        fit.sensitivity_to_records(lambda law: law.force_velocity(0.1)),
        identify.Posterior(evidence, np.ones((5, 1)), (spread,), 1),
        design,
        training,
        identify.compare({"linear": dampers.Linear}, runs),
        identify.cross_validate({"linear": dampers.Linear}, runs),
        identify.fit_many(dampers.Linear, {"a": runs[:1], "b": runs[1:]}),
        by_setting(law=dampers.Linear, runs=runs, scheduled=True),
        identify.control_charts({"force": np.random.default_rng(0).standard_normal(30)}, 25),
        identify.fit_targets(lambda n: {"y": n["x"] ** 2}, {"x": 1.0}, {"y": 4.0}),
    ]


def _vehicle_results() -> list[AbstractResult]:
    road, car = roads.sweep_sine(1.0, 4.0, duration=1.0, velocity_amplitude=0.1), CAR
    record = identify.virtual_ride(car, road, {"stroke": 1e-5}, sampling_rate=100.0)
    heights = 0.01 * np.random.default_rng(1).standard_normal(2000)
    return [
        identify.fit_vehicle(car, record, over=["damper.rate"], dt=5e-3),
        identify.compare({"alone": car}, record, over=["damper.rate"], dt=5e-3),
        vehicles.modes(car),
        jaxdamp.sweep(
            lambda p: {"y": p["a"] ** 2}, {"a": [1.0, 2.0]}, summary=jaxdamp.sweeps.Summary(smallest={"y": 1})
        ),
        jaxdamp.simulate(car, road, dt=5e-3),
        jaxdamp.simulation.harmonic_response(car, [1.0, 2.0], 0.01, substeps=4),
        rig.dynamic_stiffness(dampers.Linear(1500.0), [1.0, 2.0], [[0.01], [0.02]]),
        roads.assess_roughness(heights, 0.1),
    ]


def _tunings() -> list[AbstractResult]:
    name, units, one = "rms_sprung_acceleration", {"rms_sprung_acceleration": "m/s^2"}, np.array([1.0])
    tuning = tune.TuneResult(
        vehicle=CAR, start=CAR, metric=name, parameters=(Change("damper.rate", 2.0, 1.0, "N", "", 0.0, 5.0),),
        before={name: 2.0}, after={name: 1.5}, units=units, limits={}, active_limits=(), warnings=("Mind the kink.",),
        status=Status.STEP_LIMIT, history=(1.8, 1.5),
        scenarios=ScenarioValues(("laden",), {name: one}, {name: one}),
    )  # fmt: skip
    free = free_parameters(CAR, over=["damper.rate"])
    front = tune.ParetoFront(
        start=CAR, names=(name, "rms_dynamic_tyre_load"),
        values={name: np.array([1.0, 2.0]), "rms_dynamic_tyre_load": np.array([400.0, 300.0])},
        before={name: 2.0, "rms_dynamic_tyre_load": 500.0}, units=units | {"rms_dynamic_tyre_load": "N"},
        parameters=(FrontParameter("damper.rate", "N s/m", 1500.0, 100.0, 5000.0),),
        designs=np.array([[1000.0], [2000.0]]), limits={}, reference={name: 2.0, "rms_dynamic_tyre_load": 500.0},
        warnings=(), status=Status.CONVERGED, evaluations=2, interpolated=0, dropped=0, free=free,
        measured=object.__new__(Measurement), fresh={},
    )  # fmt: skip
    sensitivity = tune.Sensitivity({name: 2.0}, units, ("damper.rate",), ("N s/m",), np.array([1500.0]),
                                   {name: np.array([0.0])}, {})  # fmt: skip
    difference = Difference("new", name, -10.0, 2.0, 3.0, 8.0)
    law, speed = dampers.MonoTube.reference(), np.array([-0.1, 0.1])
    valve = ValveParameter("bleed", "m^2", 1e-6, 2e-6, 0.0, 2e-6, "at its upper bound", "area")
    part = OutOfReach("rebound", 0.05, 0.1, -20.0, 0.1, ("bleed",))
    valving = tune.ValvingResult(
        law=law, start=law, parameters=(valve,), velocity=speed, target_force=1000.0 * speed, force=900.0 * speed,
        curve_points=2, loop_lengths=(), rmse=10.0, error_percent=10.0, tolerance=0.02, out_of_reach=(part,),
        status=Status.CONVERGED, cavities=np.array([True, False]),
    )  # fmt: skip
    return [
        tuning,
        tune.Rescore({name: np.array([2.0, 1.0])}, {name: np.array([1.0, 0.9])}, units, name),
        front,
        sensitivity,
        valving,
        tune.DamperComparison(
            {"old": {name: one}, "new": {name: 0.9 * one}}, {"old": {name: 0.1}, "new": {name: 0.1}},
            {"old": {name: 0.1}, "new": {name: 0.1}}, (difference,), units, ("Unknown.",)),
    ]  # fmt: skip


@pytest.fixture(scope="module")
def samples() -> dict[type, AbstractResult]:
    """A result of each class."""
    return {type(each): each for each in (*_bench_results(), *_fits(), *_vehicle_results(), *_tunings())}


def test_every_result_class_has_a_sample_here(samples) -> None:
    assert {each.__name__ for each in samples} == {each.__name__ for each in result_classes()}


@pytest.mark.parametrize("kind", result_classes(), ids=lambda kind: kind.__name__)
def test_a_result_keeps_the_contract(kind, samples, tmp_path) -> None:
    result = samples[kind]
    status = result.status if isinstance(result.status, tuple) else (result.status,)
    assert status and all(isinstance(each, Status) for each in status)
    assert result.converged is all(each.good for each in status)
    assert isinstance(result.warnings, tuple) and all(isinstance(each, str) and each for each in result.warnings)
    assert isinstance(result.summary, str) and result.summary
    assert isinstance(result.table(), Table) and all(isinstance(each, Table) for each in result.tables().values())
    assert isinstance(result.plot(), matplotlib.figure.Figure)
    assert [*map(repr, copy.deepcopy(result).tables().values())] == [*map(repr, result.tables().values())]
    if not issubclass(kind, eqx.Module):  # compared, and looked for in a set, as an object: arrays have no one truth
        assert result != copy.copy(result) and len({result, result}) == 1
    data = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert data["summary"] == result.summary and data["warnings"] == list(result.warnings)
    assert data["converged"] is result.converged and set(data) > {"summary", "status", "converged", "warnings"}


@pytest.mark.parametrize("kind", ["ProfileCurve", "Rescore"])
def test_a_result_writes_its_page(kind, samples, tmp_path) -> None:
    result = next(each for each in samples.values() if type(each).__name__ == kind)
    page = result.report(tmp_path / "page.html", title="A page").read_text(encoding="utf-8")
    assert "<h1>A page</h1>" in page and "data:image/png" in page
    assert result.table().title.replace("_", " ") in page


def _names(package: ModuleType) -> list[str]:
    return [*package.__all__, *shared_names(package)]


def test_whatever_has_a_table_is_a_result() -> None:
    others = {
        name
        for package in ("bench", "identify", "roads", "simulation", "tune", "vehicles")
        for name in _names(getattr(jaxdamp, package))
        if inspect.isclass(each := getattr(getattr(jaxdamp, package), name))
        and hasattr(each, "table")
        and not issubclass(each, AbstractResult)
    }
    assert others <= NO_RESULTS


def test_the_worst_of_several_ends_counts() -> None:
    assert worst_status([Status.CONVERGED, Status.STEP_LIMIT, Status.NO_STEP]) is Status.STEP_LIMIT
    assert worst_status([Status.COMPUTED, Status.CONVERGED]) is Status.COMPUTED


def test_a_metric_that_nothing_changes_is_named(samples) -> None:
    assert samples[tune.Sensitivity].warnings == (
        "rms_sprung_acceleration does not depend on any of these numbers here.",
    )
