"""The sheet of a ride: one A4 page of a vehicle before and after, its road, its dampers, and what to build."""

from collections.abc import Mapping

import numpy as np

from jaxdamp._display import display
from jaxdamp._tables import percent_change
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import Figure
from jaxdamp.plots import _ride_panels, _ride_spectra, _rides, _sheet, _style
from jaxdamp.simulation import Response
from jaxdamp.tune import Limits, TuneResult


@of_known_numbers
def ride_sheet(
    rides: TuneResult | Response | Mapping[str, Response],
    *,
    sentence: str = "",
    name: str = "",
    limits: Limits | None = None,
) -> Figure:
    """One A4 page of a ride or a tuning, to print or to send: `result.plot("sheet")`.

    The vehicle with its numbers; its road among the classes of ISO 8608; comfort over grip with the curve of constant
    damping; the dampers with their damping ratio and the share of time at each velocity; what reaches body and tyre
    over frequency with the bands of body and wheels, and the weighted acceleration in third octaves, or of a bump
    peaks, overshoot and settling; the changes of the main metrics, with whiskers over the roads that the tuning had not
    seen, and marks at limits. Save it by `figure.savefig("ride.pdf")`.

    Arguments:
        rides: of `tune.minimise`, or of `simulate`, several by name: the first is compared with the last.
        sentence: at the top; the verdict of the tuning, or the changes, if left out.
        name: of the vehicle and its road.
        limits: of metrics, for rides; a tuning has its own.

    Raises:
        ValueError: no ride, an unknown metric in the limits.
    """
    if isinstance(rides, TuneResult):
        shown, sentence = _rides.Rides.of_tuning(rides), sentence or _rides.without_answer(rides)
        good = _style.GOOD if rides.verdict.better else _style.BAD
        answer = {"answer": rides.verdict.outcome.value, "colour": good}
    else:
        by_name = _style.by_name("rides", rides, Response, "a response", _style.SIMULATE)
        shown, answer = _rides.Rides.of_responses(by_name, limits), {}
    with _sheet.lettering():
        figure = _sheet.page()
        rows = figure.add_gridspec(5, 1, height_ratios=(1.2, 1.9, 2.7, 3.9, 2.6), hspace=0.02)
        car = shown.cars[0]
        title = name or _style.first_upper("controlled " * (car.passive is not car) + _style.class_words(car.passive))
        top = figure.add_subplot(rows[0].subgridspec(1, 1)[0])
        _sheet.head(top, title, sentence or _changes(shown), _facts(shown), **answer)
        first = [figure.add_subplot(at) for at in rows[1].subgridspec(1, 2, width_ratios=(1.0, 1.15))]
        _ride_panels.vehicle(first[0], shown)
        _ride_panels.road(first[1], shown)
        second = [figure.add_subplot(at) for at in rows[2].subgridspec(1, 2, wspace=0.06)]
        _ride_panels.plane(second[0], shown)
        _ride_panels.bars(second[1], shown)
        paths = shown.dampers()
        ratio = all(_rides.critical(shown, path, number) for path in paths for number in (0, 1))
        heights = (2.2, 1.1, 0.8) if ratio else (3.3, 0.8)
        third = rows[3].subgridspec(len(heights), max(len(paths), 1), height_ratios=heights)
        for column, path in enumerate(paths):
            curves = figure.add_subplot(third[0, column])
            below = [figure.add_subplot(third[row, column], sharex=curves) for row in range(1, len(heights))]
            _ride_panels.damper([curves, *below], shown, path)
        if shown.is_event:
            _ride_spectra.event(figure.add_subplot(rows[4].subgridspec(1, 1)[0]), shown)
        else:
            last = [figure.add_subplot(at) for at in rows[4].subgridspec(1, 3)]
            _ride_spectra.gains(last[:2], shown)
            _ride_spectra.comfort(last[2], shown)
    return figure


def _changes(shown: _rides.Rides) -> str:
    """The change of each goal, or its value for a single ride."""
    said = []
    for goal, words in _rides.GOALS.items():
        if names := shown.goal(goal):
            joined = np.max if shown.single else np.mean  # as in the first sentence of its page
            before, after = (float(joined([side[name] for name in names])) for side in shown.values)
            change = "–" if (percent := percent_change(before, after)) is None else _style.percent(percent)
            value = "up to " * (len(names) > 1) + _style.quantity(after, shown.units[names[0]])
            said.append(f"{words} {value if shown.single else change}")
    first, last = map(_style.in_words, shown.names)
    return _style.first_upper(f"{last} against {first}: " * (not shown.single) + ", ".join(said))


def _facts(shown: _rides.Rides) -> str:
    """Speed, time and roads that were not seen, in a line."""
    facts = [display().speed(shown.speed)] if shown.speed is not None else []
    facts += [f"{_style.short(float(shown.responses[0].time[-1]))} s"] if shown.responses else []
    facts += [f"{shown.fresh.roads} roads that the tuning had not seen"] if shown.fresh is not None else []
    return " · ".join(facts)
