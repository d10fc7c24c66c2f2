"""A law as a force-velocity table."""

import os
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._field_types import check_module
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import VectorLike
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper, extrapolated
from jaxdamp.rig import quasi_static


@of_known_numbers
def to_csv(law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike) -> Path:
    """Write the force of a law over velocity as a table, one point per line; in SI unless a command shows other units.

    A table holds one force for each velocity. For a law with states that is the force at constant velocity once the
    states have settled (`jaxdamp.rig.quasi_static`); its hysteresis is not in the table, which the header states.
    Velocities at which the law has no settled or no finite force have no row: a comment in the file and a Python
    warning state how many, where and why. The header also states the fitted range of the law and the rows outside it,
    since simulators could not read marks in the rows themselves.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s], positive in rebound, shape (points,).

    Returns:
        The path of the file.

    Raises:
        ValueError: velocities that do not increase, a folder that does not exist, a law without a settled force at any
            of the velocities.
    """
    table = settled_table(law, velocities, "to_csv(law, path, velocities)")
    shown = display()
    units = shown.of("m/s", signed=True), shown.of("N", signed=True)
    points = sorted(zip(units[0](table.velocity), units[1](table.force), strict=True))
    rows = [f"{float(v)!r},{float(f)!r}" for v, f in points]
    comments = [f"# {shown.words(line)}" for line in table.comments]
    heading = ",".join(f"{name} [{unit.unit}]" for name, unit in zip(("velocity", "force"), units, strict=True))
    written = write_whole(path, "\n".join([*comments, heading, *rows]) + "\n")
    warn_of_rows(written, table)
    return written


class SettledTable(NamedTuple):
    """The force of a law over velocity, and what a reader of the table must know.

    Attributes:
        velocity: [m/s], positive in rebound, shape (points,).
        force: [N], positive when it resists extension, shape (points,).
        comments: lines of text.
        left_out: the rows that were left out and why; empty if there are none.
    """

    velocity: np.ndarray
    force: np.ndarray
    comments: list[str]
    left_out: str


def settled_table(law: AbstractDamper, velocities: VectorLike, call: str) -> SettledTable:
    """The force at constant velocity once the states have settled, as `to_csv` writes it."""
    check_module("law", law, (AbstractDamper,), call)
    velocity = np.asarray(velocities, dtype=float)
    _checks.finite("velocities", velocity)
    if velocity.ndim != 1 or velocity.size == 0 or np.any(np.diff(velocity) <= 0):
        _checks.refuse("velocities", "be one or more, strictly increasing", velocity, "Try `numpy.unique`.")
    curve = quasi_static(law, velocity)
    if not curve.settled.any():
        remedy = "A table cannot represent such a law: use `respond` with the intended motion."
        what = f"{type(law).__name__}. {curve.note.removesuffix('.')}"
        _checks.refuse("law", "have a force at constant velocity", what, remedy)
    comments = [
        f"law: {law!r}",
        "velocity is positive in extension (rebound), force is positive when it resists extension",
    ]
    states = law.initial_state().size
    if states:
        comments.append(
            f"quasi-static: force at constant velocity; the hysteresis of the law's {states} state(s) is not in here"
        )
    if curve.note:
        comments.append(f"rows left out: {curve.note}")
    settled = velocity[curve.settled]
    comments += _range_lines(law, settled)
    return SettledTable(settled, np.asarray(curve.force)[curve.settled], comments, curve.note)


def warn_of_rows(written: Path, table: SettledTable) -> None:
    """A Python warning of rows that are not in the file."""
    if table.left_out:
        warnings.warn(f"{written.name}: rows left out. {table.left_out}", stacklevel=3)


def _range_lines(law: AbstractDamper, velocity: np.ndarray) -> list[str]:
    """Comments on the fitted range of the law and on the rows outside it."""
    lines = [] if law.fitted_to is None else [f"fitted to: {law.fitted_to.words()}"]
    outside = extrapolated(law, velocity)
    if not outside.any():
        return lines
    if outside.all():
        return [*lines, "extrapolated: all rows lie beyond the velocities that the law was fitted to"]
    measured = velocity[~outside]
    where = f"rows below {measured[0]:.6g} m/s and above {measured[-1]:.6g} m/s"
    return [*lines, f"extrapolated: {where}, {np.count_nonzero(outside)} of {velocity.size}, beyond all records"]
