"""`jaxdamp bench`: records of a bench in, what is odd about them and their evaluation out."""

from collections.abc import Sequence
from pathlib import Path

from jaxdamp import bench
from jaxdamp.bench import Evaluation
from jaxdamp.cli import interrupt
from jaxdamp.cli.console import Screen
from jaxdamp.cli.fitting import write_table
from jaxdamp.cli.grouping import value_of
from jaxdamp.cli.option_types import command_line
from jaxdamp.cli.options import decisions
from jaxdamp.cli.preflighting import checked
from jaxdamp.cli.record_options import ProcessOptions, ReadOptions
from jaxdamp.cli.results import results_folder
from jaxdamp.cli.vehicle_words import read_law
from jaxdamp.cli.wording import message
from jaxdamp.report import Attempts, baseline_table, bench_report, law_evaluation, records_table


def run_bench(
    screen: Screen,
    files: Sequence[Path],
    options: ReadOptions,
    *,
    processing: ProcessOptions,
    velocities: str | None = None,
    group_by: str | None = None,
    limits: Path | None = None,
    baseline: Path | None = None,
    out: Path,
    replace: bool = False,
) -> bool:
    """Look over records, evaluate those without an error, and write all of it into a folder.

    Returns:
        Whether all limits are kept; true without limits.

    Raises:
        ValueError: what the library refuses; no record without an error.
    """
    processing.steps()
    wanted, chosen = _velocities(velocities), None if limits is None else bench.read_limits(limits)
    attempts = Attempts(interrupt.check, message)
    with results_folder(out, "bench", replace=replace) as results:
        with screen.stage("Reading the records"):
            raw = options.read(files)
        screen.table(records_table(tuple(raw)))
        sound, found = checked(screen, raw, options, processing)
        runs = processing.apply(sound)
        remarks = decisions(tuple(runs)) + [f"left out: {sentence}" for sentence in runs.left_out]
        screen.heading("What was done to the records")
        screen.points(remarks)
        by = None if group_by is None else value_of(tuple(raw), group_by)
        with screen.stage("Evaluating the records"):
            evaluation = bench.evaluate(runs, velocities=wanted, by=by)
            beneath = None if baseline is None else _baseline(baseline, evaluation, options, processing)
        check = None if chosen is None else evaluation.check(chosen)
        screen.points(evaluation.notes, style="yellow")
        for name in ("velocities", "settings", "peak_forces", "loops"):
            screen.table(evaluation.tables()[name])
        if check is not None:
            screen.table(check.table())
        if beneath is not None:
            screen.table(baseline_table(evaluation, beneath))
        (results.draft / "tables").mkdir()
        write_table(results.draft, "preflight", found.table())
        _write_evaluation(results.draft, evaluation)
        if check is not None:
            write_table(results.draft, "limits", check.table())
        results.publish("the pictures and the report")
        with screen.stage("Pictures and report"):
            places = {"folder": results.draft, "attempts": attempts}
            page = bench_report(evaluation, found, check, baseline=beneath, remarks=remarks, **places)
            page.write(results.draft / "report.html", command_line())
    screen.files(out, results.published)
    screen.points(attempts.troubles, style="yellow")
    return check is None or check.passed


def _baseline(path: Path, evaluation: Evaluation, options: ReadOptions, processing: ProcessOptions) -> Evaluation:
    """The evaluation of a law on the bench of these records, or of other records at the same velocities."""
    if path.suffix == ".json":
        return law_evaluation(read_law("baseline", path), evaluation)
    return bench.evaluate(processing.apply(options.read([path])), velocities=evaluation.velocities)


def _velocities(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"Option --velocities must read like 0.052,0.131 [m/s], but is {text!r}.") from None


def _write_evaluation(folder: Path, evaluation: Evaluation) -> None:
    for name, table in evaluation.tables().items():
        write_table(folder, name, table)
