"""Each artefact of the virtual dyno is found, named and sized; clean records raise nothing."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno, preflight, read
from jaxdamp.dampers import Besinger, Bilinear, CoulombFriction, Linear, StribeckFriction


LAWS = {
    "bilinear": Bilinear(2600.0, 1200.0),
    "friction": Linear(2000.0) + CoulombFriction(60.0, 0.01),
    "besinger": Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05),
}
SENSORS: dict[str, Any] = {"force_noise": 4.0, "stroke_noise": 1e-5, "sampling_rate": 1000.0}
STEADY = SineTest(0.02, 2.0, cycles=10)
RESTING = SineTest(0.02, 2.0, cycles=6, rest_before=1.0, run_up=1.5, run_down=1.5, rest_after=2.0)


def recorded(seed=0, test=STEADY, law="besinger", **faults):
    return VirtualDyno(LAWS[law], seed=seed, **{**SENSORS, **faults}).run(test)[0]


# fault: what the dyno does, under which test; the name of the finding, its size, its relative error, others allowed
ARTEFACTS: dict[str, Any] = {
    "rest before": ({}, RESTING, 1.0, 0.3, {"rest after", "run-up", "run-down"}),
    "rest after": ({}, RESTING, 2.0, 0.2, {"rest before", "run-up", "run-down"}),
    "run-up": ({}, RESTING, 1.5, 0.35, {"rest before", "rest after", "run-down"}),
    "run-down": ({}, RESTING, 1.5, 0.35, {"rest before", "rest after", "run-up"}),
    "few samples": ({"sampling_rate": 40.0}, STEADY, 20.0, 0.01, set()),
    "few cycles": ({}, SineTest(0.02, 2.0, cycles=2), 2.0, 0.0, set()),
    "force clipped": ({"force_limit": 450.0}, STEADY, 450.0, 1e-6, set()),
    "stroke clipped": ({"stroke_limit": 0.018}, STEADY, 0.018, 1e-6, set()),
    "force spikes": ({"spike_rate": 1.0, "spike_size": 200.0}, STEADY, 200.0, 0.1, set()),
    "force quantised": ({"force_resolution": 5.0, "force_noise": 1.0}, STEADY, 5.0, 1e-6, set()),
    "stroke quantised": ({"stroke_resolution": 1e-4, "stroke_noise": 0.0}, STEADY, 1e-4, 1e-6, set()),
    "force ripple": ({"mains_ripple": 10.0}, STEADY, 10.0, 0.15, set()),
    "stroke ripple": ({"stroke_ripple": 5e-5, "mains_frequency": 60.0}, STEADY, 5e-5, 0.05, set()),
    "delay": ({"force_delay": 0.003}, STEADY, 0.003, 0.05, set()),
    "clock jitter": ({"clock_jitter": 2e-4}, STEADY, 2e-4, 0.2, set()),
    "gas force": ({"gas_force": -150.0}, STEADY, -150.0, 0.06, set()),
    "static force against gas": ({"force_offset": 80.0}, STEADY, 80.0, 0.1, set()),
    "force stuck": ({"force_stuck_from": 3.1}, STEADY, 3.1, 0.001, set()),
    "stroke stuck": ({"stroke_stuck_from": 3.1}, STEADY, 3.1, 0.001, set()),
}


def check(name, seed):
    faults, test, size, error, allowed = ARTEFACTS[name]
    found = preflight(recorded(seed, test, **faults))
    finding = found.named(name)[0]
    assert abs(finding.size or 0.0) == pytest.approx(abs(size), rel=error, abs=1e-12)
    assert {other.name for other in found.findings} - {name} <= allowed
    assert finding.remedy and finding.record == test.name
    assert found.ok == (not name.endswith(("clipped", "stuck")))


@pytest.mark.parametrize("name", ARTEFACTS)
def test_an_artefact_is_found_named_and_sized(name):
    for seed in range(1):
        check(name, seed)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ARTEFACTS)
def test_an_artefact_is_found_over_many_seeds(name):
    for seed in range(50):
        check(name, seed)


def clean(seed):
    """A record without artefacts, of any of the laws, motions, rates and noises, cut anywhere."""
    rng = np.random.default_rng(seed)
    amplitude, frequency = [(0.03, 0.5), (0.02, 2.0), (0.008, 8.0)][seed % 3]
    law = list(LAWS)[seed // 3 % 3]
    cycles = int(rng.integers(5, 15))
    sensors = {"force_noise": rng.uniform(0.0, 20.0), "stroke_noise": 10 ** rng.uniform(-6, -4.5)}
    run = recorded(seed, SineTest(amplitude, frequency, cycles=cycles), law, **sensors)
    return run.between(run.time[0] + rng.uniform(0.0, 1.0) / frequency, run.time[-1])


def test_clean_records_raise_nothing():
    for seed in range(9):
        found = preflight(clean(seed))
        assert found.findings == () and "nothing odd" in repr(found), repr(found)


@pytest.mark.exhaustive
def test_false_alarms_are_rare():
    alarms = [seed for seed in range(200) if preflight(clean(seed)).findings]
    assert len(alarms) < 4


def test_a_force_that_leads_is_early():
    (finding,) = preflight(recorded(force_delay=-0.002)).named("delay")
    assert finding.size == pytest.approx(-0.002, rel=0.05) and "leads the velocity by" in finding.message


def test_a_reversed_force_is_an_error():
    found = preflight(recorded(reversed_force=True))
    assert not found.ok and [f.name for f in found.findings] == ["force sign"]
    assert 'force_sign="opposite"' in found.findings[0].remedy


def test_heat_is_a_drift_of_the_damping():
    slope = 0.01  # 1/K
    run = recorded(heating=0.02, temperature_slope=slope, temperature_channel=True, law="friction")
    (finding,) = preflight(run).named("drift of damping")
    assert run.temperature is not None
    rise = run.temperature[-1] - run.temperature[0]
    whole = 1 - 1 / run.cycles  # from the middle of the first cycle to the middle of the last one
    start = run.temperature[0] - 293.15
    assert finding.size == pytest.approx(-slope * rise * whole / (1 - slope * (start + 0.5 * rise)), rel=0.1)


def test_gas_that_drifts():
    run = recorded()
    drifting = replace(run, force=run.force - 100.0 * run.time / run.time[-1])
    (finding,) = preflight(drifting).named("drift of static force")
    assert finding.size == pytest.approx(-100.0 * (1 - 1 / run.cycles), rel=0.1)


def test_stick_slip():
    law = Linear(300.0) + StribeckFriction(60.0, 160.0, 0.02, 0.001)
    run = VirtualDyno(law, **SENSORS).run(STEADY)[0]
    (finding,) = preflight(run).named("stick-slip")
    assert finding.size == pytest.approx(100.0, rel=0.35)


def test_a_velocity_of_another_unit_or_channel():
    run = recorded()
    assert (
        preflight(replace(run, velocity=1.1 * run.velocity)).named("velocity not of the stroke")[0].severity
        == "warning"
    )
    found = preflight(replace(run, velocity=np.roll(run.velocity, 125)))
    assert not found.ok and found.findings[0].name == "velocity not of the stroke"


def test_magnitudes_that_no_damper_test_has():
    run = recorded()
    swapped = BenchRun.from_arrays("swapped", run.time, 1e-2 * run.force, 1e3 * run.stroke)
    (finding, *_) = preflight(swapped).named("unusual peak velocity")
    assert "unusual: the peak velocity is" in finding.message and "exchanged" in finding.remedy
    far = BenchRun.from_arrays("no unit", run.time, 1e8 * run.stroke, run.force)
    assert preflight(far).findings[0].severity == "error"
    with pytest.raises(ValueError, match=r"the peak velocity is .* or the stroke in m or mm"):
        identify.fit(Linear, far)
    slow = BenchRun.from_arrays("no unit", 1e9 * run.time, run.stroke, run.force)
    assert "Hz" in preflight(slow).named("unusual frequency")[0].unit


# ---- records beside one another


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("force", [100.0, 0.1, 0.0])
def test_a_force_that_never_changes_is_an_error_without_warnings(force):
    time = np.arange(1000) / 500
    run = BenchRun.from_arrays("level", time, 0.02 * np.sin(4 * np.pi * time), np.full(1000, force))
    found = preflight(run)
    assert [finding.message for finding in found.findings if finding.severity == "error"] == [
        f"the force stays at {force:.3g} N for 2 s while the stroke moves"
    ]


def test_a_copy_of_a_record_is_an_error():
    """It counted twice, and predicted its twin where records were held out."""
    first, again = VirtualDyno(LAWS["bilinear"], force_noise=3.0).run([SineTest(0.02, f) for f in (1.0, 2.0)])
    found = preflight([first, again, replace(first, name="copy")])
    assert [(f.name, f.records, f.severity) for f in found.findings] == [("copy", ("copy",), "error")]
    assert f"a copy of {first.name}" in found.findings[0].message


def test_mixed_settings_and_a_turned_record():
    test = [SineTest(0.02, f, cycles=4) for f in (1.0, 1.1, 1.2)]
    runs = list(VirtualDyno(LAWS["bilinear"], **SENSORS).run(test))
    assert preflight(runs).findings == ()
    other = replace(runs[1], name="other setting", force=1.4 * runs[1].force)
    found = preflight([*runs, other])
    assert [f.name for f in found.findings] == ["contradiction"] and found.ok
    assert found.findings[0].record == "20mm_1.1Hz, other setting"
    assert preflight([*runs, replace(other, command=1.0)]).findings == ()
    last = runs[2]
    turned = replace(last, stroke=-last.stroke, velocity=-last.velocity, force=-last.force)
    (finding,) = preflight([runs[0], runs[1], turned]).findings
    assert (finding.name, finding.record, finding.severity) == ("sign unlike its bench", last.name, "error")


def test_a_file_turned_by_the_reader_is_named(tmp_path):
    runs = list(VirtualDyno(LAWS["bilinear"], **SENSORS).run([SineTest(0.02, f, cycles=4) for f in (1.0, 2.0, 3.0)]))
    for index, run in enumerate(runs):
        sign = -1.0 if index == 1 else 1.0
        rows = np.stack([run.time, run.stroke, sign * run.force], axis=1)
        np.savetxt(tmp_path / f"{index}.csv", rows, delimiter=",", header="t_s,x_m,F_N", comments="")
    (finding,) = preflight(read(tmp_path)).named("sign unlike its bench")
    assert finding.record == "1" and "the other 2" in finding.message


def test_hysteresis_is_told_from_a_delay_by_several_records():
    tests = [SineTest(0.02, 1.0, cycles=6), SineTest(0.01, 4.0, cycles=6)]
    late = preflight(VirtualDyno(LAWS["bilinear"], force_delay=0.004, **SENSORS).run(tests))
    assert [f.name for f in late.findings] == ["delay", "delay"]
    one, two = (VirtualDyno(LAWS["bilinear"], force_delay=d, **SENSORS).run(t)[0]
                for d, t in zip((0.008, 0.002), tests, strict=True))  # fmt: skip
    found = preflight([one, two])
    assert [(f.name, f.severity) for f in found.findings] == [("hysteresis", "note")] * 2
    assert "no delay of a channel" in found.findings[0].message


def test_measured_records(data):
    """Rest at both ends, run-up and run-down, hysteresis, steps of 3 N, an offset, currents that contradict."""
    files = sorted((data / "mr_damper").glob("*.csv"))
    runs = read(files, sign="rebound-positive", command={"*_0A": 0.0, "*_0.5A": 0.5, "*_1.0A": 1.0})
    found = preflight(runs)
    assert found.ok and not found.named("contradiction") and not found.named("delay")
    for name in ("rest before", "rest after", "run-up", "run-down", "hysteresis"):
        assert len(found.named(name)) == 12, name
    assert all(f.size == pytest.approx(3.04, abs=0.01) for f in found.named("force quantised"))
    assert {f.record for f in found.named("static force against gas")} >= {run.name for run in runs if run.command == 0}
    unstated = [replace(run, command=None) for run in runs]
    assert not preflight(unstated).named("contradiction")  # their names state the current
    mixed = preflight([replace(run, settings={}) for run in unstated])
    assert len(mixed.named("contradiction")) >= 8


# ---- the result


def test_table_plain_data_text_and_picture():
    found = preflight([recorded(test=RESTING, force_limit=450.0), recorded(force_delay=0.003)])
    assert not found.ok and len(found.of("error")) == 1
    rows = found.table().records()
    assert rows[0]["severity"] == "error" and float(rows[0]["from"] or 0.0) > 1.0 and rows[0]["unit"] == "N"
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["ok"] is False
    assert "Preflight of 2 records: 1 error" in repr(found) and "- error, force clipped" in repr(found)
    figure = found.plot()
    assert "force clipped" in [label.get_text() for label in figure.axes[0].get_xticklabels()]
    with pytest.raises(ValueError, match="at least one record"):
        preflight([])


def test_the_start_of_a_sine_has_no_ripple_of_the_mains():
    time = np.arange(60) / 500
    stroke = np.round(0.02 * np.sin(4 * np.pi * time), 8)
    velocity = 0.02 * 4 * np.pi * np.cos(4 * np.pi * time)
    run = BenchRun.from_arrays("short", time, stroke, 600 * np.tanh(velocity / 0.1) + 800 * velocity - 300.0)
    assert not [found for found in preflight(run).findings if "ripple" in found.name]


@pytest.mark.parametrize("frequency", [10.0, 20.0])
def test_a_long_delay_is_told_as_it_is(frequency, rng):
    """By the angle of the harmonics, not by its tangent: 3.3 ms for 3."""
    w, t = 2 * np.pi * frequency, np.arange(2000) / 4000
    late = 0.002 * w * np.cos(w * (t - 3e-3))
    force = np.where(late > 0, 2600.0, 1200.0) * late + rng.normal(0.0, 3.0, t.size)
    (finding,) = preflight(BenchRun.from_arrays("late", t, 0.002 * np.sin(w * t), force)).named("delay")
    assert finding.size == pytest.approx(3e-3, rel=0.01)
