from collections.abc import Callable, Sequence

import jax
import numpy as np
import pytest

from jaxdamp.bench import BenchRun, VirtualDyno, programmes
from jaxdamp.dampers import AbstractDamper, Besinger, SeriesSpring


Make = Callable[..., list[BenchRun]]

# A passenger car's damper: its opening valve is seen well, its cubic stiffness (a newton or so) is not.
CAR = SeriesSpring(Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05), stiffness=1.5e6, cubic_stiffness=1.2e8)
SINES = ((0.02, 2.0), (0.02, 5.0), (0.01, 10.0))  # m, Hz: up to 0.25, 0.63 and 0.63 m/s


@pytest.fixture(scope="session")
def sines() -> Make:
    """Records of a memoryless law under sines of exact velocity, two cycles of 400 samples each, with noise."""

    def make(
        law: AbstractDamper, *, noise: float = 0.0, seed: int = 0, tests: Sequence[tuple[float, float]] = SINES
    ) -> list[BenchRun]:
        rng = np.random.default_rng(seed)
        curve = jax.jit(jax.vmap(lambda v: law.force(0.0, v, law.initial_state())))
        runs = []
        for amplitude, frequency in tests:
            time = np.arange(800) / (400 * frequency)
            angle = 2 * np.pi * frequency * time
            stroke, velocity = amplitude * np.sin(angle), 2 * np.pi * frequency * amplitude * np.cos(angle)
            force = np.asarray(curve(velocity)) + noise * rng.standard_normal(800)
            runs.append(BenchRun(f"{1e3 * amplitude:g}mm_{frequency:g}Hz", time, stroke, velocity, force))
        return runs

    return make


@pytest.fixture(scope="session")
def car() -> SeriesSpring:
    """The law of `car_runs`."""
    return CAR


@pytest.fixture(scope="session")
def car_runs() -> list[BenchRun]:
    """The 30 records of paper 000 of a passenger car's damper with hysteresis, on a noisy bench."""
    dyno = VirtualDyno(CAR, force_noise=20.0, stroke_noise=1e-5)
    return list(dyno.run(programmes.paper_000_table_1()))


@pytest.fixture(scope="session")
def maxwell_runs() -> list[BenchRun]:
    """Four sines of a linear damper of 2000 N s/m behind a lag of 4 ms, exact in closed form, without noise."""
    runs = []
    for amplitude, frequency in ((0.02, 1.0), (0.01, 3.0), (0.01, 6.0), (0.004, 12.0)):
        time = np.arange(1200) / (400 * frequency)
        omega = 2 * np.pi * frequency
        stroke, velocity = amplitude * np.sin(omega * time), omega * amplitude * np.cos(omega * time)
        phase = np.arctan(omega * 0.004)
        force = 2000.0 * omega * amplitude * np.cos(phase) * np.cos(omega * time - phase)
        runs.append(BenchRun(f"{frequency:g} Hz", time, stroke, velocity, force))
    return runs


@pytest.fixture(scope="session")
def mr_runs(data) -> list[BenchRun]:
    """The measured records of the magnetorheological damper at 0.5 A."""
    from jaxdamp.bench import read

    return list(read(sorted((data / "mr_damper").glob("*_0.5A.csv")), sign="rebound-positive"))
