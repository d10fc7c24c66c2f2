"""Motion ratios over the wheel travel, as kinematics programs write them."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from jaxdamp import _checks
from jaxdamp._checks import ArgumentError, Setting
from jaxdamp._files import FOLDER_SUFFIXES, find_files
from jaxdamp.bench import sign as signs
from jaxdamp.bench.columns import Choice, given_column, in_si, numbers_of
from jaxdamp.bench.headers import direction_of, split_header
from jaxdamp.bench.raw import RawTable
from jaxdamp.bench.readers import READERS, read_tables
from jaxdamp.bench.record_tables import main_tables
from jaxdamp.bench.table_points import Points
from jaxdamp.bench.units import conversion
from jaxdamp.dampers import AbstractDamper, Linkage


_WORDS = {  # the ratio first: "damper motion ratio" is one
    "ratio": {"ratio", "mr", "übersetzung"},
    "damper": {"damper", "shock", "coilover", "strut", "dämpfer", "stoßdämpfer", "federbein"},
    "wheel": {"wheel", "jounce", "bump", "rebound", "droop", "rad", "radhub", "einfederung", "ausfederung"},
}
_NO_UNITS = ("", "-", "1", "m/m", "mm/mm", "in/in")


@final
@dataclass(frozen=True, eq=False)
class Kinematics:
    """Motion ratios over the wheel travel, as `bench.read_kinematics` reads them.

    Attributes:
        name: of the file.
        travel: increasing wheel travels [m], positive in rebound, shape (points,).
        ratio: damper travel divided by wheel travel there, shape (points,).
        notes: what was decided on columns, units and sign.
    """

    name: str
    travel: Points
    ratio: Points
    notes: tuple[str, ...]

    def linkage(self, law: AbstractDamper) -> Linkage:
        """The law at the wheel of a law at the damper.

        Arguments:
            law: the law at the damper.
        """
        return Linkage(law, self.travel, self.ratio)


def read_kinematics(
    path: str | os.PathLike[str],
    *,
    sign: str | None = None,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    delimiter: str | None = None,
) -> Kinematics:
    r"""Read the motion ratio over the wheel travel from a table of a kinematics program.

    One column is the wheel travel, another the damper's travel or length or the motion ratio itself. The ratio of
    damper travels is their slope at each point, by parabolas through it and its neighbours. Whether the damper column
    counts compression or extension as positive does not matter, since the ratio is positive. Rows may be in any order.

    Arguments:
        path: the file: text, a workbook, or what else `read` takes.
        sign: "rebound-positive" or "compression-positive": the direction in which the wheel travel is positive, where
            the header of its column does not say it (bump, jounce; rebound, droop).
        columns: "wheel", and "damper" or "ratio", to header or number (from 0) of the column, where the words of the
            headers do not tell.
        units: "stroke" to the unit of the travels, where the headers have none.
        delimiter: the character between columns of text files, if the search fails.

    Returns:
        The ratio, damper travel divided by wheel travel, at each wheel travel [m].

    Raises:
        FileNotFoundError: no such file.
        ValueError: no such columns; a unit or a sign that the file does not state; fewer than two points; the same
            wheel travel twice; a damper travel that turns, or a ratio that is not positive.

    >>> import tempfile
    >>> from pathlib import Path
    >>> file = Path(tempfile.mkdtemp()) / "front.csv"
    >>> lines = ["bump travel [mm],damper length [mm]", "-20,512.5", "-10,505.5", "0,500", "10,496"]
    >>> _ = file.write_text("\n".join(lines))
    >>> kinematics = read_kinematics(file)
    >>> kinematics.travel.tolist(), kinematics.ratio.round(3).tolist()
    ([-0.01, 0.0, 0.01, 0.02], [0.325, 0.475, 0.625, 0.775])
    """
    signs.check_words(sign, None)
    for role in columns or {}:
        _checks.one_of("columns", role, tuple(_WORDS))
    (file,) = find_files([path], FOLDER_SUFFIXES)
    table = main_tables(read_tables(file, READERS, delimiter))[0]
    at = _columns(table, columns or {})
    choice = Choice(units={**(units or {})})
    travel, unit = in_si(table, at["wheel"], "stroke", choice)
    factor, said = _direction(table, table.names[at["wheel"]], sign)
    quantity = "damper" if "damper" in at else "ratio"
    values, of_values = (
        in_si(table, at["damper"], "stroke", choice) if "damper" in at else (_ratios(table, at["ratio"]), "one")
    )
    there = np.isfinite(travel) & np.isfinite(values)
    order = np.argsort(factor * travel[there])
    travel, values = (factor * travel[there])[order] + 0.0, values[there][order]  # no negative zero
    _check_points(table, travel)
    notes = [f"{role} from {table.names[index]!r}" for role, index in at.items()]
    notes += [f"wheel travel in {unit}, {quantity} in {of_values}; brought to SI", said, *table.notes]
    if not travel[0] <= 0.0 <= travel[-1]:
        notes.append("no point at both sides of zero wheel travel, which is the zero of the vehicle's stroke")
    ratio = values if quantity == "ratio" else _slopes(table, travel, values)
    _check_ratios(table, travel, ratio)
    return Kinematics(file.stem, travel, ratio, tuple(notes))


def _columns(table: RawTable, chosen: Mapping[str, str | int]) -> dict[str, int]:
    """The columns of the wheel travel, and of the damper travel or else of the ratio."""
    columns = {role: given_column(table, role, wanted) for role, wanted in chosen.items()}
    for index, name in enumerate(table.names):
        role = _role(table, index)
        if role is None or index in columns.values() or role in chosen:
            continue
        if role in columns:
            choose = Setting("columns", {role: index})
            both = f"{table.names[columns[role]]!r} and {name!r}"
            raise ArgumentError(f"{table.where}: {both} could both be the {role}. Choose one: {choose}.", choose)
        columns[role] = index
    columns.pop("damper" if "ratio" in chosen or "damper" not in columns else "ratio", None)  # one is enough
    lacking = [role for role in ("wheel", "damper" if "ratio" not in columns else "ratio") if role not in columns]
    if lacking:
        choose = Setting("columns", dict.fromkeys(lacking, ...))
        what = " and ".join(f"the travel of the {role}" for role in lacking)
        there = ", ".join(map(repr, table.names))
        raise ArgumentError(f"{table.where} has no column for {what}: its columns are {there}. Pass {choose}.", choose)
    return columns


def _words(text: str) -> set[str]:
    return set(re.findall(r"[a-zß-ÿ]+", text.lower()))


def _role(table: RawTable, index: int) -> str | None:
    """What a column is by the words of its header, unless its unit says that it is no such thing."""
    name, written = split_header(table.columns[index].name)
    unit, words = table.columns[index].unit or written or "", _words(name)
    role = next((role for role, names in _WORDS.items() if words & names), None)
    return None if role != "ratio" and unit and conversion("stroke", unit) is None else role


def _direction(table: RawTable, header: str, sign: str | None) -> tuple[float, str]:
    """The factor that brings a wheel travel to rebound positive, and why."""
    if sign is not None:
        return (-1.0 if sign == "compression-positive" else 1.0), f"wheel travel is {sign}, as it was said"
    way = direction_of(header)
    if way == 0:
        signs.require(None, f"{table.where}, column {header!r}", "wheel travel", "header")
    return float(way), f"wheel travel is {signs.SIGNS[way < 0]}, as its header says"


def _ratios(table: RawTable, index: int) -> Points:
    """The column of ratios, which have no unit."""
    column = table.columns[index]
    unit = column.unit or split_header(column.name)[1] or ""
    if unit not in _NO_UNITS:
        where = f"{table.where}, column {table.names[index]!r}"
        raise ValueError(
            f"{where}: a motion ratio is damper travel divided by wheel travel, without the unit {unit!r}."
        )
    return numbers_of(table, index)


def _check_points(table: RawTable, travel: Points) -> None:
    if len(travel) < 2:
        raise ValueError(f"{table.where} must hold two or more points with numbers, but has {len(travel)}.")
    equal = np.flatnonzero(np.diff(travel) <= 0.0)
    if len(equal):
        raise ValueError(f"{table.where} has the wheel travel {1e3 * travel[equal[0]]:g} mm twice. Remove one.")


def _slopes(table: RawTable, travel: Points, damper: Points) -> Points:
    """The slope of a damper travel or length over the wheel travel, counted positive; refused where it turns."""
    rising = damper * np.sign(damper[-1] - damper[0])
    turns = np.flatnonzero(np.diff(rising) <= 0.0)
    if len(turns):
        low, high = 1e3 * travel[turns[0] : turns[0] + 2]
        raise ValueError(
            f"{table.where}: the damper travel must rise or fall all the way, but turns between {low:g} and {high:g} "
            "mm of the wheel in rebound, where the motion ratio passes zero. Leave out the rows beyond."
        )
    return np.gradient(rising, travel, edge_order=2 if len(travel) > 2 else 1)


def _check_ratios(table: RawTable, travel: Points, ratio: Points) -> None:
    if np.any(ratio <= 0.0):
        k = int(np.argmax(ratio <= 0.0))
        raise ValueError(
            f"{table.where}: motion ratios must be positive, but one is {ratio[k]:g} at {1e3 * travel[k]:g} mm of the "
            "wheel in rebound. Take magnitudes where they are counted the other way, and leave out rows near zero."
        )
