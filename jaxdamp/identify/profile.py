"""Parameters moved away from a minimum, all others fitted again: standard errors checked, costs as curves.

Linear errors are wrong if the sum of squares is no parabola. Example: the slope above a knee that the records do not
reach seems certain as long as the knee is fixed; if the knee may move, any slope fits. If a fit is doubtful, each
parameter that seems certain is therefore moved away in growing steps, and all others are fitted again at each step.
"""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Table, plain
from jaxdamp.dampers import keeps_conditions
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.propagation import Evidence
from jaxdamp.identify.search import SearchEnd, Searches
from jaxdamp.solve import BoundedLevenbergMarquardt


STEPS = 15  # of each search; an incomplete search makes an error smaller, never larger
LOOSE = 0.3  # standard errors: 0.1 in chi-square
PATIENCE = 4  # points tried without such a decrease: near kinks more is predicted than comes true
MOST_STEPS = 600  # of all searches together; parameters after that have their linear errors
CHI_SQUARE = 9.0  # increase up to which a moved parameter still fits: three standard errors
GROWTH = 4.0  # of the distance, from one step to the next
CURVE_STEPS = 60  # of each search
COARSE = BoundedLevenbergMarquardt(tolerance=0.01)  # standard errors
FIRST = 0.5  # first distance, in standard errors
CURVE_GROWTH = 1.5  # of the distance, from one point to the next
MOST_POINTS = 24  # on each side
FAR = 1e3  # relative to the value or to the standard error, beyond which a side counts as open
CLOSE = 1e-2  # of the root of the cost at an end of the interval
MOST_SECANTS = 12  # to find an end
MOST_MOVES = 10  # of all other numbers, to where conditions between them hold
OVERSHOOT, ROOM = 1.2, 1e-6  # of what is lacking, and beside it in coordinates of the search
LEAST_SHARE = 0.05  # of the bracket, by which a secant stays away from its ends


class Profile(NamedTuple):
    """Errors of parameters from moving them away from a minimum."""

    errors: Float[np.ndarray, " free"]  # at least the linear standard errors
    open_ended: Bool[np.ndarray, " free"]  # numbers that fit nearly as well at the largest distance tried


def profile(
    problem: Problem,
    minimum: SearchEnd,
    errors: Float[np.ndarray, " free"],
    far: Float[np.ndarray, " free"],
    chosen: Bool[np.ndarray, " free"],
    variance: float,
) -> Profile:
    """Standard errors that are also valid away from the minimum.

    A parameter at a distance d from its value should increase chi-square by (d/error)². If the other parameters can
    compensate so that the increase is less than `CHI_SQUARE`, the error is at least d over the root of the increase, or
    d if there is hardly any increase.
    """
    wide, open_ended, left = errors.copy(), np.zeros(errors.shape, bool), MOST_STEPS
    most = minimum.squares + CHI_SQUARE * variance  # the largest sum of squares of a parameter that still fits
    level = float(np.sqrt(variance * minimum.residual.size / most))  # of a sample's noise, to which tolerances relate
    solver = BoundedLevenbergMarquardt(tolerance=LOOSE * level, patience=PATIENCE)
    searches = Searches(problem, solver)
    sides = [(int(i), side) for i in np.flatnonzero(chosen & (errors > 0)) for side in (-1.0, 1.0)]
    for i, side in sides:
        distance, end = np.sqrt(CHI_SQUARE) * errors[i], minimum
        farthest = max(far[i], distance)
        while distance <= farthest and left > 0:
            moved = moved_to(searches, end, i, minimum.values[i] + side * distance, STEPS)
            if moved is None:
                break
            end = moved
            left -= end.steps
            rise = (end.squares - minimum.squares) / variance
            if not rise < CHI_SQUARE:
                break
            wide[i] = max(wide[i], distance / np.sqrt(max(rise, 1.0)))
            open_ended[i] |= distance == far[i]
            distance = min(GROWTH * distance, farthest) if distance < farthest else np.inf
    return Profile(wide, open_ended)


def moved_to(searches: Searches, end: SearchEnd, index: int, value: float, steps: int) -> SearchEnd | None:
    """The end of a search from that of another one, with one value changed; `None` if the law refuses this value."""
    problem, values = searches.problem, end.values.copy()
    values[index] = value
    lower, upper = problem.free.limits()
    if not lower[index] < value < upper[index]:
        return None
    if problem.has_conditions and not keeps_conditions(problem.started_at(values).free.tree):
        within = _within_conditions(searches, values, index)
        if within is None:
            return None
        values = within
    return searches.end(values, steps, held=index)


def _within_conditions(
    searches: Searches, values: Float[np.ndarray, " free"], index: int
) -> Float[np.ndarray, " free"] | None:
    """The values with all but one moved, as little as it takes, to where the conditions hold; None if none is found."""
    lower, upper = searches.coordinates.bounds()
    y = np.asarray(searches.coordinates.from_physical(values), np.float64)
    others = np.arange(y.size) != index
    for _ in range(MOST_MOVES):
        here = searches.here(y)
        wrong = here.margins <= 0.0
        if not np.any(wrong):
            return here.values
        slopes = here.slopes[wrong][:, others]
        lacking = OVERSHOOT * -here.margins[wrong] + ROOM * np.linalg.norm(slopes, axis=1)
        y[others] += np.linalg.lstsq(slopes, lacking, rcond=None)[0]
        y[others] = np.clip(y, lower, upper)[others]
    return None


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ProfileCurve(AbstractResult):
    """How much worse the records fit with other values of a parameter, the best of all others given.

    Attributes:
        name: of the parameter.
        unit: its unit.
        values: values tried, increasing, shape (points,).
        cost: increase of the sum of squares, over the variance of the noise: squared standard errors, shape (points,).
        interval: 95 % interval: where the cost is below `level`. An end is infinite if the cost stays below it.
        level: square of the quantile of Student's t, about 3.84.
        linear_interval: the interval from the standard error, which is exact where the cost is a parabola.
    """

    name: str
    unit: str
    values: Float[np.ndarray, " points"]
    cost: Float[np.ndarray, " points"]
    interval: tuple[float, float]
    level: float
    linear_interval: tuple[float, float]

    @property
    def summary(self) -> str:
        """The interval, and the one from the standard error."""
        (low, high), (lower, upper) = self.interval, self.linear_interval
        unit = f" {self.unit}".rstrip()
        return (
            f"{self.name} lies between {low:.4g} and {high:.4g}{unit} (95 %); its standard error alone says"
            f" {lower:.4g} to {upper:.4g}."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """An interval without an end."""
        open_ended = not np.all(np.isfinite(self.interval))
        return (f"The records do not bound {self.name} on both sides.",) * open_ended

    def table(self) -> Table:
        """The values tried with their cost."""
        columns = Column(self.name, self.unit, ".5g"), Column("cost in squared standard errors", spec=".3g")
        return Table(f"Profile of {self.name}", columns, tuple(zip(*map(plain, (self.values, self.cost)), strict=True)))

    def content(self) -> dict[str, Any]:
        """The curve and its intervals as plain data."""
        return self._data(*(field.name for field in dataclasses.fields(self)))

    plot = drawn_by("profile", "Cost over value, with the interval and the parabola of the standard error.")


def profile_curve(evidence: Evidence, name: str, linear: tuple[float, float]) -> ProfileCurve:
    """`FitResult.profile`."""
    problem, minimum = evidence.problem, evidence.minimum
    i, level = problem.free.names.index(name), evidence.quantile**2
    error = float(np.sqrt(evidence.covariance[i, i]))
    side = _Side(evidence, i, error if 0 < error < np.inf else 0.1 * (abs(minimum.values[i]) or 1.0))
    below, lower = side.walk(-1.0, level)
    above, upper = side.walk(1.0, level)
    points = sorted([*below, (float(minimum.values[i]), 0.0), *above])
    values, cost = (np.array(column) for column in zip(*points, strict=True))
    return ProfileCurve(name, problem.free.owners[i].unit, values, cost, (lower, upper), level, linear)


class _Side:
    """Searches with one parameter held, ever farther from the minimum."""

    def __init__(self, evidence: Evidence, index: int, unit: float) -> None:
        self.evidence, self.index, self.unit = evidence, index, unit
        self.searches = Searches(evidence.problem, COARSE)
        self.centre = float(evidence.minimum.values[index])
        jacobian = evidence.minimum.jacobian
        others = np.delete(jacobian, index, axis=1)
        column = jacobian[:, index]
        left = column - (others @ np.linalg.lstsq(others, column, rcond=None)[0] if others.size else 0.0)
        variance = evidence.covariance[index, index]
        # What a standard error costs, so that noise with a memory is counted here as it is there.
        self.one = float(left @ left) * variance if 0 < variance < np.inf else evidence.noise.variance

    def at(self, value: float, start: SearchEnd) -> tuple[float, SearchEnd] | None:
        """Cost at a value, and the end of the search; `None` where the law refuses the value."""
        end = moved_to(self.searches, start, self.index, value, CURVE_STEPS)
        if end is None:
            return None
        return max(end.squares - self.evidence.minimum.squares, 0.0) / self.one, end

    def walk(self, way: float, level: float) -> tuple[list[tuple[float, float]], float]:
        """Points on one side, and the end of the interval there."""
        edge = float(self.evidence.problem.free.limits()[way > 0][self.index])
        points: list[tuple[float, float]] = []
        inside, end = (self.centre, 0.0), self.evidence.minimum
        distance, most = FIRST * self.unit, FAR * max(abs(self.centre), self.unit)
        for _ in range(MOST_POINTS):
            value = self.centre + way * distance
            beyond = (value - edge) * way >= 0
            value = 0.5 * (inside[0] + edge) if beyond else value
            tried = self.at(value, end)
            if tried is None:
                return points, edge if beyond else inside[0]
            points.append((value, tried[0]))
            if tried[0] > level:
                more, crossing = self._between(inside, (value, tried[0]), level, end)
                return [*points, *more], crossing
            if beyond and abs(edge - value) < CLOSE * self.unit:
                return points, edge
            inside, end = (value, tried[0]), tried[1]
            distance = distance if beyond else CURVE_GROWTH * distance
            if distance > most:
                break
        return points, way * np.inf if not np.isfinite(edge) else edge

    def _between(
        self, low: tuple[float, float], high: tuple[float, float], level: float, end: SearchEnd
    ) -> tuple[list[tuple[float, float]], float]:
        """Points between one inside the interval and one outside, and its end, by secants of the root of the cost."""
        points, value = [], low[0]
        for _ in range(MOST_SECANTS):
            roots = np.sqrt([low[1], high[1], level])
            share = float(np.clip((roots[2] - roots[0]) / (roots[1] - roots[0]), LEAST_SHARE, 1.0 - LEAST_SHARE))
            value = low[0] + share * (high[0] - low[0])
            tried = self.at(value, end)
            point = (value, np.inf if tried is None else tried[0])
            points += [point] * (tried is not None)
            if abs(np.sqrt(point[1]) - roots[2]) < CLOSE:
                break
            low, high = (point, high) if point[1] < level else (low, point)
        return points, value
