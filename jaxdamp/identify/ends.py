"""Fitted numbers at an end of their range."""

import jax
import numpy as np
from jaxtyping import Float

from jaxdamp.dampers import laws_inside
from jaxdamp.parameters import Coordinates


AT_LIMIT = 1e-4  # distance from a limit given by other parameters, relative to the start, that counts as zero


def at_ends(coordinates: Coordinates, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
    """−1 for a number at the lower end of its range, 1 at the upper, else 0.

    Neighbours of ordered numbers are ends too, and so are limits that depend on other parameters of a law.
    """
    sides = coordinates.at_ends(values)
    limited = np.isin(coordinates.free.names, list(_at_conditions(coordinates, values)))
    return np.where(limited & (sides == 0), -1.0, sides)


def _at_conditions(coordinates: Coordinates, values: Float[np.ndarray, " free"]) -> set[str]:
    """Parameters at a limit given by other parameters."""
    free = coordinates.free
    scales = {p.path: float(np.max(np.abs(np.asarray(p.value)))) or 1.0 for p in free.chosen}
    found = set()
    for prefix, law in laws_inside(free.started_at(values).tree):
        if not law.has_conditions():
            continue
        plain = jax.tree.map(np.asarray, law)
        for condition in plain.conditions():
            path = prefix + condition.parameter
            margin = np.min(getattr(plain, condition.parameter) - condition.least)
            if path in scales and margin < AT_LIMIT * scales[path]:
                found.add(path)
    return found
