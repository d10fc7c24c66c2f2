"""How long a fit takes: all 30 records of paper 000, Table I, at 2 kHz, by memoryless laws and laws with hysteresis.

The peer is what an engineer would write first, `scipy.optimize.least_squares` over `scipy.integrate.solve_ivp`, here
for a linear damper in series with a spring, whose right-hand side is one line of NumPy, on the same records. Its finite
differences need a step far above the error of the integration. "first" counts compilation, "warm" does not.

    python -m benchmarks.fit
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from jaxdamp import configure


configure(cache=False)

from benchmarks._timing import first_and_warm, report  # noqa: E402
from jaxdamp.bench import BenchRun, VirtualDyno, programmes  # noqa: E402
from jaxdamp.dampers import Besinger, Linear, SeriesSpring  # noqa: E402
from jaxdamp.identify import FitResult, default_ladder, fit  # noqa: E402


LAWS = (
    "linear",
    "power_law",
    "besinger",
    "linear_friction",
    "linear_friction_lag",
    "besinger_lag",
    "besinger_series_spring",
)
PEER_LEAST = 5.0  # Hz: the slow records would take the peer hours


def peer(runs: Sequence[BenchRun]) -> np.ndarray:
    """Coefficient [N s/m] and stiffness [N/m] by output error, with SciPy's integrator and finite differences."""

    def misses(scaled: np.ndarray) -> np.ndarray:
        rate, stiffness = 1e3 * scaled[0], 1e6 * scaled[1]
        parts = []
        for run in runs:
            since, velocity = run.time - run.time[0], run.velocity
            solved = solve_ivp(
                lambda t, force: stiffness * (np.interp(t, since, velocity) - force / rate),
                (0.0, since[-1]),
                [rate * velocity[0]],
                t_eval=since,
                rtol=1e-6,
                atol=1e-3,
            )
            half = int(0.5 * run.sampling_rate / run.frequency)
            parts.append((solved.y[0] - run.force)[half:])
        return np.concatenate(parts)

    return least_squares(misses, [1.0, 0.5], method="lm", diff_step=1e-3).x * [1e3, 1e6]


def main() -> None:
    car = SeriesSpring(Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05), stiffness=1.5e6, cubic_stiffness=1.2e8)
    runs = list(VirtualDyno(car, force_noise=20.0, stroke_noise=1e-5).run(programmes.paper_000_table_1()))
    rows: list[list[Any]] = []
    for name, law in default_ladder(runs, LAWS).items():
        results: list[FitResult] = []
        first, warm = first_and_warm(lambda law=law, kept=results: kept.append(fit(law, runs)), repeats=5)
        free, steps, rmse = len(results[-1].parameters), results[-1].steps, results[-1].rmse
        rows.append([name, free, steps, first, warm, rmse])
    samples, head = sum(map(len, runs)), ["law", "free", "steps", "first, s", "warm, s", "RMSE, N"]
    report("fit", f"Fit of {len(runs)} records, {samples} samples", head, rows)

    fast = [run for run in runs if run.frequency > PEER_LEAST]
    start = SeriesSpring(Linear(1000.0), stiffness=5e5)
    results = []
    _, ours = first_and_warm(lambda: results.append(fit(start, fast, freeze=["cubic_stiffness"])), repeats=5)
    begin = time.perf_counter()
    found = peer(fast)
    theirs = time.perf_counter() - begin
    own = [float(e.value) for e in results[-1].parameters]
    rows = [["jaxdamp, warm", ours, *own], ["least_squares with solve_ivp", theirs, *map(float, found)]]
    title = f"Linear damper and series spring on {len(fast)} records, {sum(map(len, fast))} samples"
    report("fit_beside", f"{title}: {theirs / ours:.0f} times", ["by", "s", "c, N s/m", "k, N/m"], rows, 6)


if __name__ == "__main__":
    main()
