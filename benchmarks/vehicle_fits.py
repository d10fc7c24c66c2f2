"""Virtual quarter-car rigs, fitted from their motions: are the parameters within their standard errors?

`python -m benchmarks.vehicle_fits [seeds]` prints the distance of every parameter from its true value in standard
errors, over rigs with friction in the guides, noise, offsets, lags and delays of the sensors, on a sweep of the
platform and on a road, from a start that is 10 to 40 % off. No force is measured, so the sprung mass is held.
"""

import sys
import time
from collections.abc import Mapping, Sequence

import numpy as np

from jaxdamp import dampers, identify, roads, vehicles
from jaxdamp.bench import RideRecord
from jaxdamp.parameters import replace
from jaxdamp.rig import Sensor


CAR = vehicles.QuarterCar(300.0, 40.0, 20e3, 180e3, dampers.Bilinear(1800.0, 900.0), tyre_damping=100.0)
RIG = vehicles.Guided(CAR, (vehicles.Guide(dampers.CoulombFriction(40.0, 0.02)),))
NOISE = {"sprung_acceleration": 0.05, "unsprung_acceleration": 0.3, "stroke": 1e-4}
SENSORS = {
    "sprung_acceleration": Sensor(offset=0.15, lag=2e-3),
    "unsprung_acceleration": Sensor(offset=-0.3, lag=2e-3),
    "stroke": Sensor(offset=1.5e-3, delay=1e-3),
}
START = {"unsprung_mass": 50.0, "spring_rate": 15e3, "tyre_stiffness": 220e3, "tyre_damping": 60.0}
START |= {"rebound_rate": 1200.0, "compression_rate": 1200.0, "friction_force": 20.0}
KNOWN = ["friction_velocity", "guides.0.stiffness", "guides.0.damping"]


def records(seed: int) -> list[RideRecord]:
    """A sweep of the platform and a road of its own, simulated at 4 kHz and sampled at 1 kHz."""
    sweep = roads.sweep_sine(0.7, 15.0, duration=5.0, velocity_amplitude=0.15)
    road = roads.iso8608("C", speed=20.0, seed=seed)
    how = {"sensors": SENSORS, "sampling_rate": 1000.0, "seed": seed, "finer": 4}
    return [
        identify.virtual_ride(RIG, sweep, NOISE, name="sweep", **how),
        identify.virtual_ride(RIG, road, NOISE, name="road", duration=5.0, **how),
    ]


def fitted(seed: int) -> identify.VehicleFit:
    """The rig from its records."""
    sensors = {name: Sensor(**dict.fromkeys(sensor.given, 0.0)) for name, sensor in SENSORS.items()}
    return identify.fit(replace(RIG, START), records(seed), sensors=sensors, freeze=KNOWN)


def distances(
    result: identify.VehicleFit, vehicle: vehicles.AbstractVehicle, sensors: dict[str, Sensor]
) -> dict[str, float]:
    """(value − true)/standard error of every parameter."""
    return {str(row[0]): float(str(row[5])) for row in result.table(vehicle, sensors=sensors).rows}


def summarise(rows: Sequence[Mapping[str, float]]) -> None:
    """Print the distances over all repeats, and how many are within 1.96 and 3 standard errors."""
    table = np.array([list(row.values()) for row in rows])
    for name, column in zip(rows[0], table.T, strict=True):
        print(f"{name:40s} mean {column.mean():+.2f}  spread {column.std(ddof=1):.2f}  largest {abs(column).max():.2f}")
    inside = [100 * np.mean(abs(table) < limit) for limit in (1.96, 3.0)]
    print(f"{table.size} parameters: {inside[0]:.1f} % within 1.96, {inside[1]:.1f} % within 3 standard errors")


def main(seeds: int) -> None:
    rows: list[dict[str, float]] = []
    for seed in range(seeds):
        begin, result = time.perf_counter(), fitted(seed)
        assert result.converged and result.held == ("vehicle.car.sprung_mass",), result
        rows.append(distances(result, RIG, SENSORS))
        worst = max(rows[-1], key=lambda name: abs(rows[-1][name]))
        print(f"seed {seed}: largest {rows[-1][worst]:+.2f} ({worst}), {time.perf_counter() - begin:.1f} s", flush=True)
    summarise(rows)


if __name__ == "__main__":
    import jax

    jax.config.update("jax_enable_x64", True)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
