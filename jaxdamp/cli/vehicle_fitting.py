"""`jaxdamp fit-vehicle`: records of a vehicle in; its masses, rates, friction and laws out."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

import numpy as np

from jaxdamp import _checks, bench, export, identify
from jaxdamp.bench import BenchSet, RideRecord
from jaxdamp.cli.console import Screen
from jaxdamp.cli.jobs import Output, job, write_json, write_tables
from jaxdamp.cli.limits import bounds_in_si
from jaxdamp.cli.options import Call
from jaxdamp.cli.records import decisions
from jaxdamp.cli.signatures import Arguments
from jaxdamp.cli.vehicle_words import given_law, parse_vehicle, write_laws
from jaxdamp.cli.words import Named
from jaxdamp.dampers import CoulombFriction
from jaxdamp.identify import Failure, VehicleComparison, VehicleFit, VehicleRung
from jaxdamp.report import failure_sentences, ride_records_table, vehicle_comparison_report, vehicle_fit_report
from jaxdamp.rig import Rig, Sensor
from jaxdamp.tune import damper_paths
from jaxdamp.vehicles import AbstractVehicle, Guide, Guided


FRICTION_VELOCITY = 0.01  # m/s, over which the friction of a guide changes its sign, unless it is stated


def fit_vehicle(
    screen: Screen,
    vehicle: str,
    files: Sequence[Path],
    *,
    law: Path | None = None,
    reading: Annotated[Call, "bench.read_rides"],
    how: Annotated[Call, "identify.fit_vehicle"],
    guide: Sequence[Named] = (),
    friction: Sequence[str] = (),
    report: Path | None = None,
    output: Output,
) -> None:
    """Fit masses, rates, friction and dampers of a vehicle to records of its motion on a rig or a road.

    VEHICLE is the start. Columns are named as its channels, or by --columns; heights and accelerations are positive up,
    travels in extension. Writes the vehicle and its laws as JSON, tables, pictures and a page.

    Arguments:
        files: files with records of its motion, patterns, or folders.
        guide: what holds a body to the ground, fitted from these starts: friction [N], stiffness [N/m], damping
            [N s/m]; friction_velocity [m/s] and ahead [m] are held.
        friction: forms of friction to compare at guides, suspensions or, without any, beside the dampers: none,
            coulomb, dahl (gives before it slides), or all. Drives are left out in turn, and one form is recommended.
    """
    forms = friction_forms(friction)
    car = parse_vehicle(vehicle)(given_law(law))
    _checks.one_of("initial_motion", how.given.get("start", "rest"), ("rest", "free"))
    with job(screen, "fit-vehicle", output, report) as work:
        with screen.stage("Reading the records"):
            rides = bench.read_rides(list(files), **reading.arguments())
            benches = bench_words(how.given.get("bench", ()), car)
        remarks = [f"{ride.name}: {note}" for ride in rides for note in ride.notes]
        remarks += [f"bench of {path}: {note}" for path, runs in benches.items() for note in decisions(tuple(runs))]
        screen.details(ride_records_table(rides))
        screen.points(remarks)
        guided, call = fit_arguments(car, rides, benches, how, guide)
        comparison = _compared(screen, guided, forms, rides, call) if forms else None
        if comparison:
            result = comparison.best.result
        else:
            with screen.stage("Fitting"):
                result = identify.fit_vehicle(guided, rides, **call)
            screen.answer(f"{result.summary}.")
        screen.table(result.table())
        screen.details(result.scores_table())
        screen.points([result.patterns] * bool(result.patterns))
        screen.remarks(result.warnings, style="yellow")
        with work.saving("Vehicle and tables") as draft:
            _write(draft, result)
            if comparison:
                _write_comparison(draft, comparison)
        page, content = (vehicle_comparison_report, comparison) if comparison else (vehicle_fit_report, result)
        work.page(page, content, remarks=remarks)


def friction_forms(words: Sequence[str]) -> tuple[str, ...]:
    """The forms of friction that words name; all of them for "all"."""
    for word in words:
        _checks.one_of("friction", word, (*identify.FORMS, "all"))
    return identify.FORMS if "all" in words else tuple(dict.fromkeys(words))


def _compared(
    screen: Screen, car: AbstractVehicle, forms: Sequence[str], rides: Sequence[RideRecord], call: Arguments
) -> VehicleComparison:
    """The vehicle with each form of friction, fitted and judged on drives left out; said at the terminal."""
    ladder, call = identify.friction_ladder(car, forms), dict(call)
    if "coulomb" in forms:
        call["freeze"] = [*call.get("freeze", ()), "friction_velocity"]
    if "dahl" in forms and isinstance(car, Guided) and call.get("over") is not None:
        call["over"] = [*call["over"], "guides.*.law.stiffness"]
    outcomes = list[VehicleRung | Failure]()
    title = f"Fitting {len(forms)} vehicle{'s' * (len(forms) > 1)} to {len(rides)} drive{'s' * (len(rides) > 1)}"
    with screen.stage(title, total=len(forms)) as advance:
        fits = identify.fit_each_vehicle(ladder, rides, progress=lambda name: advance(name, len(outcomes)), **call)
        outcomes.extend(fits)
    comparison = VehicleComparison.of(outcomes)
    screen.answer(*comparison.verdict)
    screen.table(comparison.table(), mark=comparison.best.name)
    screen.points(failure_sentences(comparison))
    return comparison


def fit_arguments(
    car: AbstractVehicle,
    rides: Sequence[RideRecord],
    benches: Mapping[str, BenchSet],
    how: Call,
    guide: Sequence[Named],
) -> tuple[AbstractVehicle, Arguments]:
    """The vehicle with its guides, and the further arguments of `fit_vehicle`."""
    given, paths = how.given, dict(benches)
    more: Arguments = {}
    guides = [guide_words(body, numbers, car) for body, numbers in guide]
    if guides:
        of_guides = [f"guides.{i}.{name}" for i, (_, free) in enumerate(guides) for name in free]
        friction = ["law.friction_force", "law.friction_velocity"]
        numbers = [["stiffness", "damping", *friction * (guide.law is not None)] for guide, _ in guides]
        held = [f"guides.{i}.{name}" for i, names in enumerate(numbers) for name in names]
        car = Guided(car, tuple(guide for guide, _ in guides))
        more["over"] = None if "over" not in given else [*given["over"], *of_guides]
        more["freeze"] = [*given.get("freeze", ()), *[path for path in held if path not in of_guides]]
        paths = {f"car.{path}": runs for path, runs in benches.items()}
    more["sensors"] = sensor_words(given.get("sensors", ()), rides)
    machine = identify.machine_names("rig", given.get("rig", ())) or None
    parts = {"vehicle": car, "sensors": more["sensors"], "rig": Rig()}
    bounds = bounds_in_si(given.get("bounds", {}), [parts])
    return car, how.arguments(**more, bench=paths, rig=machine, bounds=bounds)


def sensor_words(given: Sequence[Named], rides: Sequence[RideRecord]) -> dict[str, Sensor]:
    """The sensors of "stroke:offset,delay=0.001", by channel; of a channel named twice the numbers are put together."""
    channels = list(dict.fromkeys(channel for ride in rides for channel in ride.channels))
    numbers: dict[str, dict[str, float]] = {}
    for pattern, stated in given:
        hits = [channel for channel in channels if fnmatchcase(channel, pattern)]
        if not hits:
            _checks.one_of("sensor", pattern, channels)
        for channel in hits:
            numbers[channel] = numbers.get(channel, {}) | stated
    return {channel: Sensor(**stated) for channel, stated in numbers.items()}


def guide_words(body: str, numbers: Mapping[str, float], car: AbstractVehicle) -> tuple[Guide, list[str]]:
    """The guide of "sprung:friction=40,damping=100", and the paths of its free numbers."""
    numbers = dict(numbers)
    _checks.one_of("guide", body, [part.name for part in car.frame().bodies])
    friction, velocity = numbers.pop("friction", None), numbers.pop("friction_velocity", FRICTION_VELOCITY)
    law = None if friction is None else CoulombFriction(friction, velocity)
    free = [name for name in numbers if name != "ahead"] + ["law.friction_force"] * (law is not None)
    return Guide(law, body, **numbers), free


def bench_words(texts: Sequence[str], car: AbstractVehicle) -> dict[str, BenchSet]:
    """The bench records of "damper=FILE", by the path of the law; of "FILE" where there is only one law."""
    dampers, files = damper_paths(car), dict[str, list[Path]]()
    for text in texts:
        path, equals, file = (part.strip() for part in text.partition("="))
        if not equals or path not in dampers:
            if len(dampers) != 1:
                _checks.refuse("bench", f"name one of the laws {', '.join(dampers)}", repr(text), "Write LAW=FILE.")
            path, file = dampers[0], text
        files.setdefault(path, []).append(Path(file))
    return {path: bench.read(paths) for path, paths in files.items()}


def _write(folder: Path, result: VehicleFit) -> None:
    """The vehicle, its laws, the tables and all of it as JSON."""
    write_laws(folder, result.vehicle)
    export.to_json(result.vehicle, folder / "vehicle.json")
    write_tables(folder, {"parameters": result.table(), "channels": result.scores_table()})
    for record in result.records:
        _write_channels(folder / f"{record.name.replace('/', '_')}_fitted.csv", result, record)
    write_json(folder / "fit.json", result.to_dict())


def _write_comparison(folder: Path, comparison: VehicleComparison) -> None:
    """The table of all vehicles, each as JSON, and all of their fits."""
    write_tables(folder, {"ladder": comparison.table(), "left_out": comparison.best.scores_table()})
    (folder / "vehicles").mkdir()
    for rung in comparison.rungs:
        export.to_json(rung.result.vehicle, folder / "vehicles" / f"{rung.name}.json")
    write_json(folder / "comparison.json", comparison.to_dict())


def _write_channels(file: Path, result: VehicleFit, record: RideRecord) -> None:
    """Measured and fitted channels of a record over time."""
    fitted, units = result.respond(record), result.vehicle.units
    header = ["time [s]"] + [f"{c} {kind} [{units[c]}]" for c in fitted for kind in ("measured", "fitted")]
    columns = [record.time] + [values for c in fitted for values in (record[c], fitted[c])]
    np.savetxt(file, np.column_stack(columns), fmt="%.8g", delimiter=",", header=",".join(header), comments="")
