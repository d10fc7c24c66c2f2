"""Sections of a page on the records and the ranges: what they are, what was done to them, what a ride uses."""

from collections.abc import Mapping, Sequence

from jaxdamp._tables import Cell, Column, Table
from jaxdamp.bench import BenchRun, Preflight
from jaxdamp.dampers import FittedRange
from jaxdamp.report.page import Report
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
    columns = [
        Column("record"),
        Column("sampling", "Hz"),
        Column("frequency", "Hz", ".3g"),
        Column("amplitude", "mm", ".3g"),
    ]
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
