"""A page on one or several rides: metrics, comfort, use of the dampers, pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from jaxdamp import plots
from jaxdamp._tables import Table
from jaxdamp.dampers import AbstractDamper
from jaxdamp.report.attempts import Attempts
from jaxdamp.report.page import Report
from jaxdamp.report.ranges import range_use_table
from jaxdamp.simulation import Response, comfort_table, metrics_table


def ride_report(
    responses: Response | Mapping[str, Response],
    *,
    title: str = "Ride",
    laws: Mapping[str, AbstractDamper] | None = None,
    remarks: Sequence[str] | None = None,
    folder: Path | None = None,
    attempts: Attempts | None = None,
) -> Report:
    """A page on one ride, or on several of one kind of vehicle side by side, the first being the baseline.

    Arguments:
        responses: of `simulate`, several by name.
        title: of the page.
        laws: the dampers by the name of their ride, to be listed.
        remarks: remarks on the results; the notes of the responses if left out.
        folder: folder for the pictures as separate files; without it they are only in the page.
        attempts: collects parts that fail; a new one if left out.

    >>> from jaxdamp import report, roads, simulate, vehicles
    >>> bump = roads.cosine_bump(0.05, start=0.2, duration=0.25)
    >>> page = report.ride_report(simulate(vehicles.presets.quarter_car_000(), bump, duration=1.0))
    >>> "rms_sprung_acceleration" in page.to_html()  # page.write("ride.html")
    True
    """
    rides = {"ride": responses} if isinstance(responses, Response) else dict(responses)
    report = Report(title, folder, attempts)
    report.text(axles_sentence(rides))
    report.points(notes_of(rides) if remarks is None else remarks)
    for name, law in (laws or {}).items():
        covered = f" Fitted to: {law.fitted_to.words()}." if law.fitted_to is not None else ""
        report.text(f"{name}: {law!r}{'.' * bool(covered)}{covered}")
    for table in ride_tables(rides).values():
        report.table(table)
    report.picture(lambda: plots.ride(rides, weighting="Wk"), title, "ride.png")
    for damper in next(iter(rides.values())).dampers:
        caption = f"Use of the {damper.replace('_', ' ')} during the ride"
        report.picture(lambda name=damper: plots.damper_use(rides, damper=name), caption, f"{damper}.png")
    return report


def ride_tables(responses: Mapping[str, Response]) -> dict[str, Table]:
    """The tables on rides by the name of their file: metrics, comfort, use of the dampers where laws have a range."""
    use = range_use_table(responses)
    tables = {"metrics": metrics_table(responses), "comfort": comfort_table(responses)}
    return tables if use is None else tables | {"range_use": use}


def axles_sentence(responses: Mapping[str, Response]) -> str:
    """When each axle met the road; nothing of a vehicle with one axle."""
    timing = next(iter(responses.values())).axle_timing
    return "" if timing.kind == "one axle" else f"Axles: {timing}."


def notes_of(responses: Mapping[str, Response]) -> list[str]:
    """The notes of each response, after its name."""
    return [f"{name}: {note}" for name, response in responses.items() for note in response.notes]
