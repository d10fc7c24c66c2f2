"""The whole chain: `jaxdamp report` with records, and `jaxdamp demo` on a damper whose truth is known."""

import functools
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from jaxdamp import _checks, bench, export, roads, simulate, vehicles
from jaxdamp._display import display
from jaxdamp._tables import Table
from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.cli.console import Screen
from jaxdamp.cli.fitting import Fitted, fit_laws, show, write_fits
from jaxdamp.cli.jobs import Output, job, write_tables
from jaxdamp.cli.options import Call
from jaxdamp.cli.records import Reading, decisions, grouped, law_names
from jaxdamp.cli.riding import Driving, driven, show_ride, unusual
from jaxdamp.cli.tuning import exit_code_of, tuned, tuning_arguments, write_tuning
from jaxdamp.cli.vehicle_words import parse_vehicle
from jaxdamp.cli.wording import message
from jaxdamp.dampers import AbstractDamper, Besinger, SeriesSpring, not_identified
from jaxdamp.identify import Comparison, FitResult
from jaxdamp.parameters import parameters
from jaxdamp.report import Attempts, FitPart, Report, chain_report, records_table, ride_tables
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Response
from jaxdamp.tune import Run, TuneResult
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
    fitted law, and with the tuned laws. Nothing is tuned if the law has no parameter that a workshop can change and
    that the records determine. Ends with exit code 1 if a limit is not met.

    Arguments:
        law: names of laws to fit, see "jaxdamp laws": "linear,besinger"; or "all"; those that suit the records if
            left out.
        minimise: the goal: comfort, travel, grip, or the name of a ride metric.
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
        commands = {run.command for run in runs}
        groups, divided = grouped(runs, None)
        if len(groups) > 1 or len(commands) > 1:
            stated = f"These state {len(commands)} commands: jaxdamp fit makes one law of them, jaxdamp tune takes it."
            one = "A report is on one setting of a damper: name the records of one."
            raise ValueError(f"{one} {divided.partition(' To say it')[0] or stated}")
        remarks = decisions(runs)
        screen.details(records_table(tuple(runs)))
        screen.points(remarks)
        car = make(None)
        fits = fit_laws(screen, names, runs, BenchSet(), keep_bad=reading.keep_bad)
        show(screen, fits)
        with work.saving("Laws and tables", "the rides, the tuning and the report") as draft:
            write_fits(draft, fits.comparison, runs, work.attempts)
            write_tables(draft / "tables", {"preflight": preflight.table()})
        part = FitPart(fits.comparison, tuple(runs), preflight=preflight, remarks=remarks)
        laws = part.begun(Attempts(message=message))
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
        rides = _driven(screen, cars, surface, run, "Driving")
        tables = show_ride(screen, rides)
        with work.saving("Tuned law, vehicle and tables") as draft:
            if result is not None:
                write_tuning(draft, result)
            write_tables(draft, {f"ride_{name}": table for name, table in tables.items()})
        title = f"{vehicle} on {road} at {display().speed(driving.speed)}"
        words = {"title": f"Bench records to a better damper: {title}", "sentences": sentences}
        work.page(chain_report, fits.comparison, {title: rides}, result, laws=laws, **words)
    exit_code_of(result)


def _nothing_to_tune(law: AbstractDamper, search: Call) -> bool:
    """Whether no parameter is named, and the law has none that can be built and that the records determine."""
    adjustable = {parameter.path for parameter in parameters(law) if parameter.adjustable}
    return "over" not in search.given and adjustable <= set(not_identified(law))


def _driven(
    screen: Screen, cars: Mapping[str, AbstractVehicle], road: AbstractRoad, run: Run, title: str
) -> dict[str, Response]:
    """Each vehicle on the road."""
    say = functools.partial(screen.points, style="yellow")
    return driven(screen, cars, lambda car: simulate(car, road, **run), say, title)


TRUE = "true damper"
EVENT = 2.0  # s: length of a ride over a bump


def _true_law() -> AbstractDamper:
    """The damper on the virtual bench: a degressive car damper whose mount yields."""
    return SeriesSpring(
        Besinger(
            compression_rate=1600.0,
            rebound_rate=4200.0,
            blow_off_rate=900.0,
            limit_velocity=0.13,
            transition_velocity=0.05,
        ),
        stiffness=1.5e6,
        cubic_stiffness=1.2e8,
    )


@dataclass(frozen=True)
class Scenario:
    """What the demo does; every number of it stands here."""

    law: AbstractDamper = field(default_factory=_true_law)  # the true damper
    true_name: str = "besinger_series_spring"  # the law of the ladder that has the same parameters
    laws: tuple[str, ...] = ("linear", "power_law", "segmented_polynomial", "besinger", "besinger_series_spring")
    tests: tuple[SineTest, ...] = field(default_factory=bench.programmes.paper_000_table_1)
    held_out: str = "30mm_*"  # pattern of the records that are not fitted, as in Fig. 8 of the paper
    force_noise: float = 20.0  # of the bench [N]
    stroke_noise: float = 1e-5  # of the bench [m]
    duration: float = 10.0  # of the rides [s]
    tyre_load: float = 1.1  # factor by which the tuning may raise the RMS variation of the tyre load
    fresh_roads: int = 32  # largest number of roads on which the tuned car is tried that the tuning has not seen
    seed: int = 0  # of all noise and roads


def demo(screen: Screen, *, seed: int = 0, output: Output) -> None:
    """Run the whole chain on a damper whose truth is known. Needs no input.

    A virtual bench records a known damper; laws are fitted to the files and compared on records that were held out; a
    quarter car rides on each law; the damper is tuned for comfort; all is written to a folder.

    Arguments:
        seed: of the noise of the virtual bench and of the roads.
    """
    run_demo(screen, Scenario(seed=seed), output)


def run_demo(screen: Screen, scenario: Scenario, output: Output) -> None:
    """Records, fits, rides, a tuning, and a folder with all of it: laws and tables first, then the pictures."""
    with job(screen, "demo", output) as work:
        runs = record(screen, scenario, work.results.draft)
        fits = fit_laws(screen, scenario.laws, runs.without(scenario.held_out), runs.select(scenario.held_out))
        show(screen, fits)
        truth = next((rung.result for rung in fits.comparison.rungs if rung.name == scenario.true_name), None)
        with work.saving("Laws and tables", f"the rides, the tuning, {fits.missing}") as draft:
            write_fits(draft, fits.comparison, runs, work.attempts)
            with work.attempts.part("true_law.json"):
                export.to_json(scenario.law, draft / "true_law.json")
            if truth is not None:
                write_tables(draft / "tables", {"parameters_and_truth": truth_table(scenario, truth)})
        preflight, remarks = bench.preflight(runs), _remarks(scenario, fits)
        part = FitPart(fits.comparison, tuple(runs), sheets=False, preflight=preflight, remarks=remarks)
        laws = part.begun(Attempts(message=message))
        rides = _rides(screen, scenario, fits)
        result = None if truth is None else _tuned(screen, truth, scenario)
        if truth is not None:
            screen.details(truth_table(scenario, truth))
        screen.say(truth_verdict(scenario, truth))
        with work.saving("Rides and tuning") as draft:
            for number, responses in enumerate(rides.values(), 1):
                tables = {f"ride_{number}_{name}": table for name, table in ride_tables(responses).items()}
                write_tables(draft / "tables", tables)
            if result is not None:
                write_tuning(draft, result)
        work.page(_page, scenario, laws, fits.comparison, truth, rides, result)
        target = work.results.target
    screen.details(screen.times_table())
    screen.say(f"Open {target / 'report.html'}. The records are files like those of a real bench; fit them yourself:")
    records = shlex.quote(str(target / "records"))
    screen.say(f'  jaxdamp fit {records} --held-out "{scenario.held_out}" --sign rebound-positive', "bold")


def _page(
    scenario: Scenario,
    laws: Callable[[], Report],
    comparison: Comparison,
    truth: FitResult | None,
    rides: Mapping[str, Mapping[str, Response]],
    tuning: TuneResult | None,
    *,
    folder: Path,
    attempts: Attempts,
) -> Report:
    """The page of the chain, with the truth."""
    page = chain_report(
        comparison,
        rides,
        tuning,
        title="jaxdamp demo: from bench records to a better damper",
        sentences=[truth_verdict(scenario, truth)],
        sheets=False,
        laws=laws,
        folder=folder,
        attempts=attempts,
    )
    if truth is not None:
        page.heading("Was the truth found?")
        page.table(truth_table(scenario, truth))
    return page


def _remarks(scenario: Scenario, fits: Fitted) -> list[str]:
    """On the records of the demo."""
    noise = f"sensor noise of {scenario.force_noise:g} N and {1e6 * scenario.stroke_noise:g} µm"
    return [
        f"A virtual bench recorded a known damper under {len(scenario.tests)} sines, with {noise}. "
        f"The records {scenario.held_out} were held out of all fits.",
        f"The true damper: {scenario.law!r}",
        *fits.failures,
    ]


def record(screen: Screen, scenario: Scenario, folder: Path) -> BenchSet:
    """Run the virtual bench, write its files and read them back."""
    dyno = VirtualDyno(
        scenario.law, force_noise=scenario.force_noise, stroke_noise=scenario.stroke_noise, seed=scenario.seed
    )
    with screen.stage(f"Virtual bench: {len(scenario.tests)} tests", len(scenario.tests)) as advance:
        records = dyno.run(scenario.tests, progress=lambda done, of: advance("", done))
    with screen.stage("Files written and read back"):
        records.write(folder / "records")
        return bench.read([folder / "records" / f"{name}.csv" for name in records.names])


def _rides(screen: Screen, scenario: Scenario, fits: Fitted) -> dict[str, dict[str, Response]]:
    """On a random road and over a bump: the true damper, the law with the largest error, and the recommended one."""
    random = roads.iso8608("C", speed=20.0, seed=scenario.seed)
    iso = f"ISO 8608 class C at {display().speed(20.0)}"
    bump = f"a bump, 60 mm high and 2 m long, at {display().speed(10.0)}"
    surfaces: dict[str, AbstractRoad] = {iso: random, bump: roads.cosine_bump(0.06, start=0.5, duration=0.2)}
    comparison = fits.comparison
    both = (max(comparison.rungs, key=lambda rung: rung.error), comparison.best)
    cars = {name: _car(law) for name, law in {TRUE: scenario.law, **{r.name: r.result.law for r in both}}.items()}
    rides = {}
    for title, road in surfaces.items():
        whole = _driven(screen, cars, road, {"duration": scenario.duration}, f"Quarter car on {title}")
        end = scenario.duration if title == iso else min(scenario.duration, EVENT)  # one program for both lengths
        rides[title] = {name: response.between(0.0, end) for name, response in whole.items()}
        show_ride(screen, rides[title])
    return rides


def _car(law: AbstractDamper) -> AbstractVehicle:
    """The corner of a car that is ridden and tuned: 300 kg of body, 1.2 Hz."""
    return vehicles.presets.quarter_car_mathworks(law)


def _tuned(screen: Screen, truth: FitResult, scenario: Scenario) -> TuneResult:
    """The fitted damper with its coefficients tuned for comfort, tried on roads that the tuning had not seen."""
    more = f"{100 * (scenario.tyre_load - 1):+.0f}%"
    screen.say(
        "For this light car the damper is stiff: it holds the tyre to the road and shakes the body. Its damping "
        f"coefficients are tuned for comfort, while the RMS variation of the tyre load may grow: {more} at most."
    )
    road = roads.iso8608("C", speed=20.0, seed=scenario.seed)
    limits, run = {"grip": more}, {"duration": scenario.duration, "fresh_roads": scenario.fresh_roads}
    what = {"metric": "comfort", "vehicle": _car(truth.law), "road": road, "over": ["damper.**rate"]}
    return tuned(screen, what | {"limits": limits} | run)


def truth_table(scenario: Scenario, result: FitResult) -> Table:
    """The recovered parameters beside the true ones."""
    return result.table(scenario.law, title=f"Parameters of {scenario.true_name}, fitted and true")


def truth_verdict(scenario: Scenario, result: FitResult | None) -> str:
    """Whether the fit found the truth, in words."""
    if result is None:
        return f"{scenario.true_name} could not be fitted."
    rows = truth_table(scenario, result).records()
    determined = [row for row in rows if not row["note"]]
    off = [abs(cell) for cell in (row["(value − true)/se"] for row in determined) if isinstance(cell, float)]
    if not off:
        return "None of the parameters is determined by these records."
    undetermined = len(rows) - len(determined)
    blind = f" {undetermined} more cannot be told from these records, and the fit says so." if undetermined else ""
    return f"{len(off)} parameters are determined; they are at most {max(off):.1f} standard errors off.{blind}"
