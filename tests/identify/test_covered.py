"""A fitted law says what its records covered."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from jaxdamp import bench, identify
from jaxdamp.bench import BenchRun, SineTest
from jaxdamp.dampers import Bilinear, Lag, Linear, Spring, TemperatureScaled, with_fitted_range
from jaxdamp.identify.covered import covered_range
from jaxdamp.rig import Rig, gas_and_friction


@pytest.fixture(scope="module")
def runs() -> tuple[BenchRun, ...]:
    dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), sampling_rate=500.0, force_noise=5.0)
    return tuple(
        dyno.run([SineTest(0.01, 1.0, cycles=3), SineTest(0.02, 2.0, cycles=3), SineTest(0.02, 4.0, cycles=3)])
    )


def ends(runs: tuple[BenchRun, ...], channel: str) -> tuple[float, float]:
    values = np.concatenate([getattr(run, channel) for run in runs])
    return float(values.min()), float(values.max())


@pytest.mark.parametrize("start", [Bilinear, Lag(Bilinear(2000.0, 1000.0), 0.002), Linear(1.0) + Spring(1.0, 0.0)])
def test_a_fit_states_what_the_fitted_records_cover(runs, start):
    covered: Any = identify.fit(start, runs, weighting=[1.0, 1.0, np.inf]).law.fitted_to
    for channel in ("velocity", "stroke", "force"):
        assert getattr(covered, channel) == ends(runs[:2], channel)
    assert covered.frequency == pytest.approx((1.0, 2.0), rel=1e-3)
    assert covered.temperature is covered.command is None


def test_a_fit_forgets_the_range_of_its_start(runs):
    start = Lag(with_fitted_range(Linear(1000.0), velocity=(-9.0, 9.0)), 0.002)
    law: Any = identify.fit(start, runs[:1]).law
    assert law.fitted_to.velocity == ends(runs[:1], "velocity") and law.law.fitted_to is None


def test_the_ranges_of_force_and_stroke_are_those_of_the_law_not_of_the_machine(runs):
    machine = Rig(force_offset=-80.0, gas_force=-300.0, gas_stiffness=2e3, friction=60.0, moving_mass=3.0)
    machine = dataclasses.replace(machine, stroke_offset=2e-3)

    def measured(run: BenchRun) -> BenchRun:
        stroke = run.stroke + 2e-3
        gas, friction = gas_and_friction(machine, stroke, run.velocity)
        inertia = machine.moving_mass * np.gradient(run.velocity, run.time)
        return dataclasses.replace(run, force=run.force + gas + friction + inertia - 80.0, stroke=stroke)

    shown = list(map(measured, runs))
    laws: list[Any] = [identify.fit(Bilinear(2000.0, 1000.0), shown, rig=machine).law]
    laws.append(identify.fit_many(Bilinear(2000.0, 1000.0), {"A": shown}, rig=machine, starts=1)["A"])
    for law in laws:
        assert law.fitted_to.stroke == pytest.approx(ends(runs, "stroke"), abs=1e-4)  # of 20 mm, 2 mm from the sensor
        assert law.fitted_to.force == pytest.approx(ends(runs, "force"), abs=15.0)  # of 1300 N


def test_the_force_of_a_law_is_without_the_zero_error_of_each_record(runs):
    zeros = zip(runs, (-300.0, 120.0, 700.0), strict=True)
    shown = [dataclasses.replace(run, force=run.force + zero) for run, zero in zeros]
    result = identify.fit(Bilinear(2000.0, 1000.0), shown, rig=["offset"], per_record=["rig.force_offset"])
    for law in (result.law, *result.record_laws):
        covered: Any = law.fitted_to
        assert covered.force == pytest.approx(ends(runs, "force"), abs=5.0)


def test_temperature_and_command_are_those_of_the_records_that_state_them(runs):
    stated = [
        dataclasses.replace(run, temperature=np.full(len(run), 300.0 + 10.0 * i), command=float(i))
        for i, run in enumerate(runs)
    ]
    covered = covered_range([runs[0], *stated[1:]])
    assert covered.temperature == (310.0, 320.0) and covered.command == (1.0, 2.0)


def test_training_and_cross_validation_state_it_too(runs):
    start = Lag(Linear(1500.0), 0.002)
    law: Any = identify.train(start, runs[:2], held_out=runs[2], weighting=[1.0, np.inf], steps=1).law
    assert law.fitted_to.velocity == ends(runs[:1], "velocity")
    for fold, out in zip(identify.cross_validate({"linear": Linear}, runs).folds, range(3), strict=True):
        kept = tuple(run for i, run in enumerate(runs) if i != out)
        assert fold.result.law.fitted_to.velocity == ends(kept, "velocity")


def test_many_fits_state_the_temperatures_of_a_law_that_depends_on_them(runs):
    start = TemperatureScaled(Linear(1500.0), temperature=293.15)
    stated = [dataclasses.replace(run, settings={"temperature": f"{20 + 30 * i} degC"}) for i, run in enumerate(runs)]
    many = identify.fit_many(start, {"A": stated}, starts=1)
    alone = identify.fit(start, stated, starts=1, weighting=np.array([5.0] * len(stated))).law
    assert alone.fitted_to is not None and alone.fitted_to.temperature is not None
    assert many["A"].fitted_to == alone.fitted_to
