"""A page on one or several rides: metrics, comfort, use of the dampers, pictures."""

from collections.abc import Callable, Mapping, Sequence
from typing import Unpack

import numpy as np

from jaxdamp import plots
from jaxdamp._display import display
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Table, percent_change, percentage, typeset_unit
from jaxdamp._words import path_words
from jaxdamp.dampers import AbstractDamper, law_name
from jaxdamp.metrics import comfort_reaction
from jaxdamp.parameters import parameters
from jaxdamp.report.benches import range_use_table
from jaxdamp.report.page import PAGE, Page, Report
from jaxdamp.simulation import Response, comfort_table, far_outside, metrics_table


WORDS = {
    "comfort": "weighted RMS of the body acceleration",
    "travel": "peak-to-peak suspension travel",
    "grip": "RMS of the dynamic tyre load",
}


@with_defaults(PAGE, title="Ride")
def ride_report(
    responses: Response | Mapping[str, Response],
    *,
    laws: Mapping[str, AbstractDamper] | None = None,
    remarks: Sequence[str] | None = None,
    **page: Unpack[Page],
) -> Report:
    """A page on one ride, or on several of one kind of vehicle side by side, the first being the baseline.

    Arguments:
        responses: of `simulate`, several by name.
        laws: the dampers by the name of their ride, to be listed.
        remarks: remarks on the results; the notes of the responses if left out.
        page: `title`, `folder` and `attempts`, all optional (see `Page`).

    >>> from jaxdamp import report, roads, simulate, vehicles
    >>> bump = roads.cosine_bump(0.05, start=0.2, duration=0.25)
    >>> page = report.ride_report(simulate(vehicles.presets.quarter_car_000(), bump, duration=1.0))
    >>> "rms_sprung_acceleration" in page.to_html()  # page.write("ride.html")
    True
    """
    rides = {"ride": responses} if isinstance(responses, Response) else dict(responses)
    report = Report(**page)
    sentences = ride_verdict(rides)
    report.verdict(*sentences)
    report.sheet(lambda: plots.ride_sheet(rides, name=page["title"]), sentences[-1], "ride_sheet")
    report.heading("The ride")
    report.text(axles_sentence(rides))
    report.points(notes_of(rides) if remarks is None else remarks)
    for name, law in (laws or {}).items():
        covered = f" Fitted to: {law.fitted_to.words()}." if law.fitted_to is not None else ""
        report.text(f"{name}: {_numbers(law)}.{covered}")
    add_rides(report, rides, page["title"])
    return report


def _numbers(law: AbstractDamper) -> str:
    """The name of a law with its numbers and their units."""
    said = []
    for one in parameters(law):
        numbers = ", ".join(f"{number:.5g}" for number in np.ravel(one.value))
        said.append(f"{path_words(one.path)} {numbers} {typeset_unit(one.unit)}".rstrip())
    return f"{law_name(law)}, {', '.join(said)}" if said else law_name(law)


def add_rides(report: Report, responses: Mapping[str, Response], title: str, prefix: str = "") -> None:
    """The tables and pictures of rides on one road.

    Arguments:
        report: the page.
        responses: by name, of one kind of vehicle, the first being the baseline.
        title: what was driven over, as the caption of the picture.
        prefix: of the names of the picture files, if the page shows several roads.
    """
    for table in ride_tables(responses).values():
        report.table(table)
    report.picture(lambda: plots.ride(responses, weighting="Wk", title=title), title, f"{prefix}ride.png")
    for damper in next(iter(responses.values())).dampers:
        caption = f"Use of the {damper.replace('_', ' ')} during the ride"
        report.picture(lambda name=damper: plots.damper_use(responses, damper=name), caption, f"{prefix}{damper}.png")


def ride_verdict(responses: Mapping[str, Response]) -> list[str]:
    """Comfort, travel and grip in a sentence for each ride, compared with the first one if there are several.

    Of several wheels or seats the largest value is said, of a comparison the change of the mean.

    Arguments:
        responses: by name, of one kind of vehicle.
    """
    (first, baseline), *others = responses.items()
    goals = {goal: names for goal in WORDS if (names := baseline.vehicle.goal_metrics(goal))}
    joined = _mean if others else max
    values = {name: _joined(response, goals, joined) for name, response in responses.items()}
    if others:
        return [
            f"{name} against {first}: "
            + ", ".join(
                f"{WORDS[g]} {percentage(percent_change(values[first][g], values[name][g]) or 0.0)}" for g in goals
            )
            + _trust(response)
            for name, response in others
        ]
    units = baseline.metric_units()
    shown = {goal: display().read(units[names[0]]) for goal, names in goals.items()}
    most = {goal: "up to " * (len(names) > 1) for goal, names in goals.items()}
    said = [f"{WORDS[g]} {most[g]}{s(values[first][g]):.3g} {typeset_unit(s.unit)}" for g, s in shown.items()]
    feel = ""
    if "comfort" in goals and typeset_unit(units[goals["comfort"][0]]) == "m/s²":
        feel = f" ISO 2631-1 calls such an acceleration {' or '.join(comfort_reaction(values[first]['comfort']))}."
    return [f"{', '.join(said)}{_trust(baseline)}{feel}" if said else ""]


def _trust(response: Response) -> str:
    """The end of a sentence: where the laws were used outside their records, that it rests on extrapolation."""
    far = far_outside(response.range_use())
    return f"; not certain, as the law is extrapolated: {'; '.join(far)}." if far else "."


def _joined(
    response: Response, goals: Mapping[str, Sequence[str]], joined: Callable[[list[float]], float]
) -> dict[str, float]:
    """The metrics of each goal as one number."""
    numbers = response.metrics()
    return {goal: joined([float(numbers[name]) for name in names]) for goal, names in goals.items()}


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def ride_tables(responses: Mapping[str, Response]) -> dict[str, Table]:
    """The tables on rides by the name of their file: metrics, comfort, use of the dampers where laws have a range.

    Arguments:
        responses: by name, of one kind of vehicle.
    """
    use = range_use_table(responses)
    tables = {"metrics": metrics_table(responses), "comfort": comfort_table(responses)}
    return tables if use is None else tables | {"range_use": use}


def axles_sentence(responses: Mapping[str, Response]) -> str:
    """When each axle met the road; nothing of a vehicle with one axle.

    Arguments:
        responses: by name.
    """
    timing = next(iter(responses.values())).axle_timing
    return "" if timing.kind == "one axle" else f"Axles: {timing}."


def notes_of(responses: Mapping[str, Response]) -> list[str]:
    """The notes of each response, after its name.

    Arguments:
        responses: by name.
    """
    return [f"{name}: {note}" for name, response in responses.items() for note in response.notes]
