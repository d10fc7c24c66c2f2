"""A page on a sweep: a table of all points, and a curve or a map of each result."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxdamp import plots
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.page import Report


if TYPE_CHECKING:
    import xarray


MOST_AXES = 2  # of a grid that is drawn


def sweep_report(
    data: "xarray.Dataset",
    *,
    title: str = "Sweep",
    remarks: Sequence[str] = (),
    folder: Path | None = None,
    attempts: Attempts | None = None,
) -> Report:
    """A page on a sweep over a grid.

    Arguments:
        data: of `jaxdamp.sweep`.
        title: of the page.
        remarks: on the results, such as the reasons of failed points.
        folder: folder for the pictures as separate files; without it they are only in the page.
        attempts: collects parts that fail; a new one if left out.

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> "area" in sweep_report(data).to_html()
    True
    """
    report = Report(title, folder, attempts)
    report.points(remarks)
    if len(data["failed"].dims) <= MOST_AXES:
        for name in data.data_vars:
            metric = str(name)
            report.picture(lambda m=metric: plots.sweep(data, m), metric.replace("_", " "), f"{metric}.png")
    else:
        report.text(f"Grids of more than {MOST_AXES} axes are not drawn.")
    report.table(data.jaxdamp.table())
    return report
