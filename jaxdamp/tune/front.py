"""A front: the designs of which none is better in one objective without being worse in another."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Generic, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jaxdamp import _checks
from jaxdamp._results import AbstractResult, drawn_by
from jaxdamp._status import Status
from jaxdamp._tables import Column, Contents, Table, percentage, plain, typeset_unit, with_unit
from jaxdamp._traced import of_known_numbers
from jaxdamp.metrics import MetricValues
from jaxdamp.parameters import FreeParameters
from jaxdamp.tune.limits import amount
from jaxdamp.tune.measuring import Measurement
from jaxdamp.tune.result import V
from jaxdamp.tune.verdict import relative_change
from jaxdamp.vehicles import AbstractVehicle


def non_dominated(values: Float[np.ndarray, "points objectives"]) -> Bool[np.ndarray, " points"]:
    """Which points no other one equals or beats in every objective (of equal points, the first one counts)."""
    no_worse = np.all(values[:, None] <= values[None, :], axis=2)
    better = np.any(values[:, None] < values[None, :], axis=2)
    earlier = np.tri(len(values), k=-1, dtype=bool).T
    return ~np.any(no_worse & (better | earlier), axis=0)


@of_known_numbers
def hypervolume(
    values: Float[np.ndarray, "points objectives"] | Sequence[Sequence[float]],
    reference: Sequence[float] | Float[np.ndarray, " objectives"],
) -> float:
    """Volume of objectives that at least one point beats, up to a reference point, by slices along the last objective.

    Arguments:
        values: objectives of each point, shape (points, objectives).
        reference: values that count as worst, one for each objective in their order.

    >>> hypervolume(np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([3.0, 3.0]))
    3.0
    """
    values = np.asarray(values, float)
    remedy = "Give one value for each objective: `[front.reference[name] for name in front.names]`."
    if isinstance(reference, Mapping):
        _checks.refuse("reference", "be numbers in the order of the columns of `values`", "a mapping", remedy)
    worst = np.array([*reference], float)
    if not np.all(np.isfinite(worst)):
        _checks.refuse("reference", "be finite", worst.tolist(), remedy)
    if values.ndim != 2 or values.shape[1:] != worst.shape:
        _checks.refuse("reference", "have one value for each column of `values`", f"of {worst.shape}", remedy)
    values = values[np.all(values < worst, axis=1)]
    if not len(values):
        return 0.0
    if values.shape[1] == 1:
        return float(worst[0] - values.min())
    values = values[np.argsort(values[:, -1])]
    heights = np.diff(np.append(values[:, -1], worst[-1]))
    areas = [hypervolume(values[: i + 1, :-1], worst[:-1]) if h > 0 else 0.0 for i, h in enumerate(heights)]
    return float(heights @ areas)


def shares_of(values: Float[np.ndarray, "points objectives"]) -> Float[np.ndarray, "points objectives"]:
    """The objectives at each point, from 0 at the best value to 1 at the worst."""
    best, worst = values.min(axis=0), values.max(axis=0)
    return (values - best) / np.where(worst > best, worst - best, 1.0)


class FrontParameter(NamedTuple):
    """A free number of a front with the bounds of the search."""

    name: str
    unit: str
    start: float
    lower: float
    upper: float


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ParetoFront(AbstractResult, Generic[V]):
    """The designs of a front, ordered by the first objective, and the vehicle that the search started from.

    Attributes:
        start: the vehicle before.
        names: of the objectives.
        values: every metric at each point, by name.
        before: every metric of the start, by name.
        units: unit of each metric.
        parameters: the free numbers, with their bounds.
        designs: the value of each free number at each point.
        limits: largest allowed value of metrics, or the smallest and the largest one.
        reference: the point up to which the hypervolume counts, by objective.
        warnings: doubts about the front, in words.
        status: `CONVERGED` only if every search of the front ended at an optimum.
        evaluations: number of designs simulated with derivatives.
        interpolated: number of designs between them simulated without derivatives.
        dropped: number of searches whose result another point beats or a limit excludes.
        free: the free parameters of the start.
        measured: the metrics of any vehicle on the road of the search.
        fresh: every metric at each point on other realisations of a random road; empty if there is none.
    """

    start: V
    names: tuple[str, ...]
    values: dict[str, Float[np.ndarray, " points"]]
    before: dict[str, float]
    units: dict[str, str]
    parameters: tuple[FrontParameter, ...]
    designs: Float[np.ndarray, "points free"]
    limits: dict[str, float | tuple[float, float]]
    reference: dict[str, float]
    warnings: tuple[str, ...]
    status: Status
    evaluations: int
    interpolated: int
    dropped: int
    free: FreeParameters
    measured: Measurement
    fresh: dict[str, Float[np.ndarray, "roads points"]]

    def __len__(self) -> int:
        return len(self.designs)

    @property
    def objectives(self) -> Float[np.ndarray, "points objectives"]:
        """The objectives at each point."""
        return np.stack([self.values[name] for name in self.names], axis=1)

    @property
    def shares(self) -> Float[np.ndarray, "points objectives"]:
        """The objectives at each point, from 0 at the best value on the front to 1 at the worst."""
        return shares_of(self.objectives)

    @property
    def knee(self) -> int:
        """Number of the point with the best compromise: farthest from the plane through the ends of the front.

        The ends are the points that are best in an objective. Where they give no plane, that of equal shares is taken.
        """
        ends = self.shares[np.argmin(self.shares, axis=0)]
        flat = np.linalg.matrix_rank(ends) < len(ends)
        normal = np.ones(len(ends)) if flat else np.linalg.solve(ends, np.ones(len(ends)))
        return int(np.argmin(self.shares @ normal))

    @property
    def hypervolume(self) -> float:
        """Volume of objectives that the front beats up to `reference`, in the product of their units."""
        return hypervolume(self.objectives, np.array([self.reference[name] for name in self.names]))

    def point(self, index: int) -> V:
        """The vehicle of a point, 0 for the best value of the first objective: for `export.to_json`, for a ride."""
        if not hasattr(index, "__index__") or not -len(self) <= index < len(self):
            _checks.refuse("index", f"be that of a point, 0 to {len(self) - 1}", index)
        return self.free.build(jnp.asarray(self.designs[index], self.free.values.dtype))

    def metrics_of(self, vehicle: AbstractVehicle) -> dict[str, float]:
        """Every metric of another vehicle of the same kind on the same road, such as a baseline."""
        must, remedy = f"be a {type(self.start).__name__}, as the start", "Compare vehicles of one kind."
        _checks.instance("vehicle", vehicle, type(self.start), must, remedy)
        values = self.measured(vehicle)
        return MetricValues.with_units({name: float(values[name]) for name in self.units}, self.units)

    plot = drawn_by("pareto", "The front with its knee, the start and other vehicles, and the laws along it.")

    @property
    def summary(self) -> str:
        """The range of each objective, and the knee, in a sentence; or that no design meets the limits."""
        ends = [
            f"{name} {amount(self.values[name].max(), self.units[name], self.values[name].min(), link=' to ')}"
            for name in self.names
        ]
        if self.status is Status.LIMIT_NOT_MET:
            return f"No design within the limits; the nearest one: {' '.join(self.warnings[:1])} {'; '.join(ends)}."
        knee = ", ".join(f"{name} {amount(self.values[name][self.knee], self.units[name])}" for name in self.names)
        changes = [relative_change(self.before[n], float(self.values[n][self.knee])) for n in self.names]
        from_start = ["from 0" if change is None else percentage(change) for change in changes]
        return (
            f"{len(self)} point{'s' * (len(self) > 1)}, {'; '.join(ends)}. Knee at point {self.knee}: {knee} "
            f"({', '.join(from_start)} from the start). {self.evaluations} designs simulated with derivatives."
        )

    def table(self) -> Table:
        """All metrics at each point, the objectives first, with a note at the knee."""
        names = [*self.names, *(name for name in self.values if name not in self.names)]
        columns = [Column("point"), *(Column(name, typeset_unit(self.units[name])) for name in names), Column("note")]
        notes = ["knee" if i == self.knee else "" for i in range(len(self))]
        rows = [(i, *(float(self.values[name][i]) for name in names), notes[i]) for i in range(len(self))]
        return Table("Front", tuple(columns), (*rows, ("start", *(self.before[name] for name in names), "")))

    def parameter_table(self) -> Table:
        """The free numbers at each point, with those of the start."""
        columns = [Column("point"), *(Column(p.name, p.unit, ".5g") for p in self.parameters)]
        rows = [(i, *map(float, row)) for i, row in enumerate(self.designs)]
        return Table(
            "Parameters along the front", tuple(columns), (*rows, ("start", *(p.start for p in self.parameters)))
        )

    def content(self) -> Contents:
        """The front as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        return self._data("knee", "hypervolume", "fresh", "evaluations", "interpolated", "dropped") | {
            "objectives": list(self.names),
            "metrics": {
                name: {"points": plain(values), "start": plain(self.before[name]), "unit": self.units[name]}
                for name, values in self.values.items()
            },
            "parameters": [
                plain(p) | {"points": plain(column)} for p, column in zip(self.parameters, self.designs.T, strict=True)
            ],
            "reference": {name: with_unit(value, self.units[name]) for name, value in self.reference.items()},
            "limits": {name: with_unit(limit, self.units[name]) for name, limit in self.limits.items()},
        }
