"""The best setting of dampers whose law depends on one, such as the clicks of a sheet: each is driven."""

import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from jaxdamp import Ride, export
from jaxdamp._display import display
from jaxdamp._pieces import piece
from jaxdamp._tables import Column, Table, plain, typeset_unit
from jaxdamp.cli.console import Screen
from jaxdamp.cli.jobs import without_range_warnings, write_tables
from jaxdamp.cli.vehicle_words import damper_places, write_laws
from jaxdamp.dampers import Scheduled, with_command
from jaxdamp.parameters import get
from jaxdamp.report import Report
from jaxdamp.roads import AbstractRoad
from jaxdamp.tune import half_interval, limit_spans
from jaxdamp.vehicles import AbstractVehicle


MOST = 2000  # combinations that are driven


class Chosen(NamedTuple):
    """Every setting, driven.

    Attributes:
        vehicle: with the best setting.
        verdict: in words.
        table: a row for each setting.
        met: whether a setting meets the limits.
    """

    vehicle: AbstractVehicle
    verdict: str
    table: Table
    met: bool

    def write(self, folder: Path) -> None:
        """The law at the best setting, the vehicle, and the table."""
        write_laws(folder, self.vehicle)
        export.to_json(self.vehicle, folder / "vehicle.json")
        write_tables(folder, {"settings": self.table})
        text = json.dumps({"verdict": self.verdict, "settings": plain(self.table.records())}, ensure_ascii=False)
        (folder / "settings.json").write_text(text + "\n", encoding="utf-8")

    def page(self, *, folder: Path, attempts: Any) -> Report:
        """The page."""
        page = Report("The best setting", folder, attempts)
        page.verdict(self.verdict)
        page.heading("All settings")
        page.table(self.table)
        return page


def settings_of(car: AbstractVehicle) -> dict[str, list[float]]:
    """The settings of dampers with a law of several, by the path of the damper."""
    laws = {path: get(car, path) for path in damper_places(car)}
    return {path: np.asarray(law.levels).tolist() for path, law in laws.items() if isinstance(law, Scheduled)}


def _at(car: AbstractVehicle, setting: Mapping[str, float]) -> AbstractVehicle:
    """The vehicle with dampers at these settings."""
    for path, command in setting.items():
        law = with_command(get(car, path), command)
        car = eqx.tree_at(lambda vehicle, path=path: get(vehicle, path), car, law)
    return car


def choose(
    screen: Screen,
    car: AbstractVehicle,
    metric: str,
    roads: Sequence[AbstractRoad],
    limits: Mapping[str, Any],
    run: Mapping[str, Any],
    *,
    white: bool,
) -> Chosen:
    """Drive every combination of settings and take the one with the smallest metric that meets the limits.

    Arguments:
        screen: the terminal.
        car: whose laws depend on a setting.
        metric: a short name or a ride metric; of several the mean counts.
        roads: of which the mean counts.
        limits: by short name or ride metric; relative ones are to the setting of the start.
        run: options of a ride.
        white: whether the road is white.
    """
    levels = settings_of(car)
    combinations = _combinations(levels)
    wanted = car.goal_metrics(metric, white=white)
    allowed = {name: limit for word, limit in limits.items() for name in car.goal_metrics(word, white=white)}
    names = list(dict.fromkeys([*wanted, *allowed]))
    rides = [Ride(car, road, metrics=names, **run) for road in roads]
    vehicles = [_at(car, dict(zip(levels, setting, strict=True))) for setting in combinations]
    settings = [_words(levels, setting) for setting in combinations]
    with screen.stage("Driving every setting", total=len(vehicles)) as advance, without_range_warnings():
        spans = limit_spans(allowed, names, _means(_driven(rides, car)))
        driven = []
        for vehicle, setting in zip(vehicles, settings, strict=True):
            advance(setting, len(driven))
            driven.append(_driven(rides, vehicle))
    rows = list(map(_means, driven))
    met = [all(low <= row[name] <= high for name, (low, high) in spans.items()) for row in rows]
    on_roads = np.array([np.mean([each[name] for name in wanted], axis=0) for each in driven])
    score = on_roads.mean(axis=1)
    order = np.argsort(np.where(met, score, np.inf) if any(met) else score, kind="stable")
    best = int(order[0])
    units = {m.name: typeset_unit(m.unit(car.units)) for m in rides[0].metrics}
    shown = display().of(units[wanted[0]])
    number = f"{wanted[0]} {shown(rows[best][wanted[0]]):.4g} {shown.unit}"
    verdict = _verdict(settings[best], number, met)
    if sum(met) > 1:
        verdict += f" {_beside_next(on_roads[order[:2]], settings[int(order[1])], white=white)}"
    return Chosen(
        vehicles[best],
        verdict,
        _table(settings, rows, met, units),
        any(met),
    )


def _table(
    settings: Sequence[str], rows: Sequence[Mapping[str, float]], met: Sequence[bool], units: Mapping[str, str]
) -> Table:
    """The metrics of every setting, and whether they meet the limits."""
    columns = (Column("setting"), *(Column(name, units[name]) for name in rows[0]), Column("limits"))
    words = ("met" if ok else "not met" for ok in met)
    cells = zip(settings, rows, words, strict=True)
    return Table("All settings", columns, tuple((setting, *row.values(), word) for setting, row, word in cells))


def _driven(rides: Sequence[Ride], vehicle: AbstractVehicle) -> dict[str, list[float]]:
    """The metrics of a vehicle on each ride."""

    def driven() -> dict[str, list[float]]:
        each = [ride.of_vehicle(vehicle)() for ride in rides]
        return {name: [float(values[name]) for values in each] for name in each[0]}

    return piece(("setting", vehicle, rides), driven)


def _means(metrics: Mapping[str, Sequence[float]]) -> dict[str, float]:
    return {name: float(np.mean(values)) for name, values in metrics.items()}


def _beside_next(on_roads: np.ndarray, following: str, *, white: bool) -> str:
    """By how much the best setting (row 0) differs from the next best (row 1) over roads, and whether that is sure."""
    gains = 100.0 * (on_roads[0] / on_roads[1] - 1.0)
    gain = f"{np.mean(gains):+.1f}"
    if white:
        return f"That is {gain} % beside {following}, the next."
    if gains.size < 2:
        return f"That is {gain} % beside {following}, the next, on one road: --roads 4 says whether on others too."
    half = half_interval(gains)
    sure = "" if -np.mean(gains) > half else ", so that these roads do not tell them apart"
    return f"That is {gain} ± {half:.1f} % beside {following}, the next, over {gains.size} roads{sure}."


def _verdict(setting: str, number: str, met: Sequence[bool]) -> str:
    """The best setting in words."""
    if any(met):
        return f"The best setting is {setting}: {number}. {sum(met)} of {len(met)} settings meet the limits."
    return f"No setting meets the limits; the smallest {number} is that of {setting}."


def _combinations(levels: Mapping[str, Sequence[float]]) -> list[tuple[float, ...]]:
    combinations = list(itertools.product(*levels.values()))
    if len(combinations) > MOST:
        many = f"{len(combinations)} combinations of settings are more than {MOST}"
        raise ValueError(f"{many}: name parameters with --over.")
    return combinations


def _words(levels: Mapping[str, Sequence[float]], setting: Sequence[float]) -> str:
    """A combination of settings in words."""
    if len(levels) == 1:
        return f"{setting[0]:g}"
    return ", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in zip(levels, setting, strict=True))
