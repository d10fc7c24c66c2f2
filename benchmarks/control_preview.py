"""What the road under the front wheel tells the rear damper: `python -m benchmarks.control_preview`.

`half_car_002` at 20 m/s on class C, 0.125 s from axle to axle, linear skyhook at both dampers. Its gain alone, and with
the gains ahead of `control.Preview`, is tuned on two roads for the acceleration of the body above the rear axle by
L-BFGS with exact gradients, and judged on two others.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize

import jaxdamp
from jaxdamp import Ride, roads
from jaxdamp.control import Controlled, Preview, Skyhook
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.vehicles import Place
from jaxdamp.vehicles.presets import half_car_002


METRICS = [
    "rms_rear_end_acceleration",
    "rms_sprung_acceleration",
    "rms_pitch_acceleration",
    "rms_rear_dynamic_tyre_load",
]
SIZES = np.array([3000.0, 1000.0])  # of the gain of skyhook and of the gains ahead [N s/m]


def rides(ahead: int, duration: float = 10.0) -> list[Ride]:
    """Two roads to tune on and two to judge on."""
    damper = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.2)
    car = dataclasses.replace(half_car_002(damper), places=(Place("rear_end", -1.5),))
    policy = Preview(Skyhook(3000.0), jnp.zeros(ahead), 0.125)
    vehicle = Controlled(car, policy, actuator_lag=1.0 / (100.0 * np.pi))
    tracks = [roads.iso8608("C", speed=20.0, seed=seed, duration=duration) for seed in (1, 2, 3, 4)]
    return [Ride(vehicle, road, metrics=METRICS, duration=duration) for road in tracks]


def main(ahead: int = 21) -> None:
    """Print both results."""
    jaxdamp.configure()
    *trained, one, other = rides(ahead)

    def driven(numbers: jax.Array, ride: Ride) -> dict[str, jax.Array]:
        return ride({"policy.policy.gain": SIZES[0] * numbers[0], "policy.gains": SIZES[1] * numbers[1:]})

    slopes = [jax.jit(jax.value_and_grad(lambda x, ride=ride: driven(x, ride)[METRICS[0]])) for ride in trained]

    def cost(numbers: np.ndarray) -> tuple[float, np.ndarray]:
        pairs = [slope(jnp.asarray(numbers)) for slope in slopes]
        return sum(float(value) for value, _ in pairs), np.sum([np.asarray(slope) for _, slope in pairs], axis=0)

    start, free = np.zeros(ahead + 1), [(0.1, 5.0)] + [(-5.0, 5.0)] * ahead
    start[0] = 1.0
    print(f"{'':20} {' '.join(METRICS)}")
    for name, bounds in (("skyhook", [*free[:1], *[(0.0, 0.0)] * ahead]), ("with preview", free)):
        found = scipy.optimize.minimize(
            cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 40}
        )
        start = found.x
        judged = [driven(jnp.asarray(start), ride) for ride in (one, other)]
        numbers = [np.mean([float(values[metric]) for values in judged]) for metric in METRICS]
        print(f"{name:20} {' '.join(f'{number:.4g}' for number in numbers)}   {np.round(start, 2)}", flush=True)


if __name__ == "__main__":
    main()
