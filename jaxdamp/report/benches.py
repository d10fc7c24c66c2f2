"""Pages and sections on bench records without a law, on their ranges, and on a force-velocity table."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Unpack

from jaxdamp._display import display
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Cell, Column, Compared, Table, comparison_table, percent_change
from jaxdamp.bench import BenchRun, Evaluation, ForceVelocityTable, LimitCheck, Preflight, evaluate
from jaxdamp.dampers import AbstractDamper, FittedRange
from jaxdamp.identify import predict_runs
from jaxdamp.report.page import PAGE, Attempts, Page, Report
from jaxdamp.simulation import Response


def add_records(
    report: Report,
    runs: Sequence[BenchRun],
    held_out: Sequence[BenchRun] = (),
    remarks: Sequence[str] = (),
    preflight: Preflight | None = None,
) -> None:
    """The section of a page on bench records.

    Arguments:
        report: the page.
        runs: the records.
        held_out: those of them that are not fitted.
        remarks: what was done to the records when they were read, in words.
        preflight: of `bench.preflight`.
    """
    report.heading("Records")
    report.table(records_table(runs, held_out))
    report.points(remarks)
    if preflight is not None and preflight.findings:
        report.heading("Preflight")
        report.picture(preflight.plot, "What was found in which record", "preflight.png")
        report.points(preflight.sentences())


def records_table(runs: Sequence[BenchRun], held_out: Sequence[BenchRun] = ()) -> Table:
    """Records with their figures, and which of them are held out.

    Arguments:
        runs: the records.
        held_out: those of them that are not fitted.
    """
    columns = [Column("record"), Column("sampling", "Hz")]
    columns += [Column("frequency", "Hz", ".3g"), Column("amplitude", "mm", ".3g")]
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


def fitted_range_table(covered: FittedRange) -> Table:
    """The range of the records that laws were fitted to.

    Arguments:
        covered: `law.fitted_to`.
    """
    columns = (Column("quantity"), Column("unit"), Column("lowest", spec=".4g"), Column("highest", spec=".4g"))
    rows = tuple((q.name, q.unit or "–", *q.limits) for q in covered.known())
    return Table("Range of the fitted records; beyond it the laws are extrapolated", columns, rows)


def range_use_table(responses: Mapping[str, Response]) -> Table | None:
    """The motion of each damper compared with the fitted range of its law; no table if no law has a range.

    Arguments:
        responses: by name.
    """
    columns = [Column("law"), Column("damper"), Column("quantity"), Column("unit")]
    columns += [Column(name, spec=".3g") for name in ("lowest", "highest", "fitted from", "fitted to", "times")]
    columns += [Column("time outside", "%", ".0f")]
    rows: list[tuple[Cell, ...]] = []
    for law, response in responses.items():
        for damper, uses in response.range_use().items():
            for use in uses:
                share = None if use.share is None else 100 * use.share
                ends = (*use.used, *use.fitted, use.times, share)
                rows.append((law, damper.replace("_", " "), use.quantity, use.unit or "–", *ends))
    if not rows:
        return None
    return Table("Use of the dampers beside the records of their laws", tuple(columns), tuple(rows))


@with_defaults(PAGE, title="Damper records")
def bench_report(
    evaluation: Evaluation,
    preflight: Preflight | None = None,
    limits: LimitCheck | None = None,
    *,
    baseline: Evaluation | AbstractDamper | None = None,
    remarks: Sequence[str] = (),
    **page: Unpack[Page],
) -> Report:
    """A page on records: preflight, limits, forces, rates, gas force and friction, loops.

    Arguments:
        evaluation: of `bench.evaluate`.
        preflight: of `bench.preflight`.
        limits: of `evaluation.check`.
        baseline: another evaluation to draw beneath, or a law, which is put on the bench with the same motions.
        remarks: on the records.
        page: `title`, `folder` and `attempts`, all optional (see `Page`).

    >>> from jaxdamp import bench, report
    >>> from jaxdamp.dampers import Bilinear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.02, 2.0))
    >>> page = report.bench_report(bench.evaluate(runs), bench.preflight(runs))  # page.write("bench.html")
    >>> "Forces at stated velocities" in page.to_html()
    True
    """
    report = Report(**page)
    if isinstance(baseline, AbstractDamper):
        baseline = law_evaluation(baseline, evaluation)
    sentences = bench_verdict(evaluation, preflight, limits)
    report.verdict(*sentences)
    doubts = evaluation.notes if preflight is None else [*preflight.sentences(), *evaluation.notes]
    more = {"sentence": sentences[0] if sentences else "", "warnings": doubts, "limits": limits}
    report.sheet(lambda: evaluation.plot("sheet", **more), more["sentence"], "damper_sheet")
    add_records(report, evaluation.runs, (), remarks, preflight)
    if preflight is not None and preflight.findings:
        report.table(preflight.table())
    if limits is not None:
        report.heading("Limits")
        report.table(limits.table())
    add_evaluation(report, evaluation, baseline, limits)
    return report


def add_evaluation(
    report: Report, evaluation: Evaluation, baseline: Evaluation | None = None, limits: LimitCheck | None = None
) -> None:
    """The section of a page on an evaluation: notes, pictures, tables, gas force and friction.

    Arguments:
        report: the page.
        evaluation: of `bench.evaluate`.
        baseline: another evaluation to draw beneath.
        limits: of `evaluation.check`, to be drawn.
    """
    report.heading("Evaluation")
    report.points(evaluation.notes)
    report.picture(
        lambda: evaluation.plot(baseline=baseline, limits=limits),
        "Mean cycles and forces over velocity",
        "evaluation.png",
    )
    for name, table in evaluation.tables().items():
        if name != "measurements" and table.rows:
            report.table(table)
        if name == "velocities" and baseline is not None:
            report.table(baseline_table(evaluation, baseline))
    for number, separated in enumerate(evaluation.gas_and_friction.values()):
        report.picture(
            separated.plot, f"Gas force and friction of {separated.record}", f"gas_and_friction_{number + 1}.png"
        )


def bench_verdict(
    evaluation: Evaluation, preflight: Preflight | None = None, limits: LimitCheck | None = None
) -> list[str]:
    """Sentences on limits, forces at the largest stated velocity, and oddities.

    Arguments:
        evaluation: of `bench.evaluate`.
        preflight: of `bench.preflight`.
        limits: of `evaluation.check`.
    """
    sentences = []
    if limits is not None:
        passed = [measured is not None and limit.kept_by(measured.value) for limit, measured in limits.results]
        sentences.append(f"Limits: {sum(passed)} of {len(passed)} are kept{'' if all(passed) else ': NOT PASSED'}.")
    if evaluation.velocities:
        velocity = max(evaluation.velocities)
        for setting in evaluation.settings:
            where = f"Setting {setting}, at" if setting else "At"
            words = _forces_in_words(evaluation, setting, velocity)
            sentences += [f"{where} {velocity:.4g} m/s: {words}."] if words else []
    return sentences + ([f"{preflight.summary}."] if preflight else [])


def _forces_in_words(evaluation: Evaluation, setting: str, velocity: float) -> str:
    """The forces of a setting at a velocity without gas force and zero error of the load cell, where these are known.

    They would shift the ratio of rebound to compression. Newtons, which the page shows in its unit, with its sign.
    """
    sign = math.copysign(1.0, display().of("N", signed=True).factor)
    separated = evaluation.gas_and_friction.get(setting)
    static = 0.0 if separated is None else separated.gas_force
    forces = {}
    for side in ("rebound", "compression"):
        measured = evaluation.get(f"{side} force", setting=setting, velocity=velocity)
        shown = dataclasses.replace(measured, value=sign * (measured.value - static)).cell
        forces |= {} if shown is None else {side: shown}
    words = " and ".join(f"{Column('').text(force)} N in {side}" for side, force in forces.items())
    if len(forces) == 2 and float(forces["compression"]):
        words += f", ratio {abs(float(forces['rebound']) / float(forces['compression'])):.2f}"
    off = f", without the static force of {round(sign * static)} N" if static else ", gas force included"
    return words + off if words else ""


def law_evaluation(law: AbstractDamper, evaluation: Evaluation) -> Evaluation:
    """The evaluation of a law on the bench with the motions of measured records.

    Arguments:
        law: the damper law.
        evaluation: of the records.
    """
    forces = predict_runs(law, evaluation.runs)
    runs = [dataclasses.replace(run, force=force) for run, force in zip(evaluation.runs, forces, strict=True)]
    setting = {run.name: name for name, group in evaluation.settings.items() for run in group}
    return evaluate(runs, velocities=evaluation.velocities, method=evaluation.method, by=lambda run: setting[run.name])


def baseline_table(evaluation: Evaluation, baseline: Evaluation) -> Table:
    """Forces at stated velocities beside those of a baseline, for each setting that both have.

    Arguments:
        evaluation: of the records.
        baseline: another evaluation; one with a single setting is compared with every setting.
    """
    rows = []
    names = {(m.quantity, m.velocity, m.setting): m for m in baseline.measurements}
    only = next(iter(baseline.settings)) if len(baseline.settings) == 1 else None
    for m in evaluation.measurements:
        other = names.get((m.quantity, m.velocity, m.setting if only is None else only))
        if m.velocity is not None and other is not None:
            values: tuple[Cell, ...] = (other.cell, m.cell)
            change = percent_change(other.value, m.value) if None not in values else None
            more = (m.setting,) if len(evaluation.settings) > 1 else ()
            rows.append(Compared(f"{m.quantity} at {m.velocity:.4g} m/s", m.unit, values, change, more))
    title, sides = "Forces beside the baseline", ("baseline", "measured")
    setting = (Column("setting"),) if len(evaluation.settings) > 1 else ()
    return comparison_table(title, "quantity", sides, rows, setting)


def table_report(table: ForceVelocityTable, *, folder: Path | None = None, attempts: Attempts | None = None) -> Report:
    """A page on a force-velocity table.

    Arguments:
        table: of `bench.read_table`.
        folder: folder for the pictures as separate files; without it they are only in the page.
        attempts: collects parts that fail; a new one if left out.
    """
    page = Report(f"Force-velocity table {table.name}", folder, attempts)
    count = len(table.curves)
    page.verdict(f"{count} setting{'s' * (count > 1)}; the laws go through the points, nothing was fitted.")
    page.heading("Force over velocity")
    page.picture(table.plot, "Forces of all settings", "family.png")
    page.table(table.table())
    page.heading("What was decided")
    page.points(table.notes)
    return page
