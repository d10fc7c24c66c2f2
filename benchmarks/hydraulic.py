"""A tube identified from a noisy bench: what is predicted, and how often 95 % intervals are right.

The virtual damper heats up, has a clearance in its joint and friction in its seal; the machine adds a moving mass, a
delay and a zero error, and noise to the force. Every record begins at rest. The first fit starts from the records and
the stated geometry. It is scored on records of other strokes and frequencies, beside laws of the ladder. Each repeat
has noise and a zero error of its own and starts from the first result. Without the clearance a fit is several times as
fast. With `--from-truth` the first fit starts from the true numbers: in a fraction of the time, for the coverage alone.

    python -m benchmarks.hydraulic [--law twin-tube] [--repeats 40] [--laws besinger_play,series_spring_dahl]
        [--without-clearance] [--from-truth]
"""

import argparse
import dataclasses
import time
from collections.abc import Sequence
from typing import NamedTuple

from jaxdamp import configure


configure()

import numpy as np  # noqa: E402

from jaxdamp.bench import BenchRun, SineTest, VirtualDyno  # noqa: E402
from jaxdamp.dampers import AbstractDamper, Heated, Linear, MonoTube, Play, TwinTube  # noqa: E402
from jaxdamp.identify import FitResult, default_ladder, fit, fit_percent, prepare  # noqa: E402
from jaxdamp.identify.problem import linearised  # noqa: E402
from jaxdamp.parameters import parameters, replace  # noqa: E402
from jaxdamp.rig import Rig  # noqa: E402


ACROSS = Linear(20.0)  # N s/m, beside the damper: what a law in series with a clearance needs
MACHINE = Rig(moving_mass=2.0, force_delay=5e-4)


class Tube(NamedTuple):
    """A virtual tube, what is known of it [m, m³], and the names of its numbers that are not fitted."""

    tube: MonoTube | TwinTube
    geometry: dict[str, float]
    known: tuple[str, ...]

    def damper(self, rigid: bool) -> AbstractDamper:
        """The damper that heats up, with the clearance of its joint unless it is rigid."""
        inside = self.tube + ACROSS
        held = inside if rigid else Play(inside, stiffness=4e6, clearance=1e-4)
        return Heated(held, sensitivity=0.003, static_force_slope=-1.0)

    def start(self, runs: Sequence[BenchRun], rigid: bool) -> AbstractDamper:
        """The damper from records and geometry, with rough values of heat and clearance."""
        columns = (np.concatenate([getattr(run, name) for run in runs]) for name in ("velocity", "force", "stroke"))
        inside = type(self.tube).guess(*columns, **self.geometry) + ACROSS
        return Heated(inside if rigid else Play(inside, stiffness=2e6, clearance=2e-4), sensitivity=0.002)


def bore(area: float) -> float:
    """Diameter [m]."""
    return float(2.0 * np.sqrt(area / np.pi))


TUBES = {
    "mono-tube": Tube(
        # its leak passes 2 % of the flow where the rebound valve opens
        replace(MonoTube.reference(), {"piston.leak": 1e-12}),
        {"piston_diameter": bore(1.52e-3), "rod_diameter": bore(1e-4), "rebound_volume": 1.1e-4},
        (),
    ),
    "twin-tube": Tube(
        # without an opening pressure the piston's compression valve could not be told from its bleed
        replace(
            TwinTube.reference(), {"piston.compression_opening_pressure": 3e5, "base.compression_valve_area": 4e-6}
        ),
        {
            "piston_diameter": bore(1.6493e-3 + 3.1416e-4),
            "rod_diameter": bore(3.1416e-4),
            "rebound_volume": 3.3e-4,
            "compression_volume": 3.9e-4,
        },
        ("base.rebound_*",),
    ),
}
NOISE, ZERO_ERROR = 10.0, 5.0  # N, standard deviations of a sample, and of the zero of a load cell that was zeroed
CYCLES, SAMPLES = 12, 300  # of each record; samples of a cycle
MOTIONS = [(0.03, 0.1), (0.025, 1.6), (0.025, 5.0), (0.006, 12.0)]  # m, Hz
OTHERS = [(0.02, 0.5), (0.03, 2.5), (0.015, 6.0), (0.008, 8.0)]
KNOWN = ["rod_area", "exponent", "rate", "cooling_time", "initial_rise"]
PRIORS = {"force_offset": (0.0, ZERO_ERROR)}


def records(damper: AbstractDamper, motions: Sequence[tuple[float, float]]) -> list[BenchRun]:
    """Records without noise."""
    runs = []
    for amplitude, frequency in motions:
        test = SineTest(amplitude, frequency, CYCLES, rest_before=0.25 / frequency, run_up=1.0 / frequency)
        runs += VirtualDyno(damper, SAMPLES * frequency, rig=MACHINE).run(test)
    return runs


def noisy(runs: Sequence[BenchRun], seed: int) -> tuple[list[BenchRun], float]:
    """The same with noise, and their zero error [N]."""
    rng = np.random.default_rng(seed)
    zero = float(rng.normal(0.0, ZERO_ERROR))
    return [dataclasses.replace(run, force=run.force + zero + rng.normal(0.0, NOISE, len(run))) for run in runs], zero


def identified(tube: Tube, runs: list[BenchRun], law: AbstractDamper, rig: Rig | None) -> FitResult:
    """Damper and machine from records, from this start."""
    freeze = [*KNOWN, *tube.known]
    return fit(law, runs, rig=rig, priors=PRIORS, starts=1, freeze=freeze, samples_per_cycle=None)


def print_information(damper: AbstractDamper, known: Sequence[str], runs: Sequence[BenchRun]) -> None:
    """Standard errors that the records allow, each alone and all together, and the bias due to the steps of a fit."""
    machine = dataclasses.replace(MACHINE, force_offset=1e-6)  # which frees it
    problem = prepare(damper, runs, rig=machine, freeze=known, samples_per_cycle=None)
    residual, jacobian = (np.asarray(a) for a in linearised(problem.free, problem.free.values, problem.residuals))
    values, rows = np.asarray(problem.free.values), problem.owner >= 0
    prior = np.diag([(1.0 / ZERO_ERROR) ** 2 if name.endswith("offset") else 0.0 for name in problem.free.names])
    matrix = jacobian[rows].T @ jacobian[rows] / NOISE**2 + prior
    errors = np.sqrt(np.diag(scaled_inverse(matrix)))
    bias = -scaled_inverse(matrix) @ (jacobian[rows].T @ residual[rows]) / NOISE**2
    print(f"{'parameter':<56} {'alone':>9} {'together':>9} {'bias / s.e.':>12}")
    for i, name in enumerate(problem.free.names):
        of, unit = (1.0, "N") if name.endswith("offset") else (abs(values[i]) / 100.0, "%")
        alone, together = 1.0 / np.sqrt(matrix[i, i]) / of, errors[i] / of
        print(f"{name:<56} {alone:>7.2g} {unit} {together:>7.2g} {unit} {bias[i] / errors[i]:>12.2f}", flush=True)


def scaled_inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of an information matrix whose rows have different units."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return np.linalg.inv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)


def print_score(name: str, result: FitResult, clean: Sequence[BenchRun], measured: Sequence[BenchRun]) -> None:
    """Fit [%] on records that were not fitted, by the force without and with noise, after the run-up."""
    predicted = result.respond(measured)
    rows = [slice(SAMPLES * 5 // 4, None)] * len(clean)
    scores = [
        [fit_percent([run.force[k]], [f[k]]) for run, f, k in zip(runs, predicted, rows, strict=True)]
        for runs in (clean, measured)
    ]
    for run, without, with_noise in zip(clean, *scores, strict=True):
        print(f"{name:<24} {run.name:<16} {without:>7.2f} % {with_noise:>7.2f} %", flush=True)


def print_coverage(damper: AbstractDamper, results: Sequence[FitResult], zeros: Sequence[float]) -> None:
    """For each parameter the share of intervals that hold the true value, where it is called identifiable."""
    true = {f"law.{p.path}": float(p.value) for p in parameters(damper)}
    true |= {f"rig.{p.path}": float(p.value) for p in parameters(MACHINE)}
    print(f"{'parameter':<56} {'s.e.':>9} {'covered':>8} {'mean z':>7} {'rms z':>6} {'identifiable':>13}")
    hits, sure_of_all = [], 0
    for i, name in enumerate(e.name for e in results[0].parameters):
        rows = [
            (r.parameters[i], zero if name.endswith("offset") else true[name])
            for r, zero in zip(results, zeros, strict=True)
        ]
        sure = [(e, value) for e, value in rows if not e.note]
        share = 100.0 * len(sure) / len(rows)
        if not sure:
            print(f"{name:<56} {'':>9} {'–':>8} {'–':>7} {'–':>6} {share:>11.0f} %", flush=True)
            continue
        inside = [e.interval[0] <= value <= e.interval[1] for e, value in sure]
        z = np.array([(e.value - value) / e.standard_error for e, value in sure])
        of, unit = (1.0, "N") if name.endswith("offset") else (abs(sure[0][1]) / 100.0, "%")
        error = np.median([e.standard_error for e, _ in sure]) / of
        hits += inside
        sure_of_all += len(sure)
        print(
            f"{name:<56} {error:>7.2g} {unit} {100.0 * np.mean(inside):>6.0f} % {z.mean():>7.2f} "
            f"{np.sqrt(np.mean(z**2)):>6.2f} {share:>11.0f} %",
            flush=True,
        )
    print(f"all: {100.0 * np.mean(hits):.1f} % of {sure_of_all} intervals", flush=True)


def main() -> None:
    """Print what the records can tell, what the fit predicts, and the coverage of its intervals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--law", default="mono-tube", choices=TUBES)
    parser.add_argument("--repeats", type=int, default=40)
    parser.add_argument("--laws", default="besinger_play,series_spring_dahl")
    parser.add_argument("--without-clearance", action="store_true")
    parser.add_argument("--from-truth", action="store_true")
    given = parser.parse_args()
    tube, rigid = TUBES[given.law], given.without_clearance
    damper = tube.damper(rigid)
    begun = time.perf_counter()

    def passed(what: str) -> None:
        print(f"[{time.perf_counter() - begun:.0f} s] {what}", flush=True)

    clean, others = records(damper, MOTIONS), records(damper, OTHERS)
    passed("records made")
    print_information(damper, [*KNOWN, *tube.known], clean)
    runs, zero = noisy(clean, 0)
    rough = tube.start(runs, rigid), Rig(moving_mass=1.0, force_delay=2e-4, force_offset=1.0)
    begin = (damper, dataclasses.replace(MACHINE, force_offset=1.0)) if given.from_truth else rough
    results, zeros = [identified(tube, runs, *begin)], [zero]
    passed(f"first fit, {results[0].steps} steps\n{results[0]}")
    measured = noisy(others, 10_000)[0]
    print_score(given.law, results[0], others, measured)
    machine = ["offset", "mass", "delay"]
    for name in filter(None, given.laws.split(",")):
        law = default_ladder(runs, [name], rig=machine)[name]
        print_score(name, fit(law, runs, rig=machine, samples_per_cycle=None, starts=1), others, measured)
        passed(name)
    for seed in range(1, given.repeats):
        runs, zero = noisy(clean, seed)
        results.append(identified(tube, runs, results[0].law, results[0].rig))
        zeros.append(zero)
        passed(f"repeat {seed} of {given.repeats - 1}, {results[-1].steps} steps")
        if seed == given.repeats - 1 or seed % 10 == 0:
            print_coverage(damper, results, zeros)


if __name__ == "__main__":
    main()
