"""`jaxdamp demo`: the whole chain on a damper whose truth is known."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from jaxdamp import bench, export, plots, roads, simulate, tune, vehicles
from jaxdamp.bench import BenchSet, SineTest, VirtualDyno
from jaxdamp.cli import findings as tables
from jaxdamp.cli import interrupt
from jaxdamp.cli.attempts import Attempts
from jaxdamp.cli.console import Screen
from jaxdamp.cli.demo_tuning import COMFORT, fresh_table, fresh_verdict, limits, outcome, purpose, tuning_tables
from jaxdamp.cli.fit_files import draw_findings, velocities, write_findings, write_table
from jaxdamp.cli.fitted import Findings
from jaxdamp.cli.fitting import fit_laws
from jaxdamp.cli.ranges import notes_of, said_in_tables
from jaxdamp.cli.results import Results, results_folder
from jaxdamp.dampers import AbstractDamper, Besinger, SeriesSpring
from jaxdamp.identify import FitResult
from jaxdamp.report import Column, Report, Table
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Response
from jaxdamp.tune import Rescore, TuneResult
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
        fresh_roads: number of roads on which the tuned car is tried that the tuning has not seen.
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
    fresh_roads: int = 5
    seed: int = 0


TRUE = "true damper"
METRICS = {
    "rms_sprung_acceleration": "body acceleration, RMS",
    "weighted_rms_sprung_acceleration": "weighted by Wk",
    "working_space_rms": "travel, RMS",
    "working_space_peak_to_peak": "travel, peak to peak",
    "rms_dynamic_tyre_load": "tyre load, RMS",
}
EVENT = 2.0  # s: length of a ride over a bump
JUDGED = "rms_sprung_acceleration"
ISO = "ISO 8608 class C at 20 m/s"
BUMP = "a bump, 60 mm high and 2 m long, at 10 m/s"


def run_demo(screen: Screen, scenario: Scenario, *, out: Path, replace: bool = False) -> None:
    """Records, fits, rides, a tuning, and a folder with all of it: laws and tables first, then the pictures."""
    attempts, report = Attempts(), Report("jaxdamp demo: from bench records to a better damper")
    with results_folder(out, "demo", replace=replace) as results:
        runs = record(screen, scenario, results.draft)
        held = runs.select(scenario.held_out)
        findings = fit_laws(screen, scenario.laws, runs.without(scenario.held_out), held)
        show_fits(screen, findings, scenario)
        with interrupt.saving(), screen.stage("Laws and tables"):
            write_findings(results.draft, findings, runs, attempts)
            _write_truth(results.draft, findings, scenario, attempts)
            results.publish(f"the rides, the tuning, {findings.missing}")
        rides = {name: ride(screen, name, road, findings, scenario) for name, road in _roads(scenario).items()}
        show_rides(screen, rides)
        tuned = improve(screen, findings, rides[ISO], scenario) if _has_truth(findings, scenario) else None
        fresh = None if tuned is None else try_fresh_roads(screen, tuned, scenario)
        if tuned is not None and fresh is not None:
            show_tuning(screen, tuned, fresh, scenario)
        _save_rides(results, rides, tuned, fresh, velocities(findings.comparison), attempts)
        with screen.stage("Pictures and report"):
            _introduce(report, scenario)
            draw_findings(results.draft, findings, report, attempts)
            _report_truth(findings, scenario, report)
            _draw_rides(results.draft, rides, report, attempts)
            if tuned is not None and fresh is not None:
                before = rides[ISO][scenario.true_name]
                _draw_tuning(results.draft, tuned, fresh, before, scenario, report, attempts)
            report.points(attempts.troubles)
            report.write(results.draft / "report.html")
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    screen.table(screen.times_table())
    screen.say(f"Open {out / 'report.html'}. The records are files like those of a real bench; fit them yourself:")
    screen.say(f'  jaxdamp fit {out / "records"} --held-out "{scenario.held_out}" --sign rebound-positive', "bold")


# ---- the steps


def record(screen: Screen, scenario: Scenario, folder: Path) -> BenchSet:
    """Run the virtual bench, write its files and read them back."""
    dyno = VirtualDyno(
        scenario.law, force_noise=scenario.force_noise, stroke_noise=scenario.stroke_noise, seed=scenario.seed
    )
    with screen.stage(f"Virtual bench: {len(scenario.tests)} tests", len(scenario.tests)) as advance:
        made = dyno.run(scenario.tests, progress=lambda done, of: advance("", done))
    with screen.stage("Files written and read back"):
        made.write(folder / "records")
        return bench.read([folder / "records" / f"{name}.csv" for name in made.names])


def _iso_road(seed: int) -> AbstractRoad:
    return roads.iso8608("C", speed=20.0, seed=seed)


def _roads(scenario: Scenario) -> dict[str, AbstractRoad]:
    """A random road and an event."""
    return {ISO: _iso_road(scenario.seed), BUMP: roads.cosine_bump(0.06, start=0.5, duration=0.2)}


def _car(law: AbstractDamper) -> AbstractVehicle:
    """The corner of a car that is ridden and tuned: 300 kg of body, 1.2 Hz."""
    return vehicles.presets.quarter_car_mathworks(law)


def ride(screen: Screen, title: str, road: AbstractRoad, findings: Findings, scenario: Scenario) -> dict[str, Response]:
    """The quarter car with the true damper and with every fitted law."""
    laws = {TRUE: scenario.law} | {rung.name: rung.result.law for rung in findings.comparison.rungs}
    duration = scenario.duration if title == ISO else min(scenario.duration, EVENT)
    responses = {}
    with screen.stage(f"Quarter car on {title}", len(laws)) as advance:
        for done, (name, law) in enumerate(laws.items()):
            advance(name, done)
            with said_in_tables():
                responses[name] = simulate(_car(law), road, duration=duration)
    return responses


def improve(screen: Screen, findings: Findings, rides: Mapping[str, Response], scenario: Scenario) -> TuneResult:
    """Tune the damping coefficients of the fitted damper for comfort, without giving up the grip of the tyre."""
    before = {name: float(value) for name, value in rides[scenario.true_name].metrics().items()}
    with screen.stage("Tuning for comfort") as advance:
        return tune.minimise(
            COMFORT,
            _car(findings.comparison[scenario.true_name].law),
            _roads(scenario)[ISO],
            over=["damper.*rate"],
            limits=limits(before, scenario.tyre_load),
            duration=scenario.duration,
            progress=lambda step, metric: advance(f"step {step}: {metric:.4f} m/s²", step),
        )


def try_fresh_roads(screen: Screen, tuned: TuneResult, scenario: Scenario) -> Rescore:
    """Drive the cars before and after the tuning over roads of the same class that it has not seen."""
    fresh = [_iso_road(scenario.seed + 1 + index) for index in range(scenario.fresh_roads)]
    with screen.stage(f"The tuned car on {len(fresh)} fresh roads"):
        return tune.rescore(tuned, fresh, duration=scenario.duration)


# ---- what they found


def show_fits(screen: Screen, findings: Findings, scenario: Scenario) -> None:
    """The ladder and the recovered parameters."""
    screen.table(findings.ladder, mark=findings.comparison.best.name)
    screen.points(findings.failures, style="red")
    screen.say(" ".join(findings.verdict))
    if not _has_truth(findings, scenario):
        return
    result = findings.comparison[scenario.true_name]
    screen.table(truth_table(scenario, result))
    screen.say(truth_verdict(scenario, result))
    screen.points(result.warnings, style="yellow")


def truth_table(scenario: Scenario, result: FitResult) -> Table:
    """The recovered parameters beside the true ones."""
    return tables.parameter_table(f"{scenario.true_name}, fitted and true", result, truth=scenario.law)


def truth_verdict(scenario: Scenario, result: FitResult) -> str:
    """Whether the fit found the truth, in words."""
    table = truth_table(scenario, result)
    at = [column.name for column in table.columns].index("(value − true)/se")
    sound = [row for row in table.rows if not row[at + 1]]
    off = [abs(cell) for cell in (row[at] for row in sound) if isinstance(cell, float)]
    if not off:
        return "None of the parameters is determined by these records."
    rest = len(table.rows) - len(sound)
    blind = f" {rest} more cannot be told from these records, and the fit says so." if rest else ""
    return f"{len(off)} parameters are determined; they are at most {max(off):.1f} standard errors off.{blind}"


def ride_table(title: str, responses: Mapping[str, Response]) -> Table:
    """Ride metrics of each law, and how far the acceleration is from that with the true damper."""
    units = next(iter(responses.values())).metric_units()
    columns = [Column("law"), *(Column(name, units[m].replace("^2", "²")) for m, name in METRICS.items())]
    found = {name: {m: float(v) for m, v in r.metrics().items()} for name, r in responses.items()}
    errors = _ride_errors(responses)
    rows = [(name, *(values[m] for m in METRICS), errors.get(name)) for name, values in found.items()]
    return Table(title, (*columns, Column("error of the acceleration", "%", "+.1f")), tuple(rows))


def _ride_errors(responses: Mapping[str, Response]) -> dict[str, float]:
    """How far the RMS acceleration with each fitted law is from that with the true damper [%]."""
    rms = {name: float(response.metrics()[JUDGED]) for name, response in responses.items()}
    return {name: 100 * (value / rms[TRUE] - 1) for name, value in rms.items() if name != TRUE}


def ride_verdict(responses: Mapping[str, Response]) -> str:
    """What the choice of a law costs in the prediction of a ride, in words."""
    errors = _ride_errors(responses)
    best, worst = (choose(errors, key=lambda name: abs(errors[name])) for choose in (min, max))
    return f"The body acceleration predicted with {worst} is {_off(errors[worst])}, with {best} {_off(errors[best])}."


def _off(error: float) -> str:
    """An error of so many percent in words."""
    return "right to 0.1 %" if abs(error) < 0.1 else f"{abs(error):.1f} % too {'high' if error > 0 else 'low'}"


def show_rides(screen: Screen, rides: Mapping[str, Mapping[str, Response]]) -> None:
    """Ride metrics on each road."""
    for title, responses in rides.items():
        screen.table(ride_table(title, responses))
        screen.say(ride_verdict(responses))
        screen.points(notes_of(responses), style="yellow")


def show_tuning(screen: Screen, tuned: TuneResult, fresh: Rescore, scenario: Scenario) -> None:
    """What the tuning did, on its road and on others."""
    screen.say(purpose(scenario.tyre_load))
    for table in tuning_tables(tuned):
        screen.table(table)
    screen.say(outcome(tuned))
    screen.points(tuned.warnings, style="yellow")
    screen.table(fresh_table(fresh))
    screen.say(fresh_verdict(fresh))


# ---- what is written


def _introduce(report: Report, scenario: Scenario) -> None:
    report.text(
        f"A virtual bench recorded a known damper under {len(scenario.tests)} sines, with sensor noise of",
        f"{scenario.force_noise:g} N and {1e6 * scenario.stroke_noise:g} µm. The records {scenario.held_out} were held",
        "out of all fits. Stroke and velocity are positive in rebound, force is positive when it resists extension.",
    )
    report.text(f"The true damper: {scenario.law!r}")


def _has_truth(findings: Findings, scenario: Scenario) -> bool:
    """Whether the law with the true parameters was fitted."""
    return any(rung.name == scenario.true_name for rung in findings.comparison.rungs)


def _write_truth(folder: Path, findings: Findings, scenario: Scenario, attempts: Attempts) -> None:
    with attempts.part("true_law.json"):
        export.to_json(scenario.law, folder / "true_law.json")
    if _has_truth(findings, scenario):
        write_table(folder, "parameters_and_truth", truth_table(scenario, findings.comparison[scenario.true_name]))


def _save_rides(
    results: Results,
    rides: Mapping[str, Mapping[str, Response]],
    tuned: TuneResult | None,
    fresh: Rescore | None,
    velocities: np.ndarray,
    attempts: Attempts,
) -> None:
    """Put the tables of the rides and the tuning into place, and the tuned law."""
    with interrupt.saving():
        (results.draft / "tables").mkdir()
        for index, (title, responses) in enumerate(rides.items()):
            write_table(results.draft, f"ride_{index + 1}", ride_table(title, responses))
        if tuned is not None:
            for name, table in zip(("tuned_parameters", "tuned_metrics"), tuning_tables(tuned), strict=True):
                write_table(results.draft, name, table)
            if fresh is not None:
                write_table(results.draft, "tuned_on_fresh_roads", fresh_table(fresh))
            law = tuned.vehicle.elements()[0]
            with attempts.part("tuned_law.json"):
                export.to_json(law, results.draft / "tuned_law.json")
            with attempts.part("tuned_law_force_velocity.csv"):
                export.to_csv(law, results.draft / "tuned_law_force_velocity.csv", velocities)
        results.publish("the pictures and the report")


def _report_truth(findings: Findings, scenario: Scenario, report: Report) -> None:
    report.heading("Was the truth found?")
    if not _has_truth(findings, scenario):
        report.text(f"{scenario.true_name} could not be fitted.")
        return
    result = findings.comparison[scenario.true_name]
    report.text(truth_verdict(scenario, result))
    report.table(truth_table(scenario, result))


def _draw_rides(folder: Path, rides: Mapping[str, Mapping[str, Response]], report: Report, attempts: Attempts) -> None:
    report.heading("The ride on each law")
    for index, (title, responses) in enumerate(rides.items()):
        report.table(ride_table(title, responses))
        report.text(ride_verdict(responses))
        report.points(notes_of(responses))
        names = sorted(_ride_errors(responses), key=lambda name: abs(_ride_errors(responses)[name]))
        shown = {name: responses[name] for name in dict.fromkeys((TRUE, names[-1], names[0]))}
        words = f"Quarter car on {title}: the true damper, the law furthest from it and the nearest"
        with attempts.part(f"The picture ride_{index + 1}.png"):
            report.picture(plots.ride(shown, reference=TRUE), words, folder / f"ride_{index + 1}.png")


def _draw_tuning(
    folder: Path,
    tuned: TuneResult,
    fresh: Rescore,
    before: Response,
    scenario: Scenario,
    report: Report,
    attempts: Attempts,
) -> None:
    report.heading("A better damper")
    report.text(purpose(scenario.tyre_load))
    for table in tuning_tables(tuned):
        report.table(table)
    report.text(outcome(tuned))
    report.points(tuned.warnings)
    report.table(fresh_table(fresh))
    report.text(fresh_verdict(fresh))
    with attempts.part("The picture tuning.png"):
        report.picture(plots.tuning(tuned), "Before and after the tuning", folder / "tuning.png")
    with attempts.part("The picture tuning_ride.png"), said_in_tables():
        after = simulate(tuned.vehicle, _roads(scenario)[ISO], duration=scenario.duration)
        figure = plots.ride({"before": before, "after": after})
        report.picture(figure, f"Quarter car on {ISO}, before and after", folder / "tuning_ride.png")
