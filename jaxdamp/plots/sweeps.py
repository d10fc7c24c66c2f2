"""A metric over the points of a sweep: curves, or a map."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp.plots import _style


if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure
    import xarray


LEVELS = 14  # of a map
MOST_CURVES = 6


def sweep(data: "xarray.Dataset", metric: str, over: Sequence[str] | None = None) -> "matplotlib.figure.Figure":
    """A result of a sweep over a grid: a curve for one axis, a map for two; failed points are marked.

    Arguments:
        data: of `jaxdamp.sweep`, over a grid.
        metric: one of its results.
        over: one axis, or two, the first along the abscissa. Left out, all there are. Fix other axes before, such as
            by `data.sel({"sprung_mass": 1200.0})`; of up to six values of one more axis, each gets a curve.

    Raises:
        ValueError: an unknown result or axis; a result that is not one number for each point; too many axes.

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> len(sweep(data, "area").axes)  # the map and its bar of colours
    2
    """
    _checks.one_of("metric", metric, [str(name) for name in data.data_vars])
    values = data[metric]
    axes = [str(name) for name in values.dims]
    if "point" in axes or not all(name in data.coords for name in axes) or values.dtype.kind != "f":
        remedy = "Points of a list or sample are best drawn by `data.plot.scatter`."
        _checks.refuse("metric", "be one number for each point of a grid", f"{metric!r} along {axes}", remedy)
    chosen = axes if over is None else [over] if isinstance(over, str) else list(over)
    for name in chosen:
        _checks.one_of("over", name, axes)
    rest = [name for name in axes if name not in chosen]
    curves = len(chosen) == 1 and len(rest) <= 1 and values.size <= MOST_CURVES * values.sizes[chosen[0]]
    if not curves and (len(chosen) != 2 or rest):
        remedy = "Choose one or two by `over`, and fix the others by `data.sel`."
        _checks.refuse("over", f"leave one or two axes, the others fixed (of {axes})", chosen, remedy)
    figure = _style.new_figure(7.0, 4.6)
    plot = figure.add_subplot()
    (_curves if curves else _map)(figure, plot, data, metric, chosen, rest)
    return figure


def _curves(
    figure: "matplotlib.figure.Figure",
    plot: "matplotlib.axes.Axes",
    data: "xarray.Dataset",
    metric: str,
    over: list[str],
    rest: list[str],
) -> None:
    """A curve over one axis, for each value of another; a cross at the foot where points failed."""
    (name,) = over
    lines = data[metric].transpose(*rest, name).values.reshape(-1, data.sizes[name])
    failed = data["failed"].transpose(*rest, name).values.reshape(lines.shape)
    others = data[rest[0]].values if rest else [None]
    where = data[name].values
    for number, (line, other) in enumerate(zip(lines, others, strict=True)):
        label = None if other is None else f"{rest[0]} = {_style.short(float(other))}{_unit(data, rest[0])}"
        plot.plot(where, line, marker="o", markersize=3.0, label=label, **_style.line_style(number))
    _style.dress(plot, _label(data, name), _label(data, metric))
    if rest:
        plot.legend(frameon=False)
    if failed.any():
        crossed = where[failed.any(axis=0)]
        foot = np.zeros(len(crossed))
        mark = plot.scatter(crossed, foot, marker="x", color=_style.BLACK, transform=plot.get_xaxis_transform())
        mark.set_clip_on(False)
        figure.legend([mark], ["failed"], loc="outside upper right", frameon=False)


def _map(
    figure: "matplotlib.figure.Figure",
    plot: "matplotlib.axes.Axes",
    data: "xarray.Dataset",
    metric: str,
    over: list[str],
    rest: list[str],
) -> None:
    """Filled contours over two axes with the smallest value marked; crosses and hatching where points failed."""
    del rest
    x, y = (data[name].values for name in over)
    values, failed = (data[name].transpose(over[1], over[0]).values for name in (metric, "failed"))
    if min(values.shape) < 2:
        _checks.refuse("data", "have two or more values along each axis of a map", values.shape, "Choose one axis.")
    shown = np.ma.masked_invalid(values)
    if shown.count() and shown.max() > shown.min():
        filled = plot.contourf(x, y, shown, LEVELS, cmap="viridis")
        figure.colorbar(filled, ax=plot, label=_label(data, metric))
        row, column = np.unravel_index(np.ma.argmin(shown), shown.shape)
        least = f"smallest: {_style.short(float(values[row, column]))}{_unit(data, metric)}"
        plot.plot(x[column], y[row], "o", color="white", markeredgecolor=_style.BLACK, label=least, clip_on=False)
    if failed.any():
        plot.patch.set(facecolor="0.95", edgecolor="0.75", hatch="///")
        rows, columns = np.nonzero(failed)
        plot.plot(x[columns], y[rows], "x", color=_style.BLACK, markersize=4.0, label="failed", clip_on=False)
    _style.dress(plot, _label(data, over[0]), _label(data, over[1]))
    plot.grid(False)
    plot.set_xlim(x.min(), x.max())
    plot.set_ylim(y.min(), y.max())
    handles, _ = plot.get_legend_handles_labels()
    _style.legend_above(figure, handles)


def _label(data: Any, name: str) -> str:
    """A name in words with its unit."""
    words = name.rpartition(".")[2].replace("_", " ")
    unit = typeset_unit(data[name].attrs.get("units", ""))
    return f"{words} [{unit}]" if unit else words


def _unit(data: Any, name: str) -> str:
    unit = typeset_unit(data[name].attrs.get("units", ""))
    return f" {unit}" if unit else ""
