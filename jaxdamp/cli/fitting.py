"""`jaxdamp fit`: records of a bench in, laws with tables and pictures out."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jaxdamp import export, identify, plots
from jaxdamp.bench import BenchSet
from jaxdamp.cli import findings as tables
from jaxdamp.cli.console import Screen
from jaxdamp.cli.options import ReadOptions, decisions, law_names, split
from jaxdamp.cli.ranges import fitted_range_table
from jaxdamp.cli.residual import Shares, residual_shares
from jaxdamp.cli.results import results_folder, written
from jaxdamp.identify import Comparison
from jaxdamp.report import Report, Table


def run_fit(
    screen: Screen,
    files: Sequence[Path],
    options: ReadOptions,
    *,
    laws: Sequence[str] = ("all",),
    held_out: Sequence[str] = (),
    weighting: str = "samples",
    out: Path,
    force: bool = False,
) -> Comparison:
    """Read records, fit laws, say how good they are, and write all of it into a folder."""
    names = law_names(laws)
    with results_folder(out, "fit", force=force) as folder:
        with screen.stage("Reading the records"):
            runs = options.read(files)
        fitted, held = split(runs, held_out)
        screen.table(tables.records_table(tuple(runs), tuple(held)))
        screen.points(decisions(tuple(runs)))
        screen.say()
        findings = fit_laws(screen, names, fitted, held, weighting)
        show(screen, findings)
        report = Report("Damper laws fitted to bench records")
        report.heading("Records")
        report.table(tables.records_table(tuple(runs), tuple(held)))
        report.points(decisions(tuple(runs)))
        with screen.stage("Pictures, tables and laws"):
            write_findings(folder, findings, runs, report)
            report.write(folder / "report.html")
        files_written = written(folder)
    screen.files(out, files_written)
    return findings.comparison


@dataclass(frozen=True)
class Findings:
    """Fits of several laws with what their errors are made of."""

    comparison: Comparison
    shares: dict[str, Shares]

    @property
    def ladder(self) -> Table:
        """The laws and their errors."""
        return tables.ladder_table(self.comparison, self.shares)

    @property
    def verdict(self) -> list[str]:
        """How good they are, in words."""
        return tables.verdict(self.comparison, self.shares)


def fit_laws(
    screen: Screen, names: Sequence[str], runs: BenchSet, held_out: BenchSet, weighting: str = "samples"
) -> Findings:
    """Fit the laws of these names."""
    title = f"Fitting {len(names)} law{'s' * (len(names) > 1)} to {len(runs)} record{'s' * (len(runs) > 1)}"
    done = itertools.count()
    with screen.stage(title, total=len(names)) as advance:
        starts = identify.default_ladder(tuple(runs), names)
        comparison = identify.compare(
            starts,
            tuple(runs),
            held_out=tuple(held_out),
            progress=lambda name: advance(name, next(done)),
            weighting=weighting,
        )
        shares = {rung.name: residual_shares(rung.result) for rung in comparison.rungs}
    return Findings(comparison, shares)


def show(screen: Screen, findings: Findings) -> None:
    """The fits at the terminal: the ladder, the parameters of the best law, and what to think of them."""
    best = findings.comparison.best
    screen.table(findings.ladder, mark=best.name)
    screen.table(tables.parameter_table(best.name, best.result))
    if best.result.law.fitted_to is not None:
        screen.table(fitted_range_table(best.result.law.fitted_to))
    screen.say(" ".join(findings.verdict))
    screen.points(best.result.warnings, style="yellow")


def write_findings(folder: Path, findings: Findings, runs: BenchSet, report: Report) -> None:
    """Laws, tables and pictures of the fits."""
    comparison, best = findings.comparison, findings.comparison.best
    (folder / "laws").mkdir()
    (folder / "tables").mkdir()
    write_table(folder, "records", tables.records_table(tuple(runs), comparison.held_out))
    write_table(folder, "ladder", findings.ladder)
    for rung in comparison.rungs:
        export.to_json(rung.result.law, folder / "laws" / f"{rung.name}.json")
        write_table(folder, f"parameters_{rung.name}", tables.parameter_table(rung.name, rung.result))
    export.to_json(best.result.law, folder / "best_law.json")
    export.to_csv(best.result.law, folder / "best_law_force_velocity.csv", velocities(comparison))
    report.heading("How good the laws are")
    report.text(*findings.verdict)
    if best.result.law.fitted_to is not None:
        report.table(fitted_range_table(best.result.law.fitted_to))
    report.table(findings.ladder)
    if len(comparison.rungs) > 1:
        report.picture(plots.ladder(comparison), "Errors of the laws", folder / "ladder.png")
    report.heading(f"The best law: {best.name}" if len(comparison.rungs) > 1 else best.name)
    report.table(tables.parameter_table(best.name, best.result))
    report.points(best.result.warnings)
    report.picture(plots.fit_loops(best.result), f"{best.name} over the fitted records", folder / "best_law_loops.png")
    if comparison.held_out:
        caption = f"{best.name} over the held-out records"
        report.picture(plots.fit_loops(best.result, comparison.held_out), caption, folder / "best_law_held_out.png")
    laws = {rung.name: rung.result.law for rung in comparison.rungs}
    figure = plots.force_velocity(laws, runs=best.result.runs, baseline=best.name if len(laws) > 1 else None)
    report.picture(figure, "Force over velocity", folder / "force_velocity.png")
    for rung in comparison.rungs:
        if rung is not best:
            report.heading(rung.name)
            report.table(tables.parameter_table(rung.name, rung.result))
            report.points(rung.result.warnings)


def write_table(folder: Path, name: str, table: Table) -> None:
    """One table as CSV."""
    (folder / "tables" / f"{name}.csv").write_text(table.to_csv(), encoding="utf-8")


def velocities(comparison: Comparison) -> np.ndarray:
    """Velocities [m/s] for a force-velocity table: the range that was fitted, and zero."""
    runs = comparison.best.result.runs
    lower = min(min(float(run.velocity.min()) for run in runs), 0.0)
    upper = max(max(float(run.velocity.max()) for run in runs), 0.0)
    points = np.linspace(lower, upper, 401)  # as many as in the pictures, for which the laws are compiled already
    points[np.argmin(np.abs(points))] = 0.0
    return points
