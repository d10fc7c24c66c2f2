"""Rides in programs of one's own: a batch by plain `jax.vmap`, and a step of optax through a long ride.

    python -m benchmarks.from_jax [--cars 32768]

Half cars drive 1 s at 1 kHz, all ride metrics. Plain `jax.vmap` chooses the form for many cars by itself; a function
that is compiled before it is batched cannot. The step of optax follows the gradient of one metric of a quarter car by
the parameters of its damper over 60 s; memory is what the compiled step needs beside its arguments. The fits to 64
noisy records of the same motion are one program, beside `fit_many` of the same records.
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

from benchmarks._timing import first_and_warm, report  # noqa: E402
from jaxdamp import Ride, bench, dampers, identify, roads  # noqa: E402
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000  # noqa: E402


LAW = dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
ROAD = roads.iso8608("C", speed=20.0, duration=60.0, seed=1)
METRIC = "rms_sprung_acceleration"


def batches(cars: int) -> list[list[Any]]:
    """A batch of half cars, compiled as one function and called as it is."""
    ride = Ride(half_car_002(LAW), ROAD, duration=1.0)
    point = {"sprung_mass": jnp.linspace(500.0, 900.0, cars)}
    ways = {
        "jit(vmap(ride))": jax.jit(jax.vmap(ride)),
        "jit(vmap(ride.side_by_side()))": jax.jit(jax.vmap(ride.side_by_side())),
        "vmap(ride)": jax.vmap(ride),
        "vmap(ride.side_by_side())": jax.vmap(ride.side_by_side()),
        "vmap(jit(ride))": jax.vmap(jax.jit(ride)),
    }
    return [[name, cars, *first_and_warm(lambda way=way: way(point), 2), None] for name, way in ways.items()]


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


def noisy_fits(count: int = 64) -> list[list[Any]]:
    """Fits to records with other noise, in a program of one's own and by `fit_many`."""
    start, tests = dampers.Besinger(1500.0, 4000.0, 1000.0, 0.12, 0.06), [bench.SineTest(0.02, f) for f in (1.0, 3.0)]
    records = [bench.VirtualDyno(LAW, force_noise=20.0, seed=seed).run(tests) for seed in range(count)]
    problem = identify.prepare(start, records[0])
    forces = jnp.stack([identify.prepare(start, runs).measured for runs in records])
    fits = jax.jit(jax.vmap(problem.minimum))
    apart = np.max(np.abs((fits(forces) - identify.fit_many(start, records).values) / 4200.0))
    own = first_and_warm(lambda: fits(forces), 5)
    many = first_and_warm(lambda: identify.fit_many(start, records).values, 5)
    rows = [["jit(vmap(problem.minimum))", own], ["fit_many", many]]
    print(f"largest difference of a number, relative to the rate: {apart:.1e}")
    return [[f"{name}, {count} records", count, *seconds, None] for name, seconds in rows]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--cars", type=int, default=32_768)
    cars = options.parse_args().cars
    rows = [*batches(cars), step_of_optax(6.0), step_of_optax(60.0), *noisy_fits()]
    report("from_jax", "In a program of one's own, one core", ["work", "cars", "first, s", "then, s", "MiB"], rows)


if __name__ == "__main__":
    main()
