"""`jaxdamp report`: bench records, a vehicle and a road in; laws, rides, a tuned damper and one page out."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from jaxdamp import _checks, simulate
from jaxdamp.bench import BenchSet
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.fitting import fit_laws, show, write_fits, write_table
from jaxdamp.cli.option_types import command_line
from jaxdamp.cli.options import decisions, law_names
from jaxdamp.cli.preflighting import checked
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions
from jaxdamp.cli.results import results_folder
from jaxdamp.cli.run_warnings import with_step_warnings, without_range_warnings
from jaxdamp.cli.tuning import RoadOptions, TuneOptions, tuned, tuning_arguments, write_tuning
from jaxdamp.cli.unusual import unusual
from jaxdamp.cli.vehicle_words import parse_vehicle
from jaxdamp.cli.wording import message
from jaxdamp.identify import FitResult
from jaxdamp.parameters import parameters
from jaxdamp.report import Attempts, chain_report, records_table, ride_tables
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult
from jaxdamp.vehicles import AbstractVehicle


def run_report(
    screen: Screen,
    files: Sequence[Path],
    reading: ReadOptions,
    processing: ProcessOptions,
    on: RoadOptions,
    options: TuneOptions,
    *,
    laws: Sequence[str],
    out: Path,
    replace: bool = False,
) -> TuneResult | None:
    """Fit laws to records, ride on the best one, tune it, and write all of it with one page.

    The vehicle rides with its own dampers, with the fitted law at all of them, and with the tuned laws. Nothing is
    tuned if the law has no parameter that a workshop can change and that the records determine.

    Raises:
        ValueError: what the library refuses; a white road, on which nothing rides.
    """
    names, make = law_names(laws), parse_vehicle(on.vehicle)
    if on.road.startswith("white"):
        _checks.refuse("road", "be one to ride on", repr(on.road), "Take iso:CLASS.")
    screen.points(unusual(on.road, on.speed), style="yellow")
    attempts = Attempts(interrupt.check, message)
    with results_folder(out, "report", replace=replace) as results:
        with screen.stage("Reading the records"):
            raw = reading.read(files)
        sound, preflight = checked(screen, raw, notes=False)
        runs = processing.apply(sound)
        remarks = decisions(tuple(runs)) + [f"left out: {sentence}" for sentence in runs.left_out]
        screen.table(records_table(tuple(runs)))
        screen.points(remarks)
        car = make(None)
        fits = fit_laws(screen, names, runs, BenchSet())
        show(screen, fits)
        with interrupt.saving(), screen.stage("Laws and tables"):
            write_fits(results.draft, fits.comparison, runs, attempts)
            write_table(results.draft, "preflight", preflight.table())
            results.publish("the rides, the tuning and the report")
        best = fits.comparison.best.result
        fitted = make(best.law)
        result, sentences = _tuned(screen, fitted, best, on, options)
        remarks += sentences
        cars = {"vehicle as it is": car, "fitted law": fitted}
        rides = _rides(screen, cars if result is None else cars | {"tuned law": result.vehicle}, on)
        title = f"{on.vehicle} on {on.road} at {on.speed:g} m/s"
        for table in ride_tables(rides).values():
            screen.table(table)
        with interrupt.saving(), screen.stage("Tuned law, vehicle and tables"):
            if result is not None:
                write_tuning(results.draft, result)
            for name, table in ride_tables(rides).items():
                (results.draft / f"ride_{name}.csv").write_text(table.to_csv(), encoding="utf-8")
            results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            words = {"title": f"Bench records to a better damper: {title}", "remarks": remarks, "runs": tuple(runs)}
            page = chain_report(
                fits.comparison, {title: rides}, result, preflight=preflight, **words,
                folder=results.draft, attempts=attempts,
            )  # fmt: skip
            page.write(results.draft / "report.html", command_line())
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return result


def _tuned(
    screen: Screen, car: AbstractVehicle, fit: FitResult, on: RoadOptions, options: TuneOptions
) -> tuple[TuneResult | None, list[str]]:
    """The tuning of what can be built and was identified, unless the options name other parameters; and remarks."""
    unknown, sentences = not_identified(fit), []
    adjustable = [p.path for p in parameters(fit.law) if p.adjustable]
    if not options.over and not set(adjustable) - set(unknown):
        sentence = (
            "Nothing is tuned: the law has no parameter that a workshop can change and that the records determine."
        )
        screen.say(sentence)
        return None, [sentence]
    left_alone = [path for path in adjustable if path in unknown and not options.over]
    if left_alone:
        options = dataclasses.replace(options, freeze=(*options.freeze, *(f"*damper.{path}" for path in left_alone)))
        sentences.append(f"Not tuned, since the records do not determine it: {', '.join(left_alone)}.")
    call, more = tuning_arguments(car, on, options)
    screen.points([*more, *sentences])
    return tuned(screen, call), [*more, *sentences]


def not_identified(fit: FitResult) -> list[str]:
    """The parameters of the law of which the records determine no number."""
    inside = "law." if fit.rig is not None or fit.record_starts else ""
    notes: dict[str, list[bool]] = {}
    for estimate in fit.parameters:
        if estimate.name.startswith(inside):
            path = estimate.name.removeprefix(inside).partition("[")[0]
            notes.setdefault(path, []).append(estimate.note == "not identifiable")
    return [path for path, unknown in notes.items() if all(unknown)]


def _rides(screen: Screen, cars: dict[str, AbstractVehicle], on: RoadOptions) -> dict[str, Response]:
    """Each vehicle on the road."""
    (road,), run = on.roads()
    rides: dict[str, Response] = {}
    with screen.stage("Driving", total=len(cars)) as advance:
        for name, car in cars.items():
            advance(name, len(rides))
            with without_range_warnings():
                rides[name], remarks = with_step_warnings(lambda car=car: simulate(car, road, **run))
            screen.points([f"{name}: {remark}" for remark in remarks], style="yellow")
    return rides
