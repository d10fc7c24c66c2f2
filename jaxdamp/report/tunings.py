"""A page on a tuning: parameters and ride metrics before and after, also on other roads."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxdamp import plots
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.page import Report
from jaxdamp.simulation import Response
from jaxdamp.tune import Rescore, TuneResult


def tuning_report(
    result: TuneResult[Any],
    *,
    title: str = "Tuning",
    rescored: Rescore | None = None,
    rides: Mapping[str, Response] | None = None,
    folder: Path | None = None,
    attempts: Attempts | None = None,
) -> Report:
    """A page on a tuning.

    Arguments:
        result: of `tune.minimise`.
        title: of the page.
        rescored: the same cars on other roads, of `tune.rescore`.
        rides: responses before and after by name, to be drawn over each other.
        folder: folder for the pictures as separate files; without it they are only in the page.
        attempts: collects parts that fail; a new one if left out.

    >>> from jaxdamp import report, roads, tune, vehicles
    >>> result = tune.minimise("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), roads.white("C", 20.0))
    >>> page = report.tuning_report(result)  # page.write("tuning.html")
    >>> result.metric in page.to_html()
    True
    """
    report = Report(title, folder, attempts)
    add_tuning(report, result, rescored, outcome=result.summary)
    if rides is not None:
        report.picture(lambda: plots.ride(rides), "Before and after", "tuning_ride.png")
    return report


def add_tuning(
    report: Report, result: TuneResult[Any], rescored: Rescore | None = None, *, outcome: str, elsewhere: str = ""
) -> None:
    """The section of a page on a tuning.

    Arguments:
        report: the page.
        result: of `tune.minimise`.
        rescored: the same cars on other roads; the fresh roads of the tuning, if there are any, if left out.
        outcome: result of the tuning, in words.
        elsewhere: result on the other roads, in words; by default those of `rescored`.
    """
    report.table(result.parameter_table())
    report.table(result.table())
    report.text(outcome)
    report.points([*result.active, *result.warnings])
    if result.scenarios is not None:
        report.table(result.scenario_table())
    rescored = result.fresh if rescored is None else rescored
    if rescored is not None:
        report.table(rescored.table())
        report.text(elsewhere or rescored.summary)
    report.picture(lambda: plots.tuning(result), "Before and after the tuning", "tuning.png")
