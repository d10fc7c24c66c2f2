"""Points of force-velocity tables: columns of files to settings and directions, in SI and the library's sign."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp._checks import ArgumentError, Setting
from jaxdamp._files import natural_key
from jaxdamp.bench import sign as signs
from jaxdamp.bench.columns import Choice, find_one, in_si
from jaxdamp.bench.headers import COMPRESSION, REBOUND, role_of, split_header, tail_unit
from jaxdamp.bench.raw import Problems, RawTable, in_words
from jaxdamp.bench.settings import settings_in_name


Directions = dict[int, dict[str, list[np.ndarray]]]  # points by direction and setting
SIDES = ("rebound", "compression", "symmetric")
_REBOUND = REBOUND | {"ext", "tension", "zug", "r"}
_COMPRESSION = COMPRESSION | {"comp", "druck", "c"}
_SETTING = {"setting", "settings", "click", "clicks", "clk", "position", "adjuster", "current", "valve", "turns"}
_DIRECTION = {"direction", "side", "stage"}
_MOST_ROWS = 5000  # of a table; more is a record
Points = Float[np.ndarray, " points"]


class Curve(NamedTuple):
    """The points of one setting."""

    setting: str  # its name, such as "4" for a click; empty if there is only one
    command: float | None  # its number; None where the name has none
    velocity: Points  # increasing [m/s], positive in rebound
    force: Points  # [N], positive when it resists extension


class Side(NamedTuple):
    """Points of one column and setting; direction is 1 in rebound, -1 in compression, 0 where signs say it.

    `by_name` is true where not the header but the name of the file or sheet says the direction.
    """

    setting: str
    direction: Points
    velocity: Points
    force: Points
    where: str
    file: Path
    by_name: bool = False


def stated_sign(table: RawTable) -> str | None:
    """The direction that the comments of a table state, as those that the library writes do; None without one."""
    match = re.search(r"velocity is positive in (extension|rebound|compression)", " ".join(table.preamble))
    return None if match is None else f"{'compression' if match[1] == 'compression' else 'rebound'}-positive"


def is_force_velocity(table: RawTable, choice: Choice) -> bool:
    """Whether a table of a file holds points of forces over velocity rather than a record over time."""
    table = with_headers(table)
    if not table.is_named or len(table) > _MOST_ROWS or any(column.unit == "s" for column in table.columns):
        return False
    roles = {role_of(column.name, column.unit) for column in table.columns}
    named = find_one(table, "velocity", choice)
    return named is not None and "time" not in roles and bool(list(_forces(table, named, choice)))


def with_headers(table: RawTable) -> RawTable:
    """The table with the numbers in its first row as headers, where the other cells of that row are words."""
    if table.is_named or not any(0 in column.faults and column.faults[0] for column in table.columns):
        return table
    heads = (column.faults.get(0, "") or f"{np.asarray(column.values)[0]:g}" for column in table.columns)
    below = (column._rows(slice(1, None)) for column in table.columns)
    columns = tuple(replace(column, name=head) for column, head in zip(below, heads, strict=True))
    return replace(table, columns=columns, lines=table.lines[1:])


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z]+|(?:(?<![^\s_(])-)?\d+(?:\.\d+)?", split_header(text)[0].lower())


def _direction(text: str) -> int:
    """The direction that a header states: 1 rebound, -1 compression, 0 none or both; by a letter if no word does."""
    words = set(_words(text))
    spelled = {word for word in words if len(word) > 1}
    words = spelled if spelled & (_REBOUND | _COMPRESSION) else words
    return int(bool(words & _REBOUND)) - int(bool(words & _COMPRESSION))


def _direction_of_name(table: RawTable, velocity: Points) -> int:
    """The direction that the name of a file or sheet states; none for velocities of both signs, where R may be right.

    A letter beside digits is part of a type or of an adjuster.
    """
    if np.any(velocity < 0.0) and np.any(velocity > 0.0):
        return 0
    return _direction(re.sub(r"(?i)[rc] ?-?\d+|\d[rc](?![a-z])", " ", f"{table.file.stem} {table.record}"))


def _setting(text: str) -> str:
    """The setting that a header or a name states: its numbers, or its words but for force and direction."""
    settings = settings_in_name(text)
    if len(settings) == 1:
        return f"{next(iter(settings.values())):g}"
    name, unit = split_header(text)
    tail = None if unit else tail_unit(name, "force")
    name = tail[0] if tail else name
    if settings:
        spelled = rf"(?i)\b(?:{'|'.join(word for word in _REBOUND | _COMPRESSION if len(word) > 1)})\b"
        return re.sub(spelled, "", name).strip(" _-,:")
    words = [word for word in _words(name) if word not in _REBOUND | _COMPRESSION | _SETTING and role_of(word) is None]
    numbers = [word for word in words if word[-1].isdigit()]
    return numbers[0] if len(numbers) == 1 else " ".join(words)


def _forces(table: RawTable, velocity: int, choice: Choice) -> Iterator[int]:
    """The columns of forces: named so, or as a setting or a direction."""
    if "force" in choice.columns:
        index = find_one(table, "force", choice)
        yield from [] if index is None else [index]
        return
    for index, column in enumerate(table.columns):
        role, words = role_of(column.name, column.unit), set(_words(column.name))
        if index == velocity or column.is_text or role not in (None, "force"):
            continue
        speaks = any(word[-1].isdigit() for word in words) or words & (_REBOUND | _COMPRESSION)
        if role == "force" or speaks or settings_in_name(column.name):
            yield index


def _column_of_words(table: RawTable, wanted: set[str], besides: Sequence[int]) -> int | None:
    """The column that one of these words names, such as that of the clicks."""
    names = {index: set(_words(name)) for index, name in enumerate(table.names) if index not in besides}
    named = (i for i, words in names.items() if wanted & words and not any(word[-1].isdigit() for word in words))
    return next(named, None)


def sides_of(table: RawTable, choice: Choice) -> tuple[list[Side], list[str]]:
    """The points of every column of forces, in SI, and notes."""
    at = find_one(table, "velocity", choice)
    assert at is not None
    forces = list(_forces(table, at, choice))
    clicks = _column_of_words(table, _SETTING, [at])
    forces = [index for index in forces if index != clicks]
    words = _column_of_words(table, _DIRECTION, [at, *forces])
    velocity, unit = in_si(table, at, "velocity", choice)
    units, sides, problems, missing = {"velocity": unit}, [], Problems(), 0
    of_name = _direction_of_name(table, velocity)
    for index in forces:
        with problems.collected(table.where):
            force, units["force"] = in_si(table, index, "force", choice)
            there = np.isfinite(velocity) & np.isfinite(force)
            missing += int(np.sum(~there))
            of_header = _direction(table.names[index])
            direction = np.full(len(velocity), of_header or of_name, dtype=float)
            if words is not None:
                direction = np.array([_direction(str(cell)) for cell in table.columns[words].values], dtype=float)
            settings = np.full(len(velocity), _setting(table.names[index]) or _setting(table.record), dtype=object)
            if clicks is not None:
                settings = np.array([in_words(value) for value in table.columns[clicks].values], dtype=object)
            where = f"{table.where}, column {table.names[index]!r}"
            for setting in dict.fromkeys(settings.tolist()):
                rows = there & (settings == setting)
                channels = direction[rows], velocity[rows], force[rows]
                sides.append(Side(setting, *channels, where, table.file, of_header == 0 and words is None))
    problems.raise_any()
    read = ", ".join(f"{role} in {text}" for role, text in units.items())
    lost = [f"left out: {missing} cell{'s' * (missing > 1)} of velocity or force without a number"] * bool(missing)
    return sides, [f"a force-velocity table: {read}; brought to SI", *lost, *table.notes]


def curves_of(sides: Sequence[Side], sign: str | None, half: str | None) -> tuple[tuple[Curve, ...], list[str]]:
    """The points by setting, both directions joined, and notes; `sign` and `half` are `sign` and `side` as given."""
    notes: list[str] = []
    points: Directions = {1: {}, -1: {}}
    for direction, side in _apart(_halves(sides, sign, half, notes)):
        points[direction].setdefault(side.setting, []).append(np.stack([side.velocity, side.force]))
    for direction, word in ((1, "rebound"), (-1, "compression")):
        if not points[direction]:
            _refuse_half(sides[0].where, word)
        _share(points[direction], points[-direction], word, notes)
    if all(np.all(side.force >= 0.0) or np.all(side.force <= 0.0) for side in sides):
        _rest(points, notes)
    names = sorted({*points[1], *points[-1]}, key=natural_key)
    lacking = [name for name in names if name not in points[1] or name not in points[-1]]
    if lacking:
        raise ValueError(f"{sides[0].where}: {', '.join(map(repr, lacking))} is there in one direction only.")
    curves = [_curve(name, [*points[-1][name], *points[1][name]], notes) for name in names]
    notes += [f"{len(curves)} settings, by columns, rows, sheets or files: {', '.join(names)}"] * (len(curves) > 1)
    return tuple(sorted(curves, key=lambda curve: np.inf if curve.command is None else curve.command)), notes


def _halves(sides: Sequence[Side], sign: str | None, half: str | None, notes: list[str]) -> list[tuple[int, Side]]:
    """The points in rebound (1) and in compression (-1) of each column, positive in rebound."""
    halves = []
    for side in sides:
        velocity, force = _oriented(side, sign, half, notes)
        for direction, there in ((1, ~np.signbit(velocity)), (-1, np.signbit(velocity))):  # −0.0 is of compression
            if there.any():
                halves.append((direction, side._replace(velocity=velocity[there], force=force[there])))
    return halves


def _apart(halves: list[tuple[int, Side]]) -> list[tuple[int, Side]]:
    """The points with the names of files as settings where these give the same ones; refused if that does not help."""
    files: dict[tuple[int, str], set[Path]] = {}
    for direction, side in halves:
        if np.any(side.velocity):
            files.setdefault((direction, side.setting), set()).add(side.file)
    if any(len(same) > 1 for same in files.values()):
        names = {file: re.split(r"[_\s]+", file.stem) for same in files.values() for file in same}
        common = set.intersection(*map(set, names.values()))
        distinct = {file: [word for word in words if word not in common] for file, words in names.items()}
        names = distinct if all(distinct.values()) else names
        halves = [(way, side._replace(setting=_in_file(names[side.file], side))) for way, side in halves]
    seen: dict[tuple[int, str], str] = {}
    for direction, side in halves:
        if np.any(side.velocity):  # a point at rest may stand in both directions
            _once(side, direction, seen.setdefault((direction, side.setting), side.where))
    return halves


def _in_file(words: Sequence[str], side: Side) -> str:
    """The setting of a column by the words of its file's name, but for those of direction, and by its header."""
    other = _REBOUND | _COMPRESSION | _SETTING if np.all(side.direction != 0.0) else _SETTING
    text = " ".join(word for word in words if word.lower() not in other)
    return " ".join(filter(None, [_setting(text) if settings_in_name(text) else text, side.setting]))


def _once(side: Side, direction: int, first: str) -> None:
    """Refuse a column that gives the same setting and direction as the first one that does."""
    if side.where == first:
        return
    way, setting = "rebound" if direction > 0 else "compression", f" at {side.setting!r}" if side.setting else ""
    (table, column), (other, before) = side.where.rsplit(", column ", 1), first.rsplit(", column ", 1)
    both = f"{table}: columns {before} and {column}" if table == other else f"{first} and {side.where}"
    names = "" if table == other else "or in the names of files and sheets, "
    raise ValueError(
        f"{both} both give the force in {way}{setting}. Name a setting in each header, such as `4 clicks`, {names}"
        "or keep one of them."
    )


def _rest(points: Directions, notes: list[str]) -> None:
    """A point of no force at zero velocity, for settings that have none there."""
    for setting, parts in points[1].items():
        if not any(np.any(part[0] == 0.0) for part in [*parts, *points[-1].get(setting, [])]):
            parts.append(np.zeros((2, 1)))
            notes.append("no force at rest, since forces are given as magnitudes by direction")


def _share(measured: dict[str, list[np.ndarray]], others: Iterable[str], word: str, notes: list[str]) -> None:
    """Take a direction that has no settings for all those of the other."""
    if len(measured) == 1 and set(measured) != set(others):
        (only,) = measured.values()
        measured.clear()
        measured.update(dict.fromkeys(others, only))
        notes.append(f"{word} is the same at all settings")


def _curve(name: str, parts: Sequence[np.ndarray], notes: list[str]) -> Curve:
    velocity, force = np.concatenate(parts, axis=1)
    unique, place, count = np.unique(np.round(velocity, 9), return_inverse=True, return_counts=True)
    if np.any(count > 1):
        notes.append("points at the same velocity are averaged")
    number = re.fullmatch(r"[-+]?\d+(?:\.\d+)?", name)
    return Curve(name, float(name) if number else None, unique, np.bincount(place.ravel(), force) / count)


def _oriented(side: Side, sign: str | None, half: str | None, notes: list[str]) -> tuple[Points, Points]:
    """Velocity and force of a column, positive in rebound; a refusal where the file does not tell the direction."""
    velocity, force = side.velocity, side.force
    factor, way = (-1.0, "compression") if sign == "compression-positive" else (1.0, "rebound")
    both = bool(np.any(force < 0.0) and np.any(force > 0.0))
    if np.all(side.direction != 0.0):
        if any(np.ptp(np.sign(force[(side.direction == d) & (force != 0.0)])) > 0 for d in set(side.direction)):
            said = "rebound" if np.all(side.direction > 0.0) else "compression"
            name = f", which the name of its file or sheet says is {said}" * side.by_name
            other = ", or rename it" * side.by_name
            raise ValueError(
                f"{side.where} has forces of both signs in one direction{name}: subtract the gas force{other}."
            )
        notes.append("rebound and compression as headers or names say")
        return np.abs(velocity) * side.direction, np.abs(force) * side.direction
    if np.any(velocity < 0.0):
        signs.require(sign, side.where, "velocities", "file")
        velocity = factor * velocity
        if not both:
            notes.append(f"positive velocity is {way}, as it was said; forces are magnitudes")
            return velocity, np.abs(force) * np.sign(velocity)
        same = float(np.dot(force, velocity)) >= 0.0
        agree = "resists motion in that direction" if same == (factor > 0) else "is counted the other way"
        notes.append(f"positive velocity is {way}, as it was said; the force {agree}, because a damper takes in energy")
        return velocity, force if same else -force
    if both:
        signs.require(sign, side.where, "forces", "file")
        notes.append(f"positive force is {way}, as it was said")
        return velocity * np.sign(force) * factor, factor * force
    if half is None:
        _refuse_half(side.where)
    notes.append(f"{half}, as it was said")
    if half == "symmetric":
        return np.concatenate([-velocity, velocity]), np.concatenate([-np.abs(force), np.abs(force)])
    direction = 1.0 if half == "rebound" else -1.0
    return direction * velocity, direction * np.abs(force)


def _refuse_half(where: str, missing: str = "") -> None:
    ways = Setting("side", "symmetric"), Setting("side", "rebound"), Setting("side", "compression")
    if missing:
        remedy = f"Add them, in this file or another one, or pass {ways[0]} if both directions are the same."
        raise ArgumentError(f"{where} has no points in {missing}. {remedy}", ways[0])
    raise ArgumentError(
        f"{where} has velocities and forces of one sign, and no header says of which. Write rebound or compression "
        f"into the header, or pass {ways[0]} if both directions are the same, and {ways[1]} or {ways[2]} if another "
        "file has the other one, with its direction in its header.",
        *ways,
    )
