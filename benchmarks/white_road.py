"""How accurate is the ride on a white road? Twelve laws on classes A to D, `python -m benchmarks.white_road`.

On `roads.white` each law is replaced by the linear one equivalent in the stationary motion, taken as normally
distributed. Here the same quarter car runs over roads whose rate is drawn as Gaussian white noise. A minute of such a
road has RMS values that scatter by 2 to 3 %. So the car with the equivalent linear damper, whose RMS is known exactly,
runs over the same roads: the RMS expected of a law is the exact one times the ratio of both runs, and the standard
error of the mean over the roads is printed beside it.
"""

import argparse
import time
import warnings
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import Ride, dampers, roads, vehicles
from jaxdamp.dampers import AbstractDamper
from jaxdamp.metrics import Metric


SPEED, DT, BEGIN = 20.0, 1e-3, 4.0  # m/s, s, s before the motion is stationary
CLASSES = ("A", "B", "C", "D")
CHANNELS = ("sprung_acceleration", "dynamic_tyre_load", "stroke")
LIMIT = 5.0  # %


def laws() -> dict[str, AbstractDamper]:
    """Friction, digressive and progressive curves, different in both directions, hysteresis, elastic parts."""
    viscous = dampers.Linear(1500.0)
    return {
        "Coulomb friction 50 N": viscous + dampers.CoulombFriction(50.0, 0.005),
        "Coulomb friction 150 N": viscous + dampers.CoulombFriction(150.0, 0.005),
        "Coulomb friction 300 N": viscous + dampers.CoulombFriction(300.0, 0.005),
        "Stribeck friction 150 N": viscous + dampers.StribeckFriction(100.0, 150.0, 0.05, 0.005),
        "asymmetric": dampers.Bilinear(4000.0, 1000.0),
        "blow-off, Besinger": dampers.Besinger(1600.0, 4200.0, 300.0, 0.13, 0.05),
        "power law, exponent 0.6": dampers.PowerLaw(1400.0, 0.6, 900.0, 0.6, knee_width=0.01),
        "Bouc-Wen": dampers.BoucWen(1500.0, 0.0, 150.0, 1e-3),
        "Dahl": viscous + dampers.Dahl(5e5, 150.0),
        "LuGre": dampers.LuGre(5e5, 300.0, 1500.0, 150.0, 200.0, 0.01),
        "series spring": dampers.SeriesSpring(viscous + dampers.CoulombFriction(150.0, 0.005), 5e5),
        "lag": dampers.Lag(dampers.Bilinear(4000.0, 1000.0), 0.005),
    }


def heights(count: int, duration: float) -> np.ndarray:
    """Roads of class A with a rate of Gaussian white noise, shape (roads, time, wheels)."""
    steps = round(duration / DT)
    density = float(roads.white("A", SPEED).velocity_psd)
    rises = np.sqrt(density * DT) * np.random.default_rng(0).standard_normal((count, steps))
    return np.concatenate([np.zeros((count, 1)), np.cumsum(rises, axis=1)], axis=1)[:, :, None]


def runs(law: AbstractDamper, roads_of_class: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """RMS of each channel in each run, shape (channels, classes, roads), by the rates of a linear law in each class."""
    car = vehicles.presets.quarter_car_000(law)
    duration = (roads_of_class.shape[-2] - 1) * DT
    metrics = [Metric(channel, "standard_deviation", window=(BEGIN, duration)) for channel in CHANNELS]
    roughest = roads.from_profile(DT * np.arange(roads_of_class.shape[-2]), roads_of_class[-1, 0, :, 0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ride = Ride(car, roughest, metrics=metrics, duration=duration, dt=DT).side_by_side()

    def run(road: jax.Array, rate: jax.Array) -> list[jax.Array]:
        point = {"damper.rate": rate} if isinstance(law, dampers.Linear) else {}
        return list(eqx.tree_at(lambda ride: ride.heights, ride, road)(point).values())

    each = jax.jit(jax.vmap(jax.vmap(run, in_axes=(0, None))))
    return lambda rates: np.asarray(jnp.stack(each(jnp.asarray(roads_of_class), jnp.asarray(rates))))


def main() -> None:
    """Print a row for each law and class, the misses by name, and the largest error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--roads", type=int, default=8, help="roads of each class")
    parser.add_argument("--duration", type=float, default=64.0, help="of each run [s]")
    parser.add_argument("--law", default="", help="only laws whose name contains this")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    begun = time.perf_counter()
    roughness = 2.0 ** np.arange(len(CLASSES))[:, None, None, None]
    driven = roughness * heights(options.roads, options.duration)[None]
    linear = runs(dampers.Linear(1500.0), driven)
    misses, worst = [], {channel: 0.0 for channel in CHANNELS}
    print(f"error of the stationary RMS [%] (standard error), {options.roads} roads of {options.duration:g} s each")
    print(f"{'law':24} class  {'equivalent damper':52}" + "".join(f"{name:>24}" for name in CHANNELS))
    for name, law in laws().items():
        if options.law not in name:
            continue
        car, white = vehicles.presets.quarter_car_000(law), [roads.white(c, SPEED) for c in CLASSES]
        equivalent = [vehicles.equivalent_dampers(car, road.velocity_psd)["damper"] for road in white]
        rates = np.array([float(one.slope) for one in equivalent])
        ratio = runs(law, driven)(rates) / linear(rates)
        for i, road in enumerate(white):
            found = vehicles.stationary_rms(car, road.velocity_psd)
            known = vehicles.stationary_rms(
                vehicles.presets.quarter_car_000(dampers.Linear(rates[i])), road.velocity_psd
            )
            words = []
            for j, channel in enumerate(CHANNELS):
                shares = float(known[channel]) * ratio[j, i] / float(found[channel])
                error = 100.0 * (1.0 / np.mean(shares) - 1.0)
                doubt = 100.0 * np.std(shares, ddof=1) / np.sqrt(shares.size)
                worst[channel] = max(worst[channel], abs(error))
                words.append(f"{error:+.1f} ({doubt:.1f})")
                if abs(error) > LIMIT:
                    misses.append(f"{name}, class {CLASSES[i]}, {channel}: {error:+.1f} %")
            print(
                f"{name:24} {CLASSES[i]:6} {equivalent[i].words():52}" + "".join(f"{w:>24}" for w in words), flush=True
            )
    print("largest: " + ", ".join(f"{channel} {value:.1f} %" for channel, value in worst.items()))
    print(f"{len(misses)} of more than {LIMIT:g} %" + "".join(f"\n  {miss}" for miss in misses))
    print(f"{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
