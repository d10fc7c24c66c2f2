from typing import Any

import jax
import numpy as np
import pytest

from jaxdamp.bench import RandomTest, Sensors, SineTest, VirtualDyno, programmes, read, virtual_dyno
from jaxdamp.dampers import Bilinear, Heated, Lag, Linear, SeriesSpring
from jaxdamp.rig import Rig


TEST = SineTest(0.01, 4.0, cycles=5)
VELOCITY = TEST.velocity(np.arange(2500) / 2000)


def test_clean_record_of_a_memoryless_law():
    run = VirtualDyno(Linear(2000.0)).run(TEST)[0]
    assert (run.name, len(run), run.sampling_rate, run.cycles) == ("10mm_4Hz", 2500, pytest.approx(2000.0), 5)
    np.testing.assert_allclose(run.stroke, TEST.stroke(run.time), atol=1e-16)
    np.testing.assert_allclose(run.force, 2000 * VELOCITY, atol=1e-3)
    np.testing.assert_allclose(run.velocity, VELOCITY, atol=1e-9)
    assert run.work_per_cycle > 0


@pytest.mark.parametrize(("frequency", "rate"), [(60.0, 2000.0), (4.0, 2000.0), (60.0, 600.0)])
def test_law_with_state_is_steady_and_exact(frequency, rate):
    """Lag and Maxwell element under a sine against their closed forms."""
    test, omega = SineTest(0.0025, frequency), 2 * np.pi * frequency
    for law, gain in (
        (Lag(Linear(2000.0), 1e-3), 2000 * 1j * omega / (1 + 1j * omega * 1e-3)),
        (SeriesSpring(Linear(2000.0), 1e6), 2000 * 1j * omega / (1 + 1j * omega * 2e-3)),
    ):
        run = VirtualDyno(law, sampling_rate=rate).run(test)[0]
        truth = np.imag(0.0025 * gain * np.exp(1j * omega * run.time))
        assert np.max(np.abs(run.force - truth)) < 1e-5 * np.max(np.abs(truth))


@pytest.mark.parametrize(
    "law",
    [Lag(Bilinear(2600.0, 1200.0), 4e-3), pytest.param(SeriesSpring(Linear(2000.0), 1e6), marks=pytest.mark.slow)],
)
def test_printed_laws_give_the_records_of_xla(law, monkeypatch):
    machine = {"gas_force": -80.0, "gas_stiffness": 900.0, "friction": 15.0, "moving_mass": 2.0, "force_offset": 12.0}
    rig = Rig(**machine, stroke_offset=3e-3, force_delay=2e-3, force_lag=1e-3)
    dyno, tests = VirtualDyno(law, rig=rig, temperature_channel=True), [TEST, SineTest(0.02, 1.0, cycles=1)]
    printed = dyno.run(tests)
    monkeypatch.setattr(virtual_dyno, "printed_forces", lambda *_: None)
    for one, other in zip(printed, dyno.run(tests), strict=True):
        np.testing.assert_allclose(one.force, other.force, rtol=0.0, atol=1e-11 * np.max(np.abs(other.force)))
        np.testing.assert_array_equal(one.temperature, other.temperature)


def test_precision_does_not_depend_on_the_session():
    law = Lag(Linear(2000.0), 1e-3)
    double = VirtualDyno(law).run(TEST)[0]
    with jax.enable_x64(False):
        single = VirtualDyno(Lag(Linear(2000.0), 1e-3)).run(TEST)[0]
    np.testing.assert_allclose(single.force, double.force, rtol=1e-5, atol=1e-3)


def test_noise_has_the_stated_size():
    clean = VirtualDyno(Linear(2000.0)).run(SineTest(0.01, 1.0, cycles=10))[0]
    noisy = VirtualDyno(Linear(2000.0), force_noise=7.0, stroke_noise=2e-5).run(SineTest(0.01, 1.0, cycles=10))[0]
    for channel, size in (("force", 7.0), ("stroke", 2e-5)):
        noise = getattr(noisy, channel) - getattr(clean, channel)
        assert np.std(noise) == pytest.approx(size, rel=0.03)
        assert abs(np.mean(noise)) < 4 * size / np.sqrt(len(noise))
        assert abs(np.mean(noise[1:] * noise[:-1])) < 4 * size**2 / np.sqrt(len(noise))
    assert not np.array_equal(noisy.velocity, clean.velocity)  # the estimate knows the measured stroke only
    assert noisy.notes[1].startswith("velocity from the stroke by harmonic")


def test_seeds():
    tests = (SineTest(0.01, 3.0), SineTest(0.01, 5.0))

    def forces(seed: int, order=slice(None)) -> dict[str, np.ndarray]:
        return {r.name: r.force for r in VirtualDyno(Linear(2000.0), force_noise=5.0, seed=seed).run(tests[order])}

    one, same, other, alone = forces(1), forces(1), forces(2), forces(1, slice(1, 2))
    np.testing.assert_array_equal(one["10mm_3Hz"], same["10mm_3Hz"])
    np.testing.assert_array_equal(one["10mm_5Hz"], alone["10mm_5Hz"])
    assert np.std(one["10mm_3Hz"] - other["10mm_3Hz"]) > 5.0
    noisy = VirtualDyno(Linear(2000.0), stroke_noise=1e-5).run(tests)
    first, second = (run.stroke - test.stroke(run.time) for run, test in zip(noisy, tests, strict=True))
    assert abs(np.corrcoef(first[: len(second)], second)[0, 1]) < 0.15  # noise of two records is not the same


def test_faults_of_the_sensors():
    clean = VirtualDyno(Linear(2000.0)).run(TEST)[0]

    def excess(**faults: float) -> np.ndarray:
        return VirtualDyno(Linear(2000.0), **faults).run(TEST)[0].force - clean.force  # type: ignore[arg-type]

    np.testing.assert_allclose(excess(gas_force=-120.0, force_offset=20.0), -100.0, atol=1e-9)
    np.testing.assert_allclose(excess(friction=30.0), 30 * np.tanh(VELOCITY / 0.005), atol=1e-9)
    delayed = 2000 * TEST.velocity(clean.time - 0.003)
    np.testing.assert_allclose(excess(force_delay=0.003) + clean.force, delayed, atol=1e-3)
    ripple = excess(mains_ripple=4.0, mains_frequency=60.0)
    spectrum = 2 * np.abs(np.fft.rfft(ripple)) / len(ripple)
    assert np.fft.rfftfreq(len(ripple), 1 / 2000)[np.argmax(spectrum)] == pytest.approx(60.0, abs=0.5)
    assert np.max(np.abs(ripple)) == pytest.approx(4.0, rel=1e-2)
    hum = VirtualDyno(Linear(2000.0), stroke_ripple=5e-5).run(TEST)[0].stroke - clean.stroke
    assert np.max(np.abs(hum)) == pytest.approx(5e-5, rel=1e-2)


def test_the_note_lists_what_the_bench_adds():
    dyno = VirtualDyno(Linear(2000.0), force_delay=0.003, gas_force=-120.0, reversed_force=True, spike_rate=2.0, seed=4)
    assert dyno.run(TEST)[0].notes[0] == (
        "made by the virtual dyno from Linear: sampled at 2000 Hz, spike rate 2 1/s, reversed force, gas force -120 N, "
        "force delay 0.003 s, seed 4"
    )


def channel(name: str, test: SineTest = TEST, **settings: Any) -> np.ndarray:
    return getattr(VirtualDyno(Linear(2000.0), **settings).run(test)[0], name)


def test_machine_and_sensors_are_objects_too():
    rig, sensors = Rig(gas_force=-50.0, force_delay=0.002), Sensors(force_noise=3.0)
    whole = channel("force", rig=rig, sensors=sensors)
    np.testing.assert_array_equal(whole, channel("force", gas_force=-50.0, force_delay=0.002, force_noise=3.0))
    with_offset = channel("force", rig=rig, sensors=sensors, force_offset=-10.0)
    np.testing.assert_allclose(whole - 10.0, with_offset, rtol=1e-13)


def test_the_record_is_what_the_machine_shows():
    """`Rig.force` under the recorded stroke and velocity explains a record of the same machine."""
    law = Bilinear(2600.0, 1200.0, 0.02)
    rig = Rig(-120.0, 800.0, 30.0, moving_mass=1.5, force_delay=0.0013, force_lag=0.002, stroke_offset=1e-3)
    run = VirtualDyno(law, rig=rig, sampling_rate=4000.0).run(TEST)[0]
    assert np.mean(run.stroke) == pytest.approx(1e-3)
    force = rig.force(law, run.time, run.stroke, run.velocity)
    later = run.time > 0.05  # the lag begins settled
    np.testing.assert_allclose(force[later], run.force[later], atol=0.1)


def test_heat_lowers_the_damping_and_raises_the_gas_force():
    test = SineTest(0.01, 4.0, cycles=40)
    hot = {"heating": 0.01, "temperature_slope": 0.002, "gas_temperature_slope": 0.0034, "temperature_channel": True}
    run = VirtualDyno(Linear(2000.0), gas_force=-100.0, cooling=0.02, **hot).run(test)[0]
    power = 0.5 * 2000.0 * (2 * np.pi * 4.0 * 0.01) ** 2  # mean, 63 W
    assert run.temperature is not None
    rise = run.temperature - 293.15
    lost = 0.02 + 0.01 * 0.002 * power
    np.testing.assert_allclose(rise[-1], 0.01 * power / lost * (1 - np.exp(-lost * 10.4)), rtol=0.02)
    np.testing.assert_allclose(
        run.force, 2000.0 * test.velocity(run.time) * (1 - 0.002 * rise) - 100.0 * (1 + 0.0034 * rise), atol=1e-3
    )
    assert VirtualDyno(Linear(2000.0), heating=0.01).run(TEST)[0].temperature is None


def test_clipping():
    clean = channel("force")
    np.testing.assert_allclose(channel("force", force_limit=300.0), np.clip(clean, -300, 300), atol=1e-12)
    np.testing.assert_array_equal(np.abs(channel("stroke", stroke_limit=0.008)).max(), 0.008)


def test_resolution():
    clean, coarse = channel("force"), channel("force", force_resolution=5.0)
    np.testing.assert_allclose(coarse, 5.0 * np.round(coarse / 5.0), atol=1e-9)
    assert np.max(np.abs(coarse - clean)) <= 2.5 + 1e-9
    assert 1e-4 - 1e-9 < np.diff(np.unique(channel("stroke", stroke_resolution=1e-4))).min() < 1.001e-4


def test_spikes():
    test = SineTest(0.01, 4.0, cycles=100)
    spikes = channel("force", test, spike_rate=3.0, spike_size=250.0) - channel("force", test)
    hit = np.abs(spikes) > 1e-9
    assert np.count_nonzero(hit) == pytest.approx(75, abs=4 * np.sqrt(75))  # of 25 s
    np.testing.assert_allclose(np.abs(spikes[hit]), 250.0)
    assert 0.4 < np.mean(spikes[hit] > 0) < 0.6


def test_jitter_of_the_clock():
    """The error is the slope of the signal times the error of the instant, the same in all channels."""
    clean, jittered = (VirtualDyno(Linear(2000.0), clock_jitter=j).run(TEST)[0] for j in (0.0, 1e-5))
    np.testing.assert_array_equal(jittered.time, clean.time)
    late = (jittered.stroke - clean.stroke) / VELOCITY
    late = late[np.abs(VELOCITY) > 0.1]
    assert np.std(late) == pytest.approx(1e-5, rel=0.1)
    slope = -2000.0 * (2 * np.pi * 4.0) ** 2 * clean.stroke[np.abs(VELOCITY) > 0.1]
    np.testing.assert_allclose((jittered.force - clean.force)[np.abs(VELOCITY) > 0.1], slope * late, atol=1e-2)


def test_reversed_force():
    np.testing.assert_array_equal(channel("force", reversed_force=True), -channel("force"))


def test_stuck_channels():
    time = np.arange(2500) / 2000
    for name, unstuck in (("force", channel("force")), ("stroke", channel("stroke"))):
        since: dict[str, Any] = {f"{name}_stuck_from": 0.8}
        stuck = channel(name, **since)
        np.testing.assert_array_equal(stuck[time < 0.8], unstuck[time < 0.8])
        np.testing.assert_array_equal(stuck[time >= 0.8], unstuck[1600])


def test_faults_are_seeded_and_leave_the_noise_alone():
    faults: dict[str, Any] = {"spike_rate": 20.0, "spike_size": 100.0, "force_noise": 2.0}
    one, same, other = (channel("force", seed=seed, **faults) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    without = channel("force", seed=1, force_noise=2.0)
    assert 10 < np.count_nonzero(np.abs(one - without) > 1e-9) < 45  # of 25 expected


def test_a_record_with_rest_and_ramps():
    test = SineTest(0.01, 4.0, cycles=5, rest_before=0.5, run_up=0.5, run_down=0.25, rest_after=0.25)
    law = Lag(Linear(2000.0), 0.004)
    run = VirtualDyno(law, force_noise=1.0, gas_force=-100.0).run(test)[0]
    assert run.duration == pytest.approx(2.75)
    at_rest = (run.time < 0.5) | (run.time > 2.5 + 0.05)
    np.testing.assert_array_equal(run.stroke[(run.time < 0.5) | (run.time > 2.5)], 0.0)
    np.testing.assert_allclose(run.force[at_rest], -100.0, atol=5.0)
    assert run.frequency == pytest.approx(4.0, rel=1e-3)


def test_a_programme_keeps_its_order_and_reports_progress():
    tests = [RandomTest(duration=4.0, warm_up=1.0), *programmes.qct_545()[::5], SineTest(0.005, 30.0)]
    steps: list[tuple[int, int]] = []
    runs = VirtualDyno(Bilinear(1500.0, 500.0)).run(tests, progress=lambda done, total: steps.append((done, total)))
    assert runs.names == tuple(test.name for test in tests)
    assert steps == [(i + 1, 6) for i in range(6)]
    for run, test in zip(runs, tests, strict=True):
        np.testing.assert_allclose(run.stroke, test.stroke(run.time), atol=1e-15)
        v = test.velocity(run.time)
        np.testing.assert_allclose(run.force, np.where(v > 0, 1500, 500) * v, atol=2e-3 * np.max(np.abs(v)) + 1e-3)


def test_records_written_and_read_are_the_same(tmp_path):
    runs = VirtualDyno(Bilinear(1500.0, 500.0), force_noise=5.0, stroke_noise=1e-5).run(programmes.paper_003())
    runs.write(tmp_path)
    for run, again in zip(runs, read(tmp_path), strict=True):
        assert again.name == run.name
        assert again.notes[0] == run.notes[0]
        for channel in ("time", "stroke", "velocity", "force"):
            np.testing.assert_array_equal(getattr(again, channel), getattr(run, channel))


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("force_noise", -1.0),
        ("sampling_rate", 0.0),
        ("gas_force", 100.0),
        ("force_offset", np.nan),
        ("force_limit", 0.0),
        ("clock_jitter", -1e-6),
    ],
)
def test_bad_settings(argument, value):
    with pytest.raises(ValueError, match=rf"`(Rig\.)?{argument}` must be"):
        VirtualDyno(Linear(2000.0), **{argument: value})


def test_an_unknown_setting_is_named():
    with pytest.raises(TypeError, match=r"no argument 'force_limits'.* Did you mean 'force_limit'\?"):
        VirtualDyno(Linear(2000.0), force_limits=100.0)


def test_the_temperature_of_a_law_that_heats_itself_is_not_that_of_the_machine():
    law = Heated(Linear(1500.0))
    with pytest.raises(ValueError, match="temperature_channel"):
        VirtualDyno(law, temperature_channel=True)


def test_bad_programmes():
    dyno = VirtualDyno(Linear(2000.0), sampling_rate=200.0)
    with pytest.raises(ValueError, match="at least one test"):
        dyno.run([])
    with pytest.raises(
        ValueError, match="'5mm_60Hz' at least 20 samples and 4 a period, but is 200 Hz, which gives 10"
    ):
        dyno.run(SineTest(0.005, 60.0))
    with pytest.raises(ValueError, match="different names"):
        dyno.run([TEST, TEST])


def test_stamps_that_show_the_jitter_are_resampled():
    test, rate = SineTest(0.02, 2.0, cycles=3), 200.0
    cases: list[dict[str, Any]] = [{}, {"clock_jitter": 5e-4}, {"clock_jitter": 5e-4, "stamped_jitter": True}]
    exact, hidden, stamped = (VirtualDyno(Linear(1500.0), rate, **faults).run(test)[0] for faults in cases)
    errors = [np.std(run.stroke - 0.02 * np.sin(4 * np.pi * run.time)) for run in (exact, hidden, stamped)]
    assert errors[0] < 1e-9 and errors[2] < 0.2 * errors[1]
    assert any("the clock jitters by up to" in note for note in stamped.notes)
    with pytest.raises(ValueError, match=r"`clock_jitter` must be small beside a step, 0.005 s"):
        VirtualDyno(Linear(1500.0), rate, clock_jitter=4e-3, stamped_jitter=True).run(test)
