"""The residuals of a vehicle: its records, measured or virtual, and bench records of its damper."""

import dataclasses
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Unpack, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp import _checks
from jaxdamp._settings import part, with_defaults
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, RideRecord
from jaxdamp.identify.model import VehicleTest, on_rig
from jaxdamp.identify.residuals import AbstractResiduals, AbstractWeighted
from jaxdamp.identify.traces import Batch, batches
from jaxdamp.parameters import get, with_values
from jaxdamp.rig import Sensor
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import SIMULATION, AbstractEngine, SimulationSettings, recorded, settled, simulate
from jaxdamp.vehicles import AbstractVehicle, ForceDriven, prefixed


@final
class RideBatch(AbstractWeighted):
    """Records of equal length, sampling rate and channels, driven side by side.

    Samples are in the order of records, channels, time.
    """

    heights: Float[Array, "records fine wheels"]
    measured: Float[Array, "records channels time"]
    weight: Float[Array, "records channels time"]
    number: Int[Array, " records"]  # of each record among those given
    engine: AbstractEngine
    dt: float = eqx.field(static=True)  # of the simulation
    finer: int = eqx.field(static=True)  # steps of the simulation in a sampling interval
    channels: tuple[str, ...] = eqx.field(static=True)
    per_record: tuple[str, ...] = eqx.field(static=True)  # paths where the model has a value for each record
    by_forces: bool = eqx.field(static=True)  # the heights are forces on the wheels

    def observed(self, model: VehicleTest) -> Float[Array, "records channels fine"]:
        """The channels at the instants of the simulation, before the sensors, in SI."""

        def one(heights: Array, number: Array) -> Array:
            of_record = self._of_record(model, number)
            system, dt = driven(of_record.vehicle, self.by_forces).system(), jnp.asarray(self.dt, heights.dtype)
            start = settled(system, heights[0])
            if of_record.starts:
                motions = [jnp.concatenate([begin.position, begin.rate]) for begin in of_record.starts]
                start = start + jnp.stack(motions)[number]
            saved, _ = recorded(self.engine, system, heights, dt, start, 1, None)
            return jax.vmap(system.channels(self.channels))(
                saved.motion, saved.port_force, saved.road, saved.road_rate
            ).T

        return self._each(one, self.heights)

    def predict(self, model: VehicleTest) -> Float[Array, "records channels time"]:
        """What the sensors show, in SI."""
        return self._shown(model, self.observed(model))

    def _shown(self, model: VehicleTest, observed: Array) -> Float[Array, "records channels time"]:
        def one(channels: Array, number: Array) -> Array:
            sensors, dt = self._of_record(model, number).sensors, jnp.asarray(self.dt, channels.dtype)
            pairs = zip(self.channels, channels, strict=True)
            shown = [sensors[name](values, dt) if name in sensors else values for name, values in pairs]
            return jnp.stack(shown)[:, :: self.finer]

        return self._each(one, observed)

    def _of_record(self, model: VehicleTest, number: Array) -> VehicleTest:
        return with_values(model, {path: get(model, path)[number] for path in self.per_record})

    def _each(self, one: Callable[[Array, Array], Array], arrays: Array) -> Array:
        if arrays.shape[0] == 1:  # one loop over time is compiled to faster code than a batch of one
            return one(arrays[0], self.number[0])[None]
        return jax.vmap(one)(arrays, self.number)

    def compared(self, model: VehicleTest, observed: Array) -> Float[Array, " samples"]:
        """Weighted difference between what the sensors show of these channels and the measurement."""
        return jnp.ravel((self._shown(model, observed) - self.measured) * self.weight)

    def __call__(self, model: VehicleTest) -> Float[Array, " samples"]:
        """Weighted difference between model and measurement."""
        return self.compared(model, self.observed(model))


@final
class DamperOnBench(AbstractResiduals):
    """Bench records of a law of the vehicle."""

    batch: Batch
    path: str = eqx.field(static=True)  # of the law in the vehicle

    def __call__(self, model: VehicleTest) -> Float[Array, " samples"]:
        """Weighted difference of the law's force from the measured one."""
        return self.batch(on_rig(get(model.vehicle, self.path), model.rig))

    def reweighted(self, factor: Float[np.ndarray, " samples"]) -> "DamperOnBench":
        """The same with every weight times a factor."""
        return dataclasses.replace(self, batch=self.batch.reweighted(factor))

    def used(self) -> Bool[np.ndarray, " samples"]:
        """Which samples count."""
        return self.batch.used()


def driven(vehicle: AbstractVehicle, by_forces: bool) -> AbstractVehicle:
    """The vehicle, on measured forces if these drive it."""
    return ForceDriven(vehicle) if by_forces else vehicle


class Drive(NamedTuple):
    """How a record is simulated: heights at the instants of the simulation [m], its step [s] and engine."""

    heights: Float[np.ndarray, "fine wheels"]
    dt: float
    finer: int
    engine: AbstractEngine


def finer_heights(record: RideRecord, finer: int) -> Float[np.ndarray, "fine wheels"]:
    """The heights under the wheels at `finer` times as many instants, between which engines take straight lines.

    Straight lines between points of a smooth curve flatten its waves by the share (π f dt)²/3. A twelfth of the second
    differences is therefore taken off the heights of the curve, after which the share is of the order (f dt)⁴.
    """
    heights = record.road
    if finer > 1:
        from scipy.interpolate import CubicSpline  # few fits need it

        heights = CubicSpline(np.arange(len(record)), heights)(np.arange((len(record) - 1) * finer + 1) / finer)
    bend = np.zeros_like(heights)
    bend[1:-1] = heights[2:] - 2.0 * heights[1:-1] + heights[:-2]
    return heights - bend / 12.0


def ride_batches(
    records: Sequence[RideRecord],
    drives: Sequence[Drive],
    sigma: Mapping[str, float],
    settling: float = 0.0,
    per_record: tuple[str, ...] = (),
) -> list[RideBatch]:
    """Records in groups that are driven together, in the order of their first members."""
    groups: dict[tuple, list[int]] = {}
    for i, (record, drive) in enumerate(zip(records, drives, strict=True)):
        forces = record.driven_by == "forces"
        steps = drive.finer, drive.engine.step_count
        alike = len(record), round(record.dt, 12), tuple(record.channels), forces, *steps
        groups.setdefault(alike, []).append(i)
    batched = []
    for (length, dt, channels, forces, finer, _), members in groups.items():
        one = drives[members[0]]
        weight = np.zeros((len(members), len(channels), length))
        weight[:, :, int(np.ceil(settling / dt)) :] = (1.0 / np.array([sigma[c] for c in channels]))[None, :, None]
        heights = np.stack([drives[i].heights for i in members])
        measured = np.stack([np.stack(list(records[i].channels.values())) for i in members])
        road, channel, weights = (jnp.asarray(a, float) for a in (heights, measured, weight))
        numbers, how = jnp.asarray(members, int), (dt / finer, finer, channels, per_record, forces)
        batched.append(RideBatch(road, channel, weights, numbers, one.engine, *how))
    return batched


def bench_parts(
    model: VehicleTest, benches: Mapping[str, Sequence[BenchRun]], sigma: Mapping[str, float], per_cycle: int | None
) -> list[DamperOnBench]:
    """The residuals of bench records by the path of the law."""
    parts = []
    for path, runs in benches.items():
        law = on_rig(get(model.vehicle, path), model.rig)
        parts += [DamperOnBench(batch, path) for batch in batches(law, runs, [sigma[path]] * len(runs), per_cycle)[0]]
    return parts


class VirtualRideSettings(SimulationSettings, total=False):
    """Further keywords of `virtual_ride`: those of `simulate` but `dt`, which follows from the record, and these.

    Arguments:
        name: name of the record; noise depends on it and on the seed only.
        finer: steps of the simulation in a sampling interval; as many as give steps of at most 1 ms, two at least, if
            left out.
    """

    name: str
    finer: int | None


LONGEST_STEP = 1e-3  # s, of virtual records
WITHOUT_STEP: SimulationSettings = {**SIMULATION}
del WITHOUT_STEP["dt"]
VIRTUAL_RIDE: VirtualRideSettings = {**WITHOUT_STEP, "name": "virtual ride", "finer": None}


@of_known_numbers
@with_defaults(VIRTUAL_RIDE)
def virtual_ride(
    vehicle: AbstractVehicle,
    road: AbstractRoad,
    channels: Mapping[str, float],
    *,
    sampling_rate: float | int = 500.0,
    sensors: Mapping[str, Sensor] | None = None,
    road_noise: float = 0.0,
    driven_by: str = "heights",
    seed: int = 0,
    **settings: Unpack[VirtualRideSettings],
) -> RideRecord:
    """A record as real sensors would write it, of a simulated vehicle.

    The vehicle is simulated in steps finer than the record, its channels pass the sensors and are sampled, and noise is
    added.

    Arguments:
        vehicle: the vehicle.
        road: a road or the motion of platforms, as in `simulate`.
        channels: the channels to measure, each with the standard deviation of its noise in its unit.
        sampling_rate: of the record [Hz].
        sensors: by channel, what the sensor adds.
        road_noise: standard deviation of the noise of the heights [m], or of the wheel forces [N].
        driven_by: what the record has of the road: "heights", or the "forces" on the wheels that it causes.
        seed: seed of the noise.
        settings: keywords, all optional: `name` and `finer` (see `VirtualRideSettings`); `duration`, `start` and others
            of `simulate` but `dt`.

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
    name, finer = settings["name"], settings["finer"]
    _checks.positive("sampling_rate", sampling_rate)
    _checks.nonnegative("road_noise", road_noise)
    _checks.one_of("driven_by", driven_by, ["heights", "forces"])
    for channel, deviation in channels.items():
        _checks.one_of("channels", channel, vehicle.units)
        _checks.nonnegative(f"channels[{channel!r}]", deviation)
    for channel in sensors or {}:
        _checks.one_of("sensors", channel, channels)
    _checks.counts(finer=finer)
    finer = finer or max(math.ceil(1.0 / (LONGEST_STEP * sampling_rate) - 1e-6), 2)
    dt = 1.0 / (finer * sampling_rate)
    response = simulate(vehicle, road, **{**part(settings, WITHOUT_STEP), "dt": dt})
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
