"""`jaxdamp fit`: records of a bench in, laws with tables and pictures out."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from jaxdamp import _checks, bench, export, identify
from jaxdamp.bench import BenchSet, Preflight
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.interrupt import Interrupted
from jaxdamp.cli.jobs import Job, Output, job, write_tables
from jaxdamp.cli.limits import bounds_in_si
from jaxdamp.cli.line_fitting import fit_line, fit_table, records_of, through_points
from jaxdamp.cli.options import Call
from jaxdamp.cli.records import Reading, decisions, grouped, law_names, names_of, split
from jaxdamp.cli.signatures import Arguments
from jaxdamp.cli.vehicle_words import read_law
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Comparison, CrossValidation, Failure, Rung
from jaxdamp.parameters import name_patterns
from jaxdamp.report import (
    Attempts,
    failure_sentences,
    fit_report,
    fitted_velocities,
    parameters_of,
    records_table,
)
from jaxdamp.rig import Rig


RIG = ("offset",)
_BRIEF = ("law", "free", "fit", "held-out fit", "held-out RMSE", "note")  # columns of the ladder at the terminal


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


def fit(
    screen: Screen,
    files: Sequence[Path],
    *,
    law: Sequence[str] = (),
    held_out: Sequence[str] = (),
    reading: Reading,
    how: Annotated[Call, "identify.fit"],
    rig: Sequence[str] = RIG,
    group_by: str | None = None,
    cross_validate: bool = False,
    baseline: Path | None = None,
    side: str | None = None,
    each: str | None = None,
    in_control: int | None = None,
    report: Path | None = None,
    resume: bool = False,
    output: Output,
) -> None:
    """Fit damper laws to bench records, and say how good they are.

    Files of velocities and forces without a time are a force-velocity table, such as a manufacturer's sheet: the laws
    go through its points, or --law names those to be fitted to it, and a setting in it is the command of one law.

    Writes a report, pictures, tables, and each law as JSON; with --group-by, and where records of the same motion
    contradict one another and their names tell them apart, all of this in a folder for each value of the setting. Laws
    and tables are in the folder before the first picture is drawn.

    With --each, the records are those of a production line: one law is fitted to every damper. The fits are kept beside
    the results, and the same command later, with --replace, fits only dampers that are new or changed.

    Arguments:
        law: names of laws, see "jaxdamp laws": "linear,besinger"; or "all"; those that suit the records if left out.
        held_out: records to score on, not to fit: a name or a pattern, such as "30mm_*".
        rig: what the test machine adds.
        cross_validate: predict each record by the best law fitted to the others.
        side: of a force-velocity table with one direction only: rebound, compression, or symmetric for both alike.
        each: what a damper of a production line is: every folder with records, every file, or every name in a table
            with the columns damper and file; pip install 'jaxdamp[cluster]'.
        in_control: so many dampers at the beginning were in control: limits of control charts of all, with --each.
    """
    given = {"held_out": held_out, "group_by": group_by, "cross_validate": cross_validate, "baseline": baseline}
    if each is not None:
        refused = _given(**given, report=report, resume=resume, side=side)
        options = _options(how, rig)
        machine = options.pop("rig")
        fit_line(screen, files, each, law, machine, reading, options, output, in_control=in_control, refused=refused)
        return
    if in_control is not None:
        _checks.refuse("in_control", "be given with --each", in_control, "Or leave it out.")
    table = reading.table(files, side)
    kind = None if table is None else through_points(law)
    if table is not None and kind is not None:
        refused = [*_given(**given, resume=resume, keep_bad=reading.keep_bad), *how.given, *["rig"] * (rig != RIG)]
        fit_table(screen, table, kind, output, report, refused)
        return
    names = law_names(law, points=table is not None)
    options = _options(how, rig)
    reference = None if baseline is None else read_law("baseline", baseline)
    if report is not None and group_by is not None:
        _checks.refuse("report", "be left out with --group-by, which writes a page for each group", str(report))
    with job(screen, "fit", output, report, resume=resume) as work:
        with screen.stage("Reading the records"):
            raw = reading.raw(files) if table is None else records_of(screen, table)
        sound, preflight = reading.checked(screen, raw, refuse=True, machine=options["rig"])
        runs = reading.processed(sound)
        _, held = split(runs, held_out)
        groups, divided = grouped(runs, group_by)
        _check_groups(groups, held, None if report is None else f"{report}", divided)
        remarks = [*decisions(runs), *filter(None, [divided])]
        screen.details(records_table(tuple(runs), tuple(held)))
        screen.points(remarks)
        options["keep_bad"] = reading.keep_bad
        options["scheduled"] = group_by is None and len({run.command for run in runs}) > 1
        if options["scheduled"] and cross_validate:
            remedy = "Records at each inner command are predicted without them anyway; --group-by command fits apart."
            _checks.refuse("cross_validate", "be left out where the records state several commands", "given", remedy)
        Fits(work, names, options, preflight, remarks, cross_validate, reference).of_all(groups, held)


def _given(**options: object) -> list[str]:
    """The options among these that are given."""
    return [name for name, value in options.items() if value]


def _options(how: Call, rig: Sequence[str]) -> Arguments:
    """The options of every fit, checked before anything is read."""
    options = how.arguments()
    if isinstance(weighting := options.get("weighting", "samples"), str):
        _checks.one_of("weighting", weighting, ("samples", "runs"))
    options["rig"] = identify.machine_names("rig", rig)
    return options


def _check_groups(groups: Mapping[str, BenchSet], held: BenchSet, page: str | None, divided: str) -> None:
    """Refuse a page for several groups, and a group of which no record is left to fit."""
    if page is not None and len(groups) > 1:
        remedy = f"{divided} Each group has a page in its folder of --out."
        _checks.refuse("report", "be left out where records are fitted apart", page, remedy)
    for name, part in groups.items():
        if all(run in held.runs for run in part):
            raise ValueError(f"Option --held-out leaves no record of {name} to fit: hold out fewer.")


class Fits(NamedTuple):
    """What the fits of all groups of records share."""

    work: Job
    names: Sequence[str]
    options: Arguments
    found: Preflight
    remarks: Sequence[str]
    cross_validate: bool
    baseline: AbstractDamper | None

    def of_all(self, groups: Mapping[str, BenchSet], held_out: BenchSet) -> None:
        """Fit every group; one of which no law could be fitted is said at the end, as long as another has a fit."""
        failed = []
        for number, (name, part) in enumerate(groups.items(), 1):
            try:
                self.of_group(name, part, held_out, later=list(groups)[number:])
            except ValueError as error:
                failed.append(f"{name}: {error}")
                if len(failed) == len(groups):
                    raise
        self.work.attempts.troubles.extend(failed)

    def of_group(self, name: str, runs: BenchSet, held_out: BenchSet, later: Sequence[str]) -> None:
        """Fit one group of records and write its folder, which has the name of the group."""
        screen = self.work.screen
        screen.say()
        if name:
            screen.heading(name)
        held, fitted = (runs.where(lambda run, yes=yes: (run in held_out.runs) == yes) for yes in (True, False))
        fits = fit_laws(screen, self.names, fitted, held, **self.options)
        show(screen, fits)
        validation = self.validated(fits.comparison.best, fitted) if self.cross_validate else None
        following = f" and the fits of {', '.join(later)}" if later else ""
        with self.work.saving("Laws and tables", fits.missing + following) as draft:
            (draft / name).mkdir(exist_ok=True)
            write_fits(draft / name, fits.comparison, runs, self.work.attempts)
            write_tables(draft / name / "tables", {"preflight": self.found.table()})
        more = {"baseline": self.baseline, "remarks": self.remarks, "preflight": self.found, "validation": validation}
        self.work.page(fit_report, fits.comparison, runs=runs, failures=fits.failures, **more, part=name)
        if later:
            self.work.results.publish(f"the fits of {', '.join(later)}")

    def validated(self, best: Rung, runs: BenchSet) -> CrossValidation | None:
        """Each record predicted by this law fitted to the others; None where that fails."""
        screen, name, rig = self.work.screen, best.name, self.options["rig"]
        with self.work.attempts.part(f"The cross-validation of {name}"), screen.stage("Leaving out each record"):
            named = {name: best.result.law} if best.reduced else identify.default_ladder(tuple(runs), [name], rig=rig)
            how = {name: self.options[name] for name in identify.FitSettings.__annotations__ if name in self.options}
            how |= {"freeze": (*name_patterns("freeze", how.get("freeze", ())), *best.held), "bad_records": "keep"}
            validation = identify.cross_validate(named, tuple(runs), rig=rig, **how)
            screen.table(validation.record_table())
            return validation
        return None


def fit_laws(
    screen: Screen,
    names: Sequence[str],
    runs: BenchSet,
    held_out: BenchSet,
    *,
    rig: Sequence[str] = (identify.OFFSET,),
    keep_bad: bool = False,
    **options: Any,
) -> Fitted:
    """Fit the laws of these names on a test machine, one after the other. Ctrl-C keeps those that are finished."""
    apart = [] if keep_bad else bench.contradictions(tuple(runs), same_command=options.get("scheduled", False))
    if apart:
        words = " ".join(bench.contradictions_in_words(apart))
        raise ValueError(f"{words} With --keep-bad, they are fitted together.")
    names = names or identify.suited_laws(runs)
    title = f"Fitting {len(names)} law{'s' * (len(names) > 1)} to {len(runs)} record{'s' * (len(runs) > 1)}"
    outcomes: list[Rung | Failure] = []
    with screen.stage(title, total=len(names)) as advance:
        try:
            starts = identify.default_ladder(tuple(runs), names, rig=rig)
            options["bounds"] = bounds_in_si(
                options.get("bounds") or {}, [{"law": law, "rig": Rig()} for law in starts.values()]
            )
            for outcome in identify.fit_each(
                starts,
                tuple(runs),
                tuple(held_out),
                progress=lambda name: advance(name, len(outcomes)),
                rig=rig,
                bad_records="keep",  # they were checked
                **options,
            ):
                outcomes.append(outcome)
                if isinstance(outcome, Rung):
                    interrupt.keep()
                    screen.points([f"{outcome.name}: {outcome.error_in_words}"])
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
    screen.answer(*comparison.verdict[:lines])
    if several:
        ladder = comparison.table()
        screen.table(ladder if screen.verbose else ladder.only(columns=_BRIEF), mark=best.name)
    if not several or screen.verbose:
        screen.table(parameters_of(best))
    screen.points(fits.failures, style="red")
    points = all(run.of_points for run in best.result.runs)
    further = len(set(names_of(points=points)) - {rung.name for rung in comparison.rungs})
    if several and further and (best.doubt or best.result.left_out.of_law):
        screen.points([f"--law all tries {further} further laws"])
    warnings = best.result.warnings if screen.verbose else best.result.main_warnings
    screen.remarks([*warnings, *comparison.verdict[lines:]], style="yellow")


def write_fits(folder: Path, comparison: Comparison, runs: BenchSet, attempts: Attempts) -> None:
    """Laws and tables of the fits, each of which may fail by itself."""
    best = comparison.best.result.law
    (folder / "laws").mkdir()
    tables = {"records": records_table(tuple(runs), comparison.held_out), "ladder": comparison.table()}
    if comparison.best.by_setting:
        tables["settings"] = comparison.best.by_setting.table()
    write_tables(folder / "tables", tables)
    for rung in comparison.rungs:
        with attempts.part(f"The files of the law {rung.name}"):
            write_tables(folder / "tables", {f"parameters_{rung.name}": parameters_of(rung)})
            export.to_json(rung.result.law, folder / "laws" / f"{rung.name}.json")
            if rung.result.rig is not None:
                (folder / "machines").mkdir(exist_ok=True)
                export.to_json(rung.result.rig, folder / "machines" / f"{rung.name}.json")
    with attempts.part("best_law.json"):
        export.to_json(best, folder / "best_law.json")
    for name, law in comparison.best.laws().items():
        at = name.removeprefix(comparison.best.name).replace(" at ", "_")
        file = f"best_law_force_velocity{at}.csv"
        with attempts.part(file):
            export.to_csv(law, folder / file, fitted_velocities(comparison))
