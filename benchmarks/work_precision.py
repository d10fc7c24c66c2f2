"""Work against precision: time of a run and its error, for steps of 4 to 1/4 ms, and tolerances.

    python -m benchmarks.work_precision

A quarter car with a Besinger damper, alone and behind a lag, over a road given at 4 ms and linear in between, so that
all use the same road. Of C and jaxdamp the time is that of one car among many on one core; of `solve_ivp` of one.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import configure


configure(cpu_devices=1, cache=False)

from benchmarks import ours  # noqa: E402
from benchmarks._timing import best, report  # noqa: E402
from benchmarks.peers import c, diffrax_vmapped, problem, scipy_numba  # noqa: E402


COARSE, CARS, FEW = 4e-3, 512, 4


def main() -> None:
    rows: list[list[Any]] = []
    for case in ("besinger", "lag"):
        coarse = problem.heights(case, 10.0, COARSE)
        table = problem.draw(case, CARS)
        lanes = {path: jnp.asarray(column[:128]) for path, column in ours.point(case, table).items()}
        for factor in (1, 2, 4, 8, 16):
            road, dt = problem.refined(coarse, factor), COARSE / factor
            exact = problem.reference(case, table[:FEW], road, dt)
            ride = ours.ride(case, road, dt)
            many = jax.jit(jax.vmap(lambda point, ride=ride: ride(point)[ours.METRIC]))
            error = problem.errors(np.asarray(many(lanes))[:FEW], exact).max()
            rows.append(
                [case, "jaxdamp", f"{1e3 * dt:g} ms", 1e6 * best(lambda m=many: m(lanes), 5) / 128, float(error)]
            )
            if c.available():
                for name, kernel in (("C, RK4", c.rk4), ("C, exponential", c.exponential)):
                    seconds = best(lambda k=kernel, r=road, d=dt: k(case, table, r, d), 5)
                    error = problem.errors(kernel(case, table[:FEW], road, dt), exact).max()
                    rows.append([case, name, f"{1e3 * dt:g} ms", 1e6 * seconds / CARS, float(error)])
            seconds = best(lambda r=road, d=dt: diffrax_vmapped.rms(case, table[:128], r, d), 1) / 128
            error = problem.errors(np.asarray(diffrax_vmapped.rms(case, table[:FEW], road, dt)), exact).max()
            rows.append([case, "diffrax Tsit5", f"{1e3 * dt:g} ms", 1e6 * seconds, float(error)])
        if scipy_numba.available():
            for rtol in (1e-4, 1e-6, 1e-8):
                run = lambda r=rtol: scipy_numba.rms(case, table[:1], road, dt, rtol=r, atol=1e-2 * r)  # noqa: E731
                error = problem.errors(np.asarray(run()), exact[:1]).max()
                rows.append([case, "solve_ivp with numba", f"rtol {rtol:g}", 1e6 * best(run, 1), float(error)])
    head = ["law", "by", "step", "us for a car and 10 s", "error of the RMS"]
    report("work_precision", "Work and precision, one core", head, rows)


if __name__ == "__main__":
    main()
