"""How often a fit names what it leaves out: `python -m benchmarks.left_out`.

Virtual records of dampers with random parameters, on a noisy bench with one artefact of random size, fitted by the true
law without it. The table shows the share of seeds in which a warning names the artefact, and in which it names others.
"""

import argparse
import sys
from collections.abc import Callable

import jaxdamp


jaxdamp.configure()

import numpy as np  # noqa: E402

from jaxdamp import bench, dampers, identify  # noqa: E402
from jaxdamp._tables import Column, Table  # noqa: E402
from jaxdamp.rig import Rig  # noqa: E402


WORDS = {
    "offset": "a constant force",
    "gas": "a constant force",
    "delay": "a delay of the force",
    "heat": "the oil warms up",
    "clearance": "a clearance",
    "mass": "a moving mass",
    "friction": "friction of",
}
TESTS = [(0.02, 1.0), (0.02, 3.0), (0.01, 8.0)]  # m, Hz


def with_clearance(law: dampers.AbstractDamper, gap: float, rng: np.random.Generator) -> list[bench.BenchRun]:
    """Records of a memoryless law whose rod moves by `gap` [m] after each reversal before the piston follows."""
    runs = []
    for amplitude, frequency in TESTS:
        time = np.arange(int(8 * 500 / min(frequency, 4.0))) / 500.0
        stroke = amplitude * np.sin(2 * np.pi * frequency * time)
        velocity = 2 * np.pi * frequency * amplitude * np.cos(2 * np.pi * frequency * time)
        piston, moved = 0.0, np.zeros(time.size)
        for k, x in enumerate(stroke):
            new = min(max(piston, x - 0.5 * gap), x + 0.5 * gap)
            moved[k], piston = float(new != piston), new
        force = np.asarray(law.force_velocity(velocity)) * moved  # type: ignore[attr-defined]
        force += 0.01 * np.abs(force).max() * rng.standard_normal(time.size)
        runs.append(bench.BenchRun(f"{frequency:g} Hz", time, stroke, velocity, force))
    return runs


def records(kind: str, law: dampers.AbstractDamper, rng: np.random.Generator, seed: int) -> list[bench.BenchRun]:
    """Records with one artefact."""
    if kind == "clearance":
        return with_clearance(law, rng.uniform(2e-4, 1e-3), rng)
    rigs: dict[str, Callable[[], Rig]] = {
        "none": Rig,
        "offset": lambda: Rig(force_offset=rng.choice([-1, 1]) * rng.uniform(10.0, 60.0)),
        "gas": lambda: Rig(gas_force=-rng.uniform(80.0, 300.0)),
        "delay": lambda: Rig(force_delay=rng.uniform(5e-4, 3e-3)),
        "heat": lambda: Rig(temperature_slope=rng.uniform(0.002, 0.004), heating=rng.uniform(0.5, 1.5) / 200.0),
        "mass": lambda: Rig(moving_mass=rng.uniform(1.0, 4.0)),
        "friction": lambda: Rig(friction=rng.uniform(15.0, 50.0)),
    }
    cycles = 60 if kind == "heat" else 4
    dyno = bench.VirtualDyno(law, rig=rigs[kind](), force_noise=10.0, stroke_noise=1e-5, sampling_rate=500.0, seed=seed)
    return list(dyno.run([bench.SineTest(a, f, cycles=cycles) for a, f in TESTS]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--only", default=",".join(["none", *WORDS]))
    parser.add_argument("--show", action="store_true", help="Print the warnings of seeds that miss the artefact.")
    arguments = parser.parse_args()
    rows = []
    for kind in arguments.only.split(","):
        named, others = 0, 0
        for seed in range(arguments.seeds):
            rng = np.random.default_rng(seed)
            numbers = np.array([1600.0, 4200.0, 900.0, 0.13, 0.05]) * rng.uniform(0.75, 1.3, 5)
            law = dampers.Besinger(*numbers)
            result = identify.fit(dampers.Besinger, records(kind, law, rng, seed), starts=1)
            found = [w for w in result.warnings if "which the fit leaves out" in w]
            hit = any(WORDS.get(kind, "-") in w for w in found)
            named += hit
            others += any(WORDS.get(kind, "-") not in w for w in found)
            if arguments.show and not hit:
                print(kind, seed, result.warnings, file=sys.stderr)
        rows.append((kind, 100.0 * named / arguments.seeds, 100.0 * others / arguments.seeds))
    columns = (Column("left out"), Column("named", "%", ".0f"), Column("others named too", "%", ".0f"))
    print(Table(f"What a fit leaves out, {arguments.seeds} seeds", columns, tuple(rows)).to_text())


if __name__ == "__main__":
    main()
