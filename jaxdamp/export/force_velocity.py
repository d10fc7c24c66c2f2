"""A law as a force-velocity table."""

import os
from pathlib import Path

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._types import VectorLike
from jaxdamp.dampers import AbstractDamper, extrapolated
from jaxdamp.export._write import write_whole
from jaxdamp.rig import quasi_static


def to_csv(law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike) -> Path:
    """Write the force of a law over velocity as a table, SI units, one point a line.

    A table holds one force for each velocity. For a law with states that is the force at constant velocity once the
    states have settled (`jaxdamp.rig.quasi_static`); its hysteresis does not fit into a table, and the header says so.
    The header also says what the law was fitted to, and which rows lie beyond: marks in the rows themselves would keep
    simulators from reading them.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s], positive in rebound, shape (points,).

    Returns:
        The path of the file.

    Raises:
        ValueError: velocities that do not increase, a folder that does not exist, a law that does not settle.
    """
    check_module("law", law, (AbstractDamper,), "to_csv(law, path, velocities)")
    velocity = np.asarray(velocities, dtype=float)
    _checks.finite("velocities", velocity)
    if velocity.ndim != 1 or velocity.size == 0 or np.any(np.diff(velocity) <= 0):
        _checks.refuse("velocities", "be one or more, strictly increasing", velocity, "Try `numpy.unique`.")
    force = np.asarray(quasi_static(law, velocity))
    header = [
        f"# law: {law!r}",
        "# velocity is positive in extension (rebound), force is positive when it resists extension",
    ]
    states = law.initial_state().size
    if states:
        header.append(
            f"# quasi-static: force at constant velocity; the hysteresis of the law's {states} state(s) is not in here"
        )
    header += _range_lines(law, velocity)
    rows = [f"{float(v)!r},{float(f)!r}" for v, f in zip(velocity, force, strict=True)]
    return write_whole(path, "\n".join([*header, "velocity [m/s],force [N]", *rows]) + "\n")


def _range_lines(law: AbstractDamper, velocity: np.ndarray) -> list[str]:
    """What the law was fitted to, and the rows that lie beyond."""
    lines = [] if law.fitted_to is None else [f"# fitted to: {law.fitted_to.words()}"]
    outside = extrapolated(law, velocity)
    if not outside.any():
        return lines
    if outside.all():
        return [*lines, "# extrapolated: all rows lie beyond the velocities that the law was fitted to"]
    measured = velocity[~outside]
    where = f"rows below {measured[0]:.6g} m/s and above {measured[-1]:.6g} m/s"
    return [*lines, f"# extrapolated: {where}, {np.count_nonzero(outside)} of {velocity.size}, beyond all records"]
