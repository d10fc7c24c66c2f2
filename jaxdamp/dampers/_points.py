"""Force-velocity points."""

from jaxtyping import Array

from jaxdamp import _checks


def check_points(velocity: Array, force: Array) -> None:
    """Refuse fewer than two points, or another number of forces than of velocities."""
    if velocity.ndim != 1 or velocity.size < 2 or force.shape != velocity.shape:
        must = "hold two or more points, one force for each velocity"
        _checks.refuse("force", must, f"of shape {force.shape} beside {velocity.shape} velocities")
