"""`jaxdamp fit-vehicle`: records of a vehicle in; its masses, rates, friction and laws out."""

import json
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from jaxdamp import _checks, bench, export, identify
from jaxdamp.bench import BenchSet, RideRecord
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.metric_words import pairs, span
from jaxdamp.cli.option_types import command_line
from jaxdamp.cli.options import decisions
from jaxdamp.cli.results import another_page, results_folder
from jaxdamp.cli.vehicle_fit_options import RideReadOptions, VehicleFitOptions, listed, numbers_of
from jaxdamp.cli.vehicle_words import parse_vehicle, read_law, write_laws
from jaxdamp.cli.wording import message
from jaxdamp.dampers import CoulombFriction
from jaxdamp.identify import VehicleFit
from jaxdamp.report import Attempts, ride_records_table, vehicle_fit_report
from jaxdamp.rig import Sensor
from jaxdamp.tune import damper_paths
from jaxdamp.vehicles import AbstractVehicle, Guide, Guided


SENSOR_STARTS: dict[str, float | None] = {"gain": 1.0, "offset": 0.0, "lag": 0.0, "delay": 0.0, "high_pass": None}
GUIDE_NUMBERS: dict[str, float | None] = dict.fromkeys(
    ("friction", "stiffness", "damping", "friction_velocity", "ahead")
)
FRICTION_VELOCITY = 0.01  # m/s, over which the friction of a guide changes its sign, unless it is stated


def run_fit_vehicle(
    screen: Screen,
    vehicle: str,
    files: Sequence[Path],
    reading: RideReadOptions,
    options: VehicleFitOptions,
    *,
    start: Path | None = None,
    out: Path,
    report: Path | None = None,
    replace: bool = False,
) -> VehicleFit:
    """Read the records, fit the vehicle, and write vehicle, laws, tables, then pictures and a page."""
    car = parse_vehicle(vehicle)(None if start is None else read_law("start", start))
    _checks.one_of("initial_motion", options.initial_motion, ("rest", "free"))
    attempts = Attempts(interrupt.check, message)
    with another_page(report, out, replace=replace), results_folder(out, "fit-vehicle", replace=replace) as results:
        with screen.stage("Reading the records"):
            rides, benches = reading.read(files), bench_words(options.bench, car)
        remarks = [f"{ride.name}: {note}" for ride in rides for note in ride.notes]
        remarks += [f"bench of {path}: {note}" for path, runs in benches.items() for note in decisions(tuple(runs))]
        screen.table(ride_records_table(rides))
        screen.points(remarks)
        call = fit_arguments(car, rides, benches, options)
        with screen.stage("Fitting"):
            result = identify.fit_vehicle(**call)
        for table in (result.scores_table(), result.table()):
            screen.table(table)
        screen.points([result.patterns] * bool(result.patterns))
        screen.points(result.warnings, style="yellow")
        interrupt.keep()
        with interrupt.saving(), screen.stage("Vehicle and tables"):
            _write(results.draft, result)
            results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            page = vehicle_fit_report(result, remarks=remarks, folder=results.draft, attempts=attempts)
            page.write(results.draft / "report.html", command_line())
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return result


def fit_arguments(
    car: AbstractVehicle, rides: Sequence[RideRecord], benches: Mapping[str, BenchSet], options: VehicleFitOptions
) -> dict[str, Any]:
    """The arguments of `fit_vehicle`."""
    guides = [guide_words(text, car) for text in options.guide]
    over, freeze, paths = listed(options.over) or None, listed(options.freeze), dict(benches)
    if guides:
        own = [f"guides.{i}.{name}" for i, (_, free) in enumerate(guides) for name in free]
        held = [f"guides.{i}.{name}" for i, (guide, free) in enumerate(guides) for name in guide_paths(guide)]
        car = Guided(car, tuple(guide for guide, _ in guides))
        over = None if over is None else [*over, *own]
        freeze = [*freeze, *[path for path in held if path not in own]]
        paths = {f"car.{path}": runs for path, runs in benches.items()}
    return {
        "vehicle": car,
        "records": rides,
        "sensors": sensor_words(options.sensor, rides),
        "bench": paths,
        "rig": identify.machine_names("rig", options.rig) or None,
        "over": over,
        "freeze": freeze,
        "bounds": {name: span("bound", value) for name, value in pairs("bound", options.bound)},
        "tie": dict(pairs("tie", options.tie)),
        "per_record": listed(options.per_record),
        "start": options.initial_motion,
        "settling": options.settling,
        "noise": {name: _number("noise", value) for name, value in pairs("noise", options.noise)},
        "dt": options.dt,
        "max_steps": options.max_steps,
    }


def sensor_words(texts: Sequence[str], rides: Sequence[RideRecord]) -> dict[str, Sensor]:
    """The sensors of "stroke:offset,delay=0.001", by channel; of a channel named twice the numbers are put together."""
    channels = list(dict.fromkeys(channel for ride in rides for channel in ride.channels))
    numbers: dict[str, dict[str, float]] = {}
    for text in texts:
        pattern, found = numbers_of("sensor", text, SENSOR_STARTS)
        hits = [channel for channel in channels if fnmatchcase(channel, pattern)]
        if not hits:
            _checks.one_of("sensor", pattern, channels)
        for channel in hits:
            numbers[channel] = numbers.get(channel, {}) | found
    return {channel: Sensor(**found) for channel, found in numbers.items()}


def guide_words(text: str, car: AbstractVehicle) -> tuple[Guide, list[str]]:
    """The guide of "sprung:friction=40,damping=100", and the paths of its free numbers."""
    body, numbers = numbers_of("guide", text, GUIDE_NUMBERS)
    _checks.one_of("guide", body, [known.name for known in car.frame().bodies])
    friction, velocity = numbers.pop("friction", None), numbers.pop("friction_velocity", FRICTION_VELOCITY)
    law = None if friction is None else CoulombFriction(friction, velocity)
    free = [name for name in numbers if name != "ahead"] + ["law.friction_force"] * (law is not None)
    return Guide(law, body, **numbers), free


def guide_paths(guide: Guide) -> list[str]:
    """The paths of all numbers of a guide."""
    return ["stiffness", "damping"] + ["law.friction_force", "law.friction_velocity"] * (guide.law is not None)


def bench_words(texts: Sequence[str], car: AbstractVehicle) -> dict[str, BenchSet]:
    """The bench records of "damper=FILE", by the path of the law; of "FILE" where there is only one law."""
    known, files = damper_paths(car), dict[str, list[Path]]()
    for text in texts:
        path, equals, file = (part.strip() for part in text.partition("="))
        if not equals or path not in known:
            if len(known) != 1:
                _checks.refuse("bench", f"name one of the laws {', '.join(known)}", repr(text), "Write LAW=FILE.")
            path, file = known[0], text
        files.setdefault(path, []).append(Path(file))
    return {path: bench.read(found) for path, found in files.items()}


def _number(option: str, text: str) -> float:
    """A number of an option."""
    try:
        return float(text)
    except ValueError:
        _checks.refuse(option, "be numbers", repr(text))


def _write(folder: Path, result: VehicleFit) -> None:
    """The vehicle, its laws, the tables and all of it as JSON."""
    write_laws(folder, result.vehicle)
    export.to_json(result.vehicle, folder / "vehicle.json")
    for name, table in {"parameters": result.table(), "channels": result.scores_table()}.items():
        (folder / f"{name}.csv").write_text(table.to_csv(), encoding="utf-8")
    for record in result.records:
        _write_channels(folder / f"{record.name.replace('/', '_')}_fitted.csv", result, record)
    text = json.dumps(result.to_dict(), indent=1, ensure_ascii=False) + "\n"
    (folder / "fit.json").write_text(text, encoding="utf-8")


def _write_channels(file: Path, result: VehicleFit, record: RideRecord) -> None:
    """Measured and fitted channels of a record over time."""
    fitted, units = result.respond(record), result.vehicle.units
    header = ["time [s]"] + [f"{c} {kind} [{units[c]}]" for c in fitted for kind in ("measured", "fitted")]
    columns = [record.time] + [values for c in fitted for values in (record[c], fitted[c])]
    np.savetxt(file, np.column_stack(columns), fmt="%.8g", delimiter=",", header=",".join(header), comments="")
