"""`jaxdamp demo`: the whole chain on a damper whose truth is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from jaxdamp import bench, export, plots, roads, simulate, tune, vehicles
from jaxdamp._tables import Table
from jaxdamp._types import Figure
from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.cli.console import Screen
from jaxdamp.cli.demo_words import (
    COMFORT,
    GRIP,
    TRUE,
    add_rides,
    outcome,
    purpose,
    ride_table,
    ride_verdict,
    show_rides,
)
from jaxdamp.cli.fitting import Fitted, fit_laws, show, write_fits
from jaxdamp.cli.jobs import Job, Output, job, without_range_warnings, write_tables
from jaxdamp.dampers import AbstractDamper, Besinger, SeriesSpring
from jaxdamp.identify import FitResult
from jaxdamp.report import (
    Attempts,
    Report,
    add_fits,
    add_other_fits,
    add_records,
    add_tuning,
    fit_verdict,
    fitted_velocities,
)
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult
from jaxdamp.vehicles import AbstractVehicle


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
    """What the demo does; every number of it stands here.

    Attributes:
        law: the true damper.
        true_name: the law of the ladder that has the same parameters.
        laws: the laws to fit.
        tests: the bench programme, paper 000 Table I.
        held_out: pattern of the records that are not fitted, as in Fig. 8 of the paper.
        force_noise: of the bench [N].
        stroke_noise: of the bench [m].
        duration: of the rides [s].
        tyre_load: factor by which the tuning may raise the RMS variation of the tyre load.
        fresh_roads: largest number of roads on which the tuned car is tried that the tuning has not seen.
        seed: of all noise and roads.
    """

    law: AbstractDamper = field(default_factory=_true_law)
    true_name: str = "besinger_series_spring"
    laws: tuple[str, ...] = ("linear", "power_law", "segmented_polynomial", "besinger", "besinger_series_spring")
    tests: tuple[SineTest, ...] = field(default_factory=bench.programmes.paper_000_table_1)
    held_out: str = "30mm_*"
    force_noise: float = 20.0
    stroke_noise: float = 1e-5
    duration: float = 10.0
    tyre_load: float = 1.1
    fresh_roads: int = 32
    seed: int = 0


EVENT = 2.0  # s: length of a ride over a bump
ISO = "ISO 8608 class C at 20 m/s"
BUMP = "a bump, 60 mm high and 2 m long, at 10 m/s"


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
        held = runs.select(scenario.held_out)
        fits = fit_laws(screen, scenario.laws, runs.without(scenario.held_out), held)
        truth = next((rung.result for rung in fits.comparison.rungs if rung.name == scenario.true_name), None)
        show(screen, fits)
        with work.saving("Laws and tables", f"the rides, the tuning, {fits.missing}") as draft:
            write_fits(draft, fits.comparison, runs, work.attempts)
            _write_truth(draft, truth, scenario, work.attempts)
        rides = {name: ride(screen, name, road, fits, scenario) for name, road in _roads(scenario).items()}
        show_rides(screen, rides)
        tuned = None if truth is None else improve(screen, truth, scenario)
        if tuned is not None:
            show_tuning(screen, tuned, scenario)
        if truth is not None:
            show_truth(screen, truth, scenario)
        _save_rides(work, rides, tuned, fits)
        work.page(_page, scenario, runs, held, fits, truth, rides, tuned)
        target = work.results.target
    screen.details(screen.times_table())
    screen.say(f"Open {target / 'report.html'}. The records are files like those of a real bench; fit them yourself:")
    screen.say(f'  jaxdamp fit {target / "records"} --held-out "{scenario.held_out}" --sign rebound-positive', "bold")


def _page(
    scenario: Scenario,
    runs: BenchSet,
    held: BenchSet,
    fits: Fitted,
    truth: FitResult | None,
    rides: Mapping[str, Mapping[str, Response]],
    tuned: TuneResult | None,
    *,
    folder: Path,
    attempts: Attempts,
) -> Report:
    """The page of the demonstration."""
    report = Report("jaxdamp demo: from bench records to a better damper", folder, attempts)
    preflight = bench.preflight(runs)
    report.verdict(
        f"{preflight.summary}.",
        *fit_verdict(report, fits.comparison),
        *([] if tuned is None else [tuned.verdict.sentence, outcome(tuned)]),
        *(f"{name}: {ride_verdict(responses)}" for name, responses in rides.items()),
        "" if truth is None else truth_verdict(scenario, truth),
    )
    _introduce(report, scenario)
    add_records(report, tuple(runs), tuple(held), preflight=preflight)
    add_fits(report, fits.comparison, fits.failures, others=False)
    _report_truth(truth, scenario, report)
    add_rides(report, rides)
    if tuned is not None:
        _report_tuning(tuned, rides[ISO][scenario.true_name], scenario, report)
    add_other_fits(report, fits.comparison)
    return report


# ---- the steps


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


def _roads(scenario: Scenario) -> dict[str, AbstractRoad]:
    """A random road and an event."""
    random = roads.iso8608("C", speed=20.0, seed=scenario.seed)
    return {ISO: random, BUMP: roads.cosine_bump(0.06, start=0.5, duration=0.2)}


def _car(law: AbstractDamper) -> AbstractVehicle:
    """The corner of a car that is ridden and tuned: 300 kg of body, 1.2 Hz."""
    return vehicles.presets.quarter_car_mathworks(law)


def ride(screen: Screen, title: str, road: AbstractRoad, fits: Fitted, scenario: Scenario) -> dict[str, Response]:
    """The quarter car with the true damper and with every fitted law."""
    laws = {TRUE: scenario.law} | {rung.name: rung.result.law for rung in fits.comparison.rungs}
    duration = scenario.duration if title == ISO else min(scenario.duration, EVENT)
    responses = {}
    with screen.stage(f"Quarter car on {title}", len(laws)) as advance:
        for done, (name, law) in enumerate(laws.items()):
            advance(name, done)
            with without_range_warnings():
                responses[name] = simulate(_car(law), road, duration=duration)
    return responses


def improve(screen: Screen, truth: FitResult, scenario: Scenario) -> TuneResult:
    """Tune the fitted damper's coefficients for comfort, keep the tyre's grip, and try it on roads not tuned on."""
    with screen.stage("Tuning for comfort") as advance:
        return tune.minimise(
            COMFORT,
            _car(truth.law),
            _roads(scenario)[ISO],
            over=["damper.**rate"],
            limits={GRIP: f"{100 * (scenario.tyre_load - 1):+.0f}%"},
            fresh_roads=scenario.fresh_roads,
            duration=scenario.duration,
            progress=lambda step, metric: advance(f"step {step}: {metric:.4f} m/s²", step),
        )


# ---- what they say


def show_truth(screen: Screen, truth: FitResult, scenario: Scenario) -> None:
    """The recovered parameters."""
    screen.details(truth_table(scenario, truth))
    screen.say(truth_verdict(scenario, truth))


def truth_table(scenario: Scenario, result: FitResult) -> Table:
    """The recovered parameters beside the true ones."""
    return result.table(scenario.law, title=f"Parameters of {scenario.true_name}, fitted and true")


def truth_verdict(scenario: Scenario, result: FitResult) -> str:
    """Whether the fit found the truth, in words."""
    rows = truth_table(scenario, result).records()
    determined = [row for row in rows if not row["note"]]
    off = [abs(cell) for cell in (row["(value − true)/se"] for row in determined) if isinstance(cell, float)]
    if not off:
        return "None of the parameters is determined by these records."
    rest = len(rows) - len(determined)
    blind = f" {rest} more cannot be told from these records, and the fit says so." if rest else ""
    return f"{len(off)} parameters are determined; they are at most {max(off):.1f} standard errors off.{blind}"


def show_tuning(screen: Screen, tuned: TuneResult, scenario: Scenario) -> None:
    """What the tuning did, on its road and on others."""
    screen.say(purpose(scenario.tyre_load))
    screen.say(tuned.verdict.sentence)
    screen.table(tuned.parameter_table())
    screen.details(tuned.table())
    screen.say(outcome(tuned))
    screen.points(tuned.warnings, style="yellow")
    if tuned.fresh is not None:
        screen.details(tuned.fresh.table())


# ---- what is written


def _introduce(report: Report, scenario: Scenario) -> None:
    report.text(
        f"A virtual bench recorded a known damper under {len(scenario.tests)} sines, with sensor noise of",
        f"{scenario.force_noise:g} N and {1e6 * scenario.stroke_noise:g} µm. The records {scenario.held_out} were held",
        "out of all fits. Stroke and velocity are positive in rebound, force is positive when it resists extension.",
    )
    report.text(f"The true damper: {scenario.law!r}")


def _write_truth(folder: Path, truth: FitResult | None, scenario: Scenario, attempts: Attempts) -> None:
    with attempts.part("true_law.json"):
        export.to_json(scenario.law, folder / "true_law.json")
    if truth is not None:
        write_tables(folder / "tables", {"parameters_and_truth": truth_table(scenario, truth)})


def _save_rides(work: Job, rides: Mapping[str, Mapping[str, Response]], tuned: TuneResult | None, fits: Fitted) -> None:
    """Put the tables of the rides and the tuning into place, and the tuned law."""
    tables = {f"ride_{i}": ride_table(title, ride) for i, (title, ride) in enumerate(rides.items(), 1)}
    with work.saving("Rides and tuning") as draft:
        if tuned is not None:
            tables |= {"tuned_parameters": tuned.parameter_table(), "tuned_metrics": tuned.table()}
            if tuned.fresh is not None:
                tables["tuned_on_fresh_roads"] = tuned.fresh.table()
            law = tuned.vehicle.elements()[0]
            with work.attempts.part("tuned_law.json"):
                export.to_json(law, draft / "tuned_law.json")
            with work.attempts.part("tuned_law_force_velocity.csv"):
                export.to_csv(law, draft / "tuned_law_force_velocity.csv", fitted_velocities(fits.comparison))
        write_tables(draft / "tables", tables)


def _report_truth(truth: FitResult | None, scenario: Scenario, report: Report) -> None:
    report.heading("Was the truth found?")
    if truth is None:
        report.text(f"{scenario.true_name} could not be fitted.")
        return
    report.table(truth_table(scenario, truth))


def _report_tuning(tuned: TuneResult, before: Response, scenario: Scenario, report: Report) -> None:
    def rides() -> Figure:
        with without_range_warnings():
            after = simulate(tuned.vehicle, _roads(scenario)[ISO], duration=scenario.duration)
            return plots.ride({"before": before, "after": after})

    report.heading(tuned.verdict.outcome.value)
    report.text(purpose(scenario.tyre_load))
    add_tuning(report, tuned)
    report.picture(rides, f"Quarter car on {ISO}, before and after", "tuning_ride.png")
