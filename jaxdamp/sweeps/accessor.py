"""What a sweep's `xarray.Dataset` can do: `data.jaxdamp.table()`, `.to_dict()`, `.plot(metric)`."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import xarray

from jaxdamp._tables import Column, Contents, Table, plain, typeset_unit
from jaxdamp._types import Figure
from jaxdamp.sweeps.axes import without_effect


@final
@xarray.register_dataset_accessor("jaxdamp")
class SweepResults:
    """Tables, plain data and pictures of a sweep.

    Datasets have it once a sweep was made, or this module imported (for results read back from a file).

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> print(data.jaxdamp.table())
    Sweep over a, b
    a  b  area
    1  3     3
    1  4     4
    2  3     6
    2  4     8
    """

    def __init__(self, data: xarray.Dataset) -> None:
        self._data = data

    def table(self) -> Table:
        """A row for each point: its axes, the results that are one number, and why it failed, where one did."""
        data = self._data
        dims = data["failed"].dims
        of_points = [name for name, axis in data.coords.items() if axis.dims and set(axis.dims) <= set(dims)]
        axes = [name for name in of_points if name not in ("failed", "reason")]
        results = [name for name, result in data.data_vars.items() if result.dims == dims]
        names = [*axes, *results]
        columns = [Column(str(name), typeset_unit(data[name].attrs.get("units", ""))) for name in names]
        cells = [data[name].broadcast_like(data["failed"]).transpose(*dims).values.ravel().tolist() for name in names]
        if data["failed"].any():
            columns, cells = [*columns, Column("reason")], [*cells, data["reason"].values.ravel().tolist()]
        rows = tuple(zip(*([_cell(cell) for cell in column] for column in cells), strict=True))
        flat = [f"; no effect of {', '.join(over)} on {name}" for name, over in without_effect(data).items()]
        return Table(f"Sweep over {', '.join(map(str, axes))}{''.join(flat)}", tuple(columns), rows)

    def to_dict(self) -> Contents:
        """As `Dataset.to_dict`, ready for JSON: numbers that are not finite are None."""
        return plain(self._data.to_dict())

    def plot(self, metric: str, over: Sequence[str] | None = None, **options: Any) -> Figure:
        """A result over one axis as a curve, over two as a map, or the plane of two results.

        Arguments:
            metric: one of the results.
            over: one axis or two; all there are if left out.
            options: of `plots.sweep`, such as `against="rms_dynamic_tyre_load"`.
        """
        from jaxdamp.plots import sweep

        return sweep(self._data, metric, over, **options)


def _cell(value: object) -> object:
    """Nothing in place of a result that there is not."""
    return None if isinstance(value, float) and np.isnan(value) else value
