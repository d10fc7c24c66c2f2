"""A page on a force-velocity table: its family of curves, forces, and what was decided."""

from pathlib import Path

from jaxdamp.bench import ForceVelocityTable
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.page import Report


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
