"""A page on a sweep: a table of all points, and a curve or a map of each result."""

import functools
from collections.abc import Hashable, Mapping, Sequence
from typing import Unpack

import numpy as np

from jaxdamp import plots
from jaxdamp._display import display
from jaxdamp._settings import with_defaults
from jaxdamp._tables import Column, Table, percent_change, typeset_unit
from jaxdamp._types import DataArray, Dataset, ScalarLike
from jaxdamp._words import first_upper, path_words
from jaxdamp.report.page import PAGE, Page, Report
from jaxdamp.sweeps import without_effect
from jaxdamp.tune import Limits, limit_spans


MOST_AXES = 2  # of a grid that is drawn
MOST_POINTS = 1000  # in the table of a page


@with_defaults(PAGE, title="Sweep")
def sweep_report(
    data: Dataset,
    *,
    remarks: Sequence[str] = (),
    limits: Limits | None = None,
    baseline: Mapping[str, ScalarLike] | None = None,
    present: Mapping[str, object] | None = None,
    plane: tuple[str, str] | None = None,
    **page: Unpack[Page],
) -> Report:
    """A page on a sweep over a grid. Its table has the first thousand points, and whether each is within the limits.

    Arguments:
        data: of `jaxdamp.sweep`.
        remarks: on the results, such as the reasons of failed points.
        limits: `{result: largest value}` or `{result: (smallest, largest)}`; hatched in maps, ringed on curves.
        baseline: results of another design by name, to which the best points are compared.
        present: the design that there is, by the names of axes and results, to be marked in the pictures.
        plane: two results that are drawn against each other, such as those of comfort and grip.
        page: `title`, `folder` and `attempts`, all optional (see `Page`).

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": p["a"] * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> "area" in sweep_report(data).to_html()
    True
    """
    data = data.compute()  # a store is read when it is asked for
    report = Report(**page)
    report.verdict(*best_points(data, limits, baseline))
    report.points(remarks)
    if data["failed"].squeeze().ndim <= MOST_AXES:
        for name in data.data_vars:
            metric = str(name)
            draw = functools.partial(plots.sweep, data, metric, limits=limits, present=present)
            report.picture(draw, path_words(metric), f"{metric}.png")
        if plane is not None:
            draw = functools.partial(plots.sweep, data, plane[0], against=plane[1], limits=limits, present=present)
            report.picture(draw, " and ".join(map(path_words, plane)), "plane.png")
    else:
        report.text(f"Grids of more than {MOST_AXES} axes of several values are not drawn.")
    report.table(points_table(data, limits).first(MOST_POINTS))
    return report


def points_table(data: Dataset, limits: Limits | None = None) -> Table:
    """A row for each point, and whether it is within the limits, which the title names.

    Arguments:
        data: of `jaxdamp.sweep`.
        limits: as in `sweep_report`.
    """
    table, spans = data.jaxdamp.table(), limit_spans(limits, [str(name) for name in data.data_vars])
    if not spans:
        return table
    words = np.where(data["failed"], "", np.where(_within(data, spans), "met", "not met")).ravel()
    rows = tuple((*row, word) for row, word in zip(table.rows, words.tolist(), strict=True))
    bounds = ", ".join(_limit_in_words(data, name, span) for name, span in spans.items())
    return Table(f"{table.title}; limits: {bounds}", (*table.columns, Column("limits")), rows)


def _limit_in_words(data: Dataset, name: str, span: tuple[float, float]) -> str:
    """A limit with its unit, as "working_space_rms ≤ 0.02 m"."""
    ends = [f"{sign} {_in_words(data, name, end)}" for sign, end in zip("≥≤", span, strict=True) if np.isfinite(end)]
    return f"{name} {' and '.join(ends)}"


def best_points(
    data: Dataset, limits: Limits | None = None, baseline: Mapping[str, ScalarLike] | None = None
) -> list[str]:
    """The smallest value of each result in a sentence, where it is, within the limits, and beside a baseline.

    With limits, the first sentence says how many points are within them, with the smallest value of the first result;
    or, if none is, by which limit the nearest point fails.

    Arguments:
        data: of `jaxdamp.sweep`.
        limits: as in `sweep_report`.
        baseline: as in `sweep_report`.
    """
    dims = data["failed"].dims
    names = [str(name) for name in data.data_vars if data[name].dims == dims]
    axes = [str(name) for name in data.coords if name not in ("failed", "reason") and set(data[name].dims) & set(dims)]
    spans = limit_spans(limits, names)
    allowed = _within(data, spans)
    count, total = int(allowed.sum()), int(allowed.size)
    idle = without_effect(data)
    sentences, smallest = _on_idle(idle), []
    for name in names if count else ():
        acting = [axis for axis in axes if axis not in idle.get(name, ())]
        smallest += [_smallest(data, name, acting, allowed, baseline)] if acting else []
    if spans:
        best = f"; {smallest.pop(0)}" if smallest else "." if count else f"{_nearest(data, axes, spans)}."
        sentences.insert(0, f"{count} of {total} points are within all limits{best}")
    return [*sentences, *map(first_upper, smallest)]


def _within(data: Dataset, spans: Mapping[str, tuple[float, float]]) -> DataArray:
    """Which points are driven and within all limits."""
    allowed = ~data["failed"]
    for name, (lower, upper) in spans.items():
        allowed = allowed & (data[name] >= lower) & (data[name] <= upper)
    return allowed


def _on_idle(idle: Mapping[str, Sequence[str]]) -> list[str]:
    """A sentence on each axis that does not change a result."""
    return [
        f"{path_words(over)} has no effect on {path_words(name)}: no value of it is better than another."
        for name, flat in idle.items()
        for over in flat
    ]


def _nearest(data: Dataset, axes: Sequence[str], spans: Mapping[str, tuple[float, float]]) -> str:
    """Of points that all fail, the one that is least beyond its limits, as a share of them, and the one it fails by."""
    ends = [(name, end, sign) for name, pair in spans.items() for end, sign in zip(pair, (-1.0, 1.0), strict=True)]
    ends = [(name, end, sign) for name, end, sign in ends if np.isfinite(end)]
    beyond = [sign * (data[name] - end).where(~data["failed"]) / (abs(end) or 1.0) for name, end, sign in ends]
    worst = np.max([share.values.ravel() for share in beyond], axis=0) if ends else np.array([np.nan])
    if np.isnan(worst).all():
        return ""  # no point has results
    place = np.unravel_index(np.nanargmin(worst), data["failed"].shape)
    name, end, sign = ends[int(np.argmax([share.values[place] for share in beyond]))]
    where = _where(data, axes, data["failed"][place].coords)
    value, limit = _in_words(data, name, data[name][place]), _in_words(data, name, end)
    side = "above" if sign > 0 else "below"
    return f": the nearest one, {where}, has {path_words(name)} of {value}, {side} its limit of {limit}"


def _smallest(
    data: Dataset,
    name: str,
    axes: Sequence[str],
    allowed: DataArray,
    baseline: Mapping[str, ScalarLike] | None,
) -> str:
    """The smallest value of a result, where it is, and its change from the baseline."""
    values = data[name].where(allowed)
    place = values.isel(values.argmin(...)).coords
    where = _where(data, axes, place)
    if baseline is not None and (before := float(baseline[name])) > 0.0:  # of others a share says nothing
        change = percent_change(before, float(values.min()))
        where += f", {change:+.1f} % from the baseline ({_in_words(data, name, baseline[name])})"
    ends = {axis: {float(data[axis].min()), float(data[axis].max())} for axis in axes if data.sizes.get(axis, 0) > 2}
    at_end = [path_words(axis) for axis, both in ends.items() if float(place[axis]) in both]
    widen = f" That is an end of {' and of '.join(at_end)}: widen the grid." if at_end else ""
    return f"smallest {path_words(name)}: {_in_words(data, name, values.min())} at {where}.{widen}"


def _where(data: Dataset, axes: Sequence[str], place: Mapping[Hashable, DataArray]) -> str:
    return ", ".join(f"{path_words(axis)} = {_in_words(data, axis, place[axis])}" for axis in axes)


def _in_words(data: Dataset, name: str, value: ScalarLike | DataArray) -> str:
    """A value of an axis or a result, rounded in the unit in which it is shown."""
    shown = display().read(data[name].attrs.get("units", ""))
    return f"{shown(float(value)):.4g} {typeset_unit(shown.unit)}".rstrip()
