"""A virtual 4-post rig with all the faults of a real one: does a fit recover the car, and say what it cannot know?

The dampers of a full car stand in linkages whose ratio changes with the stroke. Four platforms move it at random. The
accelerometers of body and wheels and the strokes have noise, zero errors, lags and delays; the files have their own
units and one channel of reversed sign. The numbers of the car start 20 to 100 % off; its mass is known.
`python -m benchmarks.four_post [--repeats 6]` prints every parameter with its error, the share of 95 % intervals that
hold the true value, and what the fit says where the unit of a channel, or its sign, is stated wrongly.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from benchmarks.vehicle_fits import distances, summarise
from jaxdamp import bench, dampers, identify, roads, vehicles
from jaxdamp.parameters import replace
from jaxdamp.rig import Sensor


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)

TRAVEL, RATIO = [-0.08, 0.0, 0.08], [0.95, 0.85, 0.7]  # of the wheel [m], from the kinematics
DURATION, RATE, FINER = 4.0, 500.0, 4  # s, Hz, steps of the simulation in a sampling interval
SIDES = ("front_left", "front_right", "rear_left", "rear_right")
ACCELERATIONS = ("sprung_acceleration", "pitch_acceleration", "roll_acceleration")
WHEELS = tuple(f"{side}_unsprung_acceleration" for side in SIDES)
STROKES = tuple(f"{side}_stroke" for side in SIDES)
NOISE = dict.fromkeys(ACCELERATIONS, 0.05) | dict.fromkeys(WHEELS, 0.3) | dict.fromkeys(STROKES, 2e-4)
SENSORS = {name: Sensor(offset=0.1 * (-1) ** k, lag=2e-3) for k, name in enumerate((*ACCELERATIONS, *WHEELS))}
SENSORS |= {name: Sensor(offset=1e-3 * (k + 1), delay=1e-3) for k, name in enumerate(STROKES)}
REVERSED = "rear_left_stroke"
KNOWN = ["sprung_mass", "*_distance", "*.track_width", "*.ratio"]  # from scales and a tape measure
RIGHT: dict[str, Any] = {"reversed_channels": [REVERSED]}
WRONG: dict[str, dict[str, Any]] = {
    f"{REVERSED} with the sign of the file": {},
    "front_left_stroke in mm read as cm": {**RIGHT, "units": {"front_left_stroke": "cm"}},
    "sprung_acceleration in g read as m/s^2": {**RIGHT, "units": {"sprung_acceleration": "m/s^2"}},
}


def corner(mass: float, spring: float, rebound: float, compression: float) -> vehicles.Corner:
    """A corner whose damper moves by a ratio of the wheel that falls in rebound."""
    damper = dampers.Linkage(dampers.Bilinear(rebound, compression), TRAVEL, RATIO)
    return vehicles.Corner(mass, spring, 190e3, damper, tyre_damping=80.0)


CAR = vehicles.FullCar(
    1200.0,
    1600.0,
    420.0,
    1.2,
    1.4,
    vehicles.Axle(corner(42.0, 24e3, 2600.0, 1300.0), 1.5, 6e3),
    vehicles.Axle(corner(38.0, 22e3, 2200.0, 1100.0), 1.5, 2e3),
)
START = {"pitch_inertia": 2000.0, "roll_inertia": 520.0}
START |= {"*.corner.unsprung_mass": 50.0, "*.corner.spring_rate": 18e3, "*.anti_roll_rate": 4e3}
START |= {"*.corner.tyre_stiffness": 230e3, "*.corner.tyre_damping": 50.0}
START |= {"*.rebound_rate": 1600.0, "*.compression_rate": 1600.0}


def ride(seed: int) -> bench.RideRecord:
    """A drive as its sensors see it, in SI and with all signs right."""
    how = {"rms": 3e-3, "duration": DURATION, "dt": 1.0 / (FINER * RATE)}
    posts = [np.asarray(roads.band_limited(0.7, 14.0, seed=4 * seed + k, **how).samples) for k in range(len(SIDES))]
    heights = np.stack([post.reshape(-1) for post in posts], axis=1)
    platforms = roads.from_profile(np.arange(len(heights)) / (FINER * RATE), heights)
    length = (len(heights) - 1) / (FINER * RATE)
    sensed = {"sensors": SENSORS, "sampling_rate": RATE, "seed": seed, "finer": FINER}
    return identify.virtual_ride(CAR, platforms, NOISE, name=f"drive {seed}", duration=length, **sensed)


def file_of(record: bench.RideRecord, folder: Path) -> Path:
    """The file of the rig: heights and strokes in mm, body accelerations in g, one channel of reversed sign."""
    units = {**dict.fromkeys(STROKES, ("mm", 1e-3)), "sprung_acceleration": ("g", 9.80665)}
    header, columns = ["time [s]"], [record.time]
    for k in range(record.wheels):
        header.append(f"road {k + 1} [mm]")
        columns.append(1e3 * record.road[:, k])
    for name, values in record.channels.items():
        unit, size = units.get(name, (record.units[name], 1.0))
        header.append(f"{name} [{unit}]")
        columns.append((-1.0 if name == REVERSED else 1.0) * values / size)
    path = folder / f"{record.name}.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(header), comments="")
    return path


def fitted(records: Sequence[bench.RideRecord]) -> identify.VehicleFit:
    """The car from its drives, with what each sensor adds."""
    sensors = {name: Sensor(**dict.fromkeys(sensor.given, 0.0)) for name, sensor in SENSORS.items()}
    return identify.fit(replace(CAR, START), records, sensors=sensors, freeze=KNOWN)


def main() -> None:
    """Print what is recovered from right files, and what is said of wrong ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=6)
    rows: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(parser.parse_args().repeats):
            begin = time.perf_counter()
            result = fitted(bench.read_rides(file_of(ride(seed), Path(name)), **RIGHT))
            rows.append(distances(result, CAR, SENSORS))
            print(f"seed {seed}: {result.status}, {time.perf_counter() - begin:.1f} s", flush=True)
            if seed == 0:
                print(result.table(CAR, sensors=SENSORS).to_text(), *result.warnings, sep="\n")
        summarise(rows)
        path = file_of(ride(0), Path(name))
        for what, how in WRONG.items():
            wrong = fitted(bench.read_rides(path, **how))
            print(f"\n{what}: {wrong.status}", *wrong.warnings, sep="\n", flush=True)


if __name__ == "__main__":
    main()
