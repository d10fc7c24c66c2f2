"""Fits of a law together with the machine that its records come from."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import BenchRun, BenchSet, SineTest, VirtualDyno
from jaxdamp.dampers import (
    AbstractDamper,
    Besinger,
    Bilinear,
    BoucWen,
    CoulombFriction,
    Lag,
    Linear,
    SeriesSpring,
    Spring,
    Table,
)
from jaxdamp.export import from_json, to_json
from jaxdamp.identify.machine import lag_time
from jaxdamp.identify.model import on_rig
from jaxdamp.identify.predicting import score
from jaxdamp.parameters import get
from jaxdamp.rig import Rig


LAW, START = Bilinear(2600.0, 1200.0), Bilinear(1500.0, 1500.0)
TESTS = [SineTest(0.02, 1.0), SineTest(0.01, 4.0), SineTest(0.005, 10.0)]
RIG = Rig(gas_force=-120.0, force_offset=25.0, force_delay=1e-3)


def records(
    law: AbstractDamper = LAW, rig: Rig = RIG, tests: list[SineTest] = TESTS, rate: float = 500.0, **more: Any
) -> BenchSet:
    return VirtualDyno(law, rig=rig, force_noise=5.0, sampling_rate=rate, seed=1, **more).run(tests)


def assert_recovered(result: identify.FitResult, law: AbstractDamper, rig: Rig) -> None:
    rows = result.table(law, true_rig=rig).rows
    away = {str(row[0]): float(str(row[5])) for row in rows}
    assert all(abs(a) < 3.0 for a in away.values()), away


@pytest.fixture(scope="module")
def result() -> identify.FitResult:
    """Gas force known, offset and delay not."""
    start = Rig(gas_force=-120.0, force_offset=-5.0, force_delay=2e-4)
    return identify.fit(START, records(), rig=start, freeze=["gas_force"])


def test_law_and_machine_are_recovered_together(result):
    assert [e.name for e in result.parameters] == [
        "law.rebound_rate",
        "law.compression_rate",
        "rig.force_delay",
        "rig.force_offset",
    ]
    assert result["rig.force_delay"].unit == "s"
    assert result.converged and not result.warnings
    assert result.fit_percent > 97.0
    assert result.rmse == pytest.approx(5.0, rel=0.05)
    assert_recovered(result, LAW, RIG)
    assert result["rig.force_delay"].standard_error < 3e-5
    assert isinstance(result.law, Bilinear) and result.rig.gas_force == -120.0


def test_a_fit_without_the_machine_is_wrong_and_says_so(result):
    blind = identify.fit(START, records())
    rate = blind["rebound_rate"]
    assert abs(rate.value - 2600.0) > 500.0  # the offset pulls both slopes together
    assert rate.standard_error > 100.0  # inflated by the correlation of the residual
    assert any("intervals hold for this law, not for the damper" in warning for warning in blind.warnings)
    assert blind.rig is None and blind.fit_percent < result.fit_percent - 15.0


def test_predictions_are_those_of_the_machine(result):
    new = VirtualDyno(LAW, rig=RIG, sampling_rate=500.0).run(SineTest(0.015, 3.0))[0]
    force = result.respond(new)
    used = slice(len(new) // 6, -3)
    np.testing.assert_allclose(force[used], new.force[used], atol=4.0)  # of 730 N
    np.testing.assert_allclose(result.score([new])[1], np.std(force[used] - new.force[used]), rtol=0.5)
    alone = np.asarray(result.law.force_velocity(0.2))
    assert float(alone) == pytest.approx(520.0, abs=2.0)
    assert sum(result.error_shares) == pytest.approx(1.0)


def test_the_machine_is_kept_with_the_result(result):
    assert from_json(to_json(result.rig)).force_delay == result.rig.force_delay
    assert result.to_dict()["rig"].startswith("Rig(gas_force=-120.0")
    assert result.law.fitted_to is not None


def test_a_lag_of_nothing_is_scored_as_none():
    """Such as one that a fit ends at: all samples count that do with a lag of zero."""
    (run,) = records(LAW, Rig(force_lag=2e-3), [SineTest(0.02, 4.0)])
    none, least, short = (score(on_rig(START, Rig(force_lag=lag)), [run]) for lag in (0.0, 2e-9, 1e-5))
    assert least[:2] == pytest.approx(none[:2], rel=1e-6)
    assert short[:2] == pytest.approx(none[:2], rel=1e-2)


def test_gas_and_offset_cannot_be_told_apart():
    found = identify.fit(START, records(rig=replace(RIG, force_delay=0.0)), rig=Rig(gas_force=-10.0, force_offset=1.0))
    assert found.steps == 0  # all of it linear: a closed form
    assert any("rig.gas_force and rig.force_offset" in warning for warning in found.warnings)
    total = found["rig.gas_force"].value + found["rig.force_offset"].value
    assert total == pytest.approx(-95.0, abs=1.0)


def test_an_offset_of_each_record():
    offsets = (20.0, -30.0, 5.0)
    pairs = zip(TESTS, offsets, strict=True)
    runs = [records(rig=Rig(gas_force=-120.0, force_offset=off), tests=[test])[0] for test, off in pairs]
    start = Rig(gas_force=-120.0, force_offset=1.0)
    found = identify.fit(START, runs, rig=start, freeze=["gas_force"], per_record=["force_offset"])
    for i, offset in enumerate(offsets):
        estimate = found[f"rig.force_offset[{i}]"]
        assert abs(estimate.value - offset) < 3 * estimate.standard_error
        assert float(found.record_rigs[i].force_offset) == pytest.approx(estimate.value)
    assert found.rig is not None and found.rig.force_offset == pytest.approx(
        np.mean([r.force_offset for r in found.record_rigs])
    )
    assert found.error_shares.shape < 0.05


def test_temperature_slope_by_the_measured_temperature():
    rig = Rig(temperature_slope=0.003, heating=0.01, cooling=0.01)
    runs = records(rig=rig, tests=[SineTest(0.02, f, cycles=40) for f in (2.0, 4.0)], temperature_channel=True)
    assert all(run.temperature is not None and run.temperature.max() > 293.15 + 5.0 for run in runs)
    found = identify.fit(START, runs, rig=Rig(temperature_slope=1e-3))
    assert_recovered(found, LAW, rig)
    assert found["rig.temperature_slope"].standard_error < 1e-4
    some = [runs[0], replace(runs[1], temperature=None)]
    with pytest.raises(ValueError, match="`runs` must all state their temperature, but is without one: 20mm_4Hz"):
        identify.fit(START, some, rig=Rig(temperature_slope=1e-3))


def test_comparisons_and_cross_validations_take_the_machine():
    runs, rig = records(rig=Rig(gas_force=-120.0)), Rig(gas_force=-10.0)
    laws = {"linear": Linear, "bilinear": Bilinear}
    best = identify.compare(laws, runs, rig=rig).best
    assert best.name == "bilinear"
    assert best.result["rig.gas_force"].value == pytest.approx(-120.0, abs=1.0)
    validated = identify.cross_validate({"bilinear": Bilinear}, runs, rig=rig)
    assert all(fold.fit_percent > 90.0 for fold in validated.folds)


def test_a_bare_law_in_a_comparison_is_fitted_beside_an_offset():
    damper = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
    runs = records(damper, Rig(gas_force=-250.0, force_offset=20.0))
    found = identify.compare({"besinger": Besinger, "spring": Linear(1000.0) + Spring(1000.0)}, runs)
    rate = found["besinger"]["rebound_rate"]
    assert rate.name == "law.rebound_rate" and rate.value == pytest.approx(float(damper.rebound_rate), rel=0.05)
    assert found["besinger"]["force_offset"].value == pytest.approx(-230.0, abs=3.0)
    # the preload of a spring is a static force too: it is the machine's, as beside every law
    assert found["spring"]["force_offset"].value < -100.0 and float(get(found["spring"].law, "terms.1.preload")) == 0.0
    assert any("The static force of -1" in warning for warning in found["spring"].warnings)
    without = identify.fit(Besinger, runs)
    assert abs(without["rebound_rate"].value - rate.value) > 0.5 * rate.value
    assert any("look like a constant force of -" in warning for warning in without.warnings)


def test_every_law_is_without_the_static_force_that_the_machine_has():
    runs = records(Linear(1800.0), Rig(gas_force=-90.0), tests=[SineTest(0.01, 1.0, cycles=3)], rate=250.0)
    starts = {"table": Table, "bouc_wen": BoucWen, "sum": Bilinear(2000.0, 1000.0) + Spring(1000.0)}
    for name, start in starts.items():
        found = identify.fit(start, runs, rig="offset", starts=1)
        assert found.rig is not None
        static = float(found.rig.force_offset)
        assert static == pytest.approx(-90.0, abs=15.0), name
        assert abs(float(found.law.force(0.0, 0.0, found.law.initial_state()))) < 2.0, name
        assert found.fit_percent == pytest.approx(found.score(runs)[0])  # the machine adds it again
        assert any(f"The static force of {static:.0f} N is gas force or zero error" in said for said in found.warnings)
    # what the call gives a value keeps it
    stated = identify.fit(Bilinear(2000.0, 1000.0) + Spring(1000.0, -50.0), runs, rig="offset")
    assert stated.rig is None and stated["preload"].value == pytest.approx(-90.0, abs=15.0)
    named = identify.fit(
        Bilinear(2000.0, 1000.0) + Spring(1000.0), runs, rig="offset", bounds={"preload": (-99.0, 9.0)}
    )
    assert named.rig is None and named["preload"].value == pytest.approx(-90.0, abs=15.0)


def test_a_constant_force_shows_no_lag():
    time = np.arange(500) / 500.0
    assert lag_time([BenchRun.from_arrays("held", time, 0.01 * np.sin(6.0 * time), np.full(500, 100.0))]) == 1e-3


@pytest.mark.parametrize("effect", ["delay", "mass", "friction", "gas_stiffness"])
def test_a_machine_without_a_static_force_leaves_it_to_the_law(effect):
    law = Bilinear(2600.0, 1200.0) + Spring(1000.0, -90.0)
    runs = records(law, Rig(), tests=[SineTest(0.01, 1.0, cycles=3), SineTest(0.005, 6.0)], rate=250.0)
    beside = identify.fit(Bilinear(2000.0, 1000.0) + Spring(900.0), runs, rig=effect, starts=1)
    assert beside["preload"].value == pytest.approx(-90.0, abs=5.0) and beside.rmse < 6.0


def test_names_of_effects_get_their_starts_from_the_records():
    rig = Rig(gas_force=-120.0, force_delay=2e-3)
    result = identify.fit(Bilinear, records(rig=rig), rig=["gas", "delay"])
    assert_recovered(result, LAW, rig)
    assert identify.machine_names("rig", ["gas, delay", "gas"]) == ["gas", "delay"]
    with pytest.raises(ValueError, match=r"`rig` must be one of .*Did you mean 'delay'"):
        identify.fit(LAW, records(), rig="dely")


@pytest.mark.parametrize(
    ("rig", "words"),
    [
        (Rig(force_delay=2e-3), "a delay of the force by 0.00"),
        (Rig(moving_mass=3.0), "a moving mass of "),
        (Rig(friction=60.0), "friction of "),
        (Rig(temperature_slope=0.004, heating=0.02), "damping that falls as the oil warms up"),
        (Rig(), ""),
    ],
    ids=lambda p: p if isinstance(p, str) else "",
)
def test_what_is_left_out_is_named(rig, words):
    tests = [SineTest(0.02, f, cycles=20 if "oil" in words else 4) for f in (1.0, 3.0, 8.0)]
    found = [w for w in identify.fit(START, records(rig=rig, tests=tests)).warnings if "leaves out" in w]
    assert len(found) == bool(words) and all(words in warning for warning in found), found


def test_a_network_is_trained_together_with_the_machine():
    runs = records(rig=Rig(gas_force=-120.0))
    trained = identify.train(Linear(1000.0), runs[:2], held_out=runs[2], rig="gas", steps=100, samples_per_cycle=50)
    assert trained.rig is not None and float(trained.rig.gas_force) < -30.0
    assert isinstance(trained.law, Linear) and "gas_force" in trained.to_dict()["rig"]


def test_what_a_fit_refuses():
    runs = records()
    with pytest.raises(ValueError, match="`rig` must have a number that is not at its default"):
        identify.fit(START, runs, rig=Rig())
    with pytest.raises(
        ValueError, match=r"rig.friction, which the rig leaves out. Give it a start: `rig=Rig\(friction="
    ):
        identify.fit(START, runs, rig=Rig(gas_force=-1.0), per_record=["rig.friction"])


@pytest.mark.exhaustive
def test_a_law_with_states_and_everything_that_a_machine_adds():
    """Heat and lag too; the friction of the machine is told from the law by its velocity alone, so it stays out."""
    law = SeriesSpring(Bilinear(2600.0, 1200.0), 3e5)
    rig = Rig(gas_force=-120.0, gas_stiffness=1500.0, force_delay=1e-3, moving_mass=4.0, temperature_slope=0.002)
    rig = replace(rig, heating=0.01, cooling=0.02)
    tests = [SineTest(0.02, 1.0, cycles=20), SineTest(0.01, 4.0, cycles=80), SineTest(0.005, 12.0, cycles=200)]
    runs = records(law, rig, tests, rate=1000.0)
    start = Rig(-20.0, 500.0, force_delay=2e-4, moving_mass=1.0, temperature_slope=1e-3, heating=0.01, cooling=0.02)
    stiff = SeriesSpring(START, 1e5)
    found = identify.fit(stiff, runs, rig=start, freeze=["cubic_stiffness", "heating", "cooling"])
    assert found.fit_percent > 97.0
    assert_recovered(found, law, rig)


def test_friction_of_law_and_machine_are_one():
    """What the machine's friction explains is what a friction in the law explains."""
    law = Linear(1500.0) + CoulombFriction(30.0, 0.02)
    runs = records(law, Rig(), tests=[SineTest(0.02, 1.0)])
    start = Rig(friction=5.0, friction_velocity=0.02)
    found = identify.fit(Linear(1000.0), runs, rig=start, freeze=["friction_velocity"])
    assert found.steps == 0
    assert abs(found["rig.friction"].value - 30.0) < 3 * found["rig.friction"].standard_error
    assert isinstance(runs[0], BenchRun)


def test_a_pattern_with_another_meaning_beside_a_machine_is_refused() -> None:
    """Paths of a law begin with "law." beside a machine, and those of a law in a wrapper by themselves."""
    law, runs = Lag(LAW, 0.005), records(tests=TESTS[:1])
    assert identify.prepare(law, runs, freeze=["law.*"]).free.names == ["lag_time"]
    refused = r"`freeze` .* 'law\.\*'.*law\.law\.rebound_rate, .* of the law, but law\.lag_time beside a machine"
    with pytest.raises(ValueError, match=refused):
        identify.prepare(law, runs, rig="offset", freeze=["law.*"])
    with pytest.raises(ValueError, match="`over`"):
        identify.prepare(law, runs, rig="offset", over="law.*")
    clear = {"law.law.*": ["law.lag_time"], "law.lag_time": ["law.law.rebound_rate", "law.law.compression_rate"]}
    for pattern, left in clear.items():
        free = identify.prepare(law, runs, rig="offset", freeze=[pattern]).free
        assert free.names == [*left, "rig.force_offset"]
    assert identify.prepare(LAW, runs, rig="offset", freeze=["law.*"]).free.names == ["rig.force_offset"]


def test_a_whole_path_of_the_law_is_the_same_number_beside_a_machine() -> None:
    """Two numbers of one name: of the outer law, whose whole path it is, and of the law inside."""
    runs = records(tests=TESTS[:1])
    alone = Lag(Lag(LAW, 0.004), 0.006)
    with_machine = identify.prepare(alone, runs, rig="offset", freeze=["lag_time", "*_rate"])
    assert with_machine.free.names == ["law.law.lag_time", "rig.force_offset"]
    bound = identify.prepare(alone, runs, rig="offset", bounds={"lag_time": (5e-3, 7e-3)})  # the inner one is outside
    assert {"law.lag_time", "law.law.lag_time"} < set(bound.free.names)
    many = identify.fit_many(alone, {"a": runs, "b": runs}, rig="offset", freeze=["lag_time", "*_rate"], max_steps=1)
    assert many.free.names == with_machine.free.names
    both = r"'law\.lag_time'.* It is law\.law\.lag_time of the law, but law\.lag_time beside a machine"
    arguments: tuple[dict[str, Any], ...] = (
        {"freeze": ["law.lag_time"]},
        {"bounds": {"law.lag_time": (1e-3, 1e-2)}},
        {"over": ["law.lag_time"]},
    )
    for argument in arguments:
        assert identify.prepare(alone, runs, **argument)
        with pytest.raises(ValueError, match=both + r".*Write 'lag_time' or 'law\.law\.lag_time'"):
            identify.prepare(alone, runs, rig="offset", **argument)
