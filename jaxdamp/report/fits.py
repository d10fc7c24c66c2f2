"""A page on laws fitted to records: errors, parameters, loops and curves."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from jaxdamp import plots, rig
from jaxdamp._tables import Cell, Column, Table
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Band, Comparison, CrossValidation, Rung, without_machine
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.fit_findings import add_findings, add_validation
from jaxdamp.report.page import Report
from jaxdamp.report.ranges import fitted_range_table


MOST_CURVES = 5  # laws in one picture of force over velocity
BAND_STEP = 10  # points of a curve from one of its band to the next


def fit_report(
    comparison: Comparison,
    *,
    title: str = "Damper laws fitted to bench records",
    runs: Iterable[BenchRun] | None = None,
    remarks: Sequence[str] = (),
    failures: Sequence[str] | None = None,
    folder: Path | None = None,
    attempts: Attempts | None = None,
    validation: CrossValidation | None = None,
) -> Report:
    """A page on the fits of several laws, or of one.

    Arguments:
        comparison: the fits, of `identify.compare`.
        title: of the page.
        runs: the records in the order of the page; the fitted ones and those held out, if left out.
        remarks: on the records.
        failures: sentences on laws without a fit, instead of those of the comparison.
        folder: folder for the pictures as separate files; without it they are only in the page.
        attempts: collects parts that fail; a new one if left out.
        validation: of `identify.cross_validate`.

    >>> from jaxdamp import bench, identify, report
    >>> from jaxdamp.dampers import Bilinear, Linear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.01, 2.0))
    >>> comparison = identify.compare({"linear": Linear, "bilinear": Bilinear}, runs)
    >>> page = report.fit_report(comparison)  # page.write("fit.html")
    >>> "Smallest error on the fitted records: bilinear" in page.to_html()
    True
    """
    report = Report(title, folder, attempts)
    report.heading("Records")
    records = (*comparison.best.result.runs, *comparison.held_out) if runs is None else tuple(runs)
    report.table(records_table(records, comparison.held_out))
    report.points(remarks)
    add_fits(report, comparison, failures)
    if validation is not None:
        add_validation(report, validation)
    return report


def add_fits(report: Report, comparison: Comparison, failures: Sequence[str] | None = None) -> None:
    """The sections of a page on fits: errors of the laws, the best one, the others."""
    best, several = comparison.best, len(comparison.rungs) > 1
    report.heading("How good the laws are")
    report.text(*comparison.verdict)
    if best.result.law.fitted_to is not None:
        report.table(fitted_range_table(best.result.law.fitted_to))
    report.table(comparison.table())
    report.points(failure_sentences(comparison) if failures is None else failures)
    if several:
        report.picture(lambda: plots.ladder(comparison), "Errors of the laws", "ladder.png")
    report.heading(f"The best law: {best.name}" if several else best.name)
    report.table(parameters_of(best))
    add_findings(report, best.result)
    report.picture(lambda: plots.fit_loops(best.result), f"{best.name} over the fitted records", "best_law_loops.png")
    if comparison.held_out:
        caption = f"{best.name} over the held-out records"
        report.picture(lambda: plots.fit_loops(best.result, comparison.held_out), caption, "best_law_held_out.png")
    if best.by_setting:
        report.table(best.by_setting.table())
        for left in best.by_setting.between:
            caption = f"{best.name} interpolated to {left.setting:g}, over records that it was not fitted to"
            report.picture(left.plot, caption, f"best_law_interpolated_to_{left.setting:g}.png")
    _add_curves(report, comparison)
    for rung in comparison.rungs:
        if rung is not best:
            report.heading(rung.name)
            report.table(parameters_of(rung))
            report.points(rung.result.warnings)


def parameters_of(rung: Rung) -> Table:
    """The parameters of one law of a comparison, under its name there."""
    return rung.result.table(title=f"Parameters of {rung.name}")


def failure_sentences(comparison: Comparison) -> list[str]:
    """The laws without a fit, and why."""
    return [f"{failure.name} could not be fitted. {failure.reason}" for failure in comparison.failed]


def records_table(runs: Sequence[BenchRun], held_out: Sequence[BenchRun] = ()) -> Table:
    """Records with their figures, and which of them are held out."""
    columns = [Column("record"), Column("rate", "Hz"), Column("motion", "Hz", ".3g"), Column("0-peak", "mm", ".3g")]
    columns += [Column("peak velocity", "m/s", ".3g"), Column("least force", "N", ".0f")]
    columns += [Column("largest force", "N", ".0f"), Column("work per cycle", "J", ".3g"), Column("cycles")]
    columns += [Column("use")] if held_out else []
    names = {run.name for run in held_out}
    rows: list[tuple[Cell, ...]] = []
    for run in runs:
        row: tuple[Cell, ...] = (run.name, run.sampling_rate, run.frequency, 1e3 * run.amplitude, run.peak_velocity)
        row += (float(run.force.min()), float(run.force.max()), run.work_per_cycle, run.cycles)
        rows.append(row + ("held out" if run.name in names else "fitted",) * bool(held_out))
    return Table("Records (stroke and velocity positive in rebound)", tuple(columns), tuple(rows))


def fitted_velocities(comparison: Comparison) -> np.ndarray:
    """Velocities [m/s] for a force-velocity table: the range that was fitted, and zero."""
    runs = comparison.best.result.runs
    lower = min(min(float(run.velocity.min()) for run in runs), 0.0)
    upper = max(max(float(run.velocity.max()) for run in runs), 0.0)
    points = np.linspace(lower, upper, 401)  # as many as in the pictures, for which the laws are compiled already
    points[np.argmin(np.abs(points))] = 0.0
    return points


def _add_curves(report: Report, comparison: Comparison) -> None:
    """Force over velocity of the best laws; a law without a curve is left out of the picture and named."""
    best = comparison.best
    order = sorted(comparison.rungs, key=lambda rung: rung.error)
    points = fitted_velocities(comparison)
    laws = _with_curves(report, {name: law for rung in order for name, law in rung.laws().items()}, points)
    bands: dict[str, Band] = {}
    with report.part(f"The band of {best.name} in force_velocity.png"):
        bands |= {best.name: best.result.band(points[::BAND_STEP])} if best.name in laws else {}
    drawn = dict(list(laws.items())[:MOST_CURVES])
    note = ""
    if len(laws) > len(drawn):
        rest = ", ".join(list(laws)[MOST_CURVES:])
        note = f"Drawn are the {MOST_CURVES} laws with the smallest errors. The other {len(laws) - len(drawn)}: {rest}."
    baseline = best.name if len(drawn) > 1 and best.name in drawn else None
    report.picture(
        lambda: plots.force_velocity(
            drawn, runs=without_machine(best.result.rig, best.result.runs), baseline=baseline, note=note, bands=bands
        ),
        "Force over velocity",
        "force_velocity.png",
    )


def _with_curves(report: Report, laws: Mapping[str, AbstractDamper], points: np.ndarray) -> dict[str, AbstractDamper]:
    """The laws to draw, whose force at constant velocity can be computed, and the rest."""
    sound: dict[str, AbstractDamper] = {}
    for name, law in laws.items():
        if len(sound) < MOST_CURVES:
            with report.part(f"The curve of {name} in force_velocity.png"):
                rig.quasi_static(law, points)
                sound[name] = law
        else:
            sound[name] = law
    return sound
