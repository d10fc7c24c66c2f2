"""A metric over the points of a sweep: curves, or a map."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import Shown, display
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Artist, Axes, Dataset, Figure
from jaxdamp.plots import _axes, _style
from jaxdamp.sweeps import without_effect
from jaxdamp.tune import Limits, limit_spans


LEVELS = 14  # of a map
MOST_CURVES = 6
PRESENT: _style.Look = {"label": "present", "linestyle": "", "clip_on": False, "zorder": 5.0} | _style.PRESENT
ON_COLOURS: _style.Look = {"color": "white", "markeredgecolor": _style.BLACK}  # of a mark in a map
BEST: _style.Look = {"linestyle": "", "clip_on": False, "zorder": 4.5} | _style.BEST | ON_COLOURS
HATCHES, RINGS = ("////", "\\\\\\\\", "xxxx", "...."), ("o", "s", "D", "^")  # of limits


class _End(NamedTuple):
    """One end of a limit: values of a result above it, or below it, violate it."""

    name: str
    value: float
    above: bool
    label: str

    def beyond(self, values: np.ndarray) -> np.ndarray:
        """Where the limit is violated."""
        return values > self.value if self.above else values < self.value


class _Shown(NamedTuple):
    """What all pictures of a sweep show."""

    figure: Figure
    plot: Axes
    data: Dataset
    metric: str
    ends: Sequence[_End]
    present: Mapping[str, float]


def sweep(
    data: Dataset,
    metric: str,
    over: Sequence[str] | None = None,
    *,
    against: str | None = None,
    limits: Limits | None = None,
    present: Mapping[str, object] | None = None,
) -> Figure:
    """A result of a sweep over a grid: a curve for one axis, a map for two; failed points are marked.

    Axes of one value are named in the title; of a single point a marker is drawn.

    Where a limit is violated, a map is hatched, and points of curves are ringed. The best point is a star, and the
    present design a filled circle. `against` another result, the points are drawn in the plane of both, such as that of
    comfort and grip, with a line for each value of the first axis and red crosses at points beyond the limits.

    Arguments:
        data: of `jaxdamp.sweep`, over a grid.
        metric: one of its results.
        over: one axis, or two, the first along the abscissa. Left out, all there are. Fix other axes before, such as
            by `data.sel({"sprung_mass": 1200.0})`; of up to six values of one more axis, each gets a curve.
        against: another result, along the ordinate of the plane of both.
        limits: `{result: largest value}` or `{result: (smallest, largest)}`, of this or other results.
        present: the design that there is, by the names of axes and results: `{"damper.rate": 1500.0, **ride()}`. It is
            marked in a map or on curves where its values of all axes are known, in a plane where both results are.

    Raises:
        ValueError: an unknown result or axis; a result that is not one number for each point; too many axes.

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> len(sweep(data, "area").axes)  # the map and its bar of colours
    2
    """
    fixed = ""
    if over is None and (alone := _of_one_value(data, metric)):
        fixed = f", {', '.join(f'{_words(data, n)} {_value(data, n, data[n].item())}' for n in alone)}"
        data = data.squeeze(alone)
    axes = _grid_axes(data, metric)
    chosen, others = _chosen_axes(data, metric, axes, over)
    names = [str(name) for name in data.data_vars]
    spans = limit_spans(limits, names)
    for name in spans:
        _checks.one_of("limits", name, names)
    at_present = {
        name: float(_checks.plain_number(f"present[{name!r}]", value)) for name, value in (present or {}).items()
    }
    figure = _style.new_figure(7.0, 4.6)
    plot = figure.add_subplot()
    shown = _Shown(figure, plot, data, metric, _ends(data, spans), at_present)
    over_axes = " and ".join(_words(data, name) for name in axes)
    idle = without_effect(data).get(metric, [])
    flat = f" (no effect of {' and '.join(_words(data, name) for name in idle)})" if idle else ""
    what = _words(data, metric) if against is None else "Designs"
    _style.dress(plot, "", "", _style.first_upper(f"{what} over {over_axes}{fixed}{flat}"))
    if against is not None:
        if (other := _grid_axes(data, against, "against")) != axes:
            _checks.refuse("against", f"be a result over {axes}", f"{against!r} over {other}")
        _plane(shown, against, chosen)
    elif len(chosen) == 1:
        _curves(shown, chosen[0], others)
    else:
        _map(shown, chosen)
    return figure


def _chosen_axes(
    data: Dataset, metric: str, axes: list[str], over: Sequence[str] | None
) -> tuple[list[str], list[str]]:
    """The axes to draw over, and the other ones: of a few values of one of them, each gets a curve."""
    chosen = axes if over is None else [over] if isinstance(over, str) else list(over)
    for name in chosen:
        _checks.one_of("over", name, axes)
    others = [name for name in axes if name not in chosen]
    curves = len(chosen) == 1 and len(others) <= 1 and data[metric].size <= MOST_CURVES * data.sizes[chosen[0]]
    if not curves and (len(chosen) != 2 or others):
        remedy = "Choose one or two by `over`, and fix the others by `data.sel`."
        _checks.refuse("over", f"leave one or two axes, the others fixed (of {axes})", chosen, remedy)
    return chosen, others


def _of_one_value(data: Dataset, metric: str) -> list[str]:
    """The axes of a grid that need not be drawn; of a single point all but the first."""
    axes = _grid_axes(data, metric)
    return [name for name in axes if data.sizes[name] == 1 and (data[metric].size > 1 or name != axes[0])]


def _grid_axes(data: Dataset, metric: str, argument: str = "metric") -> list[str]:
    """The axes of a result that is one number for each point of a grid."""
    _checks.one_of(argument, metric, [str(name) for name in data.data_vars])
    axes = [str(name) for name in data[metric].dims]
    if "point" in axes or not all(name in data.coords for name in axes) or data[metric].dtype.kind != "f":
        remedy = "Points of a list or sample are best drawn by `data.plot.scatter`."
        _checks.refuse(argument, "be one number for each point of a grid", f"{metric!r} along {axes}", remedy)
    return axes


def _curves(shown: _Shown, name: str, others: list[str]) -> None:
    """A curve over one axis, for each value of another; a cross at the foot where points failed."""
    figure, plot, data, metric, ends, present = shown
    lines = data[metric].transpose(*others, name).values.reshape(-1, data.sizes[name])
    failed = data["failed"].transpose(*others, name).values.reshape(lines.shape)
    where, drawn = data[name].values, []
    for number, (line, value) in enumerate(zip(lines, data[others[0]].values if others else [None], strict=True)):
        label = None if value is None else f"{_words(data, others[0])} = {_value(data, others[0], float(value))}"
        drawn += plot.plot(where, line, marker="o", markersize=3.0, label=label, **_style.line_style(number))
    _style.dress(plot, _label(data, name), _label(data, metric))
    if others:
        _style.legend_beside(figure, drawn, place="lower")
    marks = []
    for number, end in enumerate(ends):
        beyond = end.beyond(data[end.name].transpose(*others, name).values.reshape(lines.shape))
        places = np.broadcast_to(where, lines.shape)[beyond]
        look: _style.Look = {"marker": RINGS[number % len(RINGS)], "edgecolors": _style.BAD, "zorder": 4}
        marks.append(plot.scatter(places, lines[beyond], 60.0 + 50.0 * number, "none", label=end.label, **look))
        if end.name == metric:
            plot.axhline(end.value, **_style.LIMIT)
    if name in present:
        marks += _mark_present(plot, data, [name], present, (present[name], present.get(metric, np.nan)))
        plot.axvline(present[name], color=_style.BLACK, linestyle=":", linewidth=1.0)
        plot.set_xlim(*_widened(where))
    if failed.any():
        crossed = where[failed.any(axis=0)]
        foot = np.zeros(len(crossed))
        look = {"marker": "x", "color": _style.BLACK, "transform": plot.get_xaxis_transform(), "clip_on": False}
        marks.append(plot.scatter(crossed, foot, label="failed", **look))
    if marks:
        _style.legend_above(figure, marks, 2)


def _map(drawn: _Shown, over: list[str]) -> None:
    """Filled contours over two axes, the smallest value, lines of so much more; crosses where points failed."""
    figure, plot, data, metric, ends, present = drawn
    x, y = (data[name].values for name in over)
    values, failed = (data[name].transpose(over[1], over[0]).values for name in (metric, "failed"))
    if min(values.shape) < 2:
        _checks.refuse("data", "have two or more values along each axis of a map", values.shape, "Choose one axis.")
    shown = np.ma.masked_invalid(values)
    if shown.count() and shown.max() > shown.min():
        filled = plot.contourf(x, y, shown, LEVELS, cmap="viridis")
        _axes.label_axis(figure.colorbar(filled, ax=plot).ax, "y", _label(data, metric))
        beyond = [end.beyond(data[end.name].transpose(over[1], over[0]).values) for end in ends]
        allowed = np.ma.masked_where(np.any(beyond, axis=0), shown) if beyond else shown
        if allowed.count():
            row, column = np.unravel_index(np.ma.argmin(allowed), shown.shape)
            smallest = float(values[row, column])
            edge = any(at in (0, size - 1) and size > 2 for at, size in zip((row, column), shown.shape, strict=True))
            word = "largest" if _turned(data, metric) else "smallest"
            label = f"{word}{' within the limits' * bool(beyond)}: {_value(data, metric, smallest)}"
            label += ", at the edge: widen the grid" * edge
            _more_than(plot, x, y, shown, smallest)
            plot.plot(x[column], y[row], label=label, **BEST)
        else:
            plot.plot([], [], " ", label="no point within the limits")
    elif shown.count():
        label = f"{_value(data, metric, float(shown.max()))} at {shown.count()} of {shown.size} points"
        plot.plot([], [], " ", label=label)
    hatched = [
        _hatch(plot, x, y, data[end.name].transpose(over[1], over[0]).values, end, i) for i, end in enumerate(ends)
    ]
    _cross(plot, x, y, failed)
    _mark_present(plot, data, over, present, tuple(present.get(name, np.nan) for name in over))
    _style.dress(plot, _label(data, over[0]), _label(data, over[1]))
    plot.grid(False)
    plot.set_xlim(x.min(), x.max())
    plot.set_ylim(y.min(), y.max())
    handles = [*plot.get_legend_handles_labels()[0], *hatched]
    _style.legend_above(figure, handles, 2)


def _cross(plot: Axes, x: np.ndarray, y: np.ndarray, failed: np.ndarray) -> None:
    """Crosses in a map where points failed, about which it is hatched."""
    if failed.any():
        plot.patch.set(facecolor="0.95", edgecolor="0.75", hatch="///")
        rows, columns = np.nonzero(failed)
        look: _style.Look = {"color": _style.BLACK, "markersize": _axes.small(rows.size), "clip_on": False}
        plot.plot(x[columns], y[rows], "x", label="failed", **look)


def _mark_present(
    plot: Axes, data: Dataset, over: list[str], present: Mapping[str, float], place: tuple[float, ...]
) -> list:
    """A filled circle at the present design if it is known, or words in the legend that it is outside the grid."""
    if not all(name in present for name in over):
        return []
    if all(data[name].min() <= present[name] <= data[name].max() for name in over):
        return plot.plot(*place, **PRESENT)
    where = ", ".join(_value(data, name, present[name]) for name in over)
    return plot.plot([], [], " ", label=f"present outside the grid: {where}")


def _widened(values: np.ndarray) -> tuple[float, float]:
    """The ends of an axis with 5 % more on each side; of one value, 5 % of it."""
    more = 0.05 * float(np.ptp(values) or np.abs(values).max() or 1.0)
    return float(values.min()) - more, float(values.max()) + more


def _plane(shown: _Shown, against: str, over: list[str]) -> None:
    """Points in the plane of two results, coloured by the first axis, and those that no other one beats in both."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    figure, plot, data, metric, ends, present = shown
    x, y = (data[name].transpose(*over).values.reshape(data.sizes[over[0]], -1) for name in (metric, against))
    beyond = [end.beyond(data[end.name].transpose(*over).values.reshape(x.shape)) for end in ends]
    forbidden = np.any(beyond, axis=0) if beyond else np.zeros(x.shape, bool)
    for across, up in zip(x, y, strict=True) if x.shape[1] > 1 else [(x[:, 0], y[:, 0])]:
        plot.plot(across, up, color="0.7", linewidth=0.8, zorder=1)
    shades = np.broadcast_to(data[over[0]].values[:, None], x.shape)
    look: _style.Look = {"cmap": ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.75, 256)))}
    points = plot.scatter(x, y, 22.0, shades, vmin=shades.min(), vmax=shades.max(), **look)
    if len(shades) > 1:
        _axes.label_axis(figure.colorbar(points, ax=plot).ax, "y", _label(data, over[0]))
    handles = []
    if forbidden.any():
        label = "\n".join(end.label for end in ends)
        size = 1.7 * _axes.small(int(forbidden.sum()))
        handles += plot.plot(x[forbidden], y[forbidden], "x", color=_style.BAD, markersize=size, label=label)
    if lost := int(np.sum(data["failed"])):
        handles += plot.plot([], [], " ", label=f"{lost} of {x.size} points failed")
    allowed = np.isfinite(x) & np.isfinite(y) & ~forbidden
    best = _unbeaten(x[allowed], y[allowed])
    look = _style.AFTER | {"linewidth": 1.2, "marker": "."}
    if best[0].size:
        handles += plot.plot(*best, label="no point is better in both", **look)
    if metric in present and against in present:
        handles += plot.plot(present[metric], present[against], **PRESENT)
    _style.dress(plot, _label(data, metric), _label(data, against))
    _style.legend_above(figure, handles, 2)


def _unbeaten(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points than which no other one is smaller in both, by the first."""
    order = np.lexsort((y, x))
    x, y = x[order], y[order]
    unbeaten = y < np.minimum.accumulate(np.append(np.inf, y))[:-1]
    return x[unbeaten], y[unbeaten]


def _more_than(plot: Axes, x: np.ndarray, y: np.ndarray, values: np.ma.MaskedArray, smallest: float) -> None:
    """White lines where a result is so many percent above the smallest."""
    levels = [share for share in (2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if smallest * (1.0 + share / 100.0) < values.max()]
    if smallest > 0.0 and levels:
        heights = [smallest * (1.0 + share / 100.0) for share in levels]
        lines = plot.contour(x, y, values, heights, colors="white", linewidths=0.8)
        plot.clabel(lines, fmt=dict(zip(heights, map(_style.percent, levels), strict=True)), fontsize="small")


def _ends(data: Dataset, spans: Mapping[str, tuple[float, float]]) -> list[_End]:
    """The finite ends of limits, in words."""
    ends = []
    for name, span in spans.items():
        for value, above in zip(span, (False, True), strict=True):
            if np.isfinite(value):
                side = "below" if above is _turned(data, name) else "above"
                label = f"{_style.metric_words(name)} {side} {_value(data, name, value)}"
                ends.append(_End(name, value, above, label))
    return ends


def _hatch(plot: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray, end: _End, number: int) -> Artist:
    """Hatch a map where a limit is violated, with the boundary drawn; the handle for the legend."""
    from matplotlib.patches import Patch

    colour, hatch = _style.COLOURS[(number + 1) % len(_style.COLOURS)], HATCHES[number % len(HATCHES)]
    sign = 1.0 if end.above else -1.0
    beyond = np.ma.masked_invalid(sign * (values - end.value))
    if beyond.count() and beyond.max() > 0.0:
        region = plot.contourf(x, y, beyond, [0.0, 1.01 * float(beyond.max())], colors="none", hatches=[hatch])
        region.set(edgecolor=colour, linewidth=0.0)
        if beyond.min() < 0.0:
            plot.contour(x, y, beyond, [0.0], colors=colour, linewidths=1.8)
    return Patch(facecolor="none", edgecolor=colour, hatch=hatch, label=end.label)


def _label(data: Dataset, name: str) -> str:
    """A name in words with its unit."""
    return _style.labelled(_words(data, name), data[name].attrs.get("units", ""))


def _words(data: Dataset, name: str) -> str:
    """The last part of a name in words; the whole path if another axis has the same last part."""
    last = name.rpartition(".")[2]
    alike = [axis for axis in map(str, data.coords) if axis.rpartition(".")[2] == last and axis != name]
    return _style.metric_words(name if alike else last)


def _shown(data: Dataset, name: str) -> Shown:
    return display().read(data[name].attrs.get("units", ""), signed=display().signed(name))


def _turned(data: Dataset, name: str) -> bool:
    """Whether a result is shown with the other sign."""
    return _shown(data, name).factor < 0.0


def _value(data: Dataset, name: str, value: float) -> str:
    """A value of an axis or a result with its unit, as it is shown."""
    shown = _shown(data, name)
    return f"{_style.short(shown(value))} {typeset_unit(shown.unit)}".rstrip()
