"""A page on a tuning: parameters and ride metrics before and after, also on other roads."""

from collections.abc import Mapping
from typing import Unpack

import numpy as np

from jaxdamp import _checks, plots
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Compared, Table, comparison_table
from jaxdamp._traced import equal
from jaxdamp._words import said
from jaxdamp.parameters import get
from jaxdamp.report.page import PAGE, Page, Report
from jaxdamp.simulation import Response, Ride
from jaxdamp.tune import Rescore, TuneResult, change_in_percent, damper_paths
from jaxdamp.vehicles import AbstractVehicle


MOST_COMBINATIONS = 100  # rows of choices on a page, the best first


@with_defaults(PAGE, title="Tuning")
def tuning_report(
    result: TuneResult,
    *,
    rescored: Rescore | None = None,
    rides: Mapping[str, Response] | None = None,
    baseline: AbstractVehicle | None = None,
    **page: Unpack[Page],
) -> Report:
    """A page on a tuning.

    Arguments:
        result: of `tune.minimise`.
        rescored: the same cars on other roads, of `tune.rescore`.
        rides: responses before and after by name, to be drawn over each other.
        baseline: another vehicle of this kind, such as that of another tuning, to be compared on the same road.
        page: `title`, `folder` and `attempts`, all optional (see `Page`).

    >>> from jaxdamp import report, roads, tune, vehicles
    >>> result = tune.minimise("rms_dynamic_tyre_load", vehicles.presets.quarter_car_000(), roads.white("C", 20.0))
    >>> page = report.tuning_report(result)  # page.write("tuning.html")
    >>> result.metric in page.to_html()
    True
    """
    report = Report(**page)
    report.verdict(result.verdict.sentence, more=[result.ending])
    report.sheet(lambda: result.plot("sheet"), result.verdict.sentence, "ride_sheet")
    report.heading(result.verdict.outcome.value)
    add_tuning(report, result, rescored)
    if baseline is not None:
        add_baseline(report, result, baseline)
    if rides is not None:
        report.picture(lambda: plots.ride(rides), "Before and after", "tuning_ride.png")
    return report


def add_tuning(
    report: Report, result: TuneResult, rescored: Rescore | None = None, *, outcome: str = "", elsewhere: str = ""
) -> None:
    """The section of a page on a tuning.

    Arguments:
        report: the page.
        result: of `tune.minimise`.
        rescored: the same cars on other roads; the fresh roads of the tuning, if there are any, if left out.
        outcome: result of the tuning in words, if they do not stand at the top of the page.
        elsewhere: result on the other roads, in words; by default those of `rescored`.
    """
    report.table(result.parameter_table())
    if result.combinations is not None:
        report.table(result.combinations.table().first(MOST_COMBINATIONS))
    report.table(result.table())
    report.text(outcome)
    report.points([*result.active, *result.warnings])
    if result.scenarios is not None:
        report.table(result.scenario_table())
    if result.tolerances:
        report.table(result.tolerance_table())
    rescored = result.fresh if rescored is None else rescored
    if rescored is not None:
        report.table(rescored.table())
        report.text(said(elsewhere or rescored.summary))
    report.picture(lambda: plots.tuning(result), "Before and after the tuning", "tuning.png")


def add_baseline(report: Report, result: TuneResult, baseline: AbstractVehicle) -> None:
    """The section of a page on a tuning beside another vehicle: ride metrics on the same road, and damper curves."""
    _checks.instance("baseline", baseline, type(result.start), f"be a {type(result.start).__name__} as the tuned one")
    report.heading("Beside the baseline")
    if result.drive is not None:
        with report.part("The metrics of the baseline"):
            report.table(_beside(result, baseline))
    peaks = [values.get("peak_damper_velocity", 0.0) for values in (result.before, result.after)]
    reach = 1.1 * max(peaks) or 1.0
    for path in damper_paths(result.vehicle):
        cars = {"baseline": baseline, "before": result.start, "after": result.vehicle}
        laws = {name: get(car, path) for name, car in cars.items()}
        if not all(equal(laws["after"], law) for law in laws.values()):
            points = np.linspace(-reach, reach, 401)
            report.picture(
                lambda laws=laws, points=points: plots.force_velocity(laws, points, baseline="baseline"),
                f"{path.replace('_', ' ')}: baseline, before and after the tuning",
                f"baseline_{path.replace('.', '_')}.png",
            )


def _beside(result: TuneResult, baseline: AbstractVehicle) -> Table:
    """Ride metrics of the baseline, before and after, on the road of the tuning."""
    assert result.drive is not None
    road, run = result.drive
    every_metric = (*result.start.layout.metrics, *(result.objective.metrics if result.objective else ()))
    metrics = list({m.name: m for m in every_metric if m.name in result.units}.values())
    cars = (baseline, result.start, result.vehicle)
    rides = [Ride(car, road, metrics=metrics, **run)() for car in cars]
    rows = []
    for name in (name for name in result.units if name in rides[0]):
        values = [float(ride[name]) for ride in rides]
        rows.append(Compared(name, result.units[name], values, change_in_percent(result, name, values[0], values[-1])))
    where = "the first road" if result.scenarios is not None else "the road"
    title = f"Ride metrics on {where} of the tuning; the change is from the baseline to the tuned vehicle"
    return comparison_table(title, "metric", ("baseline", "before", "after"), rows)
