"""What `jaxdamp demo` says: what the choice of a law costs in the prediction of a ride, what the tuning gains."""

from collections.abc import Mapping

from jaxdamp import plots
from jaxdamp._tables import Column, Table, percent_change, typeset_unit
from jaxdamp.cli.console import Screen
from jaxdamp.report import Report, notes_of
from jaxdamp.simulation import Response
from jaxdamp.tune import TuneResult


TRUE = "true damper"
METRICS = {
    "rms_sprung_acceleration": "body acceleration, RMS",
    "weighted_rms_sprung_acceleration": "weighted by Wk",
    "working_space_rms": "travel, RMS",
    "working_space_peak_to_peak": "travel, peak to peak",
    "rms_dynamic_tyre_load": "tyre load, RMS",
}
JUDGED = "rms_sprung_acceleration"
COMFORT = "weighted_rms_sprung_acceleration"
GRIP = "rms_dynamic_tyre_load"
WORDS = {
    COMFORT: "body acceleration as people feel it (ISO 2631-1, Wk)",
    GRIP: "tyre load variation",
}


def ride_table(title: str, responses: Mapping[str, Response]) -> Table:
    """Ride metrics of each law, and how far the acceleration is from that with the true damper."""
    units = next(iter(responses.values())).metric_units()
    columns = [Column("law"), *(Column(name, typeset_unit(units[m])) for m, name in METRICS.items())]
    errors = ride_errors(responses)
    rows = []
    for name, response in responses.items():
        values = response.metrics(list(METRICS))
        rows.append((name, *(float(values[m]) for m in METRICS), errors.get(name)))
    return Table(title, (*columns, Column("error of the acceleration", "%", "+.1f")), tuple(rows))


def ride_errors(responses: Mapping[str, Response]) -> dict[str, float]:
    """How far the RMS acceleration with each fitted law is from that with the true damper [%], the nearest first."""
    rms = {name: float(response.metrics()[JUDGED]) for name, response in responses.items()}
    errors = {name: percent_change(rms[TRUE], value) or 0.0 for name, value in rms.items() if name != TRUE}
    return dict(sorted(errors.items(), key=lambda item: abs(item[1])))


def ride_verdict(responses: Mapping[str, Response]) -> str:
    """What the choice of a law costs in the prediction of a ride, in words."""
    errors = list(ride_errors(responses).items())
    (best, least), (worst, largest) = errors[0], errors[-1]
    return f"The body acceleration predicted with {worst} is {_off(largest)}, with {best} {_off(least)}."


def _off(error: float) -> str:
    """An error of so many percent in words."""
    return "right to 0.1 %" if abs(error) < 0.1 else f"{abs(error):.1f} % too {'high' if error > 0 else 'low'}"


def show_rides(screen: Screen, rides: Mapping[str, Mapping[str, Response]]) -> None:
    """Ride metrics on each road."""
    for title, responses in rides.items():
        screen.details(ride_table(title, responses))
        screen.say(ride_verdict(responses))
        screen.points(notes_of(responses), style="yellow")


def add_rides(report: Report, rides: Mapping[str, Mapping[str, Response]]) -> None:
    """The section of the report on the rides."""
    report.heading("The ride on each law")
    for index, (title, responses) in enumerate(rides.items()):
        report.table(ride_table(title, responses))
        report.text(ride_verdict(responses))
        report.points(notes_of(responses))
        names = list(ride_errors(responses))
        shown = {name: responses[name] for name in dict.fromkeys((TRUE, names[-1], names[0]))}
        words = f"Quarter car on {title}: the true damper, the law furthest from it and the nearest"
        report.picture(lambda rides=shown: plots.ride(rides, reference=TRUE), words, f"ride_{index + 1}.png")


def purpose(tyre_load: float) -> str:
    """What is tuned, and why, in words."""
    return (
        f"For this light car the damper is stiff: it holds the tyre to the road and shakes the body. Its three damping "
        f"coefficients, each within a third and three times its value, are tuned for the least {WORDS[COMFORT]}, while "
        f"the RMS variation of the tyre load may grow by {100 * (tyre_load - 1):.0f} % at most."
    )


def outcome(tuned: TuneResult) -> str:
    """What the tuning gained, what stopped it, and what it cost."""
    gain = 100 * (1 - tuned.after[COMFORT] / tuned.before[COMFORT])
    bounds = [f"{c.name} is {c.note}" for c in tuned.parameters if c.note]
    stops = [f"the {WORDS.get(n, n)} is at its limit" for n in tuned.active_limits]
    stops += bounds or ["all coefficients lie inside their bounds"]
    others = [n for n in tuned.before if n not in (COMFORT, *tuned.limits) and tuned.before[n]]
    shares = {n: 100 * (tuned.after[n] / tuned.before[n] - 1) for n in others}
    worse = ", ".join(f"{n.replace('_', ' ')} {s:+.0f} %" for n, s in shares.items() if s >= 1)
    cost = f"The price: {worse}." if worse else "Nothing else gets worse."
    stop = "; ".join(stops)
    return f"The body shakes {gain:.0f} % less. What ends the search: {stop}. {cost}"
