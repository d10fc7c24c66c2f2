"""The coordinates in which searches move parameters: numbers of order one, with bounds and order constraints."""

from types import ModuleType
from typing import Literal, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, PyTree

from jaxdamp.parameters._declaration import Parameter
from jaxdamp.parameters._domains import Domain
from jaxdamp.parameters._free import FreeParameters


OPEN_END = 1e-6  # distance, in coordinates, from an end that does not belong to a domain
TOUCHING = 1e-4  # gap between ordered numbers, relative to the largest, that counts as zero
LEAST_GAP = 1e-6  # smallest gap between ordered numbers in a search, relative to the largest


Vector = TypeVar("Vector", Float[Array, " free"], Float[np.ndarray, " free"])


class Bounds(NamedTuple):
    """Limits of coordinates, infinite where there is none.

    Attributes:
        lower: lower limits, shape (free,).
        upper: upper limits, shape (free,).
    """

    lower: Float[Array, " free"] | Float[np.ndarray, " free"]
    upper: Float[Array, " free"] | Float[np.ndarray, " free"]


class Coordinates(eqx.Module):
    """The coordinates of free parameters in a search, and the conversion to and from physical values.

    A coordinate is either the parameter divided by a unit: the magnitude of its start, or for a fit the width of its
    range if that is finite (a tuning has its own bounds near the start). Linearity of the force is preserved, and a
    search can end at a bound. Or it is the raw number of the smooth map of the domain, which has no bounds, but
    approaches an edge of the domain only slowly. The choice depends on the search:

    - `smooth="none"`: bounds and linear constraints (tuning). Ordered vectors are kept in order by `order`.
    - `smooth="ordered"`: bounds (fits). Ordered vectors have a smooth map.
    - `smooth="all"`: neither (training).

    Attributes:
        free: the parameters, with their start.
        smooth: which of them have a smooth map.
    """

    free: FreeParameters
    smooth: Literal["none", "ordered", "all"] = eqx.field(static=True)

    @property
    def units(self) -> list[PyTree]:
        """The unit of each parameter: its value where a coordinate without a smooth map is one."""
        return [
            np.full(p.value.shape, p.domain.upper - p.domain.lower, p.value.dtype)
            if self.smooth != "none" and _has_range(p)
            else _magnitude(p.value)
            for p in self.free.chosen
        ]

    def to_physical(self, y: Vector) -> Vector:
        """Physical values of coordinates; NumPy arrays for NumPy arrays."""
        parts = zip(self.free.chosen, self.units, self.free.split(y), strict=True)
        maps = ((p.domain.from_raw, p, u, a) for p, u, a in parts)
        return _joined([of(_plain(p, a), _scale(p)) if _is_smooth(self.smooth, p) else a * u for of, p, u, a in maps])

    def on_host(self) -> "HostMap | None":
        """The map to physical values with its derivatives, by NumPy alone; None if a domain has not written them."""
        slopes, ends = np.zeros((self.free.values.size,) * 2), np.cumsum([p.value.size for p in self.free.chosen])
        smooth = []
        for p, unit, end in zip(self.free.chosen, self.units, ends, strict=True):
            place = slice(int(end) - p.value.size, int(end))
            if not _is_smooth(self.smooth, p):
                slopes[place, place] = np.diag(np.ravel(np.asarray(unit)))
            elif p.domain.slopes is None:
                return None
            else:
                smooth.append((place, p.domain, np.asarray(_scale(p))))
        return HostMap(np.diag(slopes).copy(), slopes, tuple(smooth))

    def from_physical(self, values: Vector) -> Vector:
        """Coordinates of physical values; NumPy arrays for NumPy arrays."""
        parts = zip(self.free.chosen, self.units, self.free.split(values), strict=True)
        maps = ((p.domain.to_raw, p, u, a) for p, u, a in parts)
        return _joined([of(_plain(p, a), _scale(p)) if _is_smooth(self.smooth, p) else a / u for of, p, u, a in maps])

    @property
    def start(self) -> Float[np.ndarray, " free"]:
        """Coordinates of the values to start from."""
        return np.asarray(self.from_physical(np.asarray(self.free.values)))

    def bounds(self) -> Bounds:
        """Limits of the coordinates, at a small distance from ends that do not belong to a domain."""
        lower, upper = [], []
        for p, unit in zip(self.free.chosen, self.units, strict=True):
            low, high, margin = -np.inf, np.inf, 0.0
            if not _is_smooth(self.smooth, p):
                low, high = p.domain.lower, p.domain.upper
                belongs = not (_has_range(p) or p.domain.ordered) and p.domain.contains(np.asarray(low))
                margin = 0.0 if belongs else OPEN_END
            size = unit if isinstance(unit, Tracer) else np.asarray(unit)
            lower.append(low / size + margin)
            upper.append(high / size - margin)
        return Bounds(_joined(lower), _joined(upper))

    def order(self) -> tuple[Float[np.ndarray, "rows free"], Float[np.ndarray, " rows"]]:
        """Rows A and numbers b with A y ≥ b where vectors that must increase do so."""
        units = np.concatenate([np.ravel(np.asarray(unit, np.float64)) for unit in self.units])
        ends = np.cumsum([p.value.size for p in self.free.chosen])
        rows, gaps = [np.zeros((0, units.size))], [np.zeros(0)]
        for p, end in zip(self.free.chosen, ends, strict=True):
            if p.domain.ordered and not _is_smooth(self.smooth, p):
                numbers = np.arange(end - p.value.size, end)
                rows.append(np.diff(np.diag(units)[numbers], axis=0))
                gaps.append(np.full(numbers.size - 1, LEAST_GAP * units[numbers].max()))
        return np.concatenate(rows), np.concatenate(gaps)

    def at_ends(self, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
        """−1 for a number at the lower end of its range, 1 at the upper, else 0.

        Neighbours of ordered numbers are ends too.
        """
        pieces = self.free.split(values)
        y = np.concatenate([np.ravel(value / np.asarray(u)) for value, u in zip(pieces, self.units, strict=True)])
        low, high = self.bounds()
        sides = np.where(y <= low + OPEN_END, -1.0, np.where(y >= high - OPEN_END, 1.0, 0.0))
        parts = zip(self.free.chosen, pieces, strict=True)
        equal = [_at_neighbours(p, a) if p.domain.ordered else np.zeros(a.size) for p, a in parts]
        return sides + np.concatenate(equal)

    @property
    def ordered(self) -> Bool[np.ndarray, " free"]:
        """Which numbers belong to ordered vectors."""
        return np.array([p.domain.ordered for p in self.free.owners])


class HostMap(NamedTuple):
    """Physical values of coordinates, and their derivatives.

    Attributes:
        units: of the numbers without a smooth map, zero for the others.
        slopes: the same on the diagonal of a matrix.
        smooth: ordered vectors: their place, domain and scale.
    """

    units: Float[np.ndarray, " free"]
    slopes: Float[np.ndarray, "free free"]
    smooth: tuple[tuple[slice, Domain, Float[np.ndarray, " _"]], ...]

    def __call__(
        self, y: Float[np.ndarray, " free"]
    ) -> tuple[Float[np.ndarray, " free"], Float[np.ndarray, "free free"]]:
        """Values and derivatives at coordinates."""
        values, slopes = y * self.units, self.slopes.copy() if self.smooth else self.slopes
        for place, domain, scale in self.smooth:
            assert domain.slopes is not None
            values[place], slopes[place, place] = domain.from_raw(y[place], scale), domain.slopes(y[place], scale)
        return values, slopes


def _is_smooth(smooth: str, p: Parameter) -> bool:
    """Whether a parameter has a smooth map; no method, which equinox binds anew for each of many calls."""
    return smooth == "all" or (smooth == "ordered" and p.domain.ordered)


def _has_range(p: Parameter) -> bool:
    """Whether both ends of the range are finite."""
    return not p.domain.ordered and bool(np.isfinite(p.domain.upper - p.domain.lower))


def _magnitude(value: PyTree) -> PyTree:
    """Typical magnitude of each number, never zero; numbers much smaller than the largest are increased.

    Numbers that JAX does not trace are computed by NumPy, because JAX would compile each operation separately.
    """
    traced = isinstance(value, Tracer)
    xp: ModuleType = jnp if traced else np
    magnitude = xp.abs(jax.lax.stop_gradient(value) if traced else np.asarray(value))
    largest = xp.max(magnitude, initial=0.0)
    floor = xp.maximum(1e-3 * largest, jnp.finfo(value.dtype).tiny)
    return xp.where(magnitude > floor, magnitude, xp.where(largest == 0, 1.0, largest)).astype(value.dtype)


def _plain(p: Parameter, values: Array | np.ndarray) -> Array | np.ndarray:
    """As a map takes them: those of ordered vectors compute NumPy arrays by NumPy."""
    return values if p.domain.ordered and isinstance(values, np.ndarray) else jnp.asarray(values)


def _scale(p: Parameter) -> Array | np.ndarray:
    """The scale of the smooth map of a domain: the magnitude of the start, or of the steps of an ordered vector."""
    value = p.value if isinstance(p.value, Tracer) else np.asarray(p.value)
    return _magnitude(value if p.domain.steps is None else p.domain.steps(value))


def _joined(pieces: list[PyTree]) -> PyTree:
    xp: ModuleType = np if all(isinstance(piece, np.ndarray | np.generic) for piece in pieces) else jnp
    return xp.concatenate([xp.ravel(piece) for piece in pieces])


def _at_neighbours(p: Parameter, value: Float[np.ndarray, " _"]) -> Float[np.ndarray, " _"]:
    """−1 for an ordered number that is equal to the previous one, 1 if equal to the next one, else 0."""
    ends = [a for a in (p.domain.lower, p.domain.upper) if np.isfinite(a)]
    extent = np.ptp(ends) if len(ends) == 2 else np.abs(value).max()
    low = p.domain.lower if np.isfinite(p.domain.lower) else value[0] - extent
    high = p.domain.upper if np.isfinite(p.domain.upper) else value[-1] + extent
    touching = np.diff(np.concatenate([[low], value, [high]])) < TOUCHING * extent
    return np.where(touching[:-1], -1.0, np.where(touching[1:], 1.0, 0.0))
