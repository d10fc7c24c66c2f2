"""How often 95 % intervals hold the true value: laws and machines fitted many times to records with other noise.

The records are made once by the virtual dyno; each repeat adds noise of its own, white or with a memory (a first-order
autoregression whose neighbours have the correlation 0.9). Searches start 20 % beside the truth. Counted are parameters
that are called identifiable; the share of repeats in which they are is in the last column.

    python -m benchmarks.coverage [--repeats 200] [--only NAME]
"""

import argparse
import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy.signal

from jaxdamp import configure


configure()

from jaxdamp import identify  # noqa: E402
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno  # noqa: E402
from jaxdamp.dampers import AbstractDamper, Besinger, Bilinear, BoucWen, Lag, Linear, SeriesSpring  # noqa: E402
from jaxdamp.identify import FitResult  # noqa: E402
from jaxdamp.parameters import parameters, replace  # noqa: E402
from jaxdamp.rig import Rig  # noqa: E402


TESTS = [SineTest(0.02, 1.0, cycles=4), SineTest(0.01, 4.0, cycles=8), SineTest(0.005, 10.0, cycles=16)]
SAMPLING_RATE = 500.0  # Hz
NOISE = 15.0  # N
MEMORY = 0.9
BESIDE = (1.2, 0.8)  # start relative to the truth
BESINGER = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
CASES: dict[str, tuple[AbstractDamper, Rig | None, tuple[str, ...]]] = {
    "linear": (Linear(1500.0), None, ()),
    "bilinear": (Bilinear(2600.0, 1200.0), None, ()),
    "besinger": (BESINGER, None, ()),
    "lag": (Lag(Bilinear(2600.0, 1200.0), 0.004), None, ()),
    "series spring": (SeriesSpring(Bilinear(2600.0, 1200.0), 3e5), None, ("cubic_stiffness",)),
    "bouc-wen": (BoucWen(1500.0, 2000.0, 120.0, 0.0015), None, ("exponent",)),
    "bilinear on a machine": (
        Bilinear(2600.0, 1200.0),
        Rig(gas_force=-120.0, gas_stiffness=1500.0, moving_mass=4.0, force_delay=1e-3),
        (),
    ),
    "besinger on a machine": (BESINGER, Rig(gas_force=-120.0, friction=30.0, force_delay=1e-3), ()),
}


def coloured(rng: np.random.Generator, count: int, memory: float) -> np.ndarray:
    """Noise of standard deviation 1 whose neighbours have this correlation."""
    settled = rng.standard_normal(count + 200)
    return np.asarray(scipy.signal.lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], settled))[200:]


def beside(module: AbstractDamper | Rig, defaults: AbstractDamper | Rig | None = None) -> dict[str, float]:
    """Values alternately above and below those of a law or a machine, where they are not the defaults."""
    own = parameters(module)
    same = (
        [False] * len(own)
        if defaults is None
        else [p.value == q.value for p, q in zip(own, parameters(defaults), strict=True)]
    )
    chosen = [p for p, is_default in zip(own, same, strict=True) if not is_default and p.value != 0.0]
    return {p.path: float(p.value) * BESIDE[i % 2] for i, p in enumerate(chosen)}


def repeated(
    law: AbstractDamper, rig: Rig | None, freeze: Sequence[str], memory: float, repeats: int
) -> list[FitResult]:
    """Fits to records that differ in their noise only."""
    clean = VirtualDyno(law, rig=rig, sampling_rate=SAMPLING_RATE).run(TESTS)
    frozen = {p.path for p in parameters(law) if p.path.rpartition(".")[2] in freeze}
    start = replace(law, {path: value for path, value in beside(law).items() if path not in frozen})
    machine = None if rig is None else replace(rig, beside(rig, Rig()))
    results = []
    for seed in range(repeats):
        rng = np.random.default_rng([seed, int(100 * memory)])
        noisy: list[BenchRun] = [
            dataclasses.replace(run, force=run.force + NOISE * coloured(rng, len(run), memory)) for run in clean
        ]
        results.append(identify.fit(start, noisy, rig=machine, freeze=freeze, starts=1))
    return results


def main() -> None:
    """Print the coverage of every parameter of every case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    print(f"{'case':<24} {'noise':<10} {'parameter':<26} {'covered':>8} {'scatter / error':>16} {'identifiable':>13}")
    for name, (law, rig, freeze) in CASES.items():
        if not name.startswith(given.only):
            continue
        true = {p.path: float(p.value) for p in parameters(law)}
        if rig is not None:
            true = {f"law.{k}": v for k, v in true.items()} | {f"rig.{p.path}": float(p.value) for p in parameters(rig)}
        for memory in (0.0, MEMORY):
            results = repeated(law, rig, freeze, memory, given.repeats)
            for i, path in enumerate(e.name for e in results[0].parameters):
                rows = [r.parameters[i] for r in results if not r.parameters[i].note]
                hits = [e.interval[0] <= true[path] <= e.interval[1] for e in rows]
                z = [(e.value - true[path]) / e.standard_error for e in rows]
                share = 100.0 * len(rows) / len(results)
                covered = f"{100.0 * np.mean(hits):.1f} %" if rows else "–"
                scatter = f"{np.sqrt(np.mean(np.square(z))):.2f}" if rows else "–"
                kind = f"memory {memory:g}" if memory else "white"
                print(f"{name:<24} {kind:<10} {path:<26} {covered:>8} {scatter:>16} {share:>11.0f} %", flush=True)


if __name__ == "__main__":
    main()
