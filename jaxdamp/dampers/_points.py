"""Force-velocity points: checks of their number and of passivity."""

import numpy as np
from jaxtyping import Array

from jaxdamp import _checks


TOLERANCE = 0.05  # of the largest force; measured points near zero velocity scatter by the friction


def check_points(velocity: Array, force: Array) -> None:
    """Refuse fewer than two points, or different numbers of forces and velocities."""
    if velocity.ndim != 1 or velocity.size < 2 or force.shape != velocity.shape:
        must = "hold two or more points, one force for each velocity"
        _checks.refuse("force", must, f"of shape {force.shape} for velocities of shape {velocity.shape}")


def drives_motion(velocity: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Whether the force adds energy to the motion, for each point of a curve F(v), shape (points,).

    A law F(v) dissipates energy over every cycle if and only if (F(v) − F(0)) v ≥ 0 for all v, where F(0) is a constant
    force such as that of the gas. Violations below 5 % of the largest force are ignored, and so are curves that do not
    include zero velocity.

    Arguments:
        velocity: increasing velocities [m/s], shape (points,).
        force: forces [N], shape (points,).
    """
    if not (np.all(np.isfinite(force)) and velocity[0] <= 0.0 <= velocity[-1]):
        return np.zeros(velocity.shape, dtype=bool)
    rise = force - np.interp(0.0, velocity, force)
    return rise * np.sign(velocity) < -TOLERANCE * np.max(np.abs(rise))


def refuse_active(velocity: Array, force: Array) -> None:
    """Refuse points whose force adds energy to the motion (`drives_motion`); traced values are not checked.

    Raises:
        ValueError: the first of these points.
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
            "For an active element, pass `allow_active=True`."
        )
        _checks.refuse("force", must, value, remedy)
