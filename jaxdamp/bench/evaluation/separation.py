"""Gas force and friction of a damper, from the even and the odd part of its force at low velocity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._tables import Column, Contents, Table
from jaxdamp.bench.analysis import FoldedCycles, fold_cycles
from jaxdamp.bench.evaluation.curve import LOW_SPEED, LOWEST_SHARE, Measurement, measured
from jaxdamp.bench.motion import Samples, mean_curve
from jaxdamp.bench.runs import BenchRun


_ONE_SPEED, _MOST_OF_THE_TIME = 0.1, 0.6  # relative to the median, of the samples: 0.13 in a sine
_COLLINEAR = 100.0  # condition number from which friction and damping cannot be told apart
_BINS = 40  # of the stroke, for the curves
_CLEAR = 6.0  # standard deviations of the ratio of variances from which the damping is curved
_ALTERNATING = (-1.0) ** np.arange(1, 4)  # sign of powers of a negative number
_SAFE = 2.0  # standard errors, and changes by the next higher power, that make an uncertainty
_BELOW = 0.5  # share of the change from straight lines to parabolas that an uncertainty contains


@final
@dataclass(frozen=True, eq=False, repr=False)
class GasAndFriction(AbstractResult):
    """Gas force, its rate over the stroke, friction and bleed rates (damping at low speed) of one record.

    Attributes:
        measurements: gas force at mid-stroke, gas rate, friction, bleed rates; means over cycles with scatter, gas
            force and friction with their uncertainty too.
        stroke: of the curves [m].
        rebound: force on the way into rebound at these strokes [N].
        compression: force on the way into compression [N].
        record: the name of the record.
        velocities: the range of velocities that was used [m/s].
        note: what the friction still contains; empty if nothing.
        middle: the stroke that the gas force belongs to [m].
    """

    measurements: tuple[Measurement, ...]
    middle: float  # of the stroke [m], to which the gas force belongs
    stroke: Float[np.ndarray, " bins"]
    rebound: Float[np.ndarray, " bins"]
    compression: Float[np.ndarray, " bins"]
    record: str
    velocities: tuple[float, float]
    note: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """`note`, if there is one."""
        return (self.note,) if self.note else ()

    @property
    def summary(self) -> str:
        """Gas force and friction."""
        return f"{self.record}: gas force {self.gas_force:.1f} N, friction {self.friction:.1f} N."

    def _value(self, quantity: str) -> float:
        return next(m.value for m in self.measurements if m.quantity == quantity)

    @property
    def gas_force(self) -> float:
        """Static force at mid-stroke [N]; gas pushes the rod out, so it is negative."""
        return self._value("gas force")

    @property
    def gas_rate(self) -> float:
        """Slope of the static force over the stroke [N/m]."""
        return self._value("gas rate")

    @property
    def friction(self) -> float:
        """Force that changes sign with the velocity, extrapolated to zero velocity [N]."""
        return self._value("friction")

    @property
    def even(self) -> Float[np.ndarray, " bins"]:
        """Half the sum of both directions at equal stroke [N]: gas, and half the difference of the dampings."""
        return 0.5 * (self.rebound + self.compression)

    @property
    def odd(self) -> Float[np.ndarray, " bins"]:
        """Half the difference of both directions at equal stroke [N]: friction and damping."""
        return 0.5 * (self.rebound - self.compression)

    def static_force(self, stroke: Float[np.ndarray, " time"]) -> Float[np.ndarray, " time"]:
        """Gas force [N] at strokes [m]."""
        return self.gas_force + self.gas_rate * (stroke - self.middle)

    def table(self) -> Table:
        """The figures with their scatter over cycles."""
        low, high = self.velocities
        title = f"Gas force and friction of {self.record}, from {low:.3g} to {high:.3g} m/s"
        rows = tuple((m.quantity, m.unit, m.cell, m.uncertainty, m.count) for m in self.measurements)
        columns = (Column("quantity"), Column("unit"), Column("value"), Column("uncertainty", spec=".2g"))
        return Table(title, (*columns, Column("cycles", spec="d")), rows)

    def content(self) -> Contents:
        """The figures as plain data."""
        return {"record": self.record, "note": self.note, **self.table().to_dict()}

    plot = drawn_by("gas_and_friction", "Force over stroke in both directions, with the even and the odd part.")

    def __repr__(self) -> str:
        return "\n".join([str(self.table()), *([self.note] if self.note else [])])


def separate_gas_and_friction(run: BenchRun, *, up_to: float = LOW_SPEED) -> GasAndFriction:
    """Gas force and friction of a record, best of a quasi-static or slow one.

    In each steady cycle the samples with 0.3 to 1 times the velocity `up_to` are fitted by
    F = F_gas + k (x - x_mid) + F_friction sign(v) + c_r max(v, 0) + c_c min(v, 0): friction is what is left of the odd
    part at zero velocity, gas what is left of the even part. Where parabolas in place of the straight lines of both
    directions fit clearly better, these are taken; bleed rates are mean slopes over the range. Where the velocity is
    constant, as under a triangle, friction and damping cannot be told apart, and the note says so.

    The uncertainty of gas force and friction is the root of the sum of squares of twice the standard error, twice the
    change that the next higher power would make, and half the change that the parabolas made. It holds the true values
    of laws with a finite slope at zero velocity; a power law with an exponent below one looks like friction at any
    velocity that is measured.

    Arguments:
        run: the record.
        up_to: largest velocity to use [m/s]; the record's own peak if that is less. Stay below the knee.

    Raises:
        ValueError: no full cycle, or too few samples at these velocities.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear
    >>> dyno = bench.VirtualDyno(Bilinear(2600.0, 1200.0), gas_force=-150.0, friction=40.0, force_noise=2.0)
    >>> found = bench.separate_gas_and_friction(dyno.run(bench.SineTest(0.02, 0.5))[0])
    >>> round(found.gas_force), round(found.friction)
    (-150, 40)
    """
    _checks.positive("up_to", up_to)
    cycles = fold_cycles(run)
    high = min(up_to, run.peak_velocity)
    low = LOWEST_SHARE * high
    ends = float(cycles.stroke.min()), float(cycles.stroke.max())
    middle = 0.5 * (ends[1] + ends[0])
    fits, uncertain, note = _fit(cycles, middle, low, high, run)
    quantities = (("gas force", "N"), ("gas rate", "N/m"), ("friction", "N"))
    quantities += (("rebound bleed rate", "N s/m"), ("compression bleed rate", "N s/m"))
    measurements = tuple(
        Measurement(name, unit, *measured(column), record=run.name, uncertainty=uncertain.get(name))
        for (name, unit), column in zip(quantities, fits.T, strict=True)
    )
    (stroke, rebound), (_, compression) = (
        mean_curve(cycles.stroke[branch], cycles.force[branch], *ends, _BINS)
        for branch in (cycles.velocity > 0, cycles.velocity < 0)
    )
    return GasAndFriction(measurements, middle, stroke, rebound, compression, run.name, (low, high), note)


class _Fits(NamedTuple):
    """Every cycle fitted with damping of one order."""

    values: Float[np.ndarray, "cycles 5"]  # gas force, gas rate, friction, both rates; NaN for what cannot be told
    errors: Float[np.ndarray, "cycles 3"]  # standard errors of the first three
    squares: float  # sum over all samples [N²]
    free: int  # samples less coefficients


def _fit(
    cycles: FoldedCycles, middle: float, low: float, high: float, run: BenchRun
) -> tuple[Float[np.ndarray, "cycles 5"], dict[str, float], str]:
    """Gas force, gas rate, friction and both rates of each cycle, the uncertainty of gas force and friction, a note."""
    use = [(np.abs(velocity) >= low) & (np.abs(velocity) <= high) for velocity in cycles.velocity]
    speeds = [velocity[part] / high for velocity, part in zip(cycles.velocity, use, strict=True)]
    if min(min(np.sum(u > 0), np.sum(u < 0)) for u in speeds) < 4:
        remedy = "Take a slower record, or a larger `up_to`."
        must = "leave four samples in each direction"
        _checks.refuse("up_to", must, f"{high:.3g} m/s of record {run.name!r}", remedy)
    parts = [
        (stroke[part] - middle, u, force[part])
        for stroke, force, part, u in zip(cycles.stroke, cycles.force, use, speeds, strict=True)
    ]
    if _hardly_varies([_columns(x, u, 1) for x, u, _ in parts], speeds):
        mean = high * np.mean([np.abs(u).mean() for u in speeds])
        note = f"The velocity hardly varies: the friction contains the damping at {mean:.3g} m/s."
        return _of_order(parts, 0, high).values, {}, note
    orders = [_of_order(parts, order, high) for order in (1, 2, 3)]
    line, curve = orders[:2]
    ratio = (line.squares - curve.squares) / (2 * len(parts)) / max(curve.squares / max(curve.free, 1), 1e-300)
    best = 1 if curve.free > 0 and ratio > 1 + _CLEAR / np.sqrt(len(parts)) else 0
    uncertain = {name: _uncertainty(orders, best, column) for name, column in (("gas force", 0), ("friction", 2))}
    return orders[best].values, uncertain, ""


def _hardly_varies(columns: Sequence[Float[np.ndarray, "time terms"]], speeds: Sequence[Samples]) -> bool:
    """Whether friction and damping look alike; or most of the time is spent near one speed, as in a triangle."""
    if any(np.linalg.cond(each / np.linalg.norm(each, axis=0)) > _COLLINEAR for each in columns):
        return True
    ways = [u[side * u > 0.0] for u in speeds for side in (1.0, -1.0)]
    return all(np.mean(np.abs(u / np.median(u) - 1.0) < _ONE_SPEED) > _MOST_OF_THE_TIME for u in ways)


def _uncertainty(orders: "Sequence[_Fits]", best: int, column: int) -> float:
    """Of a figure: twice its standard error, twice what the next power changes, half of what the parabolas changed."""
    count = len(orders[best].values)
    means = [float(fits.values[:, column].mean()) for fits in orders]
    scatter = float(orders[best].values[:, column].std(ddof=1)) if count > 1 else 0.0
    error = max(scatter, float(np.sqrt(np.mean(orders[best].errors[:, column] ** 2)))) / np.sqrt(count)
    below = _BELOW * (means[best] - means[0])
    return float(np.linalg.norm([_SAFE * error, _SAFE * (means[best + 1] - means[best]), below]))


def _columns(x: Samples, u: Samples, order: int) -> Float[np.ndarray, "time terms"]:
    """Columns for gas, its rate, friction, and for each power of the relative speed one of each direction."""
    powers = [np.where(side, u**k, 0.0) for k in range(1, order + 1) for side in (u > 0, u < 0)]
    return np.stack([np.ones(len(u)), x, np.sign(u), *powers], axis=1)


def _of_order(parts: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], order: int, high: float) -> _Fits:
    """Stroke from the middle, velocity over its largest, and force of every cycle, with damping of an order."""
    values, errors, squares, free = [], [], 0.0, 0
    for x, u, force in parts:
        columns = _columns(x, u, order)
        scale = np.linalg.norm(columns, axis=0)
        solution = np.linalg.lstsq(columns / scale, force)[0] / scale
        left, more = float(np.sum((force - columns @ solution) ** 2)), max(len(u) - len(scale), 0)
        shares = np.diag(np.linalg.pinv((columns / scale).T @ (columns / scale)))
        error = np.sqrt(np.maximum(shares, 0.0) * left / max(more, 1)) / scale  # rounding may leave less than zero
        # means of u^k over the range
        slopes = [(1 - LOWEST_SHARE**k) / (1 - LOWEST_SHARE) for k in range(1, order + 1)]
        rates = [np.dot(solution[3::2], slopes), -np.dot(solution[4::2], np.array(slopes) * _ALTERNATING[:order])]
        values.append([*solution[:3], *(np.array(rates) / high if order else (np.nan, np.nan))])
        errors.append(error[:3])
        squares, free = squares + left, free + more
    return _Fits(np.array(values), np.array(errors), squares, free)
