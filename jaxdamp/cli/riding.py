"""`jaxdamp ride`: a law in a vehicle on a road, beside a baseline; and what words mean as roads."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from jaxdamp import _checks, export, plots, roads, simulate
from jaxdamp._display import display
from jaxdamp._tables import typeset_unit
from jaxdamp.cli.console import Screen
from jaxdamp.cli.controlling import Controlling
from jaxdamp.cli.early import refuse_road
from jaxdamp.cli.jobs import Output, job, with_step_warnings, write_tables
from jaxdamp.cli.limits import unit_of
from jaxdamp.cli.options import Call
from jaxdamp.cli.vehicle_words import given_law, law_of, parse_vehicle, read_baseline, with_dampers_at
from jaxdamp.dampers import AbstractDamper, command_words
from jaxdamp.report import Table, axles_sentence, notes_of, ride_report, ride_tables, ride_verdict
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.simulation import Response
from jaxdamp.tune import Run
from jaxdamp.vehicles import GOALS, AbstractVehicle


USUAL = 10.0  # s, a ride on a road without an end of its own
FASTEST = 70.0  # m/s, 252 km/h
HIGHEST_BUMP = 0.3  # m
LONGEST_BUMP = 50.0  # m
USUAL_SIZES = {  # of parameters of dampers and road vehicles, by unit: the least that is not zero, and the largest
    "kg": (0.1, 1e5),
    "N s/m": (0.0, 1e6),
    "N/m": (0.0, 1e9),
    "N": (0.0, 1e6),
    "m": (0.0, 100.0),
    "m/s": (0.0, 100.0),
    "s": (0.0, 100.0),
}


@dataclass(frozen=True)
class Driving:
    """How a road is driven over.

    Arguments:
        speed: of the vehicle [m/s].
        duration: of each ride [s]; the road's own, or 10.
        dt: step [s]; 1 ms is right for cars, a coarse one is warned of or refused.
        seed: of random roads.
    """

    speed: float = 20.0
    duration: float | None = None
    dt: float = 1e-3
    seed: int = 0

    def over(self, word: str, count: int = 1) -> tuple[list[AbstractRoad] | list[WhiteRoad], Run]:
        """So many realisations of the road that a word means, and the options of a run over them."""
        _checks.positive("speed", self.speed)
        kind, _, value = word.partition(":")
        if kind == "white":
            if self.duration is not None:
                _checks.refuse("duration", "be left out on a white road", self.duration)
            return [roads.white(value, self.speed)] * count, Run()
        if self.duration is not None:
            _checks.positive("duration", self.duration)
        length = USUAL if self.duration is None else self.duration
        seeds = range(self.seed, self.seed + count)
        realisations = [parse_road(word, speed=self.speed, duration=length, seed=seed) for seed in seeds]
        duration = length if self.duration is not None or kind == "iso" else realisations[0].duration or length
        return realisations, Run(duration=duration, dt=self.dt)


def parse_road(word: str, *, speed: float, duration: float, seed: int) -> AbstractRoad:
    """The road that a word on the command line means.

    "iso:C" is an ISO 8608 class, "bump:0.06:5" a cosine bump of height and length in metres that begins after a second,
    anything else a file: OpenCRG (*.crg), or text with positions and heights, in m or in the units of its header.
    """
    kind, _, value = word.partition(":")
    if kind == "iso":
        return roads.iso8608(value, speed, duration, seed=seed)
    if kind == "bump":
        try:
            height, length = map(float, value.split(":"))
        except ValueError:
            _checks.refuse("road", "read like bump:HEIGHT:LENGTH with numbers in metres", repr(word))
        return roads.cosine_bump(height, start=1.0, length=length, speed=speed)
    if Path(word).is_file():
        return roads.read_crg(word, speed) if word.endswith(".crg") else roads.read_profile(word, speed)
    refuse_road(word)


def unusual(road: str, speed: float) -> list[str]:
    """Sentences on a speed [m/s] or a bump that no road vehicle meets every day, as where another unit was meant.

    >>> unusual("iso:C", 72.0)
    ['unusual: a speed of 72 m/s is 259 km/h. Without a unit it is in m/s: if km/h was meant, write --speed 72km/h.']
    """
    notes = []
    if speed > FASTEST:
        remedy = f"Without a unit it is in m/s: if km/h was meant, write --speed {speed:g}km/h."
        notes.append(f"unusual: a speed of {speed:g} m/s is {3.6 * speed:.0f} km/h. {remedy}")
    kind, *size = road.split(":")
    if kind == "bump" and len(size) == 2:
        height, length = map(float, size)
        if height > HIGHEST_BUMP or length > LONGEST_BUMP:
            remedy = f"Both are in m: if mm were meant, write bump:{1e-3 * height:g}:{1e-3 * length:g}."
            notes.append(f"unusual: {road} is {height:g} m high and {length:g} m long. {remedy}")
    return notes


def beyond_vehicles(car: AbstractVehicle, over: Mapping[str, np.ndarray]) -> list[str]:
    """Sentences on values of an axis that no damper or road vehicle has, as where another unit was meant.

    >>> from jaxdamp import vehicles
    >>> beyond_vehicles(vehicles.presets.quarter_car_000(), {"damper.rate": np.array([1500.0, 1e300])})
    ['unusual: 1 of 2 values of damper.rate is beyond what vehicles have (up to 1e+06 N s/m), such as 1e+300.']
    """
    notes = []
    for name, values in over.items():
        unit = unit_of(name, over, car)
        least, most = USUAL_SIZES.get(unit, (0.0, np.inf))
        size = np.abs(values)
        beyond = values[(size > most) | ((size > 0.0) & (size < least))]
        if beyond.size:
            reach = f"from {least:g} to {most:g} {unit}" if least else f"up to {most:g} {unit}"
            verb = "is" if beyond.size == 1 else "are"
            notes.append(
                f"unusual: {beyond.size} of {values.size} values of {name} {verb} beyond what vehicles have ({reach}), "
                f"such as {beyond[np.argmax(np.abs(np.log(np.abs(beyond))))]:g}."
            )
    return notes


def ride(
    screen: Screen,
    vehicle: str,
    road: str = "iso:C",
    *,
    law: Path | None = None,
    command: float | None = None,
    driving: Driving,
    how: Annotated[Call, "simulation.simulate"],
    controlling: Controlling,
    baseline: Path | None = None,
    output: Output,
) -> None:
    """Ride on a road: metrics, comfort by ISO 2631-1 and pictures, beside a baseline.

    The vehicle has its own dampers, or the law given by --law. The channels over time, channels_*.csv, are in SI and
    positive in rebound whatever units and sign are shown.

    Arguments:
        command: what is set on the dampers, such as clicks or a coil current; that of their laws if left out.
        baseline: to compare with: another law, or another vehicle, as JSON.
    """
    damper = given_law(law)
    own, name = with_dampers_at(parse_vehicle(vehicle)(damper), command), "vehicle" if damper is None else "law"
    cars = {name: controlling.of(own, damper)}
    if baseline is not None or controlling.controller is not None:  # at its own command
        cars = {"baseline": own if baseline is None else read_baseline(baseline, own)} | cars
    (surface,), run = driving.over(road)
    if not isinstance(surface, AbstractRoad):
        refuse_road(road)
    run["duration"] = surface.duration or USUAL if driving.duration is None else driving.duration  # iso in full
    commands = at_commands(cars)
    screen.points(commands)
    screen.points(unusual(road, driving.speed), style="yellow")
    with job(screen, "ride", output) as work:
        remarks: list[str] = []
        responses = driven(screen, cars, lambda car: simulate(car, surface, **how.arguments(**run)), remarks.extend)
        remarks += notes_of(dict(reversed(responses.items())))
        tables = show_ride(screen, responses)
        screen.remarks(remarks, style="yellow")
        axles = axles_sentence(responses)
        if axles:
            screen.say(axles)
        title = f"{vehicle} on {road} at {display().speed(driving.speed)}"
        laws = {name: one for name, car in cars.items() if (one := law_of(car.passive)) is not None}
        with work.saving("Tables and channels") as draft:
            _write(draft, laws, responses)
            write_tables(draft, tables)
            plots.animation(responses, draft / "animation.html", title=title)
        work.page(ride_report, responses, title=title, laws=laws, remarks=[*commands, *remarks])


def driven(
    screen: Screen,
    cars: Mapping[str, AbstractVehicle],
    drive: Callable[[AbstractVehicle], Response],
    say: Callable[[list[str]], None],
    title: str = "Driving",
) -> dict[str, Response]:
    """Each vehicle on a road; what its run warns of the step is said at once."""
    responses: dict[str, Response] = {}
    with screen.stage(title, total=len(cars)) as advance:
        for name, car in cars.items():
            advance(name, len(responses))
            responses[name], warned = with_step_warnings(lambda car=car: drive(car))
            say([f"{name}: {text}" for text in warned])
    return responses


def at_commands(cars: Mapping[str, AbstractVehicle]) -> list[str]:
    """At which command the dampers of each car are that no controller sets."""
    passive = {name: command_words(car) for name, car in cars.items() if car.passive is car}
    return [f"{name}: {at}." for name, at in passive.items() if at]


def show_ride(screen: Screen, responses: Mapping[str, Response]) -> dict[str, Table]:
    """Rides on one road at the terminal: the answer and the main metrics; all tables by name."""
    tables = ride_tables(responses)
    screen.answer(*ride_verdict(responses))
    screen.table(headline(screen, tables["metrics"], next(iter(responses.values())).vehicle))
    screen.details(*(table for name, table in tables.items() if name != "metrics"))
    return tables


def headline(screen: Screen, table: Table, vehicle: AbstractVehicle) -> Table:
    """Comfort, travel and grip of a vehicle out of a table of all metrics; all if the terminal is to."""
    names, shown = {row[0] for row in table.rows}, set[str]()
    for goal in GOALS:
        driven, stationary = (vehicle.goal_metrics(goal, white=white) for white in (False, True))
        shown |= {*(driven if names & {*driven} else stationary)}
    return table if screen.verbose else table.only(shown)


def _write(folder: Path, laws: Mapping[str, AbstractDamper], responses: Mapping[str, Response]) -> None:
    """Laws and channels, which are in SI and positive in rebound whatever is shown."""
    for name, law in laws.items():
        export.to_json(law, folder / f"{'law' if name == 'vehicle' else name}.json")
    *_, car = (response.vehicle for response in responses.values())
    if car.passive is not car:
        export.to_json(car, folder / "vehicle.json")  # `jaxdamp export` makes C of its controller
    for name, response in responses.items():
        channels = response.to_xarray()
        units = {key: typeset_unit(each.attrs["units"]) for key, each in channels.variables.items()}
        headings = {key: f"{key} [{unit}]" if unit else key for key, unit in units.items()}
        channels.to_dataframe().reset_index().rename(columns=headings).to_csv(
            folder / f"channels_{name}.csv", index=False
        )
