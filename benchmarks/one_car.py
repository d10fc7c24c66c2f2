"""How long one quarter car takes for 10 s of road at 1 kHz, and how accurate it is.

python -m benchmarks.one_car            with the whole loop compiled as one function (see OPTION)
python -m benchmarks.one_car --plain    as JAX comes
"""

import os
import sys


OPTION = (
    "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=16777216 --xla_cpu_prefer_vector_width=512"
)
PLAIN = "--plain" in sys.argv
if not PLAIN:  # read when JAX starts its backend
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {OPTION}"

import jax  # noqa: E402


jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from benchmarks._timing import first_and_warm, show  # noqa: E402
from jaxdamp import dampers, roads, simulate, vehicles  # noqa: E402
from jaxdamp.simulation.exponential import exponential_steps  # noqa: E402


BESINGER = dampers.Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
LAWS = {
    "linear": dampers.Linear(2500.0),
    "Besinger": BESINGER,
    "Besinger + lag": dampers.Lag(BESINGER, 0.003),
    "Besinger + series spring": dampers.SeriesSpring(BESINGER, 1.5e6, 1.2e8),
}


def main() -> None:
    road = roads.iso8608("C", speed=20.0, seed=0)
    step, fine = jnp.asarray(1e-3), 8
    grid = road.height(jnp.arange(10_001.0) * 1e-3)
    # the reference sees the same road, straight between the coarse instants
    between = np.interp(np.arange(10_000 * fine + 1) / fine, np.arange(10_001), np.asarray(grid[:, 0]))
    rows = []
    for name, law in LAWS.items():
        car = vehicles.presets.quarter_car_000(law)
        first, warm = first_and_warm(lambda car=car: exponential_steps(car, grid, step))
        finer = roads.from_profile(np.arange(between.size) * 1e-3 / fine, between)
        exact = simulate(car, finer, duration=10.0, dt=1e-3 / fine)["sprung_acceleration"][::fine]
        coarse = simulate(car, roads.from_profile(np.arange(10_001) * 1e-3, grid), duration=10.0)["sprung_acceleration"]
        error = abs(float(jnp.sqrt(jnp.mean(coarse**2) / jnp.mean(exact**2))) - 1.0)
        rows.append([name, f"{1e3 * warm:.2f}", f"{warm / 10_000 * 1e6:.3f}", f"{first:.1f}", f"{error:.1e}"])
    how = "plain" if PLAIN else "loop compiled as one function"
    head = ["law", "ms per run", "us per step", "first call s", "error of RMS acceleration"]
    show(f"One quarter car, 10 s at 1 kHz, every instant saved; {how}", head, rows)


if __name__ == "__main__":
    main()
