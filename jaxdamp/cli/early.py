"""What can be told from the words and the files alone, before JAX is loaded: a mistyped path is answered at once."""

import glob
from pathlib import Path
from typing import NoReturn

from jaxdamp import _checks
from jaxdamp._documents import parse_json, read_text, read_toml
from jaxdamp._files import FOLDER_SUFFIXES, find_files
from jaxdamp._tables import Contents
from jaxdamp.cli import resuming
from jaxdamp.cli.results import refuse_target
from jaxdamp.cli.signatures import Arguments


FROM_FIT = "`jaxdamp fit` writes best_law.json from records."
FROM_BOTH = "Give the JSON of a law or of a vehicle."
EXAMPLE = 'Write for example preset = "quarter_car_000" and, below [parameters], sprung_mass = 1300.0.'
FROM_LIST = 'Or give a name, see "jaxdamp vehicles".'
ROADS = ("iso", "white", "bump")


def check(command: str, given: Arguments) -> None:
    """Refuse paths that lead nowhere, files that are not JSON, and a folder that may not be written."""
    if "out" in given and given.get("block") is None:  # a part writes no results
        again = {"replace": bool(given["replace"]), "resume": bool(given.get("resume"))}
        refuse_target(resuming.target_of(command, given), command, **again)
    if given.get("files") and given.get("each") is None:  # a line may have its records in folders inside
        find_files(given["files"], FOLDER_SUFFIXES)
    for name in ("law", "baseline"):
        if isinstance(given.get(name), Path):
            _check_law(command, name, given[name])
    if given.get("vehicle") is not None:
        _check_vehicle(Path(given["vehicle"]))
    road = given.get("road")
    if isinstance(road, str) and road.partition(":")[0] not in ROADS and not Path(road).is_file():
        refuse_road(road)
    for name in ("manifest", "limits"):
        if isinstance(given.get(name), Path):
            require_file(name, given[name])


def _check_law(command: str, name: str, path: Path) -> None:
    """Refuse a file that is no law, or for some options no vehicle or record."""
    if command == "bench" and path.suffix != ".json":  # other records
        find_files(path, FOLDER_SUFFIXES)
        return
    either = command == "export" or (name == "baseline" and command in ("ride", "tune", "sweep"))
    words, remedy = ("a law or a vehicle", FROM_BOTH) if either else ("a law", FROM_FIT)
    read_json(name, path, words, remedy)


def _check_vehicle(path: Path) -> None:
    """Refuse a file that is no vehicle; names are looked up later."""
    if path.suffix == ".json":
        read_json("vehicle", path.expanduser(), "a vehicle", FROM_LIST)
    elif path.suffix == ".toml":
        read_vehicle(path.expanduser())


def require_file(argument: str, path: Path, remedy: str = "") -> None:
    """Refuse a path where no file is; a fit by settings has the file of the name in the folder of each."""
    if not path.is_file():
        inside = [str(file) for file in sorted(path.parent.glob(f"*/{glob.escape(path.name)}"))][:4]
        _checks.refuse(
            argument, "be a file that is there", path, f"Did you mean {' or '.join(inside)}?" if inside else remedy
        )


def read_vehicle(path: Path) -> Contents:
    """What the TOML file of a vehicle says."""
    require_file("vehicle", path, FROM_LIST)
    try:
        return read_toml(path)
    except ValueError as error:
        _refuse_content("vehicle", "be TOML", path, error, EXAMPLE)


def read_json(argument: str, path: Path, words: str, remedy: str = "") -> None:
    """Refuse a path where no JSON file is."""
    require_file(argument, path, remedy)
    must = f"be {words} as JSON"
    try:
        text = read_text(path, "JSON")
    except ValueError as error:
        _refuse_content(argument, must, path, error, remedy)
    try:
        parse_json(text)
    except ValueError as error:
        _refuse_content(argument, must, path, f"is no JSON: {error}", remedy)


def _refuse_content(argument: str, must: str, path: Path, error: object, remedy: str) -> NoReturn:
    """Refuse a file for what it holds, in the words of the error, which may begin with its name."""
    said = str(error).removeprefix(f"{path} ").rstrip(".")
    _checks.refuse(argument, must, f"{path}, which {said}", remedy)


def refuse_road(text: str) -> NoReturn:
    """Refuse a word that means no road."""
    remedy = 'Examples: "iso:C", "bump:0.06:5", "profile.csv", "course.crg".'
    _checks.refuse("road", "be iso:CLASS, bump:HEIGHT:LENGTH or a file that is there", repr(text), remedy)
