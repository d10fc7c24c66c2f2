"""Cost of a gradient: derivatives of a ride metric with respect to 1 to 64 parameters, relative to the run itself.

    python -m benchmarks.gradients

The damper is a curve of so many points; the quarter car drives 10 s at 1 kHz. Forward carries all tangents through one
run, reverse drives twice and back. Beside: central differences on the fastest C, and CasADi, for Besinger's five.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp import configure


configure(cpu_devices=1, cache=False)

from benchmarks import ours  # noqa: E402
from benchmarks._timing import best, first_and_warm, report  # noqa: E402
from benchmarks.peers import c, casadi_map, finite_differences, problem  # noqa: E402
from jaxdamp import Ride, dampers, roads  # noqa: E402
from jaxdamp.sweeps import points  # noqa: E402
from jaxdamp.sweeps.function import trace  # noqa: E402
from jaxdamp.sweeps.program import prepare  # noqa: E402
from jaxdamp.vehicles.presets import quarter_car_000  # noqa: E402


DT = 1e-3
ROAD = roads.iso8608("C", speed=20.0, seed=0)


def curve(count: int) -> tuple[Ride, np.ndarray]:
    """A car whose damper has this number of parameters, and their values."""
    rng = np.random.default_rng(count)
    if count == 1:
        law, start = dampers.Linear(2500.0), np.array([2500.0])
    else:
        velocity = np.linspace(-1.2, 1.2, count)
        start = 2500.0 * velocity * (1.0 + 0.1 * rng.uniform(size=count))
        law = dampers.Table(velocity, start)
    return Ride(quarter_car_000(law), ROAD, metrics=[ours.METRIC], duration=10.0, dt=DT), start


def besinger(*, many: bool = False) -> Callable[[Array], Array]:
    ride = ours.ride("besinger", problem.heights("besinger"))
    return level_of(ride.side_by_side() if many else ride, ours.paths("besinger"))


def level_of(ride: Ride, paths: list[str]) -> Callable[[Array], Array]:
    return lambda row: ride(dict(zip(paths, row, strict=True)))[ours.METRIC]


def forward(level: Callable[[Array], Array], at: Array) -> Callable[[Array], Any]:
    """Value and all slopes: at (parameters,) or (parameters, cars), tangents as one more leading axis."""
    unit = jnp.eye(at.shape[0]).reshape(at.shape[0], at.shape[0], *(1,) * (at.ndim - 1))
    tangents = jnp.broadcast_to(unit, (at.shape[0], *at.shape))
    return jax.jit(lambda x: jax.vmap(lambda t: jax.jvp(level, (x,), (t,)), out_axes=(None, 0))(tangents))


def reverse(level: Callable[[Array], Array]) -> Callable[[Array], Any]:
    def both(x: Array) -> Any:
        value, pull = jax.vjp(level, x)
        return value, pull(jnp.ones_like(value))[0]

    return jax.jit(both)


def row(name: str, level: Callable[[Array], Array], at: np.ndarray) -> list[Any]:
    x = jnp.asarray(at)
    plain, ahead, back = jax.jit(level), forward(level, x), reverse(level)
    first, run = first_and_warm(lambda: plain(x))
    found = [first_and_warm(lambda f=f: f(x)) for f in (ahead, back)]
    ratios = [warm / run for _, warm in found]
    return [name, at.shape[0], 1e3 * run, *ratios, first, *[once for once, _ in found]]


def swept(cars: int) -> list[Any]:
    """So many cars as `sweep` lays them out, its compiled program alone."""
    ride = ours.ride("besinger", problem.heights("besinger")).side_by_side()
    cloud = points(ours.point("besinger", problem.draw("besinger", cars)))
    columns, times = cloud.columns(np.arange(cars)), []
    for gradients in (False, "forward", "reverse"):
        program = prepare(trace(ride, cloud.names, gradients), cars, None, 1, ride.lanes)
        times.append(first_and_warm(lambda program=program: program.start(columns)))
    (first, run), *found = times
    ratios = [warm / run for _, warm in found]
    return [f"{cars} cars in a sweep, Besinger", len(cloud.names), 1e3 * run, *ratios, first, *[o for o, _ in found]]


def main() -> None:
    rows: list[list[Any]] = []
    for count in (1, 4, 8, 16, 64):
        ride, start = curve(count)
        point = (lambda x: {"damper.rate": x[0]}) if count == 1 else (lambda x: {"damper.force_points": x})
        rows.append(row("one car", lambda x, r=ride, p=point: r(p(x))[ours.METRIC], start))
    level, at = besinger(), problem.draw("besinger", 1)[0]
    rows.append(row("one car, Besinger", level, at))
    for cars in (16, 32, 64, 128):
        table = problem.draw("besinger", cars).T
        rows.append(row(f"{cars} cars side by side, Besinger", jax.vmap(besinger(many=True), in_axes=1), table))
    rows += [swept(cars) for cars in (32, 128, 512)]
    head = ["work", "parameters", "run, ms", "forward / run", "reverse / run"]
    head += [f"first {what}, s" for what in ("run", "forward", "reverse")]
    report("gradients", "Gradient of the RMS of body acceleration, 10 s at 1 kHz, one core", head, rows)

    heights, others = problem.heights("besinger"), []
    x = jnp.asarray(at)
    ahead = forward(level, x)
    mine, slopes = best(lambda: ahead(x), 9), np.asarray(ahead(x)[1])
    others.append(["jaxdamp, forward", 1e3 * mine, 0.0])

    def beside(name: str, work: Callable[[], Any]) -> None:
        seconds, found = best(work), np.ravel(np.asarray(work()))
        others.append([name, 1e3 * seconds, float(np.max(np.abs(found / slopes - 1.0)))])

    if c.available():
        beside("central differences on C, RK4", lambda: finite_differences.gradient("besinger", at[None], heights, DT))
    if casadi_map.available():
        for mode in ("forward", "reverse"):
            prepared = casadi_map.prepared_gradient(heights, DT, mode=mode)
            beside(f"CasADi RK4, {mode}", lambda p=prepared: p(at))
    head = ["by", "ms", "largest difference"]
    report("gradients_beside", "Five slopes of one car with a Besinger damper, 10 s at 1 kHz", head, others)


if __name__ == "__main__":
    main()
