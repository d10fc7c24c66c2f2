"""Identification beside SciPy and lmfit in one run, on the same records: machine and law, many dampers, posterior.

- `rig`: 30 records of paper 000, Table I, with gas force and stiffness, friction of the seals, delay, offset and noise.
  Law and machine are fitted together. The peers have the same model in NumPy, with cubic splines of the motion for the
  delay, the same start and finite differences.
- `many`: `benchmarks.fit_many`.
- `posterior`: of the law's numbers from three records, compiled anew in each call, beside a random walk (Metropolis) in
  NumPy with the best step for a normal distribution, and lmfit with emcee (`pip install emcee`), all from the minimum.

The extras `benchmarks` and `bayes` are needed. All stages, or those that are named:

    python -m benchmarks.identification rig many posterior
"""

import argparse
import functools
import importlib.util
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from benchmarks import fit_many  # configures JAX
from benchmarks._timing import cost_of, report
from jaxdamp.bench import BenchRun, VirtualDyno, programmes
from jaxdamp.dampers import Besinger
from jaxdamp.identify import fit
from jaxdamp.rig import Rig


MACHINE = {"gas_force": -120.0, "gas_stiffness": 3000.0, "friction": 40.0, "force_delay": 1e-3}
OFFSET = 15.0  # N; the records show its sum with the gas force
MACHINE_START = {"gas_force": -60.0, "gas_stiffness": 1000.0, "friction": 20.0, "force_delay": 2e-4}
SEEN = np.array([*fit_many.TRUE, MACHINE["gas_force"] + OFFSET, *list(MACHINE.values())[1:]])
STARTED = np.array([*fit_many.START, *MACHINE_START.values()])
NAMES = (*fit_many.NAMES, *MACHINE)
LAST = 20  # samples at the end of a record, which the delay leaves without motion
STEPS = 20_000  # of each random walk
WALKERS, WALKER_STEPS = 20, 2000


def progress(text: str) -> None:
    print(f"... {text}", file=sys.stderr, flush=True)


class OnMachine:
    """Law and machine in NumPy, over the records without their first half cycles and last samples."""

    def __init__(self, runs: Sequence[BenchRun]) -> None:
        halves = [int(0.5 * run.sampling_rate / run.frequency) for run in runs]
        self.times = [run.time[half:-LAST] for run, half in zip(runs, halves, strict=True)]
        self.motions = [CubicSpline(run.time, np.stack([run.stroke, run.velocity], axis=1)) for run in runs]
        self.force = np.concatenate([run.force[half:-LAST] for run, half in zip(runs, halves, strict=True)])

    def misses(self, numbers: np.ndarray) -> np.ndarray:
        """Force of the model minus the measured one [N]."""
        gas, stiffness, friction, delay = numbers[5:]
        moved = [motion(time - delay) for motion, time in zip(self.motions, self.times, strict=True)]
        stroke, velocity = np.concatenate(moved).T
        machine = gas + stiffness * stroke + friction * np.tanh(velocity / 0.005)
        return fit_many.besinger(numbers[:5], velocity) + machine - self.force

    def by_scipy(self) -> np.ndarray:
        """The numbers by `scipy.optimize.least_squares` within the limits of their signs."""
        lower, upper = np.full(9, 1e-6), np.full(9, np.inf)
        lower[5], upper[5] = -np.inf, 0.0
        scale = np.abs(STARTED)
        ends = least_squares(lambda s: self.misses(s * scale), STARTED / scale, bounds=(lower, upper))
        return ends.x * scale

    def by_lmfit(self) -> np.ndarray:
        """The numbers by the function `minimize` of lmfit (leastsq) within the limits of their signs."""
        import lmfit

        parameters = lmfit.Parameters()
        for name, value in zip(NAMES, STARTED, strict=True):
            parameters.add(name, value=value, **({"max": 0.0} if value < 0 else {"min": 0.0}))
        found = lmfit.minimize(lambda p: self.misses(np.array([p[name].value for name in NAMES])), parameters)
        return np.array([found.params[name].value for name in NAMES])  # type: ignore[attr-defined]


def rig() -> None:
    """Law and machine together."""
    machine = Rig(**MACHINE, force_offset=OFFSET)
    dyno = VirtualDyno(Besinger(*fit_many.TRUE), rig=machine, force_noise=20.0)
    runs = list(dyno.run(programmes.paper_000_table_1()))
    model, start, begin = OnMachine(runs), Besinger(*fit_many.START), Rig(**MACHINE_START)
    rows: list[list[Any]] = []
    errors = np.ones(9)

    def row(by: str, work: Callable[[], Any], repeats: int = 1) -> None:
        progress(f"rig: {by}")
        cost, found = cost_of(work, repeats)
        if not isinstance(found, np.ndarray):
            if not rows:
                errors[:] = [e.standard_error for e in found.parameters]
            found = np.array([e.value for e in found.parameters])
        rows.append([by, *cost, float(np.sqrt(np.mean(model.misses(found) ** 2))), found])

    for by, count in (("fit, every sample", None), ("fit, 400 a cycle", 400)):
        work = functools.partial(fit, start, runs, rig=begin, starts=1, samples_per_cycle=count)
        row(f"{by}, compiling", work)
        row(by, work, repeats=3)
    row("SciPy least_squares", model.by_scipy)
    row("lmfit", model.by_lmfit)
    for own in rows:
        found = own.pop()
        own += [float(np.max(np.abs(found - SEEN) / errors)), ", ".join(f"{value:.5g}" for value in found)]
    title = f"Law and machine from {len(runs)} records, {model.force.size} samples; {', '.join(NAMES)}"
    head = ["by", "s", "processor s", "RMSE, N", "largest error, standard errors", "values"]
    report("identification_rig", title, head, rows, 6)


def walks(logarithm: Callable[[np.ndarray], float], centre: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Two random walks from the minimum, without their first tenth."""
    rng, half = np.random.default_rng(0), np.linalg.cholesky(covariance) * 2.38 / np.sqrt(centre.size)
    chains = []
    for _ in range(2):
        now, level, chain = centre, logarithm(centre), []
        for step in rng.standard_normal((STEPS, centre.size)):
            trial = now + half @ step
            new = logarithm(trial)
            if np.log(rng.random()) < new - level:
                now, level = trial, new
            chain.append(now)
        chains.append(chain[STEPS // 10 :])
    return np.array(chains)


def posterior() -> None:
    """Samples of the posterior, and what a thousand independent ones cost."""
    from numpyro.diagnostics import effective_sample_size

    (runs,) = fit_many.records(1, lambda law: law)
    velocity, force = (np.concatenate([getattr(run, name) for run in runs]) for name in ("velocity", "force"))
    result = fit(Besinger(*fit_many.START), runs, starts=1)
    centre = np.array([e.value for e in result.parameters])

    def misses(numbers: np.ndarray) -> np.ndarray:
        return fit_many.besinger(numbers, velocity) - force

    def logarithm(numbers: np.ndarray) -> float:
        residual = misses(numbers)
        return -0.5 * force.size * float(np.log(residual @ residual)) if np.all(numbers > 0) else -np.inf

    def emcee() -> np.ndarray:
        import lmfit

        parameters, sigma = lmfit.Parameters(), float(np.sqrt(np.mean(misses(centre) ** 2)))
        for name, value in zip(fit_many.NAMES, centre, strict=True):
            parameters.add(name, value=value, min=0.0)
        found = lmfit.minimize(
            lambda p: misses(np.array([p[name].value for name in fit_many.NAMES])) / sigma,
            parameters,
            method="emcee",
            nwalkers=WALKERS,
            steps=WALKER_STEPS,
            burn=WALKER_STEPS // 5,
            seed=0,
            progress=False,
        )
        return np.swapaxes(found.chain, 0, 1)  # type: ignore[attr-defined]

    works: dict[str, Callable[[], Any]] = {
        "FitResult.posterior (NUTS), compiling": lambda: result.posterior(),
        "the same, 5000 samples a chain": lambda: result.posterior(samples=5000),
        "random walk in NumPy": lambda: walks(logarithm, centre, np.asarray(result.covariance)),
        "lmfit with emcee": emcee,
    }
    if importlib.util.find_spec("emcee") is None:
        progress("posterior: lmfit with emcee left out, emcee is not installed (pip install emcee)")
        del works["lmfit with emcee"]
    rows: list[list[Any]] = []
    mean = deviation = np.zeros(0)
    for by, work in works.items():
        progress(f"posterior: {by}")
        cost, found = cost_of(work)
        if isinstance(found, np.ndarray):
            flat, independent = found.reshape(-1, centre.size), float(np.min(effective_sample_size(found)))
        else:
            flat, independent = found.samples, min(spread.effective for spread in found.parameters)
        if not rows:
            mean, deviation = flat.mean(axis=0), flat.std(axis=0)
        apart = float(np.max(np.abs(flat.mean(axis=0) - mean) / deviation))
        wider = float(np.max(np.abs(flat.std(axis=0) / deviation - 1.0)))
        rows.append([by, *cost, len(flat), independent, 1e3 * cost.processor / independent, apart, wider])
    head = ["by", "s", "processor s", "samples", "independent", "processor s for 1000 independent"]
    head += ["means apart, deviations", "deviations apart"]
    report("identification_posterior", f"Posterior of {centre.size} numbers, {force.size} samples", head, rows)


STAGES: dict[str, Callable[[], None]] = {"rig": rig, "many": lambda: fit_many.run(200), "posterior": posterior}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="*", help=f"of {', '.join(STAGES)}; all if left out")
    stages = parser.parse_args().stages or list(STAGES)
    for unknown in set(stages) - set(STAGES):
        parser.error(f"unknown stage {unknown!r}: choose from {', '.join(STAGES)}")
    for name in stages:
        progress(name)
        STAGES[name]()


if __name__ == "__main__":
    main()
