"""Force-velocity tables, such as a manufacturer's sheet: points of one setting or of many, as laws and for fits."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._files import FOLDER_SUFFIXES, find_files
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column as TableColumn, Table
from jaxdamp._types import Figure
from jaxdamp.bench import sign as signs
from jaxdamp.bench.columns import Choice
from jaxdamp.bench.manifest import BENCH_KEYS, TABLE_KEYS, Paths, with_manifest
from jaxdamp.bench.raw import Problems
from jaxdamp.bench.readers import FILES, READERS, Files, read_tables, with_own
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sets import BenchSet
from jaxdamp.bench.table_points import SIDES, Curve, curves_of, is_force_velocity, sides_of, stated_sign, with_headers
from jaxdamp.dampers import AbstractDamper, FittedRange, Scheduled, SplineTable, Table as TableLaw, with_fitted_range


_SAMPLING_RATE = 100.0  # Hz, of the records of `runs`
_LARGEST = 2**20  # bytes of a table


@final
@dataclass(frozen=True, repr=False, eq=False)
class ForceVelocityTable:
    """Forces over velocity of one setting or of several, as `bench.read_table` reads them.

    Attributes:
        name: of the file, or of all.
        curves: the points of each setting.
        notes: what was decided on units, sign and settings.
    """

    name: str
    curves: tuple[Curve, ...]
    notes: tuple[str, ...]

    @property
    def settings(self) -> tuple[str, ...]:
        """The names of the settings."""
        return tuple(curve.setting for curve in self.curves)

    @property
    def is_family(self) -> bool:
        """Whether there are several settings, each with a number."""
        return len(self.curves) > 1 and all(curve.command is not None for curve in self.curves)

    def law(
        self, setting: str | None = None, kind: type[TableLaw] | type[SplineTable] = TableLaw
    ) -> TableLaw | SplineTable | Scheduled:
        """The law through the points: of one setting, or of all that have numbers as one law of a command.

        Arguments:
            setting: its name; left out, all settings are the levels of a `Scheduled`, at the first one.
            kind: `dampers.Table` (straight lines) or `dampers.SplineTable` (monotone cubics).

        Returns:
            The law, with the velocities of the points as its range.

        Raises:
            ValueError: an unknown setting; several settings without numbers.
        """
        _checks.one_of("kind", getattr(kind, "__name__", str(kind)), (TableLaw.__name__, SplineTable.__name__))
        if setting is None and len(self.curves) > 1:
            if not self.is_family:
                there = ", ".join(map(repr, self.settings))
                _checks.refuse("setting", "be named", "left out", f"The settings have no numbers: {there}.")
            grid = np.unique(np.concatenate([curve.velocity for curve in self.curves]))
            tables = [
                TableLaw(curve.velocity, curve.force) for curve in self.curves
            ]  # with end slopes beyond its points
            laws = tuple(kind(grid, [float(each.force_velocity(v)) for v in grid]) for each in tables)
            levels = [float(curve.command or 0.0) for curve in self.curves]
            law = Scheduled(laws, levels, levels[0])
            return with_fitted_range(law, replace(_range(self.curves), command=(levels[0], levels[-1])))
        if setting is not None:
            _checks.one_of("setting", setting, self.settings)
        curve = self.curves[0 if setting is None else self.settings.index(setting)]
        return with_fitted_range(kind(curve.velocity, curve.force), _range([curve]))

    def laws(self) -> dict[str, AbstractDamper]:
        """The `dampers.Table` of each setting by its name."""
        return {curve.setting: self.law(curve.setting) for curve in self.curves}

    def runs(self) -> BenchSet:
        """Records to fit any law of the velocity to: one for each setting, with one sample for each point.

        Only laws without hysteresis can be fitted, since a table says nothing of it; its time and stroke are made up.
        """
        return BenchSet(_record(curve, self) for curve in self.curves)

    def table(self) -> Table:
        """The forces, a row for each velocity and a column for each setting."""
        grid = np.unique(np.concatenate([curve.velocity for curve in self.curves]))
        headings = [f"force at {name}" if name else "force" for name in self.settings]
        columns = (TableColumn("velocity", "m/s", ".4g"), *(TableColumn(name, "N", ".4g") for name in headings))
        cells = [dict(zip(curve.velocity.tolist(), curve.force.tolist(), strict=True)) for curve in self.curves]
        rows = ((v, *(of.get(v) for of in cells)) for v in grid.tolist())
        return Table(f"Forces of {self.name} (velocity positive in rebound)", columns, tuple(rows))

    def plot(self, kind: str = "family") -> Figure:
        """Force over velocity of all settings.

        Arguments:
            kind: "family", or "sheet" for an A4 page with the forces in a table.
        """
        from jaxdamp import plots

        _checks.one_of("kind", kind, ("family", "sheet"))
        return plots.force_velocity_family(self, page=kind == "sheet")

    def __repr__(self) -> str:
        return "\n".join([f"{self.table()}", *self.notes])


def _range(curves: Sequence[Curve]) -> FittedRange:
    velocity = np.concatenate([curve.velocity for curve in curves])
    force = np.concatenate([curve.force for curve in curves])
    return FittedRange(velocity=(velocity.min(), velocity.max()), force=(force.min(), force.max()))


def _record(curve: Curve, table: ForceVelocityTable) -> BenchRun:
    """A record with one sample for each point, so that a fit knows no more than these, in the order of velocities."""
    time = np.arange(len(curve.velocity)) / _SAMPLING_RATE
    name = f"{table.name}_{curve.setting}" if curve.setting else table.name
    notes = ("the points of a force-velocity table, one sample each, in the order of their velocities", *table.notes)
    v = curve.velocity
    return BenchRun(name, time, v / _SAMPLING_RATE, v, curve.force, command=curve.command, notes=notes, of_points=True)


@with_defaults(FILES)
def read_table(
    paths: Paths,
    *,
    sign: str | None = None,
    side: str | None = None,
    columns: Mapping[str, str | int | None] | None = None,
    manifest: str | os.PathLike[str] | bool = True,
    **files: Unpack[Files],
) -> ForceVelocityTable:
    r"""Read a force-velocity table: a manufacturer's sheet, or points at peak velocity.

    A column of velocities, and of forces either one column with settings in another ("clicks"), or a column for each
    setting ("4 clicks [lbf]", "R 4", "0.5A"), on several sheets or in several blocks if need be. The direction stands
    in the headers or in the names of sheets and files (rebound, compression), in a column of words, or in the signs of
    velocity or force, which `sign` then must explain. Forces may be magnitudes; then there is none at rest. Units must
    be named by the headers or by `units`.

    Arguments:
        paths: a file or several, which are one table. Where two give the same setting and direction, the words in
            which the names of the files differ are settings too.
        sign: "rebound-positive" or "compression-positive": the direction in which velocities, or else forces, are
            positive, where only their signs tell rebound from compression.
        side: of a table with one direction only: "rebound" or "compression", of which another file holds the other, or
            "symmetric" if both are the same.
        columns: "velocity" and "force" to header or number (from 0) of the column.
        manifest: a TOML file with `sign`, `columns`, `units` and `delimiter`, as in `read`; True takes `jaxdamp.toml`
            of the folder that is read.
        files: `units`, `delimiter` and `readers`, all optional (see `Files`).

    Returns:
        The points of each setting in SI, in natural order of the settings.

    Raises:
        FileNotFoundError: no such file.
        ValueError: no such table; a unit, a sign or a direction that the file does not state; all problems at once.

    >>> import tempfile
    >>> from pathlib import Path
    >>> file = Path(tempfile.mkdtemp()) / "sheet.csv"
    >>> lines = ["velocity [in/s],R 1 [lbf],R 2 [lbf],C 1 [lbf],C 2 [lbf]", "1,20,30,10,12", "5,60,90,25,30"]
    >>> _ = file.write_text("\n".join(lines))
    >>> table = read_table(file)
    >>> print(table.table())
    Forces of sheet (velocity positive in rebound)
    velocity [m/s]  force at 1 [N]  force at 2 [N]
            -0.127          -111.2          -133.4
           -0.0254          -44.48          -53.38
                 0               0               0
            0.0254           88.96           133.4
             0.127           266.9           400.3
    """
    if side is not None:
        _checks.one_of("side", side, SIDES)
    given = {"sign": sign, "columns": columns, "units": files["units"], "delimiter": files["delimiter"]}
    asked, given, notes = with_manifest(paths, manifest, given, TABLE_KEYS)
    signs.check_words(given["sign"], None)
    choice = Choice(given["columns"] or {}, given["units"] or {})
    sheets, readers = find_files(asked, {*FOLDER_SUFFIXES, *(files["readers"] or {})}), with_own(files["readers"])
    notes, sides, problems, sign, stated = [*notes], [], Problems(), given["sign"], set()
    others: dict[Path, str] = {}
    for file in sheets:
        with problems.collected(str(file)):
            tables = [with_headers(table) for table in read_tables(file, readers, given["delimiter"])]
            fitting = [table for table in tables if is_force_velocity(table, choice)]
            if not fitting:
                others[file] = ", ".join(name for table in tables for name in table.names)
            for table in fitting:
                stated.add(stated_sign(table))
                two_sides, said = sides_of(table, choice)
                sides += two_sides
                notes += said
    problems.raise_any()
    _refuse_others(others, sheets)
    sign = stated.pop() if sign is None and len(stated) == 1 else sign
    curves, said = curves_of(sides, sign, side)
    name, of_files = _called(sheets)
    return ForceVelocityTable(name, curves, tuple(dict.fromkeys([*notes, *of_files, *said])))


def _refuse_others(others: Mapping[Path, str], files: Sequence[Path]) -> None:
    """Refuse files that are no force-velocity tables, given with their columns."""
    if not others:
        return
    file, columns = next(iter(others.items()))
    what = "no force-velocity table, which has a velocity, forces and no time"
    tables = ", ".join(str(each) for each in files if each not in others)
    more = f" Further files that are none: {len(others) - 1}." * (len(others) > 1)
    apart = f" Give {tables} apart from records." * bool(tables)
    raise ValueError(f"{file} is {what}: its columns are {columns}.{more}{apart}")


def _called(files: Sequence[Path]) -> tuple[str, list[str]]:
    """The name of the table of these files, and a note where there are several."""
    note = f"points of {', '.join(file.name for file in files)}"
    return ", ".join(file.stem for file in files), [note] * (len(files) > 1)


def are_tables(
    paths: Paths,
    *,
    columns: Mapping[str, str | int | None] | None = None,
    units: Mapping[str, str] | None = None,
    delimiter: str | None = None,
    sign: str | None = None,
    manifest: str | os.PathLike[str] | bool = True,
) -> bool:
    """Whether files are force-velocity tables rather than records. Files too large for one, or unreadable, are none.

    Arguments:
        paths: files, folders or patterns.
        columns: of quantities by name or place, as in `read_table`, which has the other arguments too.
        units: of quantities.
        delimiter: between cells.
        sign: not needed to tell.
        manifest: as in `read_table`.
    """
    given = {"columns": columns, "units": units, "delimiter": delimiter}
    asked, given, _ = with_manifest(paths, manifest, given, BENCH_KEYS)
    choice = Choice(given["columns"] or {}, given["units"] or {})
    files = find_files(asked, FOLDER_SUFFIXES)
    if any(file.stat().st_size > _LARGEST for file in files):
        return False
    try:
        first = read_tables(files[0], READERS, given["delimiter"])
        return any(is_force_velocity(table, choice) for table in first)
    except (ValueError, OSError, ImportError):  # said by who reads them
        return False
