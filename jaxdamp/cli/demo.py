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
from jaxdamp.cli.fit_files import draw_findings, velocities, write_findings, write_table
from jaxdamp.cli.fitted import Findings
from jaxdamp.cli.fitting import fit_laws
from jaxdamp.cli.ranges import notes_of, said_in_tables
from jaxdamp.cli.results import Results, results_folder
from jaxdamp.dampers import AbstractDamper, Besinger, Linear, SeriesSpring
from jaxdamp.identify import FitResult
from jaxdamp.parameters import match_paths, parameters
from jaxdamp.report import Column, Report, Table
from jaxdamp.roads import AbstractRoad
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


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
        reach: factor by which the tuning may raise or lower a damping coefficient.
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
    reach: float = 3.0
    seed: int = 0


PAPER_LINEAR = "linear, 2500 N s/m"
METRICS = {
    "rms_sprung_acceleration": "body acceleration, RMS",
    "working_space_rms": "travel, RMS",
    "working_space_peak_to_peak": "travel, peak to peak",
    "rms_dynamic_tyre_load": "tyre load, RMS",
}
ISO = "ISO 8608 class C at 20 m/s"
COMFORT = "rms_sprung_acceleration"


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
        if tuned is not None:
            show_tuning(screen, tuned)
        _save_rides(results, rides, tuned, velocities(findings.comparison), attempts)
        with screen.stage("Pictures and report"):
            _introduce(report, scenario)
            draw_findings(results.draft, findings, report, attempts)
            _report_truth(findings, scenario, report)
            _draw_rides(results.draft, rides, report, attempts)
            if tuned is not None:
                _draw_tuning(results.draft, tuned, rides[ISO][scenario.true_name], scenario, report, attempts)
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


def _roads(scenario: Scenario) -> dict[str, AbstractRoad]:
    """The road of paper 000, and a real one."""
    flat = roads.band_limited(0.1, 50.0, peak_to_peak=0.01, duration=scenario.duration, dt=0.002, seed=scenario.seed)
    return {
        "paper 000: random, 0.1 to 50 Hz, 10 mm peak to peak": flat,
        ISO: roads.iso8608("C", speed=20.0, seed=scenario.seed),
    }


def ride(screen: Screen, title: str, road: AbstractRoad, findings: Findings, scenario: Scenario) -> dict[str, Response]:
    """The quarter car of paper 000 with every fitted law, and with the paper's own."""
    laws: dict[str, AbstractDamper] = {PAPER_LINEAR: Linear(2500.0)}
    laws |= {rung.name: rung.result.law for rung in findings.comparison.rungs}
    responses = {}
    with screen.stage(f"Quarter car on {title}", len(laws)) as advance:
        for done, (name, law) in enumerate(laws.items()):
            advance(name, done)
            car = vehicles.presets.quarter_car_000(law)
            with said_in_tables():
                responses[name] = simulate(car, road, duration=scenario.duration)
    return responses


def improve(screen: Screen, findings: Findings, rides: Mapping[str, Response], scenario: Scenario) -> TuneResult:
    """Tune the damping coefficients for comfort, with no more travel than before."""
    car = vehicles.presets.quarter_car_000(findings.comparison[scenario.true_name].law)
    road = _roads(scenario)[ISO]
    paths = match_paths([p.path for p in parameters(car)], ["damper.*rate"])
    values = {p.path: float(p.value) for p in parameters(car) if p.path in paths}
    travel = float(rides[scenario.true_name].metrics()["working_space_peak_to_peak"])
    with screen.stage("Tuning for comfort") as advance:
        return tune.minimise(
            COMFORT,
            car,
            road,
            over=paths,
            bounds={path: (value / scenario.reach, value * scenario.reach) for path, value in values.items()},
            limits={"working_space_peak_to_peak": travel},
            duration=scenario.duration,
            max_steps=30,
            progress=lambda step, metric: advance(f"step {step}: {metric:.4f} m/s² RMS", step),
        )


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
    """Ride metrics of each law, and the acceleration over that of the paper's linear damper."""
    units = next(iter(responses.values())).metric_units()
    columns = [Column("law"), *(Column(name, units[m].replace("^2", "²")) for m, name in METRICS.items())]
    found = {name: {m: float(v) for m, v in r.metrics().items()} for name, r in responses.items()}
    base = found[PAPER_LINEAR][COMFORT]
    rows = [(name, *(values[m] for m in METRICS), values[COMFORT] / base) for name, values in found.items()]
    return Table(title, (*columns, Column("acceleration over linear", spec=".3f")), tuple(rows))


def ride_verdict(responses: Mapping[str, Response]) -> str:
    """The paper's claim, beside what is found here."""
    claim = (
        "Paper 000 has 30 % less RMS body acceleration with its linear damper than with its power law, a ratio of 1.43"
    )
    if "power_law" not in responses:
        return f"{claim}."
    power, linear = (float(responses[name].metrics()[COMFORT]) for name in ("power_law", PAPER_LINEAR))
    return f"{claim}; here the ratio is {power / linear:.2f}. It depends on how stiff the law is at low velocity."


def show_rides(screen: Screen, rides: Mapping[str, Mapping[str, Response]]) -> None:
    """Ride metrics on each road."""
    for index, (title, responses) in enumerate(rides.items()):
        screen.table(ride_table(title, responses))
        if index == 0:
            screen.say(ride_verdict(responses))
        screen.points(notes_of(responses), style="yellow")


def tuning_tables(tuned: TuneResult) -> tuple[Table, Table]:
    """Parameters and metrics before and after."""
    sides = (Column("before"), Column("after"))
    changed = tuple(
        (p.name, p.unit, p.before, p.after, 100 * (p.after / p.before - 1), p.note) for p in tuned.parameters
    )
    parameters_changed = Table(
        "Parameters",
        (Column("parameter"), Column("unit"), *sides, Column("change", "%", "+.1f"), Column("note")),
        changed,
    )
    marks = {tuned.metric: "minimised"} | {name: f"limit {top:.4g}" for name, top in tuned.limits.items()}
    rows = tuple(
        (
            name,
            tuned.units[name].replace("^2", "²") or "–",
            before,
            tuned.after[name],
            100 * (tuned.after[name] / before - 1) if before else None,
            marks.get(name, ""),
        )
        for name, before in tuned.before.items()
    )
    columns = (Column("metric"), Column("unit"), *sides, Column("change", "%", "+.1f"), Column("note"))
    return parameters_changed, Table("Ride metrics", columns, rows)


def show_tuning(screen: Screen, tuned: TuneResult) -> None:
    """What the tuning did."""
    for table in tuning_tables(tuned):
        screen.table(table)
    screen.points(tuned.warnings, style="yellow")


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
        if index == 0:
            report.text(ride_verdict(responses))
        report.points(notes_of(responses))
        shown = {name: responses[name] for name in (PAPER_LINEAR, *list(responses)[1:][-3:])}
        with attempts.part(f"The picture ride_{index + 1}.png"):
            report.picture(plots.ride(shown), f"Quarter car on {title}", folder / f"ride_{index + 1}.png")


def _draw_tuning(
    folder: Path, tuned: TuneResult, before: Response, scenario: Scenario, report: Report, attempts: Attempts
) -> None:
    report.heading("A better damper")
    report.text(
        "The damping coefficients were tuned for the least RMS body acceleration, with no more travel than before."
    )
    for table in tuning_tables(tuned):
        report.table(table)
    report.points(tuned.warnings)
    with attempts.part("The picture tuning.png"):
        report.picture(plots.tuning(tuned), "Before and after the tuning", folder / "tuning.png")
    with attempts.part("The picture tuning_ride.png"):
        after = simulate(tuned.vehicle, _roads(scenario)[ISO], duration=scenario.duration)
        figure = plots.ride({"before": before, "after": after})
        report.picture(figure, f"Quarter car on {ISO}, before and after", folder / "tuning_ride.png")
