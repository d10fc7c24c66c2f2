"""Rides and fits in programs of one's own: a batch by plain `jax.vmap`, a step of optax, a batch of least squares.

    python -m benchmarks.from_jax [--cars 32768] [--records 64]

Half cars drive 1 s at 1 kHz, all ride metrics: a plain `jax.vmap` of a ride, which chooses the form for many cars by
itself, against the ride compiled for many; both are compiled, and driven once. The step of optax follows the gradient
of one metric of a quarter car by the parameters of its damper over 60 s; memory is what the compiled step needs beside
its arguments. Records of one motion with other noise are fitted by `jax.vmap` of the least squares of a `Problem`, and
by `fit_many`.
"""

import argparse
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array

from jaxdamp import configure


configure(cpu_devices=1, cache=False)

from benchmarks._timing import cost_of, first_and_warm, report  # noqa: E402
from jaxdamp import Ride, bench, dampers, identify, roads  # noqa: E402
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000  # noqa: E402


LAW = dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
ROAD = roads.iso8608("C", speed=20.0, duration=60.0, seed=1)
METRIC = "rms_sprung_acceleration"


def batches(cars: int) -> list[list[Any]]:
    """A batch of half cars."""
    ride = Ride(half_car_002(LAW), ROAD, duration=1.0)
    point = {"sprung_mass": jnp.linspace(500.0, 900.0, cars)}
    ways = {"jit(vmap(ride))": jax.jit(jax.vmap(ride)), "side by side": jax.jit(jax.vmap(ride.side_by_side()))}
    rows = []
    for name, way in ways.items():
        compiling, drive = cost_of(lambda way=way: way.lower(point).compile())
        once, _ = cost_of(lambda drive=drive: jax.block_until_ready(drive(point)))
        rows.append([name, cars, compiling.wall, once.wall, None])
    return rows


def step_of_optax(seconds: float) -> list[Any]:
    """One step down the gradient of a ride."""
    ride = Ride(quarter_car_000(LAW), ROAD, metrics=[METRIC], duration=seconds)
    rates = {name: jnp.asarray(getattr(LAW, name)) for name in ("compression_rate", "rebound_rate", "blow_off_rate")}
    optimiser = optax.adam(10.0)
    state = optimiser.init(rates)

    @jax.jit
    def step(rates: dict[str, Array], state: Any) -> tuple[dict[str, Array], Any]:
        slope = jax.grad(lambda rates: ride(rates)[METRIC])(rates)
        changes, after = optimiser.update(slope, state)
        return optax.apply_updates(rates, changes), after  # pyright: ignore[reportReturnType]

    first, warm = first_and_warm(lambda: step(rates, state), 3)
    needed: Any = step.lower(rates, state).compile().memory_analysis()
    return [f"optax step through {seconds:g} s", 1, first, warm, needed.temp_size_in_bytes / 2**20]


def fits(records: int) -> list[list[Any]]:
    """The same motion measured so many times, fitted together."""
    law = dampers.Lag(dampers.Bilinear(2600.0, 1200.0), 0.004)
    start = dampers.Lag(dampers.Bilinear(2000.0, 1500.0), 0.008)
    tests = [bench.SineTest(amplitude=0.01, frequency=4.0)]
    runs = [bench.VirtualDyno(law, force_noise=5.0, seed=seed).run(tests) for seed in range(records)]
    problem = identify.prepare(start, runs[0])
    forces = jnp.stack([identify.prepare(start, run).measured for run in runs])
    minima = jax.jit(jax.vmap(problem.minimum))
    alone = first_and_warm(lambda: minima(forces), 3)
    together = first_and_warm(lambda: identify.fit_many(start, runs, starts=1).values, 3)
    apart = np.max(np.abs(minima(forces) / identify.fit_many(start, runs, starts=1).values - 1.0))
    print(f"largest relative difference of a number between the two: {apart:.1e}")
    return [["vmap(problem.minimum)", records, *alone, None], ["fit_many", records, *together, None]]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--cars", type=int, default=32_768)
    options.add_argument("--records", type=int, default=64)
    given = options.parse_args()
    rows = [step_of_optax(60.0), *fits(given.records), *batches(given.cars)]
    report("from_jax", "In a program of one's own, one core", ["work", "size", "first, s", "then, s", "MiB"], rows)


if __name__ == "__main__":
    main()
