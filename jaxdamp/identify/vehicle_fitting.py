"""`fit_vehicle`: masses, rates, friction and damper laws of a vehicle from its records."""

import dataclasses
import functools
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Unpack

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._one_thread import one_thread
from jaxdamp._settings import with_defaults
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench import BenchRun, RideRecord
from jaxdamp.identify.criteria import criterion_in_words, priors_on, solve_by
from jaxdamp.identify.estimating import estimate
from jaxdamp.identify.judging import MOST_WARNINGS, fields_of_fit, on_status
from jaxdamp.identify.losses import LOSSES
from jaxdamp.identify.machine import Machine, started_machine
from jaxdamp.identify.model import VehicleTest, own_names, spread, with_means
from jaxdamp.identify.noise import Noise, channel_noise
from jaxdamp.identify.preparing import free_by_record
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd, search
from jaxdamp.identify.settings import VEHICLE, VehicleSettings, check_keywords
from jaxdamp.identify.several import Solution, search_scattered
from jaxdamp.identify.vehicle_left_out import friction_left_out, on_free_scale, on_sensors, on_signs, on_units
from jaxdamp.identify.vehicle_preparing import (
    FreeScale,
    VehicleData,
    checked_benches,
    checked_records,
    drives_of,
    first_refused,
    free_scale,
    frozen_paths,
    in_units,
    per_record_paths,
    vehicle_test,
    without,
)
from jaxdamp.identify.vehicle_residuals import Drive
from jaxdamp.identify.vehicle_result import ChannelScore, VehicleFit, channel_scores
from jaxdamp.parameters import free_parameters, matched_in_words, parameters
from jaxdamp.rig import Sensor
from jaxdamp.vehicles import AbstractVehicle


ALIKE = 0.05  # relative change of the estimated noise below which the weights are final
MOST_ROUNDS = 6
MOST_CHECKS = 4  # of whether `simulate` accepts the vehicle at the minimum


@of_known_numbers
@one_thread()
@with_defaults(VEHICLE, check=check_keywords)
def fit_vehicle(
    vehicle: AbstractVehicle,
    records: RideRecord | Iterable[RideRecord],
    *,
    sensors: Mapping[str, Sensor] | None = None,
    bench: Mapping[str, Iterable[BenchRun]] | None = None,
    rig: Machine = None,
    start: str = "rest",
    settling: float | int = 0.0,
    noise: Mapping[str, float] | None = None,
    **settings: Unpack[VehicleSettings],
) -> VehicleFit:
    """Fit masses, rates, friction and damper laws of a vehicle to records of its motion.

    The vehicle is simulated on the road of each record and compared with all measured
    channels by Levenberg-Marquardt; derivatives pass forwards through the engine. Each channel is weighted by its
    noise, which is estimated from the residual and the fit repeated until it is consistent. Nothing is random: the
    same records give the same result.

    If the records hold no force, all masses, rates and forces may be multiplied by one factor. This is found from the
    derivatives; the first mass is then held at its start, and a warning says so. Freeze what is known, or measure a
    force.

    Arguments:
        vehicle: the start. `vehicles.Guided` adds the friction of guides.
        records: one or more, of the same vehicle.
        sensors: by channel, what the sensor adds; the numbers given are free: `{"stroke": Sensor(offset=0.0)}`.
        bench: bench records of laws of the vehicle, by the path of the law: `{"damper": runs}`, or "damper.law" inside
            a `MotionRatio` or a `Linkage`. They are fitted together with the records of the vehicle; dampers that
            share a law are tied by `tie`.
        rig: test machine of the bench records, as in `fit`: a `Rig`, or names such as "gas,friction".
        start: "rest", in static equilibrium on the first heights; or "free", the initial motion of each record is
            fitted.
        settling: time at the beginning of each record that is not compared [s].
        noise: standard deviation of channels in their SI unit, where it is known, also of a path of `bench` [N]. It
            sets the weights; standard errors follow from the residual.
        settings: keywords, all optional: `over`, `freeze`, `bounds`, `tie`, `priors` (see `Free`), `loss`, robust for
            channels with spikes and dropouts, and `max_steps`, 100 if left out (see `Search`); `per_record`, `dt`,
            `samples_per_cycle`, `starts`, 1 if left out, `seed` and `solver` (see `VehicleSettings`).

    Returns:
        The fitted vehicle, its parameters with standard errors, scores of each channel, warnings.

    Raises:
        ValueError: no records; a channel that the vehicle does not have, or of another unit; a road of other wheels;
            names that fit no parameter; a start outside its bounds.

    `docs/vehicle_fits.md` shows an example.
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), "fit_vehicle(vehicle, records)")
    over, freeze, bounds, per_record = settings["over"], settings["freeze"], settings["bounds"], settings["per_record"]
    loss, priors = settings["loss"], settings["priors"] or {}
    rides = checked_records(vehicle, records)
    _checks.counts(max_steps=settings["max_steps"], starts=settings["starts"])
    _checks.one_of("loss", loss, LOSSES)
    _checks.nonnegative("settling", settling)
    if settling > 0.5 * min(len(ride) * ride.dt for ride in rides):
        _checks.refuse("settling", "leave at least half of every record", settling)
    benches = checked_benches(vehicle, bench or {}, rig)
    machine = started_machine(rig, [run for runs in benches.values() for run in runs])
    model = vehicle_test(vehicle, rides, sensors or {}, start, machine)
    frozen = frozen_paths(model, over, freeze)
    varied = free_by_record(per_record_paths(model, per_record, len(rides)), frozen)
    named = own_names(model)
    limits, ties = named.find_keys("bounds", bounds), named.find_keys("tie", settings["tie"])
    free = free_parameters(spread(model, varied, len(rides)), freeze=frozen, bounds=limits, tie=ties)
    _checks.finite("vehicle", free.values)
    expected, dt = priors_on(free, named.find_keys("priors", priors)), settings["dt"]
    drives, per_cycle = drives_of(vehicle, rides, dt), settings["samples_per_cycle"]
    data = VehicleData(model, rides, drives, benches, float(settling), varied, per_cycle, dt, expected)
    data = data.with_known_noise(noise or {})
    free = in_units(free, vehicle.units)
    problem = data.problem(free, data.first_noise())
    first = search(problem, 1)
    scale, at_start = free_scale(problem, first), channel_scores(problem, first.residual, rides)
    problem = problem._replace(free=without(free, scale.held))
    begin = np.asarray(problem.free.values)
    problem, solution = _solved(data, problem, settings)
    problem, solution, refused = _accepted(data, problem, solution, begin, {**settings, "starts": 1})
    result = _judged(data, problem, solution, scale, at_start, refused)
    criterion = criterion_in_words(problem, loss, priors)
    words = _patterns(model, settings)
    return dataclasses.replace(result, patterns=words, criterion=criterion)


def _patterns(model: VehicleTest, asked: VehicleSettings) -> str:
    """What each pattern in the call stood for, in words."""
    paths = [p.path for p in parameters(model)]
    of_vehicle = matched_in_words([path for path in paths if path.startswith("vehicle.")], over=asked["over"])
    others = matched_in_words(paths, **{name: asked[name] for name in ("freeze", "bounds", "per_record")})
    return "; ".join(filter(None, (of_vehicle, others)))


def _solved(data: VehicleData, problem: Problem, asked: VehicleSettings) -> tuple[Problem, Solution]:
    """The minimum with each channel weighted by its noise, which is estimated until it is consistent."""
    loss, starts, max_steps, solver = asked["loss"], asked["starts"], asked["max_steps"], asked["solver"]
    sigma = dict(zip(data.channels, problem.sigma, strict=True))
    rounds = 0
    while True:
        end, rounds = search(problem, max_steps, solver=solver), rounds + 1
        before, sigma = sigma, data.noise_in(end, problem, sigma, loss)
        consistent = all(abs(np.log(sigma[name] / before[name])) < ALIKE for name in sigma)
        if not end.finite or consistent or rounds == MOST_ROUNDS:
            break
        problem = data.problem(problem.free.started_at(end.values), sigma)
    if not end.finite or (loss == "squares" and starts == 1 and not data.priors):
        return problem, Solution(end, (end,), 1)
    by_squares = functools.partial(search_scattered, seed=asked["seed"], max_steps=max_steps, solver=solver)
    return solve_by(problem.started_at(end.values), by_squares, loss=loss, noise=_noise, starts=starts)


def _noise(problem: Problem, end: SearchEnd) -> Noise:
    return channel_noise(problem, end.residual, end.values.size)


def _accepted(
    data: VehicleData,
    problem: Problem,
    solution: Solution,
    start: Float[np.ndarray, " free"],
    asked: VehicleSettings,
) -> tuple[Problem, Solution, list[str]]:
    """The minimum among the vehicles that `simulate` accepts, as it does the start, with the substeps they need."""
    notes = list[str]()

    def drives_at(values: np.ndarray) -> list[Drive] | None:
        """How the records are simulated with these numbers; None where `simulate` would refuse."""
        vehicle = with_means(problem.free.started_at(values).tree, data.per_record).vehicle
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return drives_of(vehicle, data.rides, data.dt)
            except ValueError:
                return None

    for _ in range(MOST_CHECKS):
        end = solution.best
        drives = drives_at(end.values) if end.finite else data.drives
        if drives is not None:
            if all(new.engine == old.engine for new, old in zip(drives, data.drives, strict=True)):
                break
            data = data._replace(drives=drives)
        else:
            limited = first_refused(problem.free, start, end.values, lambda values: drives_at(values) is not None)
            if limited is None:
                notes.append("`simulate` refuses the fitted vehicle: start nearer to the records, or give `bounds`.")
                break
            index, value, problem = limited[0], limited[1], problem._replace(free=limited[2])
            name, unit = problem.free.names[index], problem.free.owners[index].unit
            notes.append(
                f"{name} was held at {value:.4g} {unit} or on this side of it: `simulate` refuses the vehicle beyond,"
                " whose laws are too steep for its steps."
            )
        sigma = dict(zip(data.channels, problem.sigma, strict=True))
        begin = problem.free if drives is None else problem.free.started_at(end.values)
        problem, solution = _solved(data, data.problem(begin, sigma), asked)
    return problem, solution, notes


def _judged(
    data: VehicleData,
    problem: Problem,
    solution: Solution,
    scale: FreeScale,
    at_start: Sequence[ChannelScore],
    refused: Sequence[str],
) -> VehicleFit:
    """The result at the minimum."""
    end = solution.best
    if not end.finite:
        remedy = "Start from a vehicle nearer to the records, or give `bounds`."
        _checks.refuse("vehicle", "give finite channels and derivatives over the records", "one that does not", remedy)
    problem = problem.started_at(end.values)
    model, held = problem.free.tree, (scale.held_name,) if scale.held_name else ()
    noise = _noise(problem, end)
    estimates = estimate(problem, solution, noise)
    model = with_means(model, data.per_record)
    scores = channel_scores(problem, end.residual, data.rides)
    signs = [*on_signs(scores, at_start), *on_units(at_start, model.sensors)]
    notes = [*on_status(end, estimates.unsettled), *refused, *on_free_scale(scale, model), *signs, *estimates.notes]
    if not signs:  # what such a channel looks like is no lag of a sensor, and what friction looks like neither
        friction = friction_left_out(problem, end) if noise.inflation > 1.0 else None
        notes += [friction.sentence] if friction else []
        columns = [end.jacobian, friction.columns] if friction else [end.jacobian]
        with_friction = end._replace(jacobian=np.concatenate(columns, axis=1))
        notes += on_sensors(problem, with_friction, data.rides, data.channels, model.sensors)
    if noise.inflation > 1.0:
        notes.append(
            "Neighbouring residuals are alike: the vehicle or its sensors miss something systematic. The standard"
            f" errors are {noise.inflation:.3g} times those of independent noise."
        )
    return VehicleFit(
        vehicle=model.vehicle,
        records=data.rides,
        bench=data.benches,
        scores=scores,
        warnings=tuple(notes),
        main_warnings=tuple(notes[:MOST_WARNINGS]),
        sensors=model.sensors,
        held=held,
        scale_free=scale.names,
        rig=model.rig,
        **fields_of_fit(problem, solution, noise, estimates),
    )
