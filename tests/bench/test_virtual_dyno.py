import jax
import numpy as np
import pytest

from jaxdamp.bench import RandomTest, SineTest, VirtualDyno, programmes, read
from jaxdamp.dampers import Bilinear, Lag, Linear, SeriesSpring


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
    note = VirtualDyno(Linear(2000.0), force_delay=0.003, gas_force=-120.0).run(TEST)[0].notes[0]
    assert (
        note
        == "made by the virtual dyno from Linear: sampled at 2000 Hz, force delay 0.003 s, gas force -120 N, seed 0"
    )


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
        ("force_delay", -0.001),
        ("force_offset", np.nan),
    ],
)
def test_bad_settings(argument, value):
    with pytest.raises(ValueError, match=f"`{argument}` must be"):
        VirtualDyno(Linear(2000.0), **{argument: value})


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
