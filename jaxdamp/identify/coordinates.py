"""The coordinates of a search: parameters in units of their start, within a box.

A parameter with a range of its own is y times its unit, so that the force is linear in y where it is in the parameter,
and a search can end on the edge of the range, towards which a smooth map onto the open range would crawl. Ordered
vectors use the smooth map of their domain, and have no box.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxdamp.dampers import laws_inside
from jaxdamp.parameters import FreeParameters, Parameter


OPEN_EDGE = 1e-6  # how near a parameter comes to an edge that does not belong to its domain, in its unit
AT_LIMIT = 1e-4  # distance from a limit that other parameters give, in units of the start, that counts as none
TOUCHING = 1e-4  # gap between ordered numbers, relative to the largest, that counts as none


class Box(NamedTuple):
    """Limits of the coordinates."""

    lower: Float[Array, " free"] | Float[np.ndarray, " free"]
    upper: Float[Array, " free"] | Float[np.ndarray, " free"]


def _ordered(p: Parameter) -> bool:
    return p.domain.steps is not None


def _ranged(p: Parameter) -> bool:
    """Whether both ends of the range are finite."""
    return not _ordered(p) and bool(np.isfinite(p.domain.upper - p.domain.lower))


def ordered(free: FreeParameters) -> Bool[np.ndarray, " free"]:
    """Which numbers belong to ordered vectors."""
    return np.array([_ordered(p) for p in free.chosen for _ in range(p.value.size)])


def _pieces(free: FreeParameters, vector: Array) -> list[Array]:
    """A vector cut into the shapes of the parameters."""
    ends = np.cumsum([p.value.size for p in free.chosen])[:-1]
    return [a.reshape(p.value.shape) for a, p in zip(jnp.split(vector, ends), free.chosen, strict=True)]


def _units(free: FreeParameters) -> list[Array]:
    """What one is in each coordinate: the width of a finite range, otherwise the magnitude of the start."""
    return [
        jnp.full_like(scale, p.domain.upper - p.domain.lower) if _ranged(p) else scale
        for p, scale in zip(free.chosen, free.scales, strict=True)
    ]


def to_values(free: FreeParameters, y: Float[Array, " free"]) -> Float[Array, " free"]:
    """Physical values of coordinates."""
    parts = zip(free.chosen, _units(free), free.scales, _pieces(free, y), strict=True)
    return jnp.concatenate([jnp.ravel(p.domain.from_raw(a, s) if _ordered(p) else a * u) for p, u, s, a in parts])


def start(free: FreeParameters) -> Float[Array, " free"]:
    """Coordinates of the start that `free` holds."""
    parts = zip(free.chosen, _units(free), free.scales, strict=True)
    return jnp.concatenate(
        [jnp.ravel(p.domain.to_raw(p.value, s) if _ordered(p) else p.value / u) for p, u, s in parts]
    )


def box(free: FreeParameters) -> Box:
    """Limits of the coordinates; edges that do not belong to a domain are kept away from by `OPEN_EDGE`."""
    lower, upper = [], []
    for p, unit in zip(free.chosen, _units(free), strict=True):
        if _ordered(p):
            low, high, margin = -np.inf, np.inf, 0.0
        else:
            low, high = p.domain.lower, p.domain.upper
            margin = 0.0 if not _ranged(p) and p.domain.contains(np.asarray(low)) else OPEN_EDGE
        lower.append(np.ravel(low / np.asarray(unit)) + margin)
        upper.append(np.ravel(high / np.asarray(unit)) - margin)
    return Box(np.concatenate(lower), np.concatenate(upper))


def _met(p: Parameter, value: Float[np.ndarray, " _"]) -> Float[np.ndarray, " _"]:
    """−1 where an ordered number has met the one below it, 1 where it has met the one above, else 0."""
    ends = [a for a in (p.domain.lower, p.domain.upper) if np.isfinite(a)]
    extent = np.ptp(ends) if len(ends) == 2 else np.abs(value).max()
    low = p.domain.lower if np.isfinite(p.domain.lower) else value[0] - extent
    high = p.domain.upper if np.isfinite(p.domain.upper) else value[-1] + extent
    touching = np.diff(np.concatenate([[low], value, [high]])) < TOUCHING * extent
    return np.where(touching[:-1], -1.0, np.where(touching[1:], 1.0, 0.0))


def edges(free: FreeParameters, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
    """−1 where a number lies on the lower edge of its range, 1 on the upper, else 0.

    Neighbours of ordered numbers are edges too, and so are limits that depend on other parameters.
    """
    pieces = _pieces(free, jnp.asarray(values))
    y = np.concatenate([np.ravel(value / unit) for value, unit in zip(pieces, _units(free), strict=True)])
    low, high = box(free)
    sides = np.where(y <= low + OPEN_EDGE, -1.0, np.where(y >= high - OPEN_EDGE, 1.0, 0.0))
    parts = zip(free.chosen, pieces, strict=True)
    sides += np.concatenate([_met(p, np.asarray(a)) if _ordered(p) else np.zeros(a.size) for p, a in parts])
    limited = _limited(free, values)
    return np.where(np.isin(free.names, list(limited)) & (sides == 0), -1.0, sides)


def _limited(free: FreeParameters, values: Float[np.ndarray, " free"]) -> set[str]:
    """Parameters that lie on a limit that other parameters give."""
    scales = {p.path: float(np.max(np.asarray(scale))) for p, scale in zip(free.chosen, free.scales, strict=True)}
    found = set()
    for prefix, law in laws_inside(free.started_at(values).tree):
        if not law.has_conditions():
            continue
        plain = jax.tree.map(np.asarray, law)
        for condition in plain.conditions():
            path = prefix + condition.parameter
            margin = getattr(plain, condition.parameter) - condition.least
            if path in scales and margin < AT_LIMIT * scales[path]:
                found.add(path)
    return found
