"""`jaxdamp tune`: the free parameters of a vehicle for a ride metric, with limits; and `jaxdamp sweep`."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jaxdamp import Ride, _checks, export, roads, sweep, tune
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.metric_words import axis_words, default_limits, limit_words, metric_names, objective_word, pairs, span
from jaxdamp.cli.option_types import command_line
from jaxdamp.cli.results import results_folder
from jaxdamp.cli.riding import USUAL, parse_road
from jaxdamp.cli.unusual import unusual
from jaxdamp.cli.vehicle_words import parse_vehicle, read_law, read_module, with_law, write_laws
from jaxdamp.cli.wording import in_command_line, message
from jaxdamp.dampers import AbstractDamper
from jaxdamp.report import Attempts, sweep_report, tuning_report
from jaxdamp.roads import WhiteRoad
from jaxdamp.simulation import stationary_notes
from jaxdamp.sweeps import without_effect
from jaxdamp.tune import Status, TuneResult, limit_spans
from jaxdamp.vehicles import AbstractVehicle


@dataclass(frozen=True)
class RoadOptions:
    """A vehicle with its law on a road, as the command line says it."""

    vehicle: str
    road: str
    start: Path | None = None
    speed: float = 20.0
    duration: float | None = None
    dt: float = 1e-3
    seed: int = 0

    def car(self) -> AbstractVehicle:
        """The vehicle, with the law at each damper if one is given."""
        return parse_vehicle(self.vehicle)(None if self.start is None else read_law("start", self.start))

    def roads(self, count: int = 1) -> tuple[list[Any], dict[str, Any]]:
        """So many realisations of the road, and the options of a run over them."""
        _checks.positive("speed", self.speed)
        kind, _, rest = self.road.partition(":")
        if kind == "white":
            if self.duration is not None:
                _checks.refuse("duration", "be left out on a white road", self.duration)
            return [roads.white(rest, self.speed)] * count, {}
        length = self.duration or USUAL
        seeds = range(self.seed, self.seed + count)
        realisations = [parse_road(self.road, speed=self.speed, duration=length, seed=seed) for seed in seeds]
        own = length if self.duration or kind == "iso" else realisations[0].duration or length
        return realisations, {"duration": own, "dt": self.dt}


@dataclass(frozen=True)
class TuneOptions:
    """What is tuned, as the command line says it."""

    minimise: str = "comfort"
    limit: tuple[str, ...] = ()
    over: tuple[str, ...] = ()  # what a workshop can change
    freeze: tuple[str, ...] = ()
    bound: tuple[str, ...] = ()
    tie: tuple[str, ...] = ()
    roads: int = 1
    starts: int = 1
    max_steps: int = 100


def run_tune(
    screen: Screen,
    on: RoadOptions,
    options: TuneOptions,
    *,
    baseline: Path | None = None,
    out: Path,
    replace: bool = False,
) -> TuneResult[Any]:
    """Tune a vehicle, and write the law, the vehicle, tables, then pictures and a page."""
    car = on.car()
    beside = None if baseline is None else _baseline(baseline, car)
    call, remarks = tuning_arguments(car, on, options)
    screen.points(remarks)
    screen.points(unusual(on.road, on.speed), style="yellow")
    attempts = Attempts(interrupt.check, message)
    with results_folder(out, "tune", replace=replace) as results:
        result = tuned(screen, call)
        interrupt.keep()
        with interrupt.saving(), screen.stage("Law, vehicle and tables"):
            write_tuning(results.draft, result)
            results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            page = tuning_report(result, baseline=beside, folder=results.draft, attempts=attempts)
            page.write(results.draft / "report.html", command_line())
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return result


def tuning_arguments(car: AbstractVehicle, on: RoadOptions, options: TuneOptions) -> tuple[dict[str, Any], list[str]]:
    """The arguments of `tune.minimise`, and what was chosen by default, in words."""
    if options.roads < 1:
        _checks.refuse("roads", "be 1 or more", options.roads)
    roads_driven, run = on.roads(options.roads)
    white = isinstance(roads_driven[0], WhiteRoad)
    if options.roads > 1 and (white or not on.road.startswith("iso:")):
        _checks.refuse("roads", "be 1 for a road that is not random", options.roads, "Take iso:CLASS.")
    limits = limit_words(options.limit, car, white=white)
    more, sentence = default_limits(options.limit, options.minimise, car, white=white)
    return run | {
        "metric": objective_word(options.minimise, car, white=white),
        "vehicle": car,
        "road": roads_driven[0] if len(roads_driven) == 1 else tune.Scenarios(roads_driven),
        "over": options.over or None,
        "freeze": options.freeze,
        "bounds": {name: span("bound", value) for name, value in pairs("bound", options.bound)},
        "tie": dict(pairs("tie", options.tie)),
        "limits": limits | more,
        "starts": options.starts,
        "max_steps": options.max_steps,
    }, [sentence] * bool(sentence)


def tuned(screen: Screen, call: Mapping[str, Any]) -> TuneResult[Any]:
    """The result of `tune.minimise` with these arguments, shown at the terminal."""
    with screen.stage("Tuning") as advance:
        result = tune.minimise(**call, progress=lambda step, value: advance(f"step {step}: {value:.5g}", step))
    screen.say(result.summary)
    for table in (result.parameter_table(), result.table()):
        screen.table(table)
    screen.points([in_command_line(warning) for warning in result.warnings], style="yellow")
    return result


def _baseline(path: Path, car: AbstractVehicle) -> AbstractVehicle:
    """The vehicle of the option --baseline: with another law, or that of another tuning."""
    kinds, words = (AbstractDamper, type(car)), f"a law or a {type(car).__name__}"
    module = read_module("baseline", path, kinds, words, "`jaxdamp tune` writes law.json and vehicle.json.")
    return with_law(car, module) if isinstance(module, AbstractDamper) else module


def meets_limits(result: TuneResult[Any] | None) -> bool:
    """Whether all limits are met, or nothing was tuned."""
    return result is None or result.status is not Status.LIMIT_NOT_MET


def write_tuning(folder: Path, result: TuneResult[Any]) -> None:
    """The tuned laws, the vehicle, tables, and all of it as JSON."""
    import json

    write_laws(folder, result.vehicle)
    export.to_json(result.vehicle, folder / "vehicle.json")
    tables = {"parameters": result.parameter_table(), "metrics": result.table()}
    if result.scenarios is not None:
        tables["scenarios"] = result.scenario_table()
    if result.fresh is not None:
        tables["fresh_roads"] = result.fresh.table()
    for name, table in tables.items():
        (folder / f"{name}.csv").write_text(table.to_csv(), encoding="utf-8")
    text = json.dumps(result.to_dict(), indent=1, ensure_ascii=False) + "\n"
    (folder / "tuning.json").write_text(text, encoding="utf-8")


def run_sweep(
    screen: Screen,
    on: RoadOptions,
    *,
    over: Sequence[str],
    metrics: str,
    limit: Sequence[str] = (),
    baseline: Path | None = None,
    out: Path,
    replace: bool = False,
) -> Any:
    """Ride metrics over a grid of parameters: a table, a netCDF file, pictures and a page."""
    car = on.car()
    (road,), run = on.roads()
    white = isinstance(road, WhiteRoad)
    words = [word.strip() for word in metrics.split(",")]
    limits = limit_words(limit, car, white=white)
    names = [n for word in words for n in metric_names("metric", word, car, white=white)]
    names = list(dict.fromkeys([*names, *limits]))
    limit_spans(limits, names, dict.fromkeys(names, 1.0))  # refuses what is no limit before anything is driven
    beside = None if baseline is None else _baseline(baseline, car)
    axes = axis_words(over)
    ride = Ride(car, road, metrics=names, **run)
    ride({name: values[0] for name, values in axes.items() if not ride.out_of_domain({name: values[:1]})[0]})
    screen.points(unusual(on.road, on.speed), style="yellow")
    attempts = Attempts(interrupt.check, message)
    with results_folder(out, "sweep", replace=replace) as results:
        with screen.stage("Driving") as advance, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            data = sweep(ride, axes, progress=lambda done, total: advance(f"{done} of {total} points", done))
        remarks = [str(warning.message) for warning in caught]
        screen.table(data.jaxdamp.table())
        remarks += stationary_notes(ride.vehicle, road) if isinstance(road, WhiteRoad) else []
        remarks += [f"No effect on {name}: {', '.join(flat)}." for name, flat in without_effect(data).items()]
        screen.points(remarks, style="yellow")
        with interrupt.saving(), screen.stage("Tables"):
            (results.draft / "sweep.csv").write_text(data.jaxdamp.table().to_csv(), encoding="utf-8")
            data.to_netcdf(results.draft / "sweep.nc", engine="scipy")
            results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            drawn = {"folder": results.draft, "attempts": attempts}
            if limits:
                limits = limit_spans(limits, names, {name: float(value) for name, value in ride().items()})
            marks = {"limits": limits, "baseline": None if beside is None else dict(ride.of_vehicle(beside)())}
            page = sweep_report(data, remarks=remarks, **marks, **drawn)
            page.write(results.draft / "report.html", command_line())
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return data
