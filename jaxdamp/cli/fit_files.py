"""The files of fitted laws: first laws and tables, then pictures, each of which may fail by itself."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jaxdamp import export, plots, rig
from jaxdamp.bench import BenchSet
from jaxdamp.cli import findings as tables
from jaxdamp.cli.attempts import Attempts
from jaxdamp.cli.fitted import Findings
from jaxdamp.cli.ranges import fitted_range_table
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Comparison
from jaxdamp.report import Report, Table


MOST_CURVES = 5  # laws in one picture of force over velocity


def write_findings(folder: Path, findings: Findings, runs: BenchSet, attempts: Attempts) -> None:
    """Laws and tables of the fits."""
    comparison, best = findings.comparison, findings.comparison.best
    (folder / "laws").mkdir()
    (folder / "tables").mkdir()
    write_table(folder, "records", tables.records_table(tuple(runs), comparison.held_out))
    write_table(folder, "ladder", findings.ladder)
    for rung in comparison.rungs:
        with attempts.part(f"The files of the law {rung.name}"):
            write_table(folder, f"parameters_{rung.name}", tables.parameter_table(rung.name, rung.result))
            export.to_json(rung.result.law, folder / "laws" / f"{rung.name}.json")
    with attempts.part("best_law.json"):
        export.to_json(best.result.law, folder / "best_law.json")
    with attempts.part("best_law_force_velocity.csv"):
        export.to_csv(best.result.law, folder / "best_law_force_velocity.csv", velocities(comparison))


def draw_findings(folder: Path, findings: Findings, report: Report, attempts: Attempts) -> None:
    """Pictures of the fits, and the report with its tables."""
    comparison, best = findings.comparison, findings.comparison.best
    report.heading("How good the laws are")
    report.text(*findings.verdict)
    if best.result.law.fitted_to is not None:
        report.table(fitted_range_table(best.result.law.fitted_to))
    report.table(findings.ladder)
    report.points(findings.failures)
    if len(comparison.rungs) > 1:
        with attempts.part("The picture ladder.png"):
            report.picture(plots.ladder(comparison), "Errors of the laws", folder / "ladder.png")
    report.heading(f"The best law: {best.name}" if len(comparison.rungs) > 1 else best.name)
    report.table(tables.parameter_table(best.name, best.result))
    report.points(best.result.warnings)
    with attempts.part("The picture best_law_loops.png"):
        caption = f"{best.name} over the fitted records"
        report.picture(plots.fit_loops(best.result), caption, folder / "best_law_loops.png")
    if comparison.held_out:
        with attempts.part("The picture best_law_held_out.png"):
            figure = plots.fit_loops(best.result, comparison.held_out)
            report.picture(figure, f"{best.name} over the held-out records", folder / "best_law_held_out.png")
    with attempts.part("The picture force_velocity.png"):
        _draw_curves(folder, comparison, report, attempts)
    for rung in comparison.rungs:
        if rung is not best:
            report.heading(rung.name)
            report.table(tables.parameter_table(rung.name, rung.result))
            report.points(rung.result.warnings)


def _draw_curves(folder: Path, comparison: Comparison, report: Report, attempts: Attempts) -> None:
    """Force over velocity of the best laws; a law without a curve is left out of the picture and named."""
    best = comparison.best
    order = sorted(comparison.rungs, key=lambda rung: rung.error)
    laws = _with_curves({rung.name: rung.result.law for rung in order}, velocities(comparison), attempts)
    drawn = dict(list(laws.items())[:MOST_CURVES])
    note = ""
    if len(laws) > len(drawn):
        rest = ", ".join(list(laws)[MOST_CURVES:])
        note = f"Drawn are the {MOST_CURVES} laws with the smallest errors. The other {len(laws) - len(drawn)}: {rest}."
    baseline = best.name if len(drawn) > 1 and best.name in drawn else None
    figure = plots.force_velocity(drawn, runs=best.result.runs, baseline=baseline, note=note)
    report.picture(figure, "Force over velocity", folder / "force_velocity.png")


def _with_curves(
    laws: Mapping[str, AbstractDamper], points: np.ndarray, attempts: Attempts
) -> dict[str, AbstractDamper]:
    """The laws, in their order, whose force at constant velocity can be computed, as many as are drawn and the rest."""
    sound: dict[str, AbstractDamper] = {}
    for name, law in laws.items():
        if len(sound) < MOST_CURVES:
            with attempts.part(f"The curve of {name} in force_velocity.png"):
                rig.quasi_static(law, points)
                sound[name] = law
        else:
            sound[name] = law
    return sound


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
