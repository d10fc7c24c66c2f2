"""`jaxdamp tune`: the free parameters of a vehicle for a ride metric, with limits; `jaxdamp sweep`, also in parts."""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast

import numpy as np
import typer

from jaxdamp import Ride, _checks, export, sweep, tune
from jaxdamp._checks import ArgumentError, part_of
from jaxdamp._pieces import kept_file
from jaxdamp._types import Dataset
from jaxdamp.blocks import command_of, note_command, stored_blocks
from jaxdamp.cli import interrupt, resuming
from jaxdamp.cli.console import Screen
from jaxdamp.cli.controlling import Controlling
from jaxdamp.cli.jobs import Output, job, write_json, write_tables
from jaxdamp.cli.limits import axes_in_si, bounds_in_si, in_si
from jaxdamp.cli.options import Call
from jaxdamp.cli.riding import Driving, at_commands, beyond_vehicles, unusual
from jaxdamp.cli.signatures import Arguments
from jaxdamp.cli.vehicle_words import given_law, parse_vehicle, read_baseline, with_dampers_at, write_laws
from jaxdamp.cli.words import Axis, Limit
from jaxdamp.control import Controlled
from jaxdamp.dampers import Scheduled
from jaxdamp.parameters import match_paths, modules_inside, named_parameters
from jaxdamp.report import MOST_POINTS, Table, best_points, points_table, sweep_report, tuning_report
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import stationary_notes
from jaxdamp.sweeps import grid, without_effect
from jaxdamp.tune import Run, Status, TuneResult, goal_limits, limit_spans
from jaxdamp.vehicles import AbstractVehicle


def sweep_part(screen: Screen, ride: Ride, axes: Mapping[str, np.ndarray], how: Call, store: Path, part: str) -> None:
    """Compute the blocks of one part, and say how many points the store has."""
    told = f"Blocks that are done are in {str(store)!r}, and the same command goes on from there."
    with interrupt.closing(lambda: told):
        data, remarks = swept(screen, ride, axes, how, store, part)
    screen.points(remarks, style="yellow")
    done, count = data.attrs["points_done"], data["failed"].size
    blocks, (number, _) = stored_blocks(store), part_of("block", part)
    idle = f"part {part} has no block: the sweep has {blocks}." if number > blocks else f"part {part} is done."
    remedy = "The same command without --block writes the results." if done == count else ""
    screen.answer(idle, f"{done} of {count} points are in {store}.", remedy)


def swept(
    screen: Screen,
    ride: Ride,
    axes: Mapping[str, np.ndarray],
    how: Call,
    file: Path | None,
    part: str | None = None,
) -> tuple[Dataset, list[str]]:
    """The results of a sweep with what it warns of."""
    stored = file if file is not None and file.suffix == ".zarr" else None
    now = resuming.given_now()
    with screen.stage("Driving") as advance, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")

        def tell(done: int, total: int) -> None:
            if stored is not None:
                note_command(stored, json.dumps(now, ensure_ascii=False))
            advance(f"{done} of {total} points", done)

        try:
            data = sweep(ride, axes, **how.arguments(file=file, cluster=part, progress=tell))
        except ArgumentError as error:
            if stored is None or error.argument != "file":
                raise
            differences = resuming.differences_between(json.loads(command_of(stored) or "{}"), now) if now else []
            if not differences:
                raise
            again = "Give what was given then, name another folder with --out, or delete the store to begin anew."
            raise ValueError(f"{str(stored)!r} holds another sweep: {'; '.join(differences)}. {again}") from error
    return data, [str(warning.message) for warning in caught]


ON_SCREEN = 30  # points of a sweep that are printed; of more, its smallest results are printed too
GRIP = "+10%"  # how much more a tyre load may vary after a tuning, by default


def tune_command(
    screen: Screen,
    vehicle: str,
    road: str,
    *,
    law: Path | None = None,
    minimise: str = "comfort",
    search: Annotated[Call, "tune.minimise"],
    roads: int = 1,
    driving: Driving,
    controlling: Controlling,
    baseline: Path | None = None,
    resume: bool = False,
    output: Output,
) -> None:
    """Tune the dampers of a vehicle for a ride metric within limits.

    Dampers whose law has settings, such as that of a manufacturer's sheet, are driven at each of them. Writes the law,
    the vehicle, tables, pictures and a page. Ends with exit code 1 if a limit is not met. Grip is
    limited to +10% of the start by itself; --limit grip=none removes that. With --controller the numbers of the
    policy are tuned, or what --over names (policy.gain, actuator_lag, car.damper.laws.1.rate). The policy alone is
    written as controller.json, which --controller of ride takes; vehicle.json has its period, delay and lags too.

    Arguments:
        road: iso:A to iso:H, white:A to white:H, bump:HEIGHT:LENGTH [m], or a file of position, height.
        minimise: the goal: comfort, travel, grip, or the name of a ride metric.
        roads: realisations of an iso road, driven side by side; their mean counts.
        baseline: to compare with: another law, or another tuning's vehicle.json, as JSON.
    """
    damper = given_law(law)
    car = parse_vehicle(vehicle)(damper)
    reference = None if baseline is None else read_baseline(baseline, car)
    if roads < 1:
        _checks.refuse("roads", "be 1 or more", roads)
    if roads > 1 and not road.startswith("iso:"):
        _checks.refuse("roads", "be 1 for a road that is not random", roads, "Take iso:CLASS.")
    surfaces, run = driving.over(road, roads)
    car = controlling.of(car, damper)
    if controlling.controller is not None:
        search = replace(search, given={"over": ["policy.**"], **search.given})
    elif "over" not in search.given and (settings := _settings(car)):
        search = replace(search, given={"over": settings, **search.given})
        screen.points(["Every setting of the law is driven; --over names parameters to tune instead."])
    call, remarks = tuning_arguments(car, minimise, surfaces, search, driving.seed, run)
    screen.points(remarks)
    screen.points(unusual(road, driving.speed), style="yellow")
    with job(screen, "tune", output, resume=resume) as work:
        result = tuned(screen, call)
        with work.saving("Law, vehicle and tables") as draft:
            write_tuning(draft, result)
        work.page(tuning_report, result, baseline=reference)
    exit_code_of(result)


def _settings(car: AbstractVehicle) -> dict[str, tune.Choice]:
    """The settings of laws of several, such as the clicks of a sheet, by the name of the command."""
    laws = ((path, law) for path, law in modules_inside(car) if isinstance(law, Scheduled))
    return {f"{path}command": tune.Choice(np.asarray(law.levels)) for path, law in laws}


def tuning_arguments(
    car: AbstractVehicle, metric: str, roads: Sequence[AbstractRoad | WhiteRoad], search: Call, seed: int, run: Run
) -> tuple[Arguments, list[str]]:
    """The arguments of `tune.minimise`, and what was chosen by default, in words."""
    limits, remarks = _limits(car, metric, search, white=isinstance(roads[0], WhiteRoad))
    road = roads[0] if len(roads) == 1 else tune.Scenarios(roads)
    bounds = bounds_in_si(search.given.get("bounds", {}), [car])
    call = search.arguments(metric=metric, vehicle=car, road=road, limits=limits, bounds=bounds, seed=seed, **run)
    return call, remarks


def _limits(car: AbstractVehicle, metric: str, search: Call, *, white: bool) -> tuple[dict[str, Limit], list[str]]:
    """The limits given, that of the grip of the other wheels by default, and a remark on it."""
    limits, remarks = in_si(search.given.get("limits", {}), car, white=white)
    every = car.goal_metrics("grip", white=white)
    wheels = [name for name in every if name not in (*limits, metric)]
    if wheels and "grip" not in (*limits, metric):
        limits |= dict.fromkeys(["grip"] if wheels == every else wheels, GRIP)
        of = "each tyre load" if wheels == every else f"the other tyre loads, {', '.join(wheels)}"
        sentence = f"Limited by default: grip (RMS variation of {of}) to {GRIP} of the start"
        remarks.append(f"{sentence}; --limit grip=none removes it.")
    return {name: limit for name, limit in limits.items() if limit is not None}, remarks


def tuned(screen: Screen, call: Arguments) -> TuneResult:
    """The result of `tune.minimise` with these arguments, shown at the terminal."""
    with screen.stage("Tuning") as advance:
        result = tune.minimise(**call, progress=lambda step, value: advance(f"step {step}: {value:.5g}", step))
    screen.answer(result.verdict.sentence)
    screen.say(result.summary.removeprefix(result.verdict.sentence).strip())
    rows = result.combinations.table() if result.combinations else result.parameter_table()
    screen.table(rows.first(MOST_POINTS if screen.verbose else ON_SCREEN))
    screen.details(result.table())
    screen.remarks(result.warnings, style="yellow")
    return result


def exit_code_of(result: TuneResult | None) -> None:
    """End with exit code 1 if a limit is not met."""
    if result is not None and result.status is Status.LIMIT_NOT_MET:
        raise typer.Exit(1)


def write_tuning(folder: Path, result: TuneResult) -> None:
    """The tuned laws, the vehicle, tables, and all of it as JSON."""
    write_laws(folder, result.vehicle)
    export.to_json(result.vehicle, folder / "vehicle.json")
    if isinstance(result.vehicle, Controlled) and not isinstance(result.vehicle.policy, dict):
        export.to_json(result.vehicle.policy, folder / "controller.json")
    write_tables(folder, result.tables() | ({} if result.fresh is None else {"fresh_roads": result.fresh.table()}))
    write_json(folder / "tuning.json", result.to_dict())


def sweep_command(
    screen: Screen,
    vehicle: str,
    road: str,
    *,
    over: Mapping[str, Axis],
    law: Path | None = None,
    metric: Sequence[str] = ("comfort", "travel", "grip"),
    limit: Mapping[str, Limit] | None = None,
    driving: Driving,
    how: Annotated[Call, "sweeps.sweep"],
    command: float | None = None,
    baseline: Path | None = None,
    block: str | None = None,
    resume: bool = False,
    output: Output,
) -> None:
    """Compute ride metrics over a grid of parameters: curves, maps and a table.

    With --block, a process computes its part of the sweep into a store, the folder of --out with .zarr behind its name;
    any number of them, one after the other or at once, as an array job has them. The same command without --block
    computes what is missing there, and writes the results.

    Arguments:
        road: iso:A to iso:H, white:A to white:H, bump:HEIGHT:LENGTH [m], or a file of position, height.
        over: axes.
        metric: what is computed: comfort, travel, grip, or names of ride metrics.
        limit: limits.
        command: what is set on the dampers, such as clicks or a coil current; that of their laws if left out.
        baseline: to compare with: another law, or another tuning's vehicle.json, as JSON.
        block: compute this part of the sweep only, into a store; pip install 'jaxdamp[cluster]'.
    """
    store = output.store("sweep")
    car = with_dampers_at(parse_vehicle(vehicle)(given_law(law)), command)
    (surface,), run = driving.over(road)
    white = isinstance(surface, WhiteRoad)
    stated, said = in_si(limit or {}, car, white=white)
    limits = _limits_by_metric(stated, car, white=white)
    names = [name for word in metric for name in _metrics_of("metric", word, car, white=white)]
    names = list(dict.fromkeys([*names, *limits]))
    limit_spans(limits, names, dict.fromkeys(names, 1.0))  # refuses what is no limit before anything is driven
    reference = None if baseline is None else read_baseline(baseline, car)
    ride = Ride(car, surface, metrics=names, **run)
    axes = grid(axes_in_si(over, car)).values
    ride({name: values[0] for name, values in axes.items() if not ride.out_of_domain({name: values[:1]})[0]})
    screen.points([*said, *at_commands({"vehicle": car})])
    screen.points(unusual(road, driving.speed), style="yellow")
    if block is not None:
        sweep_part(screen, ride, axes, how, store, block)
        return
    with job(screen, "sweep", output, resume=resume) as work:
        data, warned = swept(screen, ride, axes, how, store if store.exists() else kept_file("sweep.nc"))
        data = data.load()[names]  # in the order asked for: of points within the limits the first is named
        remarks = beyond_vehicles(car, axes) + warned
        at = _present(car, axes)
        at_start = {name: float(value) for name, value in ride(at if len(at) == len(axes) else None).items()}
        spans = limit_spans(limits, names, at_start)
        before = None if reference is None else dict(ride.of_vehicle(reference)())
        table = points_table(data, spans)
        _show_points(screen, table, lambda: best_points(data, spans, before), limited=bool(spans))
        remarks += stationary_notes(ride.vehicle, surface) if isinstance(surface, WhiteRoad) else []
        remarks += [f"No effect on {name}: {', '.join(flat)}." for name, flat in without_effect(data).items()]
        screen.points(remarks, style="yellow")
        with work.saving("Tables") as draft:
            write_tables(draft, {"sweep": table})
            data.to_netcdf(draft / "sweep.nc", engine="scipy")
        plane = _comfort_and_grip(car, names, white=white)
        marks = {"limits": spans, "baseline": before, "present": {**at, **at_start}, "plane": plane}
        work.page(sweep_report, data, remarks=remarks, **marks)


def _show_points(screen: Screen, table: Table, best: Callable[[], list[str]], *, limited: bool) -> None:
    """The first points of a sweep, how many are within the limits, and of a large one where results are smallest."""
    screen.table(table.first(MOST_POINTS if screen.verbose else ON_SCREEN))
    if len(table.rows) > ON_SCREEN:
        screen.points([f"sweep.csv has all {len(table.rows)} points.", *best()])
    elif limited:
        screen.points(best()[:1])


def _comfort_and_grip(car: AbstractVehicle, names: Sequence[str], *, white: bool) -> tuple[str, str] | None:
    """The first metrics of comfort and grip, where both are swept."""
    comfort, grip = (_metrics_of("metric", word, car, white=white)[0] for word in ("comfort", "grip"))
    return (comfort, grip) if {comfort, grip} <= set(names) else None


def _present(car: AbstractVehicle, over: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The values that the vehicle has of the axes; those left out that stand for several different ones."""
    numbers = {p.path: float(p.value) for p in named_parameters(car, over) if not np.shape(p.value)}
    values = {name: {numbers[path] for path in match_paths(list(numbers), [name])} for name in over}
    return {name: value.pop() for name, value in values.items() if len(value) == 1}


def _limits_by_metric(limit: Mapping[str, Limit], car: AbstractVehicle, *, white: bool) -> dict[str, Limit]:
    """The limits by the ride metrics that their words mean."""
    given = {word: span for word, span in limit.items() if span is not None}
    return cast(dict[str, Limit], goal_limits(given, car, white=white, argument="limit"))


def _metrics_of(option: str, word: str, car: AbstractVehicle, *, white: bool) -> list[str]:
    """The ride metrics that a word means."""
    _checks.one_of(option, word, car.metric_words)
    return car.goal_metrics(word, white=white)
