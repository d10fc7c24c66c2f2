"""Force-velocity points: their number, and whether they are those of a damper."""

import numpy as np
from jaxtyping import Array

from jaxdamp import _checks


TOLERANCE = 0.05  # of the largest force; measured points near zero velocity scatter by the friction


def check_points(velocity: Array, force: Array) -> None:
    """Refuse fewer than two points, or another number of forces than of velocities."""
    if velocity.ndim != 1 or velocity.size < 2 or force.shape != velocity.shape:
        must = "hold two or more points, one force for each velocity"
        _checks.refuse("force", must, f"of shape {force.shape} beside {velocity.shape} velocities")


def drives_motion(velocity: np.ndarray, force: np.ndarray) -> np.ndarray:
    """At which points of a curve F(v) the force drives the motion instead of damping it, shape (points,).

    A law F(v) takes in energy over every closed cycle if and only if (F(v) − F(0)) v ≥ 0 for all v, where F(0) is a
    constant force such as that of the gas. Violations below 5 % of the largest force do not count, and velocities that
    do not hold zero cannot be judged.

    Arguments:
        velocity: increasing [m/s], shape (points,).
        force: [N], shape (points,).
    """
    if not (np.all(np.isfinite(force)) and velocity[0] <= 0.0 <= velocity[-1]):
        return np.zeros(velocity.shape, dtype=bool)
    rise = force - np.interp(0.0, velocity, force)
    return rise * np.sign(velocity) < -TOLERANCE * np.max(np.abs(rise))


def refuse_active(velocity: Array, force: Array) -> None:
    """Refuse points that drive the motion instead of damping it (`drives_motion`); traced values pass.

    Raises:
        ValueError: names the points.
    """
    v, f = _checks.concrete(velocity), _checks.concrete(force)
    if v is None or f is None:
        return
    driven = drives_motion(v, f)
    if np.any(driven):
        first = int(np.argmax(driven))
        value = f"{f[first]:g} N at {v[first]:g} m/s, {np.count_nonzero(driven)} of {v.size} points"
        must = "resist the motion, so that it is larger than at zero velocity in rebound and smaller in compression"
        remedy = (
            "Force is positive when it resists extension: in compression a damper's force is negative. "
            "If an active element is meant, pass `allow_active=True`."
        )
        _checks.refuse("force", must, value, remedy)
