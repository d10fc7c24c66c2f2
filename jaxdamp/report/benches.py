"""A page on bench records without a law: what is odd about them, and their evaluation."""

from collections.abc import Sequence
from pathlib import Path

from jaxdamp.bench import Evaluation, LimitCheck, Preflight
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.fits import records_table
from jaxdamp.report.page import Report


def bench_report(
    evaluation: Evaluation,
    preflight: Preflight | None = None,
    limits: LimitCheck | None = None,
    *,
    baseline: Evaluation | None = None,
    title: str = "Damper records",
    remarks: Sequence[str] = (),
    folder: Path | None = None,
    attempts: Attempts | None = None,
) -> Report:
    """A page on records: preflight, limits, forces, rates, gas force and friction, loops.

    Arguments:
        evaluation: of `bench.evaluate`.
        preflight: of `bench.preflight`.
        limits: of `evaluation.check`.
        baseline: another evaluation to draw beneath.
        title: of the page.
        remarks: on the records.
        folder: for the pictures as files of their own; in the page alone if it is left out.
        attempts: what may fail by itself; new ones if left out.

    >>> from jaxdamp import bench, report
    >>> from jaxdamp.dampers import Bilinear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0), force_noise=5.0).run(bench.SineTest(0.02, 2.0))
    >>> page = report.bench_report(bench.evaluate(runs), bench.preflight(runs))  # page.write("bench.html")
    >>> "Forces at stated velocities" in page.to_html()
    True
    """
    report = Report(title, folder, attempts)
    report.heading("Records")
    report.table(records_table(evaluation.runs))
    report.points(remarks)
    if preflight is not None:
        report.heading("Preflight")
        report.text(f"{preflight.summary()}.")
        if preflight.findings:
            report.picture(preflight.plot, "What was found in which record", "preflight.png")
            report.table(preflight.table())
    if limits is not None:
        report.heading("Limits")
        report.table(limits.table())
    report.heading("Evaluation")
    report.points(evaluation.notes)
    report.picture(lambda: evaluation.plot(baseline, limits), "Mean cycles and forces over velocity", "evaluation.png")
    for name, table in evaluation.tables().items():
        if name != "measurements":
            report.table(table)
    for number, found in enumerate(evaluation.gas_and_friction.values()):
        report.picture(found.plot, f"Gas force and friction of {found.record}", f"gas_and_friction_{number + 1}.png")
    return report
