"""`jaxdamp fit`: records of a bench in, laws with tables and pictures out."""

from collections.abc import Sequence
from pathlib import Path

from jaxdamp import _checks, identify
from jaxdamp.bench import BenchSet
from jaxdamp.cli import findings as tables
from jaxdamp.cli import interrupt
from jaxdamp.cli.attempts import Attempts
from jaxdamp.cli.console import Screen
from jaxdamp.cli.fit_files import draw_findings, write_findings
from jaxdamp.cli.fitted import Findings
from jaxdamp.cli.interrupt import Interrupted
from jaxdamp.cli.options import ReadOptions, decisions, law_names, split
from jaxdamp.cli.ranges import fitted_range_table
from jaxdamp.cli.residual import Shares, residual_shares
from jaxdamp.cli.results import results_folder
from jaxdamp.identify import Comparison, Failure, Rung
from jaxdamp.report import Report


def run_fit(
    screen: Screen,
    files: Sequence[Path],
    options: ReadOptions,
    *,
    laws: Sequence[str] = ("all",),
    held_out: Sequence[str] = (),
    weighting: str = "samples",
    out: Path,
    replace: bool = False,
) -> Comparison:
    """Read records, fit laws, say how good they are, and write all of it into a folder.

    Laws and tables are in the folder before the first picture is drawn.
    """
    names = law_names(laws)
    _checks.one_of("weighting", weighting, ("samples", "runs"))
    with results_folder(out, "fit", replace=replace) as results:
        with screen.stage("Reading the records"):
            runs = options.read(files)
        fitted, held = split(runs, held_out)
        screen.table(tables.records_table(tuple(runs), tuple(held)))
        screen.points(decisions(tuple(runs)))
        screen.say()
        findings = fit_laws(screen, names, fitted, held, weighting)
        show(screen, findings)
        attempts = Attempts()
        with interrupt.saving(), screen.stage("Laws and tables"):
            write_findings(results.draft, findings, runs, attempts)
            results.publish(findings.missing)
        report = Report("Damper laws fitted to bench records")
        report.heading("Records")
        report.table(tables.records_table(tuple(runs), tuple(held)))
        report.points(decisions(tuple(runs)))
        with screen.stage("Pictures and report"):
            draw_findings(results.draft, findings, report, attempts)
            report.points(attempts.troubles)
            report.write(results.draft / "report.html")
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return findings.comparison


def fit_laws(
    screen: Screen, names: Sequence[str], runs: BenchSet, held_out: BenchSet, weighting: str = "samples"
) -> Findings:
    """Fit the laws of these names, one after the other. Ctrl-C keeps those that are finished.

    Raises:
        ValueError: not one law could be fitted.
    """
    title = f"Fitting {len(names)} law{'s' * (len(names) > 1)} to {len(runs)} record{'s' * (len(runs) > 1)}"
    outcomes: list[Rung | Failure] = []
    shares: dict[str, Shares] = {}
    with screen.stage(title, total=len(names)) as advance:
        try:
            starts = identify.default_ladder(tuple(runs), names)
            for outcome in identify.fit_each(
                starts,
                tuple(runs),
                tuple(held_out),
                progress=lambda name: advance(name, len(outcomes)),
                weighting=weighting,
            ):
                if isinstance(outcome, Rung):
                    shares[outcome.name] = residual_shares(outcome.result)
                    interrupt.keep()
                outcomes.append(outcome)
        except Interrupted:
            if not shares:
                raise
    done = {outcome.name for outcome in outcomes}
    comparison = Comparison.of(outcomes, tuple(held_out))
    return Findings(comparison, shares, tuple(name for name in names if name not in done))


def show(screen: Screen, findings: Findings) -> None:
    """The fits at the terminal: the ladder, the parameters of the best law, and what to think of them."""
    best = findings.comparison.best
    screen.table(findings.ladder, mark=best.name)
    screen.points(findings.failures, style="red")
    screen.table(tables.parameter_table(best.name, best.result))
    if best.result.law.fitted_to is not None:
        screen.table(fitted_range_table(best.result.law.fitted_to))
    screen.say(" ".join(findings.verdict))
    screen.points(best.result.warnings, style="yellow")
