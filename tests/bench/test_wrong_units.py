"""Records with one channel in a wrong unit are refused, by channel, value and probable unit; true records are not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jaxdamp import bench, dampers, identify
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno, preflight

from . import plain_records as made


# unit of the numbers and the one they were taken for: the channel, what is done to a record, the remedy
WRONG: dict[str, tuple[str, Callable[[BenchRun], BenchRun], str]] = {
    "ms taken for s": ("time", lambda run: made.of_time(run, 1e3), 'units={"time": "ms"}'),
    "s taken for ms": ("time", lambda run: made.of_time(run, 1e-3), 'units={"time": "s"}'),
    "us taken for s": ("time", lambda run: made.of_time(run, 1e6), 'units={"time": "us"}'),
    "mm taken for m": ("stroke", lambda run: made.of_stroke(run, 1e3), 'units={"stroke": "mm"}'),
    "m taken for mm": ("stroke", lambda run: made.of_stroke(run, 1e-3), 'units={"stroke": "m"}'),
    "um taken for m": ("stroke", lambda run: made.of_stroke(run, 1e6), 'units={"stroke": "um"}'),
    "N taken for kN": ("force", lambda run: made.of_force(run, 1e3), 'units={"force": "N"}'),
    "kN taken for N": ("force", lambda run: made.of_force(run, 1e-3), 'units={"force": "kN"}'),
}
LBF = 4.4482216
# in files: the numbers of the time in seconds, the header, what the error says, the remedy
IN_FILES: dict[str, tuple[Callable[[BenchRun], np.ndarray], str, str, str]] = {
    "ms": (lambda run: 1e3 * run.time, "time [s]", "ms taken for s", '`units={"time": "ms"}`'),
    "s": (lambda run: run.time, "time [ms]", "s taken for ms", '`units={"time": "s"}`.'),
    "us": (lambda run: 1e6 * run.time, "time [ms]", "us taken for ms", '`units={"time": "us"}`'),
    "samples": (
        lambda run: np.arange(1.0, len(run) + 1.0),
        "time [s]",
        "ms taken for s",
        'if it counts samples, with `columns={"time": None}` and `sampling_rate=...`.',
    ),
    "min": (lambda run: run.time / 60.0, "time [s]", "min taken for s", '`units={"time": "min"}`.'),
}


def is_refused(name: str, run: BenchRun) -> bool:
    """Whether the only error of a record in this wrong unit names it."""
    channel, wrong, remedy = WRONG[name]
    errors = preflight(wrong(run)).of("error")
    return [(f.name, name in f.message, remedy in f.remedy) for f in errors] == [(f"unit of {channel}", True, True)]


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_unit_is_an_error_that_names_it(name: str) -> None:
    assert all(is_refused(name, made.clean(seed)) for seed in range(3))


def is_refused_in_file(name: str, run: BenchRun, file: Path) -> bool:
    """Whether the only error of a file with such a time names its unit and how to read it again."""
    numbers, header, said, remedy = IN_FILES[name]
    columns = np.column_stack([numbers(run), 1e3 * run.stroke, run.force])
    np.savetxt(file, columns, "%.10g", ",", header=f"{header},stroke [mm],force [N]", comments="")
    errors = preflight(bench.read(file, sign="rebound-positive")).of("error")
    return [(f.name, said in f.message, remedy in f.remedy) for f in errors] == [("unit of time", True, True)]


@pytest.mark.parametrize("name", IN_FILES)
def test_the_unit_that_a_file_states_tells_which_one_it_is(name: str, tmp_path: Path) -> None:
    assert all(is_refused_in_file(name, made.clean(seed), tmp_path / "run.csv") for seed in (1, 8))


@pytest.mark.slow
@pytest.mark.parametrize("name", IN_FILES)
def test_the_unit_of_the_time_of_files_is_found_in_30(name: str, tmp_path: Path) -> None:
    """Minutes taken for seconds only in fast tests: a slow one is 60 times faster then, and still usual."""
    runs = [made.clean(seed, "random" if name == "min" else None) for seed in range(30)]
    assert sum(is_refused_in_file(name, run, tmp_path / "run.csv") for run in runs) >= 29


def test_a_rate_that_is_wrong_by_1000_is_the_rate_not_a_column(tmp_path: Path) -> None:
    run, file = made.clean(1), tmp_path / "run.csv"
    columns = np.column_stack([1e3 * run.stroke, run.force])
    np.savetxt(file, columns, delimiter=",", header="stroke [mm],force [N]", comments="")
    read = bench.read(file, sign="rebound-positive", sampling_rate=1e3 * run.sampling_rate)
    (error,) = preflight(read).of("error")
    assert error.name == "unit of time" and "sampling_rate=" in error.remedy and "units=" not in error.remedy


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_unit_is_found_in_95_of_100_records_of_all_kinds(name: str) -> None:
    found = [is_refused(name, made.clean(seed)) for seed in range(105)]
    assert np.mean(found) >= 0.95, made.clean(found.index(False)).name


def test_the_error_names_what_is_odd_with_its_value() -> None:
    run = VirtualDyno(dampers.Linear(1500.0), force_noise=5.0).run(SineTest(0.004, 1.0, cycles=5))[0]
    (finding,) = preflight(made.of_stroke(run, 1e3)).findings
    assert finding.message == (
        "the stroke looks 1000 times too large, mm taken for m: "
        "peak velocity 25.1 m/s, amplitude 4 m, ratio of force and velocity 1.52 N s/m"
    )
    assert (finding.size, finding.unit) == (pytest.approx(1.52, abs=0.01), "N s/m")


@pytest.mark.parametrize("name", WRONG)
def test_a_fit_refuses_a_wrong_unit_unless_told_otherwise(name: str) -> None:
    wrong = WRONG[name][1](made.clean(7, "qct"))
    with pytest.raises(ValueError, match=f"{name}.*bad_records="):
        identify.fit(dampers.Bilinear, wrong)
    with pytest.raises(ValueError, match=name):
        identify.compare({"bilinear": dampers.Bilinear}, [wrong])
    assert bench.usable([wrong], "keep") == (wrong,)


@pytest.mark.parametrize("seeds", [range(7), pytest.param(range(7, 14), marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "factor", [1 / LBF, *(pytest.param(factor, marks=pytest.mark.slow) for factor in (LBF, 1 / 25.4, 10.0))]
)
def test_a_smaller_factor_is_never_guessed(factor: float, seeds: range) -> None:
    """Pounds for newtons, inches for millimetres, kilograms: no magnitude tells them."""
    runs = [make(made.clean(seed), factor) for seed in seeds for make in (made.of_force, made.of_stroke)]
    assert not [f.message for run in runs for f in preflight(run).findings if f.name.startswith("unit of")]


def test_a_spike_is_no_unit() -> None:
    run = made.clean(5, "qct")
    force = np.array(run.force)
    force[len(run) // 2 : len(run) // 2 + 2] = 1e6
    assert {f.name for f in preflight(replace(run, force=force)).of("error")} == {"force spikes"}


def test_measured_records_and_small_and_large_dampers_are_not_refused(data) -> None:
    """Seals of a bicycle damper, a bus, a yaw damper of a train, a shaker at 0.3 mm, gas at 0.5 mm/s."""
    runs = list(bench.read(data / "mr_damper" / "*.csv", sign="rebound-positive"))
    true = {
        "bicycle": (50.0, SineTest(0.01, 0.5)),
        "bus": (50000.0, SineTest(0.05, 1.67)),
        "yaw": (1.5e6 / 4, SineTest(0.012, 0.5)),
        "shaker": (3000.0, SineTest(0.0003, 50.0)),
        "static": (2e5, SineTest(0.02, 0.004)),
    }
    runs += [
        VirtualDyno(dampers.Linear(rate), force_noise=1.0, sampling_rate=max(100 * test.frequency, 10.0)).run(
            replace(test, name=name)
        )[0]
        for name, (rate, test) in true.items()
    ]
    assert [f"{f}" for f in preflight(runs).findings if f.name.startswith("unit of")] == []
