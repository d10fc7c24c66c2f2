"""`fit_vehicle`: masses, rates, friction and damper laws of a vehicle from its records."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, RideRecord
from jaxdamp.identify._blas import one_thread
from jaxdamp.identify.estimating import estimate
from jaxdamp.identify.machine import Machine, started_machine
from jaxdamp.identify.noise import independent
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd, search
from jaxdamp.identify.several import Solution
from jaxdamp.identify.vehicle_left_out import on_sensors, on_signs
from jaxdamp.identify.vehicle_noise import channel_noise
from jaxdamp.identify.vehicle_preparing import (
    VehicleData,
    checked_benches,
    checked_records,
    drives_of,
    frozen_paths,
    in_units,
    known_noise,
    per_record_paths,
    vehicle_test,
)
from jaxdamp.identify.vehicle_result import VehicleFit, channel_scores
from jaxdamp.identify.vehicle_scale import FreeScale, free_scale, without
from jaxdamp.parameters import free_parameters, get, matched_in_words, parameters, with_values
from jaxdamp.rig import Sensor
from jaxdamp.vehicles import AbstractVehicle


ALIKE = 0.05  # relative change of the estimated noise below which the weights are final
MOST_ROUNDS = 6


@of_known_numbers
@one_thread()
def fit_vehicle(
    vehicle: AbstractVehicle,
    records: RideRecord | Iterable[RideRecord],
    *,
    sensors: Mapping[str, Sensor] | None = None,
    bench: Mapping[str, Iterable[BenchRun]] | None = None,
    rig: Machine = None,
    over: Sequence[str] | None = None,
    freeze: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str] | None = None,
    per_record: Sequence[str] = (),
    start: str = "rest",
    settling: float | int = 0.0,
    noise: Mapping[str, float] | None = None,
    dt: float | None = None,
    samples_per_cycle: int | None = 400,
    max_steps: int = 100,
) -> VehicleFit:
    """Fit masses, rates, friction and damper laws of a vehicle to records of its motion.

    The vehicle is simulated on the road of each record and compared with all measured
    channels by Levenberg-Marquardt; derivatives pass forwards through the engine. Each channel is weighted by its
    noise, which is estimated from the residual and the fit repeated until it is consistent. Nothing is random; there
    is one start, the vehicle given.

    If the records hold no force, all masses, rates and forces may be multiplied by one factor. This is found from the
    derivatives; the first mass is then held at its start, and a warning says so. Freeze what is known, or measure a
    force.

    Arguments:
        vehicle: the start. `vehicles.Guided` adds the friction of guides.
        records: one or more, of the same vehicle.
        sensors: by channel, what the sensor adds; the numbers given are free: `{"stroke": Sensor(offset=0.0)}`.
        bench: bench records of laws of the vehicle, by the path of the law: `{"damper": runs}`, or "damper.law" inside
            a `MotionRatio`. They are fitted together with the records of the vehicle; dampers that share a law are
            tied by `tie`.
        rig: test machine of the bench records, as in `fit`: a `Rig`, or names such as "gas,friction".
        over: parameters of the vehicle to fit, by path, last part or pattern; all if left out.
        freeze: parameters to hold at their start, also of sensors.
        bounds: extra limits `{name: (lower, upper)}`.
        tie: parameters that take the values of others, as in `fit`.
        per_record: parameters with a value for each record, such as "sprung_mass" (payload) or "offset".
        start: "rest", in static equilibrium on the first heights; or "free", the initial motion of each record is
            fitted.
        settling: time at the beginning of each record that is not compared [s].
        noise: standard deviation of channels in their SI unit, where it is known, also of a path of `bench` [N]. It
            sets the weights; standard errors follow from the residual.
        dt: longest step of the simulation [s], 1 ms if left out. Records with a longer sampling interval are simulated
            in fractions of it. Between the samples the road is a smooth curve through the measured heights.
        samples_per_cycle: of bench records, as in `fit`.
        max_steps: largest number of steps of each search.

    Returns:
        The fitted vehicle, its parameters with standard errors, scores of each channel, warnings.

    Raises:
        ValueError: no records; a channel that the vehicle does not have, or of another unit; a road of other wheels;
            names that fit no parameter; a start outside its bounds.

    `docs/vehicle_fits.md` shows an example.
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), "fit_vehicle(vehicle, records)")
    rides = checked_records(vehicle, records)
    if max_steps < 1:
        _checks.refuse("max_steps", "be 1 or more", max_steps)
    _checks.nonnegative("settling", settling)
    if settling > 0.5 * min(len(ride) * ride.dt for ride in rides):
        _checks.refuse("settling", "leave at least half of every record", settling)
    benches = checked_benches(vehicle, bench or {}, rig)
    machine = started_machine(rig, [run for runs in benches.values() for run in runs])
    model = vehicle_test(vehicle, rides, sensors or {}, start, machine)
    own, frozen = per_record_paths(model, per_record, len(rides)), frozen_paths(model, over, freeze)
    spread = with_values(model, {path: jnp.full(len(rides), get(model, path)) for path in own})
    data = VehicleData(model, rides, drives_of(vehicle, rides, dt), benches, float(settling), own, samples_per_cycle)
    known = known_noise(data, noise or {})

    free = free_parameters(spread, freeze=frozen, bounds=bounds, tie=tie)
    _checks.finite("vehicle", free.values)
    free, sigma = in_units(free, vehicle.units), {**data.first_noise(), **known}
    problem = data.problem(free, sigma)
    end = search(problem, 1)
    scale = free_scale(problem, end)
    for _ in range(MOST_ROUNDS):
        end = search(problem, max_steps, scale.held)
        before, sigma = sigma, {**data.noise_in(end, problem, sigma), **known}
        if not end.finite or all(abs(np.log(sigma[name] / before[name])) < ALIKE for name in sigma):
            break
        problem = data.problem(free.started_at(end.values), sigma)
    known = [p.path for p in parameters(model)]
    of_vehicle = [path for path in known if path.startswith("vehicle.")]
    named = matched_in_words(of_vehicle, over=over or ())
    others = matched_in_words(known, freeze=freeze, bounds=bounds or {}, per_record=per_record)
    patterns = "; ".join(filter(None, (named, others)))
    return dataclasses.replace(_judged(data, problem, end, scale), patterns=patterns)


def _judged(data: VehicleData, problem: Problem, end: SearchEnd, scale: FreeScale) -> VehicleFit:
    """The result at the minimum."""
    if not end.finite:
        remedy = "Start from a vehicle nearer to the records, or give `bounds`."
        _checks.refuse("vehicle", "give finite channels and derivatives over the records", "one that does not", remedy)
    model = problem.free.started_at(end.values).tree
    held = () if scale.held is None else (problem.free.names[scale.held],)
    problem, end = without(problem.started_at(end.values), end, scale.held)
    noise = channel_noise(problem, end.residual, end.values.size)
    estimates = estimate(problem, Solution(end, (end,), 1), independent(noise.sigma, problem.used, end.values.size))
    own = {path: get(model, path) for path in data.per_record}
    model = with_values(model, {path: jnp.mean(values) for path, values in own.items()})
    notes = [f"The search did not converge: {end.status.sentence}"] * (not end.converged)
    if scale.names:
        values = [
            f" {name} was held at {float(get(model, name)):.6g}; the standard errors are for this." for name in held
        ]
        notes.append(
            "These records hold no force, so only ratios of masses, rates and forces can be determined:"
            f" {', '.join(scale.names)} may all be larger by one factor.{''.join(values)}"
            " Fix one mass that is known, or measure a force."
        )
    scores = channel_scores(problem, end.residual, data.rides, data.channels)
    notes += [*on_signs(scores), *estimates.notes]
    notes += on_sensors(problem, end, data.rides, data.channels, model.sensors)
    if noise.inflation > 1.0:
        notes.append(
            "Neighbouring residuals are alike: the vehicle or its sensors miss something systematic. The standard"
            f" errors are {noise.inflation:.3g} times those of independent noise."
        )
    return VehicleFit(
        vehicle=model.vehicle,
        records=data.rides,
        bench=data.benches,
        parameters=estimates.estimates,
        covariance=estimates.covariance,
        scores=scores,
        warnings=tuple(notes),
        status=end.status,
        steps=end.steps,
        inflation=noise.inflation,
        sensors=model.sensors,
        held=held,
        scale_free=scale.names,
        rig=model.rig,
        problem=problem,
    )
