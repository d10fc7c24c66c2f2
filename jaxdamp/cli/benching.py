"""`jaxdamp bench`: records of a bench in, what is odd about them and their evaluation out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from jaxdamp import bench
from jaxdamp.bench import Evaluation
from jaxdamp.cli.console import Screen
from jaxdamp.cli.jobs import Output, job, write_tables
from jaxdamp.cli.options import Call
from jaxdamp.cli.records import Reading, decisions, value_of
from jaxdamp.cli.vehicle_words import read_law
from jaxdamp.report import baseline_table, bench_report, bench_verdict, law_evaluation, records_table


def bench_command(
    screen: Screen,
    files: Sequence[Path],
    *,
    reading: Reading,
    how: Annotated[Call, "bench.evaluate"],
    group_by: str | None = None,
    limits: Path | None = None,
    baseline: Path | None = None,
    output: Output,
) -> None:
    """Look over bench records and evaluate them: what is odd, forces, rates, gas force, friction, limits.

    Writes a page, pictures, and tables. Records with an error are named and not evaluated. Ends with exit code 1 if a
    limit is not kept.

    Arguments:
        limits: CSV of limits: quantity, minimum, maximum, velocity, setting, record; compression and gas forces
            are negative.
        baseline: to compare with: a law as JSON, or other records, read the same way.
    """
    reading.processing()
    chosen = None if limits is None else bench.read_limits(limits)
    with job(screen, "bench", output) as work:
        with screen.stage("Reading the records"):
            raw = reading.raw(files)
        screen.details(records_table(tuple(raw)))
        sound, preflight = reading.checked(screen, raw)
        runs = reading.processed(sound)
        remarks = decisions(runs)
        screen.points(remarks)
        by = None if group_by is None else value_of(tuple(raw), group_by)
        with screen.stage("Evaluating the records"):
            evaluation = bench.evaluate(runs, **how.arguments(by=by))
            beneath = None if baseline is None else _baseline(baseline, evaluation, reading)
        check = None if chosen is None else evaluation.check(chosen)
        tables = evaluation.tables()
        screen.answer(*bench_verdict(evaluation, limits=check))
        if tables["velocities"].rows:
            screen.table(tables["velocities"])
        screen.details(*(tables[name] for name in ("settings", "peak_forces", "loops")))
        screen.remarks(evaluation.notes, style="yellow")
        if check is not None:
            screen.table(check.table())
            screen.remarks(check.warnings, style="yellow")
        if beneath is not None:
            screen.table(baseline_table(evaluation, beneath))
        with work.saving("Tables") as draft:
            more = {} if check is None else {"limits": check.table()}
            write_tables(draft / "tables", {"preflight": preflight.table(), **tables, **more})
        work.page(bench_report, evaluation, preflight, check, baseline=beneath, remarks=remarks)
    if check is not None and not check.passed:
        raise typer.Exit(1)


def _baseline(path: Path, evaluation: Evaluation, reading: Reading) -> Evaluation:
    """The evaluation of a law on the bench of these records, or of other records at the same velocities."""
    if path.suffix == ".json":
        return law_evaluation(read_law("baseline", path), evaluation)
    return bench.evaluate(reading.processed(reading.raw([path])), velocities=evaluation.velocities)
