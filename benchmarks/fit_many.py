"""200 dampers fitted in one call, beside single fits, SciPy's `least_squares` and lmfit on the same records.

The peers fit the memoryless law, written in NumPy, with finite differences and from the same start; each damper has
three records. Compilation does not count. Single fits and the peers are timed on the first dampers. Times are compared
by the processor's clock, which other work on the machine changes less.

    python -m benchmarks.fit_many
"""

import argparse
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from jaxdamp import configure


configure(cache=False)

from benchmarks._timing import Cost, cost_of, report  # noqa: E402
from jaxdamp.bench import BenchRun, SineTest, VirtualDyno  # noqa: E402
from jaxdamp.dampers import AbstractDamper, Besinger, Lag  # noqa: E402
from jaxdamp.identify import fit, fit_many  # noqa: E402


TESTS = [SineTest(0.02, 1.0), SineTest(0.02, 3.0), SineTest(0.01, 8.0)]
TRUE = np.array([1600.0, 4200.0, 900.0, 0.13, 0.05])
START = np.array([1500.0, 4000.0, 1000.0, 0.12, 0.06])
NAMES = ("compression_rate", "rebound_rate", "blow_off_rate", "limit_velocity", "transition_velocity")
TIMED = 10  # dampers that single fits and peers are timed on


def besinger(numbers: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paper 001's law in NumPy [N]."""
    compression, rebound, blow_off, limit, transition = numbers
    closed = np.minimum(v, limit)
    u = closed / transition - 1.0
    rate = 0.5 * (rebound - compression) * u / np.sqrt(1.0 + u * u) + 0.5 * (rebound + compression)
    return rate * closed + blow_off * np.maximum(v - limit, 0.0)


def by_scipy(runs: Sequence[BenchRun]) -> np.ndarray:
    """`scipy.optimize.least_squares` within positive bounds."""
    velocity, force = (np.concatenate([getattr(run, name) for run in runs]) for name in ("velocity", "force"))
    positive = (np.full(5, 1e-6), np.full(5, np.inf))
    return START * least_squares(lambda s: besinger(s * START, velocity) - force, np.ones(5), bounds=positive).x


def by_lmfit(runs: Sequence[BenchRun]) -> np.ndarray:
    """The function `minimize` of lmfit (leastsq with bounds)."""
    import lmfit

    velocity, force = (np.concatenate([getattr(run, name) for run in runs]) for name in ("velocity", "force"))
    parameters = lmfit.Parameters()
    for name, value in zip(NAMES, START, strict=True):
        parameters.add(name, value=value, min=1e-6)
    found = lmfit.minimize(lambda p: besinger(np.array([p[n].value for n in NAMES]), velocity) - force, parameters)
    return np.array([found.params[name].value for name in NAMES])  # type: ignore[attr-defined]


def records(count: int, wrap: Callable[[AbstractDamper], AbstractDamper]) -> list[list[BenchRun]]:
    """Records of dampers whose numbers differ by up to 20 %."""
    rng = np.random.default_rng(0)
    laws = [wrap(Besinger(*(TRUE * rng.uniform(0.8, 1.2, 5)))) for _ in range(count)]
    dynos = [VirtualDyno(law, force_noise=10.0, sampling_rate=500.0, seed=i) for i, law in enumerate(laws)]
    return [list(dyno.run(TESTS)) for dyno in dynos]


def run(count: int) -> None:
    """Fit so many dampers by each method, and print the table."""
    rows: list[list[Any]] = []
    cases: dict[str, Callable[[AbstractDamper], AbstractDamper]] = {"besinger": lambda law: law}
    cases["besinger_lag"] = lambda law: Lag(law, 0.004)
    for name, wrap in cases.items():
        dampers = records(count, wrap)
        start = wrap(Besinger(*START))
        fit_many(start, dampers)  # compiles
        own, many = cost_of(lambda s=start, d=dampers: fit_many(s, d), repeats=5)

        def row(label: str, cost: Cost, least: float | None, law: str = name, own: Cost = own) -> list[Any]:
            return [law, label, *cost, cost.processor / own.processor, least]

        rows.append(row("fit_many", own, many.fit_percent.min()))
        for starts, label in ((1, "fit, one start"), (None, "fit, all starts")):
            fit(start, dampers[0], starts=starts)  # compiles
            some = dampers[:TIMED]
            each, found = cost_of(lambda s=start, d=some, n=starts: [fit(s, runs, starts=n) for runs in d])
            rows.append(row(label, each.times(count / len(some)), min(r.fit_percent for r in found)))
        for label, peer in (("SciPy least_squares", by_scipy), ("lmfit", by_lmfit)) if name == "besinger" else ():
            some = dampers[:TIMED]
            each, found = cost_of(lambda d=some, p=peer: [p(runs) for runs in d])
            apart = max(
                float(np.max(np.abs(a - v) / e))
                for a, v, e in zip(found, many.values, many.standard_errors, strict=False)
            )
            label = f"{label}, up to {apart:.2g} standard errors from fit_many"
            rows.append(row(label, each.times(count / len(some)), None))
    head = ["law", "by", "s", "processor s", "times fit_many's", "least fit, %"]
    report("fit_many", f"{count} dampers, three records each", head, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dampers", type=int, default=200)
    run(parser.parse_args().dampers)


if __name__ == "__main__":
    main()
