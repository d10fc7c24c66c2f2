"""What is measured of a damper: figures of cycles, and forces over velocity at one setting."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from jaxdamp._display import plus_minus
from jaxdamp._tables import Cell, Shown
from jaxdamp.bench.analysis import FoldedCycles
from jaxdamp.bench.contradictions import repeats
from jaxdamp.bench.motion import CENTRAL, Cycles, Figures, around_middle, at_peak, mean_where, speed_is_constant
from jaxdamp.bench.runs import BenchRun


@dataclass(frozen=True)
class Measurement:
    """A quantity of a damper, measured so many times.

    Arguments:
        quantity: its name, such as "rebound force".
        unit: in SI.
        value: the mean.
        scatter: standard deviation of the single values (over cycles, or over repeated records); None for a single one.
        count: single values in the mean.
        setting: of the damper, such as "0.5" for a coil current; empty if there is only one.
        record: of which it was measured; empty if several records went into it.
        velocity: at which it was measured [m/s], positive; None where it belongs to no velocity.
        uncertainty: half the width of an interval that should hold the true value, with errors of the method that the
            scatter does not show; None where it is not known.
    """

    quantity: str
    unit: str
    value: float
    scatter: float | None = None
    count: int = 1
    setting: str = ""
    record: str = ""
    velocity: float | None = None
    uncertainty: float | None = None

    @property
    def cell(self) -> Cell:
        """Value and uncertainty, or scatter where that is not known, for a table; nothing where there is no value."""
        if not np.isfinite(self.value):
            return None
        width = self.scatter if self.uncertainty is None else self.uncertainty
        return Shown(self.value, f"{self.value:.4g}" if width is None else plus_minus(self.value, width))


def at_velocity(measurement: Measurement, velocity: float | None) -> bool:
    """Whether it was measured at a velocity [m/s], or at none where that is None."""
    if velocity is None or measurement.velocity is None:
        return velocity is None and measurement.velocity is None
    return bool(np.isclose(measurement.velocity, velocity))


Mean: TypeAlias = tuple[float, float | None, int]  # of several values, with their scatter and number


def measured(values: Float[np.ndarray, " values"]) -> Mean:
    """Mean, standard deviation and number of the values that are finite."""
    values = values[np.isfinite(values)]
    if not len(values):
        return float("nan"), None, 0
    return float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else None, len(values)


TURNING = 0.05  # of the peak velocity, below which samples count as taken at zero velocity


def cycle_figures(cycles: FoldedCycles) -> dict[tuple[str, str], Figures]:
    """The figures of each cycle by quantity and unit.

    - force at peak velocity: mean over the samples within 2 % of the largest velocity of that direction; in strokes at
      constant velocity, as of a triangle, over the central half of the stroke;
    - force at mid-stroke: mean over the central 10 % of the stroke range;
    - rebound/compression ratio: of the magnitudes of the forces at peak velocity;
    - static force: at zero velocity, mean of both ends of the stroke;
    - energy: ∮ F v dt; equivalent damping: ∮ F v dt / ∮ v² dt, which is E / (π ω X²) for a sine;
    - hysteresis area: −∮ F dv, positive where the force lags behind the velocity;
    - hysteresis width: force at zero velocity at the rebound end of the stroke less that at the compression end,
      so that a spring (gas) of rate k adds 2 k X.
    """
    stroke, velocity, force = cycles.stroke, cycles.velocity, cycles.force
    rebound, compression = (at_peak(stroke, sign * velocity) for sign in (1.0, -1.0))
    forces = mean_where(force, rebound), mean_where(force, compression)
    middle = 0.5 * (stroke.max(axis=1, keepdims=True) + stroke.min(axis=1, keepdims=True))
    central = around_middle(stroke, CENTRAL)
    turning = np.abs(velocity) <= TURNING * np.abs(velocity).max(axis=1, keepdims=True)
    energy = np.mean(force * velocity, axis=1) * cycles.periods
    squared = np.mean(velocity**2, axis=1) * cycles.periods
    ends = [mean_where(force, turning & side) for side in (stroke > middle, stroke < middle)]
    return {
        ("rebound velocity", "m/s"): mean_where(velocity, rebound),
        ("rebound force", "N"): forces[0],
        ("compression velocity", "m/s"): mean_where(velocity, compression),
        ("compression force", "N"): forces[1],
        ("rebound/compression ratio", ""): np.abs(forces[0] / forces[1]),
        ("mid-stroke rebound force", "N"): mean_where(force, central & (velocity > 0)),
        ("mid-stroke compression force", "N"): mean_where(force, central & (velocity < 0)),
        ("mean force", "N"): force.mean(axis=1),
        ("static force", "N"): 0.5 * (ends[0] + ends[1]),
        ("energy per cycle", "J"): energy,
        ("equivalent damping", "N s/m"): energy / squared,
        ("hysteresis area", "W"): -_loop_integral(force, velocity),
        ("hysteresis width", "N"): ends[0] - ends[1],
    }


def _loop_integral(force: Cycles, velocity: Cycles) -> Figures:
    """∮ F dv of each closed cycle, by straight lines between its points."""
    following = np.roll(force, -1, axis=1)
    return np.sum(0.5 * (force + following) * (np.roll(velocity, -1, axis=1) - velocity), axis=1)


OEM_VELOCITIES = (0.052, 0.131, 0.262, 0.393, 0.524, 1.047)  # m/s, common in damper specifications
LOW_SPEED = 0.05  # m/s, up to which damping is taken as a straight line or a parabola
LOWEST_SHARE = 0.3  # of the range of velocities, below which friction is not fully there
METHODS = ("interpolation", "window", "loop")
DIRECTIONS = {"rebound": 1.0, "compression": -1.0}
_KNEES = 40  # candidates of the search, twice
_BEND = 0.1  # relative difference of two rates from which there is a knee
_EXPLAINS = 0.5  # of the straight line's residual that the knee must take away

Cycle = Float[np.ndarray, " points"]


class PeakForce(NamedTuple):
    """Force of one record at the peak velocity of one direction."""

    velocity: float  # m/s, positive
    force: float  # N
    scatter: float | None  # N


def interpolated(points: Sequence[PeakForce], velocity: float) -> Mean:
    """Force on the straight line between the records whose peak velocities enclose a velocity; NaN beyond them."""
    points = sorted(points)
    velocities = np.array([point.velocity for point in points])
    after = int(np.searchsorted(velocities, velocity))
    if after < len(points) and np.isclose(velocities[after], velocity, rtol=1e-9):
        point = points[after]
        return point.force, point.scatter, 1
    if not 0 < after < len(points):
        return float("nan"), None, 0
    one, two = points[after - 1], points[after]
    share = (velocity - one.velocity) / (two.velocity - one.velocity)
    have_scatter = one.scatter is not None and two.scatter is not None
    between = float(np.hypot((1 - share) * (one.scatter or 0.0), share * (two.scatter or 0.0)))
    return (1 - share) * one.force + share * two.force, between if have_scatter else None, 2


def in_window(points: Sequence[PeakForce], velocity: float, window: float) -> Mean:
    """Mean force of the records whose peak velocity is within a share of a velocity; NaN without one.

    The scatter is that over the records, or over the cycles of a single one.
    """
    inside = [point for point in points if abs(point.velocity / velocity - 1.0) <= window]
    value, scatter, count = measured(np.array([point.force for point in inside]))
    return value, inside[0].scatter if count == 1 else scatter, count


def on_loop(cycles: FoldedCycles, sign: float, velocity: float, window: float) -> Mean:
    """Force at a velocity on the continuous loop, mean of its accelerating and its decelerating branch.

    Each branch is fitted by a straight line over the velocities within a share of the stated one. NaN where the
    record does not reach it, or has it only in turns between strokes at constant velocity.
    """
    directed = sign * cycles.velocity
    slower = velocity < (1.0 - window) * np.median(directed[directed > 0])
    only_in_turns = speed_is_constant(cycles.stroke, directed) & slower
    branches = np.gradient(directed, axis=1) > 0
    forces = [
        0.5 * sum(_force_at(v[branch], f[branch], velocity, window) for branch in (accelerating, ~accelerating))
        for v, f, accelerating in zip(directed, cycles.force, branches, strict=True)
    ]
    return measured(np.where(only_in_turns, np.nan, forces))


def _force_at(velocity: Cycle, force: Cycle, at: float, window: float) -> float:
    near = np.abs(velocity - at) <= window * at
    if near.sum() >= 3 and velocity[near].min() < at < velocity[near].max():
        offset = velocity[near] - at
        slope = np.dot(offset - offset.mean(), force[near]) / np.dot(offset - offset.mean(), offset)
        return float(force[near].mean() - slope * offset.mean())
    order = np.argsort(velocity)
    return float(np.interp(at, velocity[order], force[order], left=np.nan, right=np.nan)) if len(order) else np.nan


def rates_and_knees(cycles: FoldedCycles, setting: str, record: str) -> list[Measurement]:
    """Low- and high-speed rate and knee velocity of both directions, of the loop of the fastest record.

    F = F₀ + c_low min(|v|, v_k) + c_high max(|v| - v_k, 0) + k x by least squares in every cycle, from
    0.015 m/s on, where friction is fully there. A knee exists where both rates differ by more than a tenth and it
    takes away more than half of what a straight line leaves; otherwise there is one rate, and no knee.
    """
    measurements = []
    for name, sign in DIRECTIONS.items():
        each = zip(cycles.stroke, cycles.velocity, cycles.force, strict=True)
        rows = np.array([_bend(*cycle, sign) for cycle in each])
        rows[speed_is_constant(cycles.stroke, sign * cycles.velocity)] = np.nan  # one velocity has no slope
        quantities = (f"{name} rate", f"{name} low-speed rate", f"{name} high-speed rate", f"{name} knee velocity")
        for quantity, column in zip(quantities, rows.T, strict=True):
            if np.isfinite(column).mean() >= 0.5:
                unit = "m/s" if quantity.endswith("velocity") else "N s/m"
                measurements.append(Measurement(quantity, unit, *measured(column), setting=setting, record=record))
    return measurements


def _bend(stroke: Cycle, velocity: Cycle, force: Cycle, sign: float) -> tuple[float, float, float, float]:
    """One rate, or low-speed rate, high-speed rate and knee velocity, of one direction of one cycle; NaN for others."""
    use = sign * velocity > LOWEST_SHARE * LOW_SPEED
    v, f, x = sign * velocity[use], sign * force[use], stroke[use] - stroke.mean()
    nothing = float("nan")
    if use.sum() < 8:
        return nothing, nothing, nothing, nothing
    straight, left = _solve(np.stack([np.ones(len(v)), x, v])[None], f)
    low, high = np.quantile(v, [0.1, 0.9])
    knees = np.linspace(low, high, _KNEES)
    near = int(np.argmin(_with_knees(v, x, f, knees)[1]))
    knees = np.linspace(knees[max(near - 1, 0)], knees[min(near + 1, _KNEES - 1)], _KNEES)
    bent, squares = _with_knees(v, x, f, knees)
    best = int(np.argmin(squares))
    low_rate, high_rate = bent[best, 2:].tolist()
    bends = abs(low_rate - high_rate) > _BEND * max(abs(low_rate), abs(high_rate))
    if bends and squares[best] < (1 - _EXPLAINS) * left[0]:
        return nothing, low_rate, high_rate, float(knees[best])
    return float(straight[0, 2]), nothing, nothing, nothing


def _with_knees(v: Cycle, x: Cycle, force: Cycle, knees: Float[np.ndarray, " knees"]) -> tuple[np.ndarray, np.ndarray]:
    """Least squares with two rates for each of several knee velocities: F₀, k, c_low, c_high and the squares left."""
    ramps = [np.broadcast_to(c, (len(knees), len(v))) for c in (np.ones(len(v)), x)]
    bent = [np.minimum(v, knees[:, None]), np.maximum(v - knees[:, None], 0.0)]
    return _solve(np.stack([*ramps, *bent], axis=1), force)


def _solve(rows: Float[np.ndarray, "knees terms points"], force: Cycle) -> tuple[np.ndarray, np.ndarray]:
    """Least squares for many sets of terms, and the squares that each leaves.

    By normal equations of terms of one size, and their eigenvalues: far less work than a pseudo-inverse of the terms.
    """
    gram = rows @ rows.transpose(0, 2, 1)
    sizes = np.sqrt(np.einsum("ktt->kt", gram))
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    values, vectors = np.linalg.eigh(gram / (sizes[:, :, None] * sizes[:, None, :]))
    seen = values > 1e-12 * values[:, -1:]
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=seen)
    along = np.matmul(vectors.transpose(0, 2, 1), (rows @ force / sizes)[..., None])[..., 0]
    solutions = np.matmul(vectors, (inverse * along)[..., None])[..., 0] / sizes
    left = np.matmul(solutions[:, None, :], rows)[:, 0] - force
    return solutions, np.einsum("kp,kp->k", left, left)


WINDOW = 0.05  # share of a stated velocity within which samples, or records, count as taken at it


def fastest(runs: Sequence[BenchRun]) -> BenchRun:
    """The record of the largest velocity."""
    return max(runs, key=lambda run: run.peak_velocity)


class Forces(NamedTuple):
    """Records by setting, and how forces at stated velocities are found from them."""

    settings: Mapping[str, Sequence[BenchRun]]
    cycles: Mapping[str, FoldedCycles]
    method: str
    window: float

    def at(
        self, velocities: Sequence[float] | None, setting: str, of_records: Sequence[Measurement]
    ) -> list[Measurement]:
        """Forces and their ratio at the stated velocities; without any stated, at those that the records reach."""
        measurements, peaks = [], self._peaks(setting, of_records)
        loop = self.cycles[fastest(self.settings[setting]).name]
        for velocity in OEM_VELOCITIES if velocities is None else velocities:
            forces: dict[str, Mean] = {}
            for direction, sign in DIRECTIONS.items():
                if self.method == "loop":
                    forces[direction] = on_loop(loop, sign, velocity, self.window)
                elif self.method == "window":
                    forces[direction] = in_window(peaks[direction], velocity, self.window)
                else:
                    forces[direction] = interpolated(peaks[direction], velocity)
            values = [force[0] for force in forces.values()]
            if velocities is None and not np.isfinite(values).any():
                continue
            more = {"setting": setting, "velocity": float(velocity)}
            measurements += [Measurement(f"{name} force", "N", *force, **more) for name, force in forces.items()]
            measurements.append(Measurement("rebound/compression ratio", "", *_ratio(*forces.values()), **more))
        return measurements

    def _peaks(self, setting: str, measurements: Sequence[Measurement]) -> dict[str, list[PeakForce]]:
        """Forces at the peak velocities of each direction, one for each motion: repeated records are averaged."""
        by = {(m.record, m.quantity): m for m in measurements if m.record and m.setting == setting}
        groups = repeats(self.settings[setting])
        by_direction = {
            name: [_peak_force([run.name for run in group], by, name) for group in groups] for name in DIRECTIONS
        }
        return {name: [peak for peak in peaks if peak is not None] for name, peaks in by_direction.items()}

    def span(self, measurements: Sequence[Measurement]) -> tuple[float, float, str]:
        """The lowest and highest velocity at which all settings give a force, equal if at none; in words."""
        peaks = [points for name in self.settings for points in self._peaks(name, measurements).values()]
        spans = [[point.velocity for point in points] for points in peaks if points]
        low, high = max(map(min, spans), default=0.0), min(map(max, spans), default=0.0)
        loops = [self.cycles[fastest(runs).name] for runs in self.settings.values()] if self.method == "loop" else []
        if loops and not any(speed_is_constant(loop.stroke, loop.velocity).any() for loop in loops):
            low = 0.0  # a loop goes through all velocities
        at = f"the records give forces at {high:.3g} m/s" if self.method == "loop" else "the records enclose none"
        words = f"the records give forces from {low:.3g} to {high:.3g} m/s" if low < high else at
        return low, max(low, high), words


def _peak_force(records: Sequence[str], by: Mapping[tuple[str, str], Measurement], direction: str) -> PeakForce | None:
    """Force at the peak velocity of a direction, of records of one motion; None where it was not measured."""
    velocity = np.array([abs(by[record, f"{direction} velocity"].value) for record in records])
    forces = [by[record, f"{direction} force"] for record in records]
    value, between, count = measured(np.array([m.value for m in forces]))
    within = [m.scatter for m in forces if m.scatter is not None]
    parts = [] if between is None else [between]
    parts += [float(np.sqrt(np.mean(np.square(within))))] if within else []
    if not count or not np.isfinite(velocity).all():
        return None
    return PeakForce(float(velocity.mean()), value, float(np.linalg.norm(parts)) if parts else None)


def _ratio(one: Mean, other: Mean) -> Mean:
    """Ratio of the magnitudes of two forces; their scatters taken as independent."""
    if not other[0]:
        return float("nan"), None, 0
    value = abs(one[0] / other[0])
    has_scatter = one[1] is not None and other[1] is not None and one[0] != 0.0
    scatter = float(value * np.hypot((one[1] or 0.0) / one[0], (other[1] or 0.0) / other[0])) if has_scatter else None
    return value, scatter, min(one[2], other[2])
