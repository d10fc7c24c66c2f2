"""Numbers shared by many dampers, or polynomials of a setting such as the clicks of an adjuster."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jaxdamp import _checks
from jaxdamp._triangles import rows_of_products
from jaxdamp.parameters import Bounds, FreeParameters, match_paths
from jaxdamp.solve import Linearisation


Products = Float[np.ndarray, "_lanes _columns _columns"]
OWN = -1  # in place of a degree: every damper has its own value


class Dependence(NamedTuple):
    """How the coordinates of each damper follow from one vector: its own values, then coefficients of polynomials."""

    degree: Int[np.ndarray, " free"]  # of the polynomial of each coordinate in the setting, or `OWN`
    basis: Float[np.ndarray, "dampers degrees"]  # Legendre polynomials of each damper's setting, scaled to −1 … 1
    column: Int[np.ndarray, "dampers free"]  # of the vector, for each damper and coordinate (the first of a polynomial)
    size: int  # of the vector
    ends: tuple[float, float]  # lowest and highest setting

    def at_dampers(self, vector: Float[np.ndarray, " size"]) -> Float[np.ndarray, "dampers free"]:
        """The coordinates of every damper."""
        return np.stack([weights @ vector[columns] for columns, weights in map(self.rows, range(len(self.column)))])

    def at_setting(self, vector: Float[np.ndarray, " size"], setting: float) -> Float[np.ndarray, " free"]:
        """The coordinates at a setting; not a number where the dampers have their own."""
        basis = legendre(np.array([setting]), self.ends, self.basis.shape[1])[0]
        firsts = zip(self.degree, self.column[0], strict=True)
        return np.array([basis[: d + 1] @ vector[c : c + d + 1] if d != OWN else np.nan for d, c in firsts])

    def rows(self, damper: int) -> tuple[Int[np.ndarray, " used"], Float[np.ndarray, "free used"]]:
        """The entries of the vector that a damper uses, and the matrix from them to its coordinates."""
        counts = np.where(self.degree == OWN, 1, self.degree + 1)
        columns = np.concatenate([c + np.arange(n) for c, n in zip(self.column[damper], counts, strict=True)])
        weights, begin = np.zeros((counts.size, columns.size)), 0
        for j, n in enumerate(counts):
            weights[j, begin : begin + n] = 1.0 if self.degree[j] == OWN else self.basis[damper, :n]
            begin += n
        return columns, weights

    def start(self, y: Float[np.ndarray, "dampers free"]) -> Float[np.ndarray, " size"]:
        """The vector nearest to coordinates of all dampers, polynomials by least squares."""
        vector = np.zeros(self.size)
        for j, d in enumerate(self.degree):
            if d == OWN:
                vector[self.column[:, j]] = y[:, j]
            else:
                first = self.column[0, j]
                vector[first : first + d + 1] = np.linalg.lstsq(self.basis[:, : d + 1], y[:, j], rcond=None)[0]
        return vector

    def bounds(self, bounds: Bounds) -> Bounds:
        """Limits of the vector: those of the coordinates, none for polynomials, whose values are checked instead."""
        sides = []
        for side, none in ((bounds.lower, -np.inf), (bounds.upper, np.inf)):
            limit = np.full(self.size, none)
            for j, d in enumerate(self.degree):
                if d in (OWN, 0):
                    limit[self.column[:, j]] = np.asarray(side)[j]
            sides.append(limit)
        return Bounds(*sides)

    def gathered(self, here: Linearisation, products: Products, inside: bool) -> tuple[Linearisation, Products]:
        """The problem of all dampers together, by the vector."""
        together = np.zeros((self.size + 1, self.size + 1))
        slopes = np.zeros((*here.margins.shape, self.size))
        for damper, (of_damper, by_y) in enumerate(zip(products, here.margin_slopes, strict=True)):
            columns, weights = self.rows(damper)
            slopes[damper][:, columns] = by_y @ weights
            columns, weights = np.append(columns, self.size), np.pad(weights, ((0, 1), (0, 1)))
            weights[-1, -1] = 1.0
            together[np.ix_(columns, columns)] += weights.T @ of_damper @ weights
        margins = np.append(np.ravel(here.margins), 1.0 if inside else -1.0)
        by_vector = np.concatenate([slopes.reshape(-1, self.size), np.zeros((1, self.size))])
        rows, samples = rows_of_products(together[None]), np.sum(here.samples, keepdims=True)
        return Linearisation(rows, margins[None], by_vector[None], samples), together[None]


def legendre(setting: np.ndarray, ends: tuple[float, float], count: int) -> np.ndarray:
    """The first Legendre polynomials of settings, scaled so that the ends are −1 and 1."""
    width = ends[1] - ends[0] or 1.0
    return np.polynomial.legendre.legvander((2.0 * setting - ends[0] - ends[1]) / width, count - 1)


def dependence(
    free: FreeParameters,
    shared: Mapping[str, int],
    settings: Sequence[float | int] | None,
    dampers: int,
) -> Dependence | None:
    """The dependence that the arguments of `fit_many` state; `None` if every damper has its own values."""
    if settings is not None and len(settings) != dampers:
        _checks.refuse("settings", f"give one number for each of {dampers} dampers", f"{len(settings)} numbers")
    degree = _degrees(free, shared)
    if np.all(degree == OWN):
        return None
    most = int(degree.max())
    if most > 0 and settings is None:
        remedy = "Give one number for each damper, such as its clicks, or share with degree 0."
        _checks.refuse("settings", "be given for polynomials of the setting", None, remedy)
    number = np.zeros(dampers) if settings is None else np.asarray(settings, float)
    if most >= (distinct := np.unique(number).size):
        _checks.refuse("shared", f"have degrees below the number of settings, {distinct}", most, "Take a lower degree.")
    column, size = np.zeros((dampers, degree.size), int), 0
    for j, d in enumerate(degree):
        column[:, j] = size + (np.arange(dampers) if d == OWN else 0)
        size += dampers if d == OWN else int(d) + 1
    ends = (float(number.min()), float(number.max()))
    return Dependence(degree, legendre(number, ends, most + 1), column, size, ends)


def _degrees(free: FreeParameters, degrees: Mapping[str, int]) -> Int[np.ndarray, " free"]:
    """The degree of each number in the setting, `OWN` where every damper has its own."""
    degree = np.full(len(free.names), OWN)
    for name, d in degrees.items():
        if not isinstance(d, int) or d < 0:
            _checks.refuse(f"shared[{name!r}]", "be the degree of a polynomial, 0 or more", d)
        named = match_paths([p.path for p in free.chosen], [name])
        degree[[p.path in named for p in free.owners]] = d
    return degree
