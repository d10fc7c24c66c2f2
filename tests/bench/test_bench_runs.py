import numpy as np
import pytest

from jaxdamp.bench import BenchRun, BenchSet, read


T = np.arange(1500) / 1000
OMEGA = 2 * np.pi * 4


def _run(name: str = "run", amplitude: float = 0.01, cycles: float = 6, rest: int = 0, **more) -> BenchRun:
    time = np.arange(round(1000 * cycles / 4)) / 1000
    still = np.zeros(rest)
    x, v = (
        np.concatenate([still, a, still])
        for a in (amplitude * np.sin(OMEGA * time), amplitude * OMEGA * np.cos(OMEGA * time))
    )
    return BenchRun.from_arrays(name, np.arange(len(x)) / 1000, x, 1500 * v, v, **more)


def test_figures_of_a_viscous_damper_on_a_sine():
    run = _run()
    assert run.frequency == pytest.approx(4.0, rel=1e-6)
    assert run.amplitude == pytest.approx(0.01, rel=1e-3)
    assert run.sampling_rate == pytest.approx(1000.0)
    assert run.duration == pytest.approx(1.5)
    assert run.cycles == 6
    assert run.peak_velocity == pytest.approx(OMEGA * 0.01)
    assert run.work_per_cycle == pytest.approx(np.pi * 1500 * OMEGA * 0.01**2, rel=1e-4)
    assert run.dissipated_energy == pytest.approx(6 * run.work_per_cycle, rel=3e-3)


@pytest.mark.parametrize("cycles", [1, 2, 2.5, 3, 7.9])
def test_full_cycles_are_counted(cycles):
    run = _run(cycles=cycles)
    assert run.cycles == int(cycles)
    assert run.work_per_cycle == pytest.approx(np.pi * 1500 * OMEGA * 0.01**2, rel=1e-2)


def test_rest_before_and_after_does_not_count():
    run = _run(rest=700)
    assert run.frequency == pytest.approx(4.0, rel=1e-3)
    assert run.cycles in (5, 6)
    assert run.work_per_cycle == pytest.approx(np.pi * 1500 * OMEGA * 0.01**2, rel=5e-3)


def test_noise_hardly_moves_the_figures(rng):
    time = np.arange(6000) / 2000
    stroke = 0.01 * np.sin(OMEGA * time) + 5e-5 * rng.standard_normal(6000)
    run = BenchRun.from_arrays("noisy", time, stroke, 600 * np.cos(OMEGA * time) + 20 * rng.standard_normal(6000))
    assert run.frequency == pytest.approx(4.0, rel=2e-3)
    assert run.amplitude == pytest.approx(0.01, rel=5e-3)
    assert run.peak_velocity == pytest.approx(OMEGA * 0.01, rel=2e-3)
    assert run.work_per_cycle == pytest.approx(np.pi * 600 * 0.01, rel=1e-2)
    assert "harmonic" in run.notes[-1]


def test_channels_are_copies_that_cannot_be_written():
    stroke = 0.01 * np.sin(OMEGA * T)
    run = BenchRun.from_arrays("a", T, stroke, stroke)
    stroke[0] = 5.0
    assert run.stroke[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        run.stroke[0] = 1.0
    with pytest.raises(AttributeError):
        run.name = "b"  # type: ignore[misc]


def test_parts_of_a_record():
    run = _run()
    last = run.last_cycles(2)
    assert len(last) == 500
    assert last.time[0] == pytest.approx(1.0)
    assert last.notes[-1].startswith("cut to 1 … 1.499")
    np.testing.assert_array_equal(run.between(0.1, 0.4).force, run.force[100:400])
    with pytest.raises(ValueError, match="between 1 and the number of full cycles, 6"):
        run.last_cycles(7)
    with pytest.raises(ValueError, match=r"It runs from 0 to 1.499 s"):
        run.between(5.0, 6.0)


def test_bad_channels():
    x = 0.01 * np.sin(OMEGA * T)
    with pytest.raises(ValueError, match=r"`force` must be a column of as many samples as the time, 1500"):
        BenchRun.from_arrays("a", T, x, x[1:])
    with pytest.raises(ValueError, match=r"record 'a', sample 3: the force is nan"):
        BenchRun.from_arrays("a", T, x, np.where(T == T[3], np.nan, x))
    with pytest.raises(ValueError, match="only 5 samples"):
        BenchRun.from_arrays("a", T[:5], x[:5], x[:5])
    with pytest.raises(ValueError, match="must increase"):
        BenchRun.from_arrays("a", T[::-1], x, x)
    with pytest.raises(ValueError, match="stroke is constant"):
        BenchRun.from_arrays("a", T, 0 * x, x, x)


def test_words():
    run = _run("fast", temperature=np.full(1500, 303.15), source="a.csv", notes=["force turned"])
    text = run.describe()
    for part in ("fast", "a.csv", "1500 at 1000 Hz", "mm zero to peak", "30.0 … 30.0 °C", "- force turned"):
        assert part in text
    assert repr(run).startswith("BenchRun('fast': 1.5 s at 1000 Hz, 4 Hz, ")


@pytest.fixture
def runs() -> BenchSet:
    return BenchSet([_run("5mm_A", 0.005), _run("10mm_A", 0.010), _run("10mm_B", 0.010)])


def test_set_is_ordered_and_indexed(runs):
    assert len(runs) == 3
    assert [run.name for run in runs] == list(runs.names) == ["5mm_A", "10mm_A", "10mm_B"]
    assert runs[0] is runs["5mm_A"]
    assert runs[-1].name == "10mm_B"
    assert runs[1:].names == ("10mm_A", "10mm_B")
    assert "5mm_A" in runs
    assert (runs[:1] + runs[1:]).names == runs.names
    with pytest.raises(KeyError, match="Did you mean '10mm_A'"):
        runs["10mmA"]
    with pytest.raises(IndexError, match="3 records"):
        runs[3]


def test_selection(runs):
    assert runs.select("10mm_*").names == ("10mm_A", "10mm_B")
    assert runs.select(["5mm_A", "10mm_B"]).names == ("5mm_A", "10mm_B")
    assert runs.select(lambda run: run.amplitude < 0.007).names == ("5mm_A",)
    assert runs.where(lambda run: abs(run.amplitude - 0.010) < 1e-4).names == ("10mm_A", "10mm_B")
    assert runs.without("*_A").names == ("10mm_B",)
    assert len(runs.without(lambda run: True)) == 0
    with pytest.raises(KeyError, match="No record is called '20mm"):
        runs.select("20mm*")
    with pytest.raises(KeyError):
        runs.without("20mm*")


def test_table_and_repr(runs):
    rows = runs.table()
    assert [row["name"] for row in rows] == list(runs.names)
    assert rows[1]["work_per_cycle"] == pytest.approx(4 * rows[0]["work_per_cycle"])
    assert repr(runs).splitlines()[0] == "BenchSet of 3 records"
    assert "10mm_B" in repr(runs)
    assert repr(BenchSet()) == "BenchSet(empty)"
    assert runs.describe().count("samples") == 3


def test_names_are_unique(runs):
    with pytest.raises(ValueError, match="different names, but is twice '5mm_A'"):
        BenchSet([runs[0], runs[0]])


def test_written_files_are_read_back_to_the_last_bit(tmp_path, rng):
    stroke_noise, force, warm = rng.standard_normal((3, 1500))
    stroke = 0.01 * np.sin(OMEGA * T) + 1e-5 * stroke_noise
    notes = ["force turned,\nand more"]
    first = BenchRun.from_arrays("a/b", T, stroke, force, temperature=300 + warm, notes=notes)
    second = BenchRun("pushes", T + 1 / 3, first.stroke, 2 * first.velocity, -1e3 * first.velocity)
    files = BenchSet([first, second]).write(tmp_path / "new" / "folder")
    assert [file.name for file in files] == ["a_b.csv", "pushes.csv"]
    back = read(tmp_path / "new" / "folder")
    for run, again in zip((first, second), back, strict=True):
        for channel in ("time", "stroke", "velocity", "force"):
            np.testing.assert_array_equal(getattr(again, channel), getattr(run, channel))
    assert back[0].temperature is not None
    np.testing.assert_array_equal(back[0].temperature, 300 + warm)
    assert back[0].notes[0] == "force turned, and more"
    assert "as the file states" in back[1].notes[-1]
    with pytest.raises(ValueError, match="states that it is rebound-positive"):
        read(files[0], sign="compression-positive")


def test_names_that_make_one_file(tmp_path):
    with pytest.raises(ValueError, match="different files"):
        BenchSet([_run("a/b"), _run("a:b")]).write(tmp_path)
