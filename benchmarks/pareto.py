"""Hypervolume of fronts of ride comfort against tyre load: `tune.pareto` beside NSGA-II (pymoo) with 20 times the runs.

    python -m benchmarks.pareto [--slopes 4 8] [--seeds 3] [--population 100]

Quarter car on 5 s of an ISO class C road at 20 m/s; free are the slopes of a force-velocity curve of so many pieces,
between 300 and 12 000 N s/m, with a limit on the working space. Each seed is a random start of `tune.pareto` and the
seed of NSGA-II (as many generations as its budget allows). A design simulated with derivatives counts
as one run and one more for each parameter, which is more than the time that it takes. The hypervolume counts up to one
reference point, and is given relative to that of a front of 5000 points. Of NSGA-II all designs that it ever simulated
count, and its last population alone.
"""

import argparse
import time
from typing import Any

import numpy as np

from jaxdamp import configure


configure(cpu_devices=1, cache=False)

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
from pymoo.algorithms.moo.nsga2 import NSGA2  # noqa: E402
from pymoo.core.problem import Problem  # noqa: E402
from pymoo.optimize import minimize  # noqa: E402

from benchmarks._timing import report  # noqa: E402
from jaxdamp import Ride, dampers, roads, tune  # noqa: E402
from jaxdamp._progress import Progress  # noqa: E402
from jaxdamp.vehicles.presets import quarter_car_000  # noqa: E402


OBJECTIVES = ["rms_sprung_acceleration", "rms_dynamic_tyre_load"]
LIMIT = "working_space_peak_to_peak"
LOWER, UPPER, TOP = 300.0, 12_000.0, 0.062
ROAD = roads.iso8608("C", speed=20.0, seed=1)
DURATION, DT, LANES, POINTS, BETWEEN, FACTOR = 5.0, 2e-3, 16, 33, 600, 20
RUN: dict[str, Any] = {"duration": DURATION, "dt": DT}
OPTIONS: dict[str, Any] = RUN | {"fresh_roads": 0, "over": {"slopes": (LOWER, UPPER)}, "limits": {LIMIT: TOP}}


def car(slopes: np.ndarray) -> Any:
    """The quarter car with a damper curve of these slopes; knots to both sides of zero velocity."""
    sides = np.array([0.05, 0.15, 0.3])[: len(slopes) // 2 - 1]
    knots = np.concatenate([-sides[::-1], [0.0], sides])
    return quarter_car_000(dampers.PiecewiseLinear(knots, slopes, knee_width=0.01, monotone=False))


class Simulated(Problem):
    """The same work for pymoo: designs simulated side by side."""

    def __init__(self, count: int) -> None:
        super().__init__(n_var=count, n_obj=2, n_ieq_constr=1, xl=LOWER, xu=UPPER)
        ride = Ride(car(np.full(count, 3e3)), ROAD, metrics=[*OBJECTIVES, LIMIT], **RUN).side_by_side()

        def metrics(slopes: Any) -> Any:
            values = ride({"damper.slopes": slopes})
            return jnp.stack([values[name] for name in (*OBJECTIVES, LIMIT)])

        self.values = jax.jit(jax.vmap(metrics))

    def all_metrics(self, designs: np.ndarray) -> np.ndarray:
        """Objectives and limited metric of designs."""
        padded = np.concatenate([designs, np.repeat(designs[:1], -len(designs) % LANES, axis=0)])
        parts = [np.asarray(self.values(part)) for part in padded.reshape(-1, LANES, designs.shape[1])]
        return np.concatenate(parts)[: len(designs)]

    def _evaluate(self, x: np.ndarray, out: dict, *args: Any, **kwargs: Any) -> None:
        values = self.all_metrics(x)
        out["F"], out["G"] = values[:, :2], values[:, 2:] - TOP


def nsga2(problem: Simulated, runs: float, seed: int, population: int) -> tuple[np.ndarray, np.ndarray]:
    """All allowed designs that NSGA-II ever simulated, and those of its last population, by their objectives."""
    generations = int(runs // population)
    history: list[np.ndarray] = []
    with Progress("NSGA-II") as shown:

        def record(algorithm: Any) -> None:
            designs = algorithm.pop
            history.append(designs.get("F")[designs.get("G")[:, 0] <= 0.0])
            shown(f"generation {len(history)} of {generations}")

        result = minimize(
            problem, NSGA2(pop_size=population), ("n_gen", generations), seed=seed, callback=record, verbose=False
        )
    return np.concatenate(history), np.atleast_2d(result.F) if result.F is not None else np.zeros((0, 2))


def row(count: int, seed: int, population: int, problem: Simulated, whole: tuple[float, np.ndarray]) -> dict[str, Any]:
    """Both fronts of one seed."""
    start = np.random.default_rng(seed).uniform(LOWER, UPPER, count)
    begun = time.perf_counter()
    front = tune.pareto(OBJECTIVES, car(start), ROAD, points=POINTS, between=BETWEEN, **OPTIONS)
    taken = time.perf_counter() - begun
    runs = front.evaluations * (1 + count) + front.interpolated
    begun = time.perf_counter()
    history, last = nsga2(problem, FACTOR * runs, seed, population)
    full, reference = whole
    return {
        "slopes": count,
        "seed": seed,
        "points": len(front),
        "designs": front.evaluations,
        "runs": runs,
        "seconds": round(taken, 1),
        "front": tune.hypervolume(front.objectives, reference) / full,
        "NSGA-II runs": FACTOR * runs,
        "NSGA-II seconds": round(time.perf_counter() - begun, 1),
        "NSGA-II, all designs": tune.hypervolume(history, reference) / full,
        "NSGA-II, last population": tune.hypervolume(last, reference) / full,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slopes", type=int, nargs="+", default=[4, 8], help="numbers of pieces of the curve")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--population", type=int, default=100, help="of NSGA-II")
    words = parser.parse_args()
    rows = []
    for count in words.slopes:
        problem = Simulated(count)
        whole = tune.pareto(OBJECTIVES, car(np.full(count, 3e3)), ROAD, points=129, between=5000, **OPTIONS)
        reference = np.array([whole.reference[name] for name in OBJECTIVES])
        print(whole.summary, *whole.warnings, sep="\n", flush=True)
        for seed in range(words.seeds):
            rows.append(row(count, seed, words.population, problem, (whole.hypervolume, reference)))
            print(", ".join(f"{name} {value}" for name, value in rows[-1].items()), flush=True)
    title = f"Hypervolume, relative to a front of 5000 points; NSGA-II with a population of {words.population}"
    report("pareto", title, list(rows[0]), [list(one.values()) for one in rows], digits=6)


if __name__ == "__main__":
    main()
