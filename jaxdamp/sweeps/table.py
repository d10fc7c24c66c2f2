"""The results of a sweep while it runs, point after point, and their labels."""

import dataclasses
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, final

import numpy as np

from jaxdamp.sweeps.axes import PARAMETER, AbstractPoints
from jaxdamp.sweeps.tracing import Traced


if TYPE_CHECKING:
    import xarray


@final
@dataclasses.dataclass
class Table:
    """Results by name, the points along the first axis; NaN where there is none (yet)."""

    points: AbstractPoints
    traced: Traced
    units: Mapping[str, str]
    values: dict[str, np.ndarray]
    done: np.ndarray
    failed: np.ndarray

    @classmethod
    def empty(cls, points: AbstractPoints, traced: Traced, units: Mapping[str, str]) -> "Table":
        """Nothing is done."""
        count = points.count
        values = {name: np.full((count, *r.shape), np.nan, r.dtype) for name, r in traced.results.items()}
        return cls(points, traced, units, values, np.zeros(count, bool), np.zeros(count, bool))

    def fill(self, indices: np.ndarray, results: Mapping[str, np.ndarray] | None) -> None:
        """Enter the results of some points: finite numbers stay; None says that there are none."""
        for name, found in (results or {}).items():
            finite = np.isfinite(found)
            self.values[name][indices] = np.where(finite, found, np.nan)
            self.failed[indices] |= ~np.all(finite, axis=tuple(range(1, found.ndim)))
        if results is None:
            self.failed[indices] = True
        self.done[indices] = True

    def label(self) -> "xarray.Dataset":
        """The results with the names, values and units of the axes."""
        import xarray

        dims, lengths = list(self.points.shape), list(self.points.shape.values())
        variables = {}
        for name, values in self.values.items():
            own = [f"{name}_{i}" for i in range(values.ndim - 1)]
            if name in self.traced.slopes.values():
                own = [PARAMETER]
            variables[name] = ([*dims, *own], values.reshape(*lengths, *values.shape[1:]), self._about(name))
        coordinates: dict[str, Any] = {
            name: (along, values, self._about(name)) for name, (along, values) in self.points.coordinates.items()
        }
        coordinates["failed"] = (dims, self.failed.reshape(lengths))
        if self.traced.slopes:
            coordinates[PARAMETER] = (PARAMETER, np.array(self.points.names))
        return xarray.Dataset(variables, coordinates, {"failed_points": int(self.failed.sum())})

    def _about(self, name: str) -> dict[str, str]:
        """Unit, and for a derivative what it is."""
        for result, slope in self.traced.slopes.items():
            if name == slope:
                unit = {"units": f"{self.units[result]} per unit of the parameter"} if result in self.units else {}
                return {"long_name": f"derivative of {result} by the parameter", **unit}
        return {"units": self.units[name]} if name in self.units else {}

    def warn(self, first_error: str) -> None:
        """Say how many points failed, and where."""
        count, total = int(self.failed.sum()), len(self.failed)
        if not count:
            return
        columns = self.points.columns(np.flatnonzero(self.failed))
        where = [
            f"{name} = {c.min():.6g}" if c.min() == c.max() else f"{name} from {c.min():.6g} to {c.max():.6g}"
            for name, c in columns.items()
        ]
        error = f" The first error was: {first_error}" if first_error else ""
        warnings.warn(
            f"{count} of {total} points of the sweep failed: what is not finite there is NaN. They lie at "
            f"{', '.join(where)}. Look at them with `data.where(data.failed, drop=True)`.{error}",
            stacklevel=3,
        )
