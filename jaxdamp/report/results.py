"""A page on any result: its summary, warnings, tables and picture; on some kinds a longer one."""

from collections.abc import Callable
from pathlib import Path

from jaxdamp._results import AbstractResult
from jaxdamp.bench import Evaluation
from jaxdamp.identify import Comparison, VehicleComparison, VehicleFit
from jaxdamp.report.benches import bench_report
from jaxdamp.report.fits import fit_report
from jaxdamp.report.page import Attempts, Report
from jaxdamp.report.rides import ride_report
from jaxdamp.report.tunings import tuning_report
from jaxdamp.report.vehicle_fits import vehicle_comparison_report, vehicle_fit_report
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


_PAGES: dict[type, Callable[..., Report]] = {
    Comparison: fit_report,
    Evaluation: bench_report,
    Response: ride_report,
    TuneResult: tuning_report,
    VehicleComparison: vehicle_comparison_report,
    VehicleFit: vehicle_fit_report,
}


def result_report(
    result: AbstractResult, title: str = "", *, folder: Path | None = None, attempts: Attempts | None = None
) -> Report:
    """A page on a result, as `result.report(path)` writes it.

    Arguments:
        result: of a fit, a tuning or a study.
        title: of the page; that of its kind if left out.
        folder: where its pictures are written as files too.
        attempts: parts that may fail by themselves.

    >>> from jaxdamp import report, vehicles
    >>> page = report.result_report(vehicles.modes(vehicles.presets.quarter_car_000()))
    >>> "damping ratio" in page.to_html()
    True
    """
    page_of = next((page for kind, page in _PAGES.items() if isinstance(result, kind)), None)
    if page_of is not None:
        named = {"title": title} if title else {}
        return page_of(result, folder=folder, attempts=attempts, **named)
    page = Report(title or result.table().title, folder, attempts)
    page.verdict(result.summary)
    if result.warnings:
        page.heading("Warnings")
        page.points(result.warnings)
    page.heading("Results")
    for table in result.tables().values():
        page.table(table)
    page.picture(result.plot, result.summary, "result.png")
    return page
