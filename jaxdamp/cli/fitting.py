"""`jaxdamp fit`: records of a bench in, laws with tables and pictures out."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jaxdamp import _checks, export, identify
from jaxdamp._tables import Table
from jaxdamp.bench import BenchSet, Preflight
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.grouping import grouped
from jaxdamp.cli.interrupt import Interrupted
from jaxdamp.cli.option_types import command_line
from jaxdamp.cli.options import decisions, law_names, split
from jaxdamp.cli.preflighting import checked
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions
from jaxdamp.cli.results import Results, another_page, results_folder
from jaxdamp.cli.vehicle_words import read_law
from jaxdamp.cli.wording import in_command_line, message
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Comparison, CrossValidation, Failure, Rung
from jaxdamp.report import (
    Attempts,
    failure_sentences,
    fit_report,
    fitted_velocities,
    parameters_of,
    records_table,
)


class Fitted:
    """The fits of a command, and the laws that an interruption left without one.

    Attributes:
        comparison: the fits.
        failures: the laws without a fit, and why, a sentence each.
        missing: what is still to be written after laws and tables.
    """

    def __init__(self, comparison: Comparison, interrupted: Sequence[str]) -> None:
        self.comparison = comparison
        left = [f"{name} was not fitted: interrupted." for name in interrupted]
        self.failures = failure_sentences(comparison) + left
        laws = f"the fits of {', '.join(interrupted)}, " if interrupted else ""
        self.missing = f"{laws}the pictures and the report"


def run_fit(
    screen: Screen,
    files: Sequence[Path],
    options: ReadOptions,
    *,
    laws: Sequence[str] = ("all",),
    held_out: Sequence[str] = (),
    weighting: str = "samples",
    rig: Sequence[str] = (identify.OFFSET,),
    processing: ProcessOptions | None = None,
    group_by: str | None = None,
    cross_validate: bool = False,
    baseline: Path | None = None,
    out: Path,
    report: Path | None = None,
    replace: bool = False,
) -> None:
    """Read and check records, fit laws to those without an error, say how good they are, and write all into a folder.

    Laws and tables are in the folder before the first picture is drawn. Records that are grouped by a setting are
    fitted one group after the other, each into a folder of its own inside.
    """
    names = law_names(laws)
    _checks.one_of("weighting", weighting, ("samples", "runs"))
    machine = identify.machine_names("rig", rig)
    beside = None if baseline is None else read_law("baseline", baseline)
    attempts = Attempts(interrupt.check, message)
    if report is not None and group_by is not None:
        _checks.refuse("report", "be left out with --group-by, which writes a page for each group", str(report))
    with another_page(report, out, replace=replace), results_folder(out, "fit", replace=replace) as results:
        with screen.stage("Reading the records"):
            raw = options.read(files)
        sound, found = checked(screen, raw, options, processing or ProcessOptions(), refuse=True)
        runs = (processing or ProcessOptions()).apply(sound)
        _, held = split(runs, held_out)
        groups = grouped(runs, group_by)
        for name, part in groups.items():
            if all(run in held.runs for run in part):
                raise ValueError(f"Option --held-out leaves no record of {name} to fit: hold out fewer.")
        remarks = decisions(tuple(runs)) + [f"left out: {sentence}" for sentence in runs.left_out]
        screen.table(records_table(tuple(runs), tuple(held)))
        screen.points(remarks)
        scheduled = group_by is None and len({run.command for run in runs}) > 1
        if scheduled and cross_validate:
            remedy = "Records at each inner command are predicted without them anyway; --group-by command fits apart."
            _checks.refuse("cross-validate", "be left out where the records state several commands", "given", remedy)
        job = FitJob(
            screen, names, weighting, machine, scheduled, results, attempts, found, remarks, cross_validate, beside
        )
        failed = []
        for number, (name, part) in enumerate(groups.items(), 1):
            try:
                job.fit_group(name, part, held, later=list(groups)[number:])
            except ValueError as error:  # no law could be fitted to this group
                failed.append(f"{name}: {error}")
                if len(failed) == len(groups):
                    raise
        attempts.troubles += failed
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")


class FitJob(NamedTuple):
    """What the fits of all groups of records share."""

    screen: Screen
    names: Sequence[str]
    weighting: str
    rig: Sequence[str]
    scheduled: bool
    results: Results
    attempts: Attempts
    found: Preflight
    remarks: Sequence[str]
    cross_validate: bool
    baseline: AbstractDamper | None

    def fit_group(self, name: str, runs: BenchSet, held_out: BenchSet, later: Sequence[str]) -> None:
        """Fit one group of records and write its folder, which has the name of the group.

        Arguments:
            name: of the group; empty if there is only one, which is written without a folder of its own.
            runs: its records.
            held_out: the records of all groups that are not fitted.
            later: the groups that follow.
        """
        self.screen.say()
        if name:
            self.screen.heading(name)
        held, fitted = (runs.where(lambda run, yes=yes: (run in held_out.runs) == yes) for yes in (True, False))
        how = {"weighting": self.weighting, "rig": self.rig, "scheduled": self.scheduled}
        fits = fit_laws(self.screen, self.names, fitted, held, **how)
        show(self.screen, fits)
        validation = self.validated(fits.comparison.best.name, fitted) if self.cross_validate else None
        following = f" and the fits of {', '.join(later)}" if later else ""
        with interrupt.saving(), self.screen.stage("Laws and tables"):
            folder = self.results.draft / name
            folder.mkdir(exist_ok=True)
            write_fits(folder, fits.comparison, runs, self.attempts)
            write_table(folder, "preflight", self.found.table())
            self.results.publish(fits.missing + following)
        with self.screen.stage("Pictures and report"):
            folder = self.results.draft / name
            folder.mkdir(exist_ok=True)
            places = {"folder": folder, "attempts": self.attempts}
            page = fit_report(
                fits.comparison,
                runs=runs,
                baseline=self.baseline,
                remarks=self.remarks,
                preflight=self.found,
                failures=fits.failures,
                validation=validation,
                **places,
            )
            page.write(folder / "report.html", command_line())
            if later:
                self.results.publish(f"the fits of {', '.join(later)}")

    def validated(self, name: str, runs: BenchSet) -> CrossValidation | None:
        """Each record predicted by the law of this name fitted to the others; None where that fails."""
        with self.attempts.part(f"The cross-validation of {name}"), self.screen.stage("Leaving out each record"):
            start = identify.default_ladder(tuple(runs), [name], rig=self.rig)
            validation = identify.cross_validate(start, tuple(runs), rig=self.rig)
            self.screen.table(validation.record_table())
            return validation
        return None


def fit_laws(
    screen: Screen,
    names: Sequence[str],
    runs: BenchSet,
    held_out: BenchSet,
    *,
    weighting: str = "samples",
    rig: Sequence[str] = (identify.OFFSET,),
    scheduled: bool = False,
) -> Fitted:
    """Fit the laws of these names on a test machine, one after the other. Ctrl-C keeps those that are finished.

    Laws may be `scheduled`: their parameters are then functions of what the records state as their command.

    Raises:
        ValueError: not one law could be fitted.
    """
    title = f"Fitting {len(names)} law{'s' * (len(names) > 1)} to {len(runs)} record{'s' * (len(runs) > 1)}"
    outcomes: list[Rung | Failure] = []
    with screen.stage(title, total=len(names)) as advance:
        try:
            starts = identify.default_ladder(tuple(runs), names, rig=rig)
            for outcome in identify.fit_each(
                starts,
                tuple(runs),
                tuple(held_out),
                progress=lambda name: advance(name, len(outcomes)),
                weighting=weighting,
                rig=rig,
                scheduled=scheduled,
                bad_records="keep",  # they were checked
            ):
                outcomes.append(outcome)
                if isinstance(outcome, Rung):
                    interrupt.keep()
        except Interrupted:
            if not any(isinstance(outcome, Rung) for outcome in outcomes):
                raise
    done = {outcome.name for outcome in outcomes}
    comparison = Comparison.of(outcomes, tuple(held_out))
    if comparison.best.by_setting:
        with screen.stage("Leaving out settings"):
            _ = comparison.best.by_setting.between
    return Fitted(comparison, [name for name in names if name not in done])


def show(screen: Screen, fits: Fitted) -> None:
    """The fits at the terminal: the answer, one table, the gist of the warnings; all else is in tables and page."""
    comparison, best = fits.comparison, fits.comparison.best
    several = len(comparison.rungs) > 1
    lines = 1 + several  # of the verdict: which law, and why
    screen.say()
    screen.say(" ".join(comparison.verdict[:lines]), style="bold")
    screen.table(comparison.table() if several else parameters_of(best), mark=best.name)
    screen.points(fits.failures, style="red")
    screen.say(" ".join(comparison.verdict[lines:]))
    result = best.result
    screen.points([in_command_line(warning) for warning in result.main_warnings], style="yellow")
    if len(result.warnings) > len(result.main_warnings):
        screen.points([f"all {len(result.warnings)} warnings of {best.name} are in report.html"])


def write_fits(folder: Path, comparison: Comparison, runs: BenchSet, attempts: Attempts) -> None:
    """Laws and tables of the fits, each of which may fail by itself."""
    best = comparison.best.result.law
    (folder / "laws").mkdir()
    (folder / "tables").mkdir()
    write_table(folder, "records", records_table(tuple(runs), comparison.held_out))
    write_table(folder, "ladder", comparison.table())
    for rung in comparison.rungs:
        with attempts.part(f"The files of the law {rung.name}"):
            write_table(folder, f"parameters_{rung.name}", parameters_of(rung))
            export.to_json(rung.result.law, folder / "laws" / f"{rung.name}.json")
            if rung.result.rig is not None:
                (folder / "machines").mkdir(exist_ok=True)
                export.to_json(rung.result.rig, folder / "machines" / f"{rung.name}.json")
    if comparison.best.by_setting:
        write_table(folder, "settings", comparison.best.by_setting.table())
    with attempts.part("best_law.json"):
        export.to_json(best, folder / "best_law.json")
    for name, law in comparison.best.laws().items():
        at = name.removeprefix(comparison.best.name).replace(" at ", "_")
        file = f"best_law_force_velocity{at}.csv"
        with attempts.part(file):
            export.to_csv(law, folder / file, fitted_velocities(comparison))


def write_table(folder: Path, name: str, table: Table) -> None:
    """One table as CSV."""
    (folder / "tables" / f"{name}.csv").write_text(table.to_csv(), encoding="utf-8")
