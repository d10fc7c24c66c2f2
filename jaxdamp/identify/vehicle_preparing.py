"""Records and a vehicle as a least-squares problem."""

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.bench import BenchRun, RideRecord, as_runs
from jaxdamp.dampers import AbstractDamper, Reach
from jaxdamp.identify.criteria import Priors
from jaxdamp.identify.machine import Machine, absent_paths
from jaxdamp.identify.model import InitialMotion, VehicleTest, own_names
from jaxdamp.identify.preparing import not_chosen
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.vehicle_residuals import Drive, bench_parts, driven, finer_heights, ride_batches
from jaxdamp.parameters import FreeParameters, get, interval, match_paths, parameters
from jaxdamp.rig import Rig, Sensor
from jaxdamp.simulation import Exponential, RunCheck
from jaxdamp.vehicles import AbstractVehicle, refuse_controller


FIRST_GUESS = 0.1  # noise of a channel at first, relative to its standard deviation
MEDIAN = 1.4826  # standard deviation of normal noise, relative to the median of its magnitude
LEAST_NOISE = 1e-4  # the same at the end, so that records without noise can be fitted
UNSEEN = 1e-6  # change of the channels when the scale is doubled, relative to them, that counts as none
UNSEEN_SINGLE = 1e-4  # the same in single precision
FAR = 1e3  # times a limited number, to which it may go away from its limit
INWARD = 0.1  # of the way from its limit back to the start, where the search begins anew
BISECTIONS = 10  # of the range in which a number stops to be accepted
EVERYWHERE = Reach(np.inf, np.inf)  # laws of a vehicle: no number is outside the records


class VehicleData(NamedTuple):
    """The records of a fit, made ready."""

    model: VehicleTest
    rides: tuple[RideRecord, ...]
    drives: list[Drive]
    benches: dict[str, tuple[BenchRun, ...]]
    settling: float
    per_record: tuple[str, ...]
    samples_per_cycle: int | None
    dt: float | None = None  # longest step of the simulation, s
    priors: tuple[Priors, ...] = ()
    known: Mapping[str, float] = {}  # noise of channels, where it is given

    @property
    def channels(self) -> list[str]:
        """All measured channels, then the paths of the laws on a bench: the owners of residuals."""
        return [*dict.fromkeys(name for ride in self.rides for name in ride.channels), *self.benches]

    def with_known_noise(self, noise: Mapping[str, float]) -> "VehicleData":
        """The same with the noise that is given, checked."""
        for name, value in noise.items():
            _checks.one_of("noise", name, self.channels)
            _checks.positive(f"noise[{name!r}]", value)
        return self._replace(known={name: float(value) for name, value in noise.items()})

    def first_noise(self) -> dict[str, float]:
        """A share of the standard deviation of each channel, where its noise is not given."""
        return {name: FIRST_GUESS * level for name, level in self.levels().items()} | dict(self.known)

    def levels(self) -> dict[str, float]:
        """The standard deviation of each channel over all records."""
        rides = {
            name: np.concatenate([r[name] - r[name].mean() for r in self.rides if name in r.channels])
            for name in self.channels
            if name not in self.benches
        }
        forces = {path: np.concatenate([run.force for run in runs]) for path, runs in self.benches.items()}
        return {name: float(np.std(values)) for name, values in (rides | forces).items()}

    def problem(self, free: FreeParameters, sigma: Mapping[str, float]) -> Problem:
        """The least squares with residuals divided by the noise of each channel."""
        rides = ride_batches(self.rides, self.drives, sigma, self.settling, self.per_record)
        number = {name: i for i, name in enumerate(self.channels)}
        owner = [
            np.broadcast_to(np.array([number[c] for c in b.channels])[None, :, None], b.weight.shape).ravel()
            for b in rides
        ]
        forces = bench_parts(self.model, self.benches, sigma, self.samples_per_cycle)
        owner += [np.full(part.batch.weight.size, number[part.path]) for part in forces]
        weighted = [np.ravel(b.measured * b.weight) for b in rides]
        weighted += [np.ravel(part.batch.force * part.batch.weight) for part in forces]
        level = float(np.sqrt(sum(np.sum(np.square(values)) for values in weighted)))
        ordered = tuple(sigma[name] for name in self.channels)
        owner += [np.zeros(part.size, int) for part in self.priors]
        parts, owners = (*rides, *forces, *self.priors), np.concatenate(owner)
        return Problem(
            free, parts, level, self.rides, ordered, owners, EVERYWHERE, self.model.vehicle, self.per_record, True
        )

    def noise_in(self, end: SearchEnd, problem: Problem, sigma: Mapping[str, float], loss: str) -> dict[str, float]:
        """RMS of the residual of each channel, in its unit; with a robust loss that of most samples, by the median."""
        used, levels, noise = problem.used, self.levels(), {}
        for i, name in enumerate(self.channels):
            residual = end.residual[used & (problem.owner == i)]
            size = np.sqrt(np.mean(residual**2)) if loss == "squares" else MEDIAN * np.median(np.abs(residual))
            noise[name] = max(sigma[name] * float(size), LEAST_NOISE * levels[name])
        return noise | dict(self.known)


def checked_records(vehicle: AbstractVehicle, records: RideRecord | Iterable[RideRecord]) -> tuple[RideRecord, ...]:
    """The records, after a check that the vehicle has their channels and wheels."""
    refuse_controller(vehicle, "a fit")
    if isinstance(records, Mapping):
        remedy = (
            "Of several vehicles, each has a fit of its own: `{name: fit(vehicle, rides[name]) for name in rides}`."
        )
        _checks.refuse("records", "be one or more records of one vehicle", _checks.described(records), remedy)
    rides = tuple(records) if isinstance(records, Iterable) else (records,)
    if not rides:
        _checks.refuse("records", "hold at least one record", "empty", "Read some with `bench.read_rides`.")
    names = [ride.name for ride in rides if isinstance(ride, RideRecord)]
    if len(set(names)) < len(names):
        _checks.refuse("records", "have names that differ", ", ".join(names), "Results are listed by name.")
    units, wheels = vehicle.units, vehicle.wheel_names
    for ride in rides:
        must = "be records of a vehicle"
        _checks.instance("records", ride, RideRecord, must, "Bench records of its damper go to `bench={path: runs}`.")
        for name in ride.channels:
            _checks.one_of(f"channel of record {ride.name!r}", name, units)
            if ride.units.get(name, units[name]) != units[name]:
                value = f"{ride.units[name]} for {name!r} in record {ride.name!r}"
                _checks.refuse("records", f"be in the units of the vehicle, {units[name]}", value)
        if ride.wheels != len(wheels):
            value = f"{ride.wheels} in record {ride.name!r}"
            remedy = "Each wheel has a column, also those of the rear axle: delay the road yourself."
            _checks.refuse("road", f"have a column for each of {len(wheels)} wheel(s) of the vehicle", value, remedy)
    return rides


def checked_benches(
    vehicle: AbstractVehicle, bench: Mapping[str, Any], rig: Machine
) -> dict[str, tuple[BenchRun, ...]]:
    """The bench records by the path of the law."""
    if rig is not None and not bench:
        _checks.refuse("rig", "come with bench records", repr(rig), "Pass them as `bench={'damper': runs}`.")
    for path in bench:
        try:
            law = get(vehicle, path)
        except (AttributeError, LookupError):
            law = None
        remedy = "Write the path of a damper law, such as 'damper' or 'front.damper'."
        _checks.instance("bench", law, AbstractDamper, f"name laws of the vehicle, which {path!r} is not", remedy)
    return {path: as_runs(runs, call="fit_vehicle(..., bench={'damper': runs})") for path, runs in bench.items()}


def vehicle_test(
    vehicle: AbstractVehicle,
    rides: Sequence[RideRecord],
    sensors: Mapping[str, Sensor],
    start: str,
    rig: Rig | None,
) -> VehicleTest:
    """The vehicle with its sensors and initial motions."""
    _checks.one_of("start", start, ["rest", "free"])
    for name, sensor in sensors.items():
        _checks.one_of("sensors", name, list(dict.fromkeys(c for ride in rides for c in ride.channels)))
        check_module(f"sensors[{name!r}]", sensor, (Sensor,), "fit_vehicle(..., sensors={'stroke': Sensor(offset=0)})")
    count = len(vehicle.coordinates)
    starts = [InitialMotion(jnp.zeros(count), jnp.zeros(count)) for _ in rides] if start == "free" else []
    return VehicleTest(vehicle, dict(sensors), tuple(starts), rig)


def frozen_paths(model: VehicleTest, over: Sequence[str] | None, freeze: Sequence[str]) -> list[str]:
    """Paths that are held: those asked for, what `over` leaves out, what sensors and test machine do not have."""
    paths, held = [p.path for p in parameters(model)], not_chosen(model, over, "sensors.", "starts.", "rig.")
    for name, sensor in model.sensors.items():
        held += [f"sensors.{name}.{p.path}" for p in parameters(sensor) if p.path not in sensor.given]
    held += absent_paths(model.rig)
    return [*held, *match_paths(paths, own_names(model).find("freeze", freeze))]


def per_record_paths(model: VehicleTest, names: Sequence[str], count: int) -> tuple[str, ...]:
    """Paths of the parameters with a value for each record."""
    by_path = {p.path: p for p in parameters(model) if not p.path.startswith(("rig.", "starts."))}
    given = {f"sensors.{name}.{number}" for name, sensor in model.sensors.items() for number in sensor.given}
    chosen = [p for p in by_path if p.startswith("vehicle.") or p in given]
    paths = match_paths(chosen, own_names(model).find("per_record", names))
    for path in paths:
        if by_path[path].value.ndim or count < 2:
            value = f"{path}, with {count} record(s)" if count < 2 else f"{path}, a vector"
            _checks.refuse("per_record", "name single numbers that differ between several records", value)
    return tuple(paths)


def drives_of(vehicle: AbstractVehicle, rides: Sequence[RideRecord], dt: float | None) -> list[Drive]:
    """How each record is simulated, with as many substeps as the laws need at the start."""
    longest, drives = 1e-3 if dt is None else dt, []
    _checks.positive("dt", longest)
    for ride in rides:
        finer = max(int(np.ceil(ride.dt / longest - 1e-6)), 1)
        heights = finer_heights(ride, finer)

        def half(ride: RideRecord = ride, finer: int = finer) -> Array:
            return jnp.asarray(finer_heights(ride, 2 * finer), float)

        system = driven(vehicle, ride.driven_by == "forces").system()
        check = RunCheck(system, jnp.asarray(heights, float), half, ride.dt / finer)
        drives.append(Drive(heights, ride.dt / finer, finer, Exponential().prepared(check)))
    return drives


def first_refused(
    free: FreeParameters,
    start: Float[np.ndarray, " free"],
    end: Float[np.ndarray, " free"],
    accepted: Callable[[Float[np.ndarray, " free"]], bool],
) -> tuple[int, float, FreeParameters] | None:
    """The number by which the end of a search is refused, its last accepted value, and the free parameters within it.

    None if no single number makes the difference.
    """
    for index, p in enumerate(free.owners):
        moved = end.copy()
        moved[index] = start[index]
        if p.value.ndim or not accepted(moved):
            continue
        good, bad = float(start[index]), float(end[index])
        for _ in range(BISECTIONS):
            moved[index] = np.sqrt(good * bad) if good * bad > 0 else 0.5 * (good + bad)
            good, bad = (moved[index], bad) if accepted(moved) else (good, moved[index])
        lower, upper = (float(side[index]) for side in free.limits())
        lower, upper = (np.clip(side, -FAR * abs(good), FAR * abs(good)) for side in (lower, upper))
        limits = (float(good), float(upper)) if good > bad else (float(lower), float(good))
        chosen = tuple(dataclasses.replace(q, domain=interval(*limits)) if q.path == p.path else q for q in free.chosen)
        moved[index] = good + INWARD * (start[index] - good)
        return index, float(good), FreeParameters(free.tree, chosen, free.ties).started_at(moved)
    return None


def in_units(free: FreeParameters, units: Mapping[str, str]) -> FreeParameters:
    """The same with the units of the channels for the offsets of their sensors."""
    changed = []
    for p in free.chosen:
        kind, _, name = p.path.partition(".")
        channel, _, field = name.partition(".")
        unit = units[channel] if kind == "sensors" and field == "offset" else p.unit
        changed.append(dataclasses.replace(p, unit=unit))
    return FreeParameters(free.tree, tuple(changed), free.ties)


class FreeScale(NamedTuple):
    """Numbers that may all grow by one factor without any change of the channels, and the one that is held."""

    names: tuple[str, ...] = ()  # of the numbers; empty if the records show the scale
    held: int | None = None  # index of the number held, the first mass if there is one; None if none can be
    held_name: str = ""  # its name


def force_powers(free: FreeParameters) -> Float[np.ndarray, " free"]:
    """How often each number's unit contains a force or a mass: 1 for N/m and kg, −1 for K/J, 0 for m/s.

    >>> from jaxdamp.parameters import free_parameters
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> force_powers(free_parameters(quarter_car_000(), over=["sprung_mass", "rate"])).tolist()
    [1.0, 1.0]
    """
    return np.array([_power(p.unit) for p in free.owners], float)


def _power(unit: str) -> int:
    above, _, below = unit.partition("/")
    return sum(sign * len(re.findall(r"\b(?:N|kg|Pa|J|W)\b", part)) for sign, part in ((1, above), (-1, below)))


def free_scale(problem: Problem, point: SearchEnd) -> FreeScale:
    """Whether all masses, rates and forces may grow by one factor, from the derivatives at a point.

    They may not where a force is measured, or where one of them is frozen.
    """
    free = problem.free
    powers = force_powers(free)
    change = float(np.linalg.norm(point.jacobian @ (powers * point.values)))
    unseen = UNSEEN if free.values.dtype == np.float64 else UNSEEN_SINGLE
    if not np.any(powers) or not change < unseen * problem.level:
        return FreeScale()
    single = [i for i, p in enumerate(free.owners) if powers[i] and p.value.ndim == 0]
    masses = [i for i in single if free.owners[i].unit == "kg"]
    names = tuple(name for name, power in zip(free.names, powers, strict=True) if power)
    held = next(iter([*masses, *single]), None)
    return FreeScale(names, held, "" if held is None else free.names[held])


def without(free: FreeParameters, held: int | None) -> FreeParameters:
    """The free parameters without the number that is held at its start, and those tied to it."""
    if held is None:
        return free
    path = free.owners[held].path
    ties = tuple(pair for pair in free.ties if pair[1] != path)
    tree = free.started_at(np.asarray(free.values)).tree
    return FreeParameters(tree, tuple(p for p in free.chosen if p.path != path), ties)
