"""A page on laws fitted to records: errors, parameters, loops and curves, what the machine adds, doubts."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Unpack

import numpy as np

from jaxdamp import plots, rig
from jaxdamp._settings import part, with_defaults
from jaxdamp._tables import Table
from jaxdamp._words import in_words
from jaxdamp.bench import BenchRun, Preflight
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import (
    Band,
    Comparison,
    CrossValidation,
    FitResult,
    Rung,
    VehicleComparison,
    rounded,
    without_machine,
)
from jaxdamp.parameters import parameters
from jaxdamp.report.benches import add_records, fitted_range_table
from jaxdamp.report.page import PAGE, Page, Report


def machine_sentences(result: FitResult) -> tuple[str, ...]:
    """What the test machine adds to the force, and what it was taken not to add."""
    if result.rig is None:
        return ("No test machine was fitted: all of the measured force counts as the damper's.",)
    machine = {e.name.removeprefix("rig."): e for e in result.parameters if e.name.startswith("rig.")}
    texts = [(name, *rounded(e.value, e.standard_error), e.unit) for name, e in machine.items()]
    fitted = [f"{name.replace('_', ' ')} {value} ± {error} {unit}".rstrip() for name, value, error, unit in texts]
    absent = [p.path.replace("_", " ") for p in parameters(result.rig) if not np.any(np.asarray(p.value))]
    return (
        f"Fitted together with the law, as effects of the test machine: {', '.join(fitted) or 'none that was free'}.",
        f"Taken as absent: {', '.join(absent)}. An absent effect that the residual shows is named below.",
    )


def add_findings(report: Report, result: FitResult) -> None:
    """The test machine and the warnings of a fit; without warnings, what that means."""
    report.text(*machine_sentences(result))
    report.points(result.warnings)
    if not result.warnings:
        report.text(
            "No warnings: the search converged, the records determine every number, no effect of the machine that was"
            " left out shows in the residual, and the intervals need no correction for correlated residuals."
        )


MOST_CURVES = 5  # laws in one picture of force over velocity
BASELINE = "baseline"  # name of a law to compare with
BAND_STEP = 10  # points of a curve from one of its band to the next


class FitPage(Page, total=False):
    """Keywords of `fit_report` and `chain_report`: those of `Page`, and these.

    Arguments:
        runs: the records in the order of the page; the fitted ones and those held out, if left out.
        remarks: on the records.
        preflight: of `bench.preflight`.
        baseline: another law, drawn over the curves and scored on the same records.
    """

    runs: Sequence[BenchRun] | None
    remarks: Sequence[str]
    preflight: Preflight | None
    baseline: AbstractDamper | None


FIT_PAGE: FitPage = {**PAGE, "runs": None, "remarks": (), "preflight": None, "baseline": None}


@with_defaults(FIT_PAGE, title="Damper laws fitted to bench records")
def fit_report(
    comparison: Comparison,
    *,
    failures: Sequence[str] | None = None,
    validation: CrossValidation | None = None,
    **page: Unpack[FitPage],
) -> Report:
    """A page on the fits of several laws, or of one.

    Arguments:
        comparison: the fits, of `identify.compare`.
        failures: sentences on laws without a fit, instead of those of the comparison.
        validation: of `identify.cross_validate`.
        page: `title`, `folder`, `attempts`, `runs`, `remarks`, `preflight`, `baseline`, all optional (see `FitPage`).

    >>> from jaxdamp import bench, identify, report
    >>> from jaxdamp.dampers import Bilinear, Linear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.01, 2.0))
    >>> comparison = identify.compare({"linear": Linear, "bilinear": Bilinear}, runs)
    >>> page = report.fit_report(comparison)  # page.write("fit.html")
    >>> "Recommended: bilinear" in page.to_html()
    True
    """
    report, runs, preflight = Report(**part(page, PAGE)), page["runs"], page["preflight"]
    baseline = page["baseline"]
    best, *others = fit_verdict(report, comparison, baseline)
    report.verdict(best, f"{preflight.summary}." if preflight and preflight.records else "", more=others)
    records = (*comparison.best.result.runs, *comparison.held_out) if runs is None else tuple(runs)
    if not all(run.of_points for run in records):  # a table has no cycles to show
        report.sheet(lambda: comparison.plot("sheet", baseline=baseline), comparison.verdict[0], "damper_sheet")
    add_records(report, records, comparison.held_out, page["remarks"], preflight)
    add_fits(report, comparison, failures, baseline)
    if validation is not None:
        best_law = validation.best
        report.heading("Records predicted by fits without them")
        report.text(
            f"Each record was left out once and predicted by {best_law} fitted to the others: mean fit"
            f" {validation.fit_percent(best_law):.1f} %, RMSE {validation.rmse(best_law):.4g} N."
        )
        report.table(validation.record_table())
    return report


def fit_verdict(report: Report, comparison: Comparison, baseline: AbstractDamper | None = None) -> tuple[str, ...]:
    """Sentences on the errors of the laws, and of a baseline on the same records and the same test machine.

    Arguments:
        report: the page, which lists a baseline that cannot be computed on the records.
        comparison: the fits.
        baseline: another law.
    """
    best, others = comparison.best, ()
    if baseline is not None:
        with report.part("The errors of the baseline"):
            records = comparison.held_out or best.result.runs
            percent, rmse, _ = dataclasses.replace(best.result, law=baseline, record_laws=()).score(records)
            factor = f", {rmse / best.error:.1f} times that of {best.name}" if best.error else ""
            others = (f"Baseline on the same records: RMSE {rmse:.4g} N (fit {percent:.1f} %){factor}.",)
    return *comparison.verdict, *others


def add_fits(
    report: Report,
    comparison: Comparison,
    failures: Sequence[str] | None = None,
    baseline: AbstractDamper | None = None,
    *,
    others: bool = True,
) -> None:
    """The sections of a page on fits: errors of the laws, the best one, the others.

    Arguments:
        report: the page.
        comparison: the fits, of `identify.compare`.
        failures: sentences on laws without a fit, instead of those of the comparison.
        baseline: another law to draw.
        others: the parameters of the other laws too; `add_other_fits` adds them later.
    """
    best, several = comparison.best, len(comparison.rungs) > 1
    moved = not all(run.of_points for run in best.result.runs)  # a table has no loops
    report.heading("How good the laws are")
    if best.result.law.fitted_to is not None:
        report.table(fitted_range_table(best.result.law.fitted_to))
    report.table(comparison.table())
    report.points(failure_sentences(comparison) if failures is None else failures)
    if several:
        report.picture(lambda: plots.ladder(comparison), "Errors of the laws", "ladder.png")
        if moved:
            report.picture(lambda: comparison.plot("loops"), "One record and each law", "loops_by_law.png")
    report.heading(f"The recommended law: {best.name}" if several else best.name)
    report.table(parameters_of(best))
    if best.judged_on:
        report.table(best.scores_table())
    add_findings(report, best.result)
    loops = functools.partial(plots.fit_loops, best.result, name=best.name)
    if moved:
        report.picture(loops, f"{best.name} over the fitted records", "best_law_loops.png")
    if comparison.held_out:
        caption = f"{best.name} over the held-out records"
        report.picture(lambda: loops(comparison.held_out), caption, "best_law_held_out.png")
    if best.by_setting:
        report.table(best.by_setting.table())
        for left in best.by_setting.between:
            caption = f"{best.name} interpolated to {left.setting:g}, over records that it was not fitted to"
            report.picture(left.plot, caption, f"best_law_interpolated_to_{left.setting:g}.png")
    _add_curves(report, comparison, baseline)
    if others:
        add_other_fits(report, comparison)


def add_other_fits(report: Report, comparison: Comparison) -> None:
    """The sections of a page on the laws that are not the best: parameters and warnings.

    Arguments:
        report: the page.
        comparison: of `identify.compare`.
    """
    for rung in comparison.rungs:
        if rung is not comparison.best:
            report.heading(rung.name)
            report.table(parameters_of(rung))
            report.points(rung.result.warnings)


def parameters_of(rung: Rung) -> Table:
    """The parameters of one law of a comparison, under its name there.

    Arguments:
        rung: a law of the comparison.
    """
    return rung.result.table(title=f"Parameters of {rung.name}")


def failure_sentences(comparison: Comparison | VehicleComparison) -> list[str]:
    """The laws or vehicles without a fit, and why.

    Arguments:
        comparison: of `identify.compare`.
    """
    return [f"{failure.name} could not be fitted. {failure.reason}" for failure in comparison.failed]


def fitted_velocities(comparison: Comparison) -> np.ndarray:
    """Velocities [m/s] for a force-velocity table: the range that was fitted, and zero.

    Arguments:
        comparison: of `identify.compare`.
    """
    runs = comparison.best.result.runs
    lower = min(min(float(run.velocity.min()) for run in runs), 0.0)
    upper = max(max(float(run.velocity.max()) for run in runs), 0.0)
    points = np.linspace(lower, upper, 401)  # as many as in the pictures, for which the laws are compiled already
    points[np.argmin(np.abs(points))] = 0.0
    return points


def _add_curves(report: Report, comparison: Comparison, baseline: AbstractDamper | None) -> None:
    """Force over velocity of the best laws; a law without a curve is left out of the picture and named.

    The best law is blue, the baseline dashed and black.
    """
    best = comparison.best
    order = sorted(comparison.rungs, key=lambda rung: (rung is not best, rung.error))
    points = fitted_velocities(comparison)
    laws = _with_curves(report, {name: law for rung in order for name, law in rung.laws().items()}, points)
    bands: dict[str, Band] = {}
    with report.part(f"The band of {best.name} in force_velocity.png"):
        bands |= {best.name: best.result.band(points[::BAND_STEP])} if best.name in laws else {}
    drawn = dict(list(laws.items())[:MOST_CURVES])
    notes = []
    if len(laws) > len(drawn):
        notes = [f"Not drawn, with larger errors: {', '.join(map(in_words, list(laws)[MOST_CURVES:]))}."]
    if baseline is not None:
        drawn |= _with_curves(report, {BASELINE: baseline}, points)
    machine, runs = best.result.rig, best.result.runs
    static = {name: rung.result.static_force for rung in order for name in rung.laws() if name in drawn}
    if machine is not None and (friction := float(machine.friction)):
        notes += [f"The measured points hold the friction of the machine, {friction:.4g} N, the laws do not."]
    without_force = None if machine is None else dataclasses.replace(machine, force_offset=0.0, gas_force=0.0)
    report.picture(
        lambda: plots.force_velocity(
            drawn,
            runs=without_machine(without_force, runs),
            baseline=BASELINE if BASELINE in drawn else None,
            note=" ".join(notes),
            bands=bands,
            static_force=static,
        ),
        "Force over velocity",
        "force_velocity.png",
    )


def _with_curves(report: Report, laws: Mapping[str, AbstractDamper], points: np.ndarray) -> dict[str, AbstractDamper]:
    """The laws to draw, whose force at constant velocity can be computed, and the rest."""
    sound: dict[str, AbstractDamper] = {}
    for name, law in laws.items():
        with report.part(f"The curve of {name} in force_velocity.png"):
            if len(sound) < MOST_CURVES:
                rig.quasi_static(law, points)
            sound[name] = law
    return sound
