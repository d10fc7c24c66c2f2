"""How many cars a second: a sweep by jaxdamp against hand-written C, diffrax, SciPy with numba and CasADi.

    python -m benchmarks.throughput            all peers
    python -m benchmarks.throughput --c-only   jaxdamp and C
    python -m benchmarks.throughput --quick    jaxdamp and C on one core, fewer cars
    python -m benchmarks.throughput --only lag,half_car    some cases

All simulate the same road of class C at 20 m/s, 10 s at 1 kHz, each car with different dampers, in double precision,
and compute the RMS of body acceleration. "error" is the largest relative error of four cars against adaptive
integration at a tolerance of 1e-10. Every peer runs with as many cars as it needs to show its best rate.
"""

import sys
import time
from typing import Any

import numpy as np

from jaxdamp import configure


DONE = configure(cache=False)

from benchmarks import ours  # noqa: E402
from benchmarks._timing import best, report  # noqa: E402
from benchmarks.peers import c, casadi_map, diffrax_vmapped, problem, scipy_numba  # noqa: E402
from jaxdamp import sweep  # noqa: E402
from jaxdamp.sweeps import points  # noqa: E402


DURATION, DT, FEW = 10.0, 1e-3, 4
STEPS = round(DURATION / DT)
QUICK = "--quick" in sys.argv
CARS = {"jaxdamp": 8192 if QUICK else 32_768, "c": 4096, "diffrax": 1024, "scipy": 4, "casadi": 64}


def swept(
    case: str, road: problem.Heights, cars: int, devices: int, *, printed: bool | None = None
) -> tuple[float, np.ndarray]:
    """Cars a second of a sweep after its first call, best of three, and the results of the first cars."""
    ride, table = ours.ride(case, road, printed=printed), problem.draw(case, cars)
    rates, found = [], np.empty(0)
    for _ in range(3):
        marks: list[tuple[float, int]] = []
        data = sweep(
            ride,
            points(ours.point(case, table)),
            devices=devices,
            progress=lambda done, _, marks=marks: marks.append((time.perf_counter(), done)),
        )
        (begin, first), (end, last) = marks[0], marks[-1]
        rates.append((last - first) / (end - begin))
        found = data[ours.METRIC].values
    return max(rates), found


def c_rates(case: str, road: problem.Heights, exact: np.ndarray) -> list[list[Any]]:
    table = problem.draw(case, CARS["c"])
    rows: list[list[Any]] = []
    for name, kernel in (("C, RK4", c.rk4), ("C, exponential step", c.exponential)):
        rates = [
            CARS["c"] / best(lambda n=n, k=kernel: k(case, table, road, DT, threads=n), 5)
            for n in ((1, 1) if QUICK else (1, 2))
        ]
        error = problem.errors(kernel(case, table[:FEW], road, DT), exact).max()
        rows.append([case, name, *[rate * STEPS / 1e6 for rate in rates], float(error)])
    return rows


def other_rates(case: str, road: problem.Heights, exact: np.ndarray) -> list[list[Any]]:
    def row(name: str, cars: int, run: Any, repeats: int = 2) -> list[Any]:
        table = problem.draw(case, cars)
        rate = cars / best(lambda: run(table), repeats)
        error = problem.errors(np.asarray(run(problem.draw(case, max(cars, FEW))[:FEW])), exact).max()
        return [case, name, "", rate * STEPS / 1e6, float(error)]

    rows = [row("diffrax Tsit5, vmapped", CARS["diffrax"], lambda table: diffrax_vmapped.rms(case, table, road, DT))]
    if scipy_numba.available():
        for rtol in (1e-4, 1e-6):
            run = lambda table, rtol=rtol: scipy_numba.rms(case, table, road, DT, rtol=rtol)  # noqa: E731
            rows.append(row(f"solve_ivp with numba, rtol {rtol:g}", CARS["scipy"], run, 1))
    if case == "besinger" and casadi_map.available():
        rows.append(row("CasADi RK4", CARS["casadi"], lambda table: casadi_map.rms(table, road, DT), 1))
    return rows


def cases() -> list[str]:
    """Those named after `--only`, or all."""
    words = sys.argv[1:]
    return words[words.index("--only") + 1].split(",") if "--only" in words else list(problem.CASES)


def main() -> None:
    rows: list[list[Any]] = []
    for case in cases():
        road = problem.heights(case, DURATION, DT)
        exact = problem.reference(case, problem.draw(case, FEW), road, DT)
        counts = (1,) if QUICK else range(1, DONE.cpu_devices + 1)
        error = problem.errors(problem.simulated(case, problem.draw(case, FEW), road, DT), exact).max()
        for name, printed in (("jaxdamp.sweep", None), ("jaxdamp.sweep, by XLA", False)):
            both = [swept(case, road, CARS["jaxdamp"], n, printed=printed)[0] * STEPS / 1e6 for n in counts]
            rows.append([case, name, both[0], both[-1], float(error)])
        if c.available():
            rows += c_rates(case, road, exact)
        if "--c-only" not in sys.argv and not QUICK:
            rows += other_rates(case, road, exact)
        print(*(row for row in rows if row[0] == case), sep="\n", flush=True)  # of long runs, what is done
    ours_ = {row[0]: row[3] for row in rows if row[1] == "jaxdamp.sweep"}
    rows = [[*row, ours_[row[0]] / row[3]] for row in rows]
    head = ["car", "by", "1 core, M steps/s", "all cores", "error", "jaxdamp is so many times as fast"]
    report("throughput", f"Sweep: cars x {DURATION:g} s at {1 / DT:g} Hz, million car-steps a second", head, rows)


if __name__ == "__main__":
    main()
