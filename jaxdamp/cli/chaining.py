"""`jaxdamp report`: bench records, a vehicle and a road in; laws, rides, a tuned damper and one page out."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

from jaxdamp import _checks, simulate
from jaxdamp._display import display
from jaxdamp.bench import BenchSet
from jaxdamp.cli.console import Screen
from jaxdamp.cli.fitting import fit_laws, show, write_fits
from jaxdamp.cli.jobs import Output, job, with_step_warnings, without_range_warnings, write_tables
from jaxdamp.cli.options import Call
from jaxdamp.cli.records import Reading, decisions, grouped, law_names
from jaxdamp.cli.riding import Driving, show_ride, unusual
from jaxdamp.cli.tuning import exit_code_of, tuned, tuning_arguments, write_tuning
from jaxdamp.cli.vehicle_words import parse_vehicle
from jaxdamp.dampers import AbstractDamper, not_identified
from jaxdamp.parameters import parameters
from jaxdamp.report import chain_report, records_table
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Response
from jaxdamp.tune import Run
from jaxdamp.vehicles import AbstractVehicle


def report(
    screen: Screen,
    files: Sequence[Path],
    *,
    vehicle: str = "quarter_car_000",
    road: str = "iso:C",
    law: Sequence[str] = (),
    minimise: str = "comfort",
    search: Annotated[Call, "tune.minimise"],
    reading: Reading,
    driving: Driving,
    resume: bool = False,
    output: Output,
) -> None:
    """The whole chain on one page: bench records, fitted laws, rides on the best one, and its tuning.

    Writes the laws, the tuned vehicle, tables, pictures and the page. The vehicle rides with its own dampers, with the
    fitted law at all of them, and with the tuned laws. Nothing is tuned if the law has no parameter that a workshop can
    change and that the records determine. Ends with exit code 1 if a limit is not met.

    Arguments:
        law: names of laws to fit, see "jaxdamp laws": "linear,besinger"; or "all"; six that suit the records if left
            out.
        minimise: comfort, travel, grip, or the name of a ride metric.
    """
    names, make = law_names(law), parse_vehicle(vehicle)
    if road.startswith("white"):
        _checks.refuse("road", "be one to ride on", repr(road), "Take iso:CLASS.")
    (surface,), run = driving.over(road)
    assert isinstance(surface, AbstractRoad)
    screen.points(unusual(road, driving.speed), style="yellow")
    with job(screen, "report", output, resume=resume) as work:
        with screen.stage("Reading the records"):
            raw = reading.raw(files)
        sound, preflight = reading.checked(screen, raw, refuse=True)
        runs = reading.processed(sound)
        groups, divided = grouped(runs, None)
        if len(groups) > 1:
            raise ValueError(f"A report is on one setting of a damper: name the records of one. {divided}")
        remarks = decisions(runs)
        screen.details(records_table(tuple(runs)))
        screen.points(remarks)
        car = make(None)
        fits = fit_laws(screen, names, runs, BenchSet(), keep_bad=reading.keep_bad)
        show(screen, fits)
        with work.saving("Laws and tables", "the rides, the tuning and the report") as draft:
            write_fits(draft, fits.comparison, runs, work.attempts)
            write_tables(draft / "tables", {"preflight": preflight.table()})
        best = fits.comparison.best.result
        fitted = make(best.law)
        result, cars = None, {"vehicle as it is": car, "fitted law": fitted}
        if _nothing_to_tune(best.law, search):
            can = "the law has no parameter that a workshop can change and that the records determine"
            sentences = [f"Nothing is tuned: {can}."]
            screen.points(sentences)
        else:
            call, sentences = tuning_arguments(fitted, minimise, [surface], search, driving.seed, run)
            screen.points(sentences)
            result = tuned(screen, call)
            cars["tuned law"] = result.vehicle
        remarks += sentences
        rides = driven(screen, cars, surface, run, "Driving")
        tables = show_ride(screen, rides)
        with work.saving("Tuned law, vehicle and tables") as draft:
            if result is not None:
                write_tuning(draft, result)
            write_tables(draft, {f"ride_{name}": table for name, table in tables.items()})
        title = f"{vehicle} on {road} at {display().speed(driving.speed)}"
        words = {"title": f"Bench records to a better damper: {title}", "remarks": remarks, "runs": tuple(runs)}
        work.page(chain_report, fits.comparison, {title: rides}, result, preflight=preflight, **words)
    exit_code_of(result)


def _nothing_to_tune(law: AbstractDamper, search: Call) -> bool:
    """Whether no parameter is named, and the law has none that can be built and that the records determine."""
    adjustable = {parameter.path for parameter in parameters(law) if parameter.adjustable}
    return "over" not in search.given and adjustable <= set(not_identified(law))


def driven(
    screen: Screen, cars: Mapping[str, AbstractVehicle], road: AbstractRoad, run: Run, title: str
) -> dict[str, Response]:
    """Each vehicle on the road."""
    rides: dict[str, Response] = {}
    with screen.stage(title, total=len(cars)) as advance:
        for name, car in cars.items():
            advance(name, len(rides))
            with without_range_warnings():
                rides[name], remarks = with_step_warnings(lambda car=car: simulate(car, road, **run))
            screen.points([f"{name}: {remark}" for remark in remarks], style="yellow")
    return rides
