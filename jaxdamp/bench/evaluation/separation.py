"""Gas force and friction of a damper, from the even and the odd part of its force at low velocity."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp._tables import Column, Table
from jaxdamp.bench.analysis import FoldedCycles, fold_cycles
from jaxdamp.bench.evaluation.measurements import Measurement, measured
from jaxdamp.bench.runs import BenchRun


if TYPE_CHECKING:
    import matplotlib.figure


LOW_SPEED = 0.05  # m/s, up to which damping is taken as proportional to velocity
LOWEST_SHARE = 0.3  # of the range of velocities, below which friction is not fully there
_COLLINEAR = 100.0  # condition number from which friction and damping cannot be told apart
_BINS = 40  # of the stroke, for the curves


@final
@dataclass(frozen=True, eq=False, repr=False)
class GasAndFriction:
    """Gas force, its rate over the stroke, friction and bleed rates (damping at low speed) of one record.

    Attributes:
        measurements: gas force at mid-stroke, gas rate, friction, bleed rates; means over cycles with scatter.
        stroke: of the curves [m].
        rebound: force on the way into rebound at these strokes [N].
        compression: force on the way into compression [N].
        record: the name of the record.
        velocities: the range of velocities that was used [m/s].
        note: what the friction still contains; empty if nothing.
    """

    measurements: tuple[Measurement, ...]
    middle: float  # of the stroke [m], to which the gas force belongs
    stroke: Float[np.ndarray, " bins"]
    rebound: Float[np.ndarray, " bins"]
    compression: Float[np.ndarray, " bins"]
    record: str
    velocities: tuple[float, float]
    note: str = ""

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
        rows = tuple((m.quantity, m.unit, m.cell, m.count) for m in self.measurements)
        return Table(title, (Column("quantity"), Column("unit"), Column("value"), Column("cycles", spec="d")), rows)

    def to_dict(self) -> dict[str, Any]:
        """The figures as plain data."""
        return {"record": self.record, "note": self.note, **self.table().to_dict()}

    def plot(self) -> "matplotlib.figure.Figure":
        """Force over stroke in both directions, with the even and the odd part."""
        from jaxdamp import plots

        return plots.gas_and_friction(self)

    def __repr__(self) -> str:
        return "\n".join([str(self.table()), *([self.note] if self.note else [])])


def separate_gas_and_friction(run: BenchRun, *, up_to: float = LOW_SPEED) -> GasAndFriction:
    """Gas force and friction of a record, best of a quasi-static or slow one.

    In each steady cycle the samples with 0.3 to 1 times the velocity `up_to` are fitted by
    F = F_gas + k (x - x_mid) + F_friction sign(v) + c_r max(v, 0) + c_c min(v, 0): friction is what is left of the odd
    part at zero velocity, gas what is left of the even part. Where the velocity is constant, as under a triangle,
    friction and damping cannot be told apart, and the note says so.

    Arguments:
        run: the record.
        up_to: largest velocity to use [m/s]; the record's own peak if that is less. Below it the damping must be
            proportional to the velocity: stay below the knee.

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
    fits, note = _fit(cycles, low, high, run)
    quantities = (("gas force", "N"), ("gas rate", "N/m"), ("friction", "N"))
    quantities += (("rebound bleed rate", "N s/m"), ("compression bleed rate", "N s/m"))
    found = tuple(
        Measurement(name, unit, *measured(column), record=run.name)
        for (name, unit), column in zip(quantities, fits.T, strict=True)
    )
    stroke, rebound, compression = _branches(cycles)
    middle = 0.5 * float(cycles.stroke.max() + cycles.stroke.min())
    return GasAndFriction(found, middle, stroke, rebound, compression, run.name, (low, high), note)


def _fit(cycles: FoldedCycles, low: float, high: float, run: BenchRun) -> tuple[Float[np.ndarray, "cycles 5"], str]:
    """Gas force, gas rate, friction and both rates of each cycle; NaN where a record cannot tell."""
    middle = 0.5 * float(cycles.stroke.max() + cycles.stroke.min())
    rows, note = [], ""
    for stroke, velocity, force in zip(cycles.stroke, cycles.velocity, cycles.force, strict=True):
        use = (np.abs(velocity) >= low) & (np.abs(velocity) <= high)
        x, v = stroke[use] - middle, velocity[use]
        if min(np.sum(v > 0), np.sum(v < 0)) < 4:
            remedy = "Take a slower record, or a larger `up_to`."
            must = "leave four samples in each direction"
            _checks.refuse("up_to", must, f"{high:.3g} m/s of record {run.name!r}", remedy)
        columns = np.stack([np.ones(len(v)), x, np.sign(v), np.maximum(v, 0.0), np.minimum(v, 0.0)], axis=1)
        scale = np.linalg.norm(columns, axis=0)
        told_apart = bool(np.linalg.cond(columns / scale) < _COLLINEAR)
        size = 5 if told_apart else 3
        if not told_apart:
            note = f"The velocity hardly varies: the friction contains the damping at {np.abs(v).mean():.3g} m/s."
        solution = np.linalg.lstsq((columns / scale)[:, :size], force[use])[0] / scale[:size]
        rows.append(np.concatenate([solution, np.full(5 - size, np.nan)]))
    return np.stack(rows), note


def _branches(cycles: FoldedCycles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strokes, and the mean force there on the way into rebound and into compression."""
    low, high = float(cycles.stroke.min()), float(cycles.stroke.max())
    bins = np.minimum(((cycles.stroke - low) / (high - low) * _BINS).astype(int), _BINS - 1)
    centres = low + (np.arange(_BINS) + 0.5) / _BINS * (high - low)
    means = []
    for branch in (cycles.velocity > 0, cycles.velocity < 0):
        count = np.bincount(bins[branch], minlength=_BINS)
        sums = np.bincount(bins[branch], cycles.force[branch], minlength=_BINS)
        means.append(np.divide(sums, count, out=np.full(_BINS, np.nan), where=count > 0))
    return centres, means[0], means[1]
