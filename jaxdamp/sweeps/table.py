"""The results of a sweep while it runs, point after point, and their labels."""

import dataclasses
from collections.abc import Mapping
from typing import final

import numpy as np

from jaxdamp._types import Dataset
from jaxdamp._warned import warn
from jaxdamp.sweeps.axes import PARAMETER, AbstractPoints, Columns
from jaxdamp.sweeps.function import Traced


MOST_REASONS = 4  # that a warning names


@final
@dataclasses.dataclass
class Table:
    """Results by name, the points along the first axis; NaN where there is none (yet).

    `reason` holds for each point the number of a text in `reasons`, the first of which is empty: nothing failed.
    """

    points: AbstractPoints
    traced: Traced
    units: Mapping[str, str]
    values: dict[str, np.ndarray]
    done: np.ndarray
    reason: np.ndarray
    reasons: list[str]

    @classmethod
    def empty(cls, points: AbstractPoints, traced: Traced, units: Mapping[str, str]) -> "Table":
        """Nothing is done."""
        count = points.count
        values = {name: np.full((count, *r.shape), np.nan, r.dtype) for name, r in traced.results.items()}
        return cls(points, traced, units, values, np.zeros(count, bool), np.zeros(count, np.int32), [""])

    @property
    def failed(self) -> np.ndarray:
        """The points that are done but lack a result."""
        return self.reason > 0

    def fill(self, indices: np.ndarray, results: Mapping[str, np.ndarray] | None, error: str = "") -> None:
        """Enter the results of some points: finite numbers stay; None says that there are none, because of an error."""
        for name, column in (results or {}).items():
            finite = np.isfinite(column)
            self.values[name][indices] = np.where(finite, column, np.nan)
            bad = indices[~np.all(finite, axis=tuple(range(1, column.ndim)))]
            self.give_reasons(bad[~self.failed[bad]], f"{name} is not finite")
        if results is None:
            self.give_reasons(indices, f"the function raised: {error}" if error else "the function raised")
        self.done[indices] = True

    def leave_out(self, reasons: np.ndarray) -> None:
        """Mark points that are not to be computed, by a text for each; an empty one leaves a point alone."""
        for reason in dict.fromkeys(reasons[reasons != ""]):
            indices = np.flatnonzero(reasons == reason)
            self.give_reasons(indices, reason)
            self.done[indices] = True

    def give_reasons(self, indices: np.ndarray, reason: str) -> None:
        """Enter the text that says why these points failed."""
        if indices.size:
            if reason not in self.reasons:
                self.reasons.append(reason)
            self.reason[indices] = self.reasons.index(reason)

    def label(self) -> Dataset:
        """The results with the names, values and units of the axes."""
        import xarray

        from jaxdamp.sweeps import accessor  # noqa: F401  (gives datasets their `.jaxdamp`)

        dims, lengths = list(self.points.shape), list(self.points.shape.values())
        variables = {}
        for name, values in self.values.items():
            numbered = [f"{name}_{i}" for i in range(values.ndim - 1)]
            if name in self.traced.slopes.values():
                numbered = [PARAMETER]
            variables[name] = ([*dims, *numbered], values.reshape(*lengths, *values.shape[1:]), self.about(name))
        coordinates: dict[str, object] = {
            name: (along, values, self.about(name)) for name, (along, values) in self.points.coordinates.items()
        }
        coordinates["failed"] = (dims, self.failed.reshape(lengths))
        coordinates["reason"] = (dims, np.array(self.reasons, dtype=object)[self.reason].reshape(lengths))
        if self.traced.slopes:
            coordinates[PARAMETER] = (PARAMETER, np.array(self.points.names))
        return xarray.Dataset(variables, coordinates, {"failed_points": int(self.failed.sum())})

    def about(self, name: str) -> dict[str, str]:
        """Unit, and for a derivative what it is."""
        for result, slope in self.traced.slopes.items():
            if name == slope:
                unit = {"units": f"{self.units[result]} per unit of the parameter"} if result in self.units else {}
                return {"long_name": f"derivative of {result} by the parameter", **unit}
        return {"units": self.units[name]} if name in self.units else {}

    def warn(self) -> None:
        """Say how many points failed, where, and why."""
        count, total = int(self.failed.sum()), len(self.failed)
        if not count:
            return
        columns = self.points.columns(np.flatnonzero(self.failed))
        numbers = np.bincount(self.reason, minlength=len(self.reasons))
        by_count = sorted(range(1, len(self.reasons)), key=lambda i: -numbers[i])
        why = [f"{self.reasons[i]} ({numbers[i]})" for i in by_count[:MOST_REASONS]]
        why += ["and others"] * (len(by_count) > MOST_REASONS)
        warn(
            f"{count} of {total} points of the sweep failed: what is not finite there is NaN. They lie at "
            f"{extent(columns)}. Why: {'; '.join(why)}. Look at them with `data.where(data.failed, drop=True)`, and at "
            "`data.reason`."
        )


def extent(columns: Columns) -> str:
    """The range of some points along each axis, in words."""
    where = [
        f"{name} = {c.min():.6g}" if c.min() == c.max() else f"{name} from {c.min():.6g} to {c.max():.6g}"
        for name, c in columns.items()
    ]
    return ", ".join(where)
