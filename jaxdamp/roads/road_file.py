"""Roads from text files."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from jaxdamp import _checks
from jaxdamp._documents import read_text
from jaxdamp._types import ScalarLike
from jaxdamp._unit_registry import ratio
from jaxdamp.roads._sampled import SampledRoad
from jaxdamp.roads.profile import from_profile


_LENGTHS = {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
_TIMES = {"s": 1.0, "ms": 0.001}
Column = str | int


def read_profile(
    path: str | Path,
    speed: ScalarLike | int | None = None,
    *,
    position: Column = 0,
    height: Column | Sequence[Column] = 1,
    position_unit: str | None = None,
    height_unit: str | None = None,
    periodic: bool = False,
    ramp: float | int = 0.0,
) -> SampledRoad:
    r"""A road from a text file with one column of positions (or times) and one or several of heights.

    Columns are separated by commas, semicolons, tabs or blanks. Lines that begin with # or %, and empty ones, are left
    out. Names of columns may stand in the first remaining line, with their units: `position [ft],height [in]`, or
    `height_mm`. Everything else is as for `from_profile`.

    Arguments:
        path: the file.
        speed: the speed of the vehicle [m/s] if the positions are distances along the road; left out if they are times.
        position: the column of positions, by name or by number from 0.
        height: the column of heights, or one column for each track, by name or by number from 0.
        position_unit: "m", "km", "cm", "mm", "ft" or "in"; without a speed "s" or "ms". By default the unit in the name
            of the column; where it has none, "m", or "s" without a speed.
        height_unit: "m", "km", "cm", "mm", "ft" or "in". By default the unit in the name of each column; where it has
            none, "m".
        periodic: repeat the profile for ever, as for `from_profile`.
        ramp: the time [s] over which the road fades in, as for `from_profile`.

    Raises:
        ValueError: if the file holds no numbers, if lines differ in length or a field is not a number, if a column or
            unit is unknown, if the unit of a column is none of its quantity or another one than is given, or if
            `from_profile` refuses the values.
        FileNotFoundError: if there is no such file.

    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "lane.csv"
    >>> _ = file.write_text("distance,left,right\n0.0,0,1\n0.1,5,2\n0.2,0,3\n")
    >>> road = read_profile(file, speed=10.0, height=["left", "right"], height_unit="mm")
    >>> road.height(np.array([0.01, 0.02]))
    Array([[0.005, 0.002],
           [0.   , 0.003]], dtype=float64)
    """
    of_positions = _TIMES if speed is None else _LENGTHS
    for argument, unit, units in (
        ("position_unit", position_unit, of_positions),
        ("height_unit", height_unit, _LENGTHS),
    ):
        if unit is not None:
            _checks.one_of(argument, unit, units)
    names, table = _table(Path(path))
    chosen = [height] if isinstance(height, str | int) else list(height)
    columns = [_column("height", column, names, path) for column in chosen]
    heights = [table[:, i] * _size_of_unit("height_unit", height_unit, names[i], _LENGTHS, path) for i in columns]
    i = _column("position", position, names, path)
    size = _size_of_unit("position_unit", position_unit, names[i], of_positions, path)
    return from_profile(table[:, i] * size, np.stack(heights, axis=1), speed, periodic=periodic, ramp=ramp)


def _size_of_unit(argument: str, given: str | None, name: str, units: Mapping[str, float], path: object) -> float:
    """The unit of a column in SI: that in its name or, where this has none, the one given, or the first of `units`."""
    written = _unit_in(name)
    if not written:
        return units[given or next(iter(units))]
    size = _size(written, units)
    if size is None:
        kind = "time" if units is _TIMES else "length"
        remedy = f"Usual units are {', '.join(units)}."
        if argument == "position_unit":
            remedy += " Positions along the road need `speed`, positions in time are without it."
        must = f"name a file with a unit of {kind} in the header of its {argument.removesuffix('_unit')}s"
        _checks.refuse("path", must, f"{path} with the column {name!r}", remedy)
    if given is not None and not np.isclose(units[given], size, rtol=1e-9):
        remedy = "Leave it out, or correct the header."
        _checks.refuse(argument, f"be the unit of the column {name!r} of {path}", repr(given), remedy)
    return size


def _unit_in(name: str) -> str:
    """The unit in the name of a column, in brackets or, if it is of a length or a time, behind an underscore."""
    brackets = re.findall(r"[\[({]\s*([^\[\](){}]*?)\s*[\])}]", name)
    if brackets:
        return brackets[-1]
    tail = name.rpartition("_")
    return tail[2] if tail[0] and tail[2] in (*_LENGTHS, *_TIMES) else ""


def _size(written: str, units: Mapping[str, float]) -> float | None:
    """A unit in SI, or None if it is none of the same quantity as `units`."""
    chosen = next((unit for unit in (written, written.lower()) if unit in units), None)
    return ratio(written, next(iter(units))) if chosen is None else units[chosen]


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    """The names of the columns (their numbers where there are none) and the numbers of a file."""
    lines = _lines(path)
    separator = next((mark for mark in ";\t," if mark in lines[0]), None)
    # a unit in brackets belongs to the name before it
    split = (
        [re.split(r"\s+(?![\[({])", line) for line in lines]
        if separator is None
        else list(csv.reader(lines, delimiter=separator))
    )
    rows = [[field.strip() for field in row] for row in split]
    has_names = not all(map(_is_number, rows[0]))
    names = rows.pop(0) if has_names else [str(number) for number in range(len(rows[0]))]
    if not rows:
        _checks.refuse("path", "name a file with numbers", f"{path}, which has only {lines[0]!r}")
    wrong = [i for i, row in enumerate(rows, has_names) if len(row) != len(names) or not all(map(_is_number, row))]
    if wrong:
        remedy = "Remarks begin with # or %; decimals have a point."
        must = f"name a file with {len(names)} numbers in each line"
        _checks.refuse("path", must, f"{path} with {lines[wrong[0]]!r}", remedy)
    return names, np.array(rows, float).reshape(len(rows), len(names))


def _lines(path: Path) -> list[str]:
    """The lines of a file but remarks."""
    stripped = map(str.strip, read_text(path, "text").splitlines())
    lines = [line for line in stripped if line and line[0] not in "#%"]
    if not lines:
        _checks.refuse("path", "name a file with numbers", f"{path}, which is empty")
    return lines


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _column(argument: str, column: Column, names: list[str], path: object) -> int:
    if isinstance(column, str):
        _checks.one_of(argument, column, names)
        return names.index(column)
    if not 0 <= column < len(names):
        _checks.refuse(argument, f"be a column from 0 to {len(names) - 1}", column, f"{path} has {names}.")
    return column
