"""What vehicles and laws are called on the command line: `jaxdamp vehicles`, `jaxdamp laws`, and files."""

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

import equinox as eqx

from jaxdamp import _checks, export, vehicles
from jaxdamp._tables import Contents
from jaxdamp._traced import equal
from jaxdamp.cli.console import Screen
from jaxdamp.cli.early import EXAMPLE, FROM_FIT, read_json, read_vehicle
from jaxdamp.dampers import AbstractDamper, check_commands, takes_command, with_command
from jaxdamp.identify import laws_table
from jaxdamp.parameters import get, matching, modules_inside, replace
from jaxdamp.report import Column, Table
from jaxdamp.tune import damper_paths
from jaxdamp.vehicles import AbstractVehicle, Cab, Seat


T = TypeVar("T")
MakeCar = Callable[[AbstractDamper | None], AbstractVehicle]


def presets() -> dict[str, Callable[..., AbstractVehicle]]:
    """The published vehicles that take a damper, by name."""
    functions = inspect.getmembers(vehicles.presets, inspect.isfunction)
    return {name: make for name, make in functions if "damper" in inspect.signature(make).parameters}


def list_vehicles(screen: Screen) -> None:
    """List the vehicles that a law can be put into."""
    rows = tuple((name, (inspect.getdoc(make) or "").partition("\n")[0]) for name, make in presets().items())
    screen.table(Table("Vehicles", (Column("vehicle"), Column("what it is")), rows))


def list_laws(screen: Screen) -> None:
    """List the laws that can be fitted by name."""
    screen.table(laws_table())


def parse_vehicle(word: str) -> MakeCar:
    """The vehicle that a word means, as a function of a law for its dampers, or of None for its own.

    A name out of `jaxdamp vehicles`, a JSON file of `export.to_json`, or a TOML file with a preset and other values:

        preset = "quarter_car_000"

        [parameters]
        sprung_mass = 1300.0
    """
    path = Path(word).expanduser()
    if path.suffix not in (".json", ".toml"):
        _checks.one_of("vehicle", word, presets())
        return lambda law: presets()[word](damper=law)
    if path.suffix == ".json":
        remedy = 'Or give a name, see "jaxdamp vehicles"; a law is put into one with --law.'
        car = read_module("vehicle", path, AbstractVehicle, "a vehicle", remedy)
        return lambda law: car if law is None else with_law(car, law)
    return _preset(word, read_vehicle(path))


def read_law(argument: str, path: Path) -> AbstractDamper:
    """The law of a JSON file."""
    return read_module(argument, path, AbstractDamper, "a law", FROM_FIT)


def given_law(path: Path | None) -> AbstractDamper | None:
    """The law of the option --law, if it is given."""
    return None if path is None else read_law("law", path)


def read_baseline(path: Path, car: AbstractVehicle) -> AbstractVehicle:
    """The vehicle of the option --baseline: this one with another law, as --law puts it in, or one of its kind."""
    kinds, words = (AbstractDamper, type(car)), f"a law or a {type(car).__name__}"
    module = read_module("baseline", path, kinds, words, "`jaxdamp tune` writes law.json and vehicle.json.")
    return with_law(car, module) if isinstance(module, AbstractDamper) else module


def read_module(argument: str, path: Path, kinds: type[T] | tuple[type[T], ...], words: str, remedy: str = "") -> T:
    """What a JSON file of `export.to_json` holds."""
    read_json(argument, path, words, remedy)
    module = export.from_json(path)
    _checks.instance(argument, module, kinds, f"be {words} as JSON", remedy)
    return module


def _preset(word: str, document: Contents) -> MakeCar:
    extra = [key for key in document if key not in ("preset", "tyre_lifts", "parameters")]
    name, values, lifts = document.get("preset"), document.get("parameters", {}), document.get("tyre_lifts", False)
    if extra or not (isinstance(name, str) and isinstance(values, dict) and isinstance(lifts, bool)):
        must = "be a TOML file of preset, tyre_lifts (true or false) and [parameters]"
        held = extra or [f"{key} = {value!r}" for key, value in document.items() if not isinstance(value, dict)]
        _checks.refuse("vehicle", must, f"one of {', '.join(held)}", EXAMPLE)
    _checks.one_of(f"preset in {word}", name, presets())
    numbers = dict(_flat(values))
    return lambda law: replace(presets()[name](damper=law, tyre_lifts=lifts), numbers)


def _flat(values: Mapping[str, object], prefix: str = "") -> list[tuple[str, object]]:
    """Tables inside a table as paths: `[parameters.front] spring_rate = 2e4` is front.spring_rate."""
    pairs = []
    for key, value in values.items():
        pairs += _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else [(prefix + key, value)]
    return pairs


def with_law(vehicle: AbstractVehicle, law: AbstractDamper) -> AbstractVehicle:
    """The vehicle with a law at its dampers, but for those of seats and of a cab, which keep their own."""
    mounts = [prefix for prefix, part in modules_inside(vehicle) if isinstance(part, Seat | Cab)]
    places = damper_places(vehicle)
    for path in [path for path in places if not path.startswith((*mounts,))] or places:
        vehicle = eqx.tree_at(lambda car, path=path: get(car, path), vehicle, law)
    return vehicle


def commanded(law: AbstractDamper, command: float | None) -> AbstractDamper:
    """A law at the command of the option --command; at its own without one."""
    if command is None:
        return law
    check_commands("command", law, command)
    return with_command(law, command)


def with_dampers_at(vehicle: AbstractVehicle, command: float | None) -> AbstractVehicle:
    """The vehicle with its dampers that take a command at that of the option --command; itself without one."""
    if command is None:
        return vehicle
    if vehicle.passive is not vehicle:
        _checks.refuse("command", "be left out of a vehicle with a controller, which sets it", command)
    laws = {path: get(vehicle, path) for path in damper_places(vehicle)}
    for path, law in ({path: law for path, law in laws.items() if takes_command(law)} or laws).items():
        vehicle = eqx.tree_at(lambda car, path=path: get(car, path), vehicle, commanded(law, command))
    return vehicle


def law_of(vehicle: AbstractVehicle) -> AbstractDamper | None:
    """The law that all dampers of a vehicle have; None where they differ."""
    first, *others = [*dampers_of(vehicle).values()] or [None]
    return first if all(equal(first, law) for law in others) else None


def dampers_of(vehicle: AbstractVehicle) -> dict[str, AbstractDamper]:
    """The laws at the dampers of a vehicle by their paths."""
    return {path: get(vehicle, path) for path in matching(damper_paths(vehicle), "*damper")}


def write_laws(folder: Path, vehicle: AbstractVehicle) -> None:
    """The dampers of a vehicle as JSON: law.json if all are alike, otherwise a file named after each path."""
    law = law_of(vehicle)
    for path, one in (dampers_of(vehicle) if law is None else {"law": law}).items():
        export.to_json(one, folder / f"{path.replace('.', '_')}.json")


def damper_places(vehicle: AbstractVehicle) -> list[str]:
    """The paths of the dampers of a vehicle."""
    dampers = damper_paths(vehicle)
    places = matching(dampers, "*damper")
    if not places:
        remedy = "Leave the law out, to take those of the vehicle."
        _checks.refuse("vehicle", "have a law whose path ends with 'damper'", ", ".join(dampers) or "none", remedy)
    return places
