"""Records of a simulated vehicle, with the sensors and the noise of a real one."""

import zlib
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import RideRecord
from jaxdamp.rig import Sensor
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import simulate
from jaxdamp.vehicles import AbstractVehicle, prefixed


@of_known_numbers
def virtual_ride(
    vehicle: AbstractVehicle,
    road: AbstractRoad,
    channels: Mapping[str, float],
    *,
    duration: float | None = None,
    sampling_rate: float | int = 500.0,
    sensors: Mapping[str, Sensor] | None = None,
    road_noise: float = 0.0,
    driven_by: str = "heights",
    start: Mapping[str, float] | None = None,
    name: str = "virtual ride",
    seed: int = 0,
    finer: int = 2,
    **options: Any,
) -> RideRecord:
    """A record as real sensors would write it, of a simulated vehicle.

    The vehicle is simulated in steps finer than the record, its channels pass the sensors and are sampled, and noise is
    added.

    Arguments:
        vehicle: the vehicle.
        road: a road or the motion of platforms, as in `simulate`.
        channels: the channels to measure, each with the standard deviation of its noise in its unit.
        duration: as in `simulate`.
        sampling_rate: of the record [Hz].
        sensors: by channel, what the sensor adds.
        road_noise: standard deviation of the noise of the heights [m], or of the wheel forces [N].
        driven_by: what the record has of the road: "heights", or the "forces" on the wheels that it causes.
        start: as in `simulate`.
        name: name of the record; noise depends on it and on the seed only.
        seed: seed of the noise.
        finer: steps of the simulation in a sampling interval.
        options: further ones of `simulate`.

    Returns:
        The record, with the units of the channels and the seed among its settings.

    Raises:
        ValueError: an unknown channel, noise that is negative, what `simulate` refuses.

    >>> from jaxdamp import roads, vehicles
    >>> car = vehicles.presets.quarter_car_000()
    >>> noise = {"sprung_acceleration": 0.05, "stroke": 1e-4}
    >>> virtual_ride(car, roads.sine(0.01, frequency=1.2), noise, duration=5.0, seed=3)
    RideRecord('virtual ride': 5.002 s at 500 Hz, 1 wheel moved by 20 mm, measured: sprung_acceleration, stroke)
    """
    _checks.positive("sampling_rate", sampling_rate)
    _checks.nonnegative("road_noise", road_noise)
    _checks.one_of("driven_by", driven_by, ["heights", "forces"])
    for channel, deviation in channels.items():
        _checks.one_of("channels", channel, vehicle.units)
        _checks.nonnegative(f"channels[{channel!r}]", deviation)
    for channel in sensors or {}:
        _checks.one_of("sensors", channel, channels)
    dt = 1.0 / (finer * sampling_rate)
    response = simulate(vehicle, road, duration=duration, dt=dt, start=start, **options)
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    shown = {}
    for channel, deviation in channels.items():
        values, sensor = response[channel], (sensors or {}).get(channel)
        clean = np.asarray(values if sensor is None else sensor(values, jnp.asarray(dt, values.dtype)))[::finer]
        shown[channel] = clean + deviation * rng.standard_normal(clean.shape)
    loads = [response[prefixed(wheel, "dynamic_tyre_load")] for wheel in vehicle.wheel_names]
    heights = np.asarray(response.road if driven_by == "heights" else jnp.stack(loads, axis=1))[::finer]
    heights = heights + road_noise * rng.standard_normal(heights.shape)
    units = {channel: vehicle.units[channel] for channel in channels}
    time = np.arange(len(heights)) / sampling_rate
    note = f"simulated: {type(vehicle).__name__}, sensors {dict(sensors or {})}, noise {dict(channels)}, seed {seed}"
    return RideRecord(name, time, heights, shown, units, driven_by, {"seed": seed}, "virtual ride", (note,))
