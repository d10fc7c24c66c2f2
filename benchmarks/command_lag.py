"""How often the 95 % interval of an actuator's lag holds the true lag: records whose coil current varies, with noise.

A damper with hysteresis whose rates and friction depend on the current is run by the virtual dyno: steps of current,
random levels, and held levels, with an actuator lag of 8 ms and noise on force and current. The records are made once;
each repeat adds noise of its own. The law at both levels and the lag are estimated together, from a start 20 % beside
the truth and a lag of 3 ms; records at other currents, with another motion, are then predicted.

    python -m benchmarks.command_lag [--repeats 100] [--memory 0.0]
"""

import argparse
import dataclasses
from typing import NamedTuple

import numpy as np

from jaxdamp import configure


configure()

from benchmarks.coverage import beside, coloured  # noqa: E402
from jaxdamp import identify  # noqa: E402
from jaxdamp.bench import BenchRun, CommandStep, SineTest, VirtualDyno  # noqa: E402
from jaxdamp.dampers import BoucWen, Scheduled  # noqa: E402
from jaxdamp.identify import FitResult  # noqa: E402
from jaxdamp.parameters import parameters, replace  # noqa: E402
from jaxdamp.rig import Rig  # noqa: E402


LAG = 8e-3  # s
START = 3e-3  # s
NOISE = 15.0  # N
CURRENT_NOISE = 5e-3  # A
SAMPLING_RATE = 500.0  # Hz
TRUTH = Scheduled((BoucWen(600.0, 1000.0, 60.0, 1e-3), BoucWen(1800.0, 1000.0, 500.0, 1.5e-3)), [0.0, 1.0], 0.0)
FROZEN = ("stiffness", "shape", "exponent", "static_force")
TESTS = [
    CommandStep(SineTest(0.02, 1.5, cycles=6), (0.0, 1.0, 0.5), hold=0.3, rise=8e-3),
    CommandStep.random(SineTest(0.008, 4.0, cycles=16), 0.0, 1.0, hold=0.15, rise=8e-3, seed=1),
]
FRESH = [CommandStep.random(SineTest(0.015, 2.5, cycles=8), 0.0, 1.0, hold=0.1, rise=8e-3, seed=7)]


class Repeats(NamedTuple):
    """Fits to records that differ in their noise only.

    Attributes:
        results: of each repeat.
        fresh: fit percent on a record of another motion and other currents, of each repeat [%].
    """

    results: list[FitResult]
    fresh: list[float]


def repeated(repeats: int, memory: float = 0.0) -> Repeats:
    """The fits.

    Arguments:
        repeats: how many.
        memory: correlation of neighbouring samples of the force's noise.
    """
    dyno = VirtualDyno(TRUTH, sampling_rate=SAMPLING_RATE, command_lag=LAG)
    clean, unseen = dyno.run(TESTS), dyno.run(FRESH)
    frozen = [p.path for p in parameters(TRUTH) if p.path.endswith(FROZEN)]
    start = replace(TRUTH, {path: value for path, value in beside(TRUTH).items() if path not in frozen})
    results, fresh = [], []
    for seed in range(repeats):
        rng = np.random.default_rng([seed, int(100 * memory)])
        noisy = [_noisy(run, rng, memory) for run in clean]
        results.append(identify.fit(start, noisy, rig=Rig(command_lag=START), freeze=FROZEN, starts=1))
        fresh.append(results[-1].score(unseen)[0])
    return Repeats(results, fresh)


def _noisy(run: BenchRun, rng: np.random.Generator, memory: float) -> BenchRun:
    assert run.command_channel is not None
    command = run.command_channel + CURRENT_NOISE * rng.standard_normal(len(run))
    force = run.force + NOISE * coloured(rng, len(run), memory)
    return dataclasses.replace(run, force=force, command_channel=command)


def true_values() -> dict[str, float]:
    """The truth by the paths of the fits."""
    return {f"law.{p.path}": float(p.value) for p in parameters(TRUTH)} | {"rig.command_lag": LAG}


def main() -> None:
    """Print the coverage of every parameter."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--memory", type=float, default=0.0)
    given = parser.parse_args()
    results, fresh = repeated(given.repeats, given.memory)
    true = true_values()
    print(f"{'parameter':<30} {'true':>10} {'mean':>10} {'standard error':>15} {'covered':>9} {'scatter / error':>16}")
    for i, path in enumerate(e.name for e in results[0].parameters):
        rows = [result.parameters[i] for result in results]
        hits = np.mean([e.interval[0] <= true[path] <= e.interval[1] for e in rows])
        z = [(e.value - true[path]) / e.standard_error for e in rows]
        mean, error = np.mean([e.value for e in rows]), np.mean([e.standard_error for e in rows])
        print(
            f"{path:<30} {true[path]:>10.4g} {mean:>10.4g} {error:>15.2g} {100 * hits:>7.1f} % "
            f"{np.sqrt(np.mean(np.square(z))):>16.2f}"
        )
    print(f"Another motion at other currents: fit {np.mean(fresh):.2f} % (least {np.min(fresh):.2f} %)")


if __name__ == "__main__":
    main()
