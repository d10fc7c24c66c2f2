"""Sensitivities as coloured curves and effects of parameters; a choice of valving: wanted and reached force."""

import itertools

import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Axes, Figure
from jaxdamp.identify import RecordSensitivity
from jaxdamp.plots import _style
from jaxdamp.tune import Sensitivity, ValvingResult


def valving(result: ValvingResult) -> Figure:
    """Wanted and reached force over velocity, the parts out of reach shaded, and the error below.

    Arguments:
        result: of `tune.valving`.
    """
    remedy = "The call is `valving(result)` with the result of `tune.valving`."
    _checks.instance("result", result, ValvingResult, "be a choice of valving", remedy)
    figure = _style.new_figure(8.0, 6.4)
    forces, errors = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    ends = np.cumsum([result.curve_points, *result.loop_lengths])
    parts = [(slice(0, ends[0]), "curve")] if ends[0] else []
    parts += [(slice(a, b), f"loop {i + 1}") for i, (a, b) in enumerate(itertools.pairwise(ends))]
    handles = []
    for number, (part, name) in enumerate(parts):
        order = np.argsort(result.velocity[part]) if name == "curve" else np.arange(part.stop - part.start)
        velocity, wanted, reached = (a[part][order] for a in (result.velocity, result.target_force, result.force))
        colour = _style.COLOURS[number % len(_style.COLOURS)]
        (target,) = forces.plot(velocity, wanted, "--", color=_style.BLACK, linewidth=1.2, label="wanted", zorder=3)
        (line,) = forces.plot(velocity, reached, color=colour, linewidth=1.8, label=f"reached, {name}")
        errors.plot(velocity, reached - wanted, color=colour, linewidth=1.4)
        handles += [line] if handles else [target, line]
    for part in result.out_of_reach:
        sign = 1.0 if part.side == "rebound" else -1.0
        span = sorted((sign * part.slowest, sign * part.fastest))
        for axes in (forces, errors):
            shade = axes.axvspan(*span, color=_style.SHADE, zorder=0, label="out of reach")
        if part is result.out_of_reach[0]:
            handles.append(shade)
    title = f"Valving: wanted and reached force, error {result.error_percent:.2g} %"
    _style.dress(forces, "", _style.FORCE, title, zero="xy")
    _style.dress(errors, _style.VELOCITY, "error [N]", zero="xy")
    _style.legend_above(figure, handles, 4)
    _style.note_below(figure, [result.summary])
    return figure


MOST = 12  # parameters that are drawn


def sensitivity(result: Sensitivity, *, most: int = MOST) -> Figure:
    """The curve of each damper as a band coloured by its effect on each metric, above the effects of the parameters.

    Red: more force at this velocity, or more of this parameter, raises the metric; blue: lowers it.

    Arguments:
        result: of `tune.sensitivity`.
        most: number of parameters to draw, the most effective first.
    """
    remedy = "The call is `plots.sensitivity(tune.sensitivity(...))`."
    _checks.instance("result", result, Sensitivity, "be the result of `tune.sensitivity`", remedy)
    metrics, dampers = list(result.values), list(result.curves)
    names = [str(row[0]) for row in result.table().rows][:most]
    heights = [3.4] * len(dampers) + [0.9 + 0.26 * len(names)]
    figure = _style.new_figure(1.5 + 4.3 * len(metrics), sum(heights))
    grid = figure.add_gridspec(len(heights), len(metrics), height_ratios=heights)
    for column, metric in enumerate(metrics):
        for row, damper in enumerate(dampers):
            _band(figure, figure.add_subplot(grid[row, column]), result, damper, metric)
        axes = figure.add_subplot(grid[-1, column])
        values = [np.nan_to_num(result.elasticities(metric)[name]) for name in names]
        colours = [_style.COLOURS[1] if value > 0 else _style.COLOURS[0] for value in values]
        axes.barh(np.arange(len(names)), values, 0.65, color=colours)
        words = [_style.path_words(name) if column == 0 else "" for name in names]
        axes.set_yticks(np.arange(len(names)), words)
        axes.invert_yaxis()
        _style.dress(axes, "change for +1 % [%]", "", _style.metric_words(metric), zero="x")
        axes.grid(False, axis="y")
    return figure


def record_sensitivity(result: RecordSensitivity) -> Figure:
    """The change of functions of a fitted law for 10 N more measured force at each sample, over the velocity.

    Arguments:
        result: of `FitResult.sensitivity_to_records`.
    """
    remedy = "The call is `plots.record_sensitivity(result.sensitivity_to_records(function))`."
    _checks.instance("result", result, RecordSensitivity, "be the result of `sensitivity_to_records`", remedy)
    figure = _style.new_figure(5.2 * len(result.values), 3.8)
    for column, name in enumerate(result.values):
        axes = figure.add_subplot(1, len(result.values), column + 1)
        for number, (record, slopes) in enumerate(zip(result.records, result.by_sample[name], strict=True)):
            colour = _style.COLOURS[number % len(_style.COLOURS)]
            axes.plot(result.velocity[number], 10.0 * slopes, ".", ms=2.5, color=colour, label=_style.brief(record))
        _style.dress(axes, _style.VELOCITY, "change for 10 N more in one sample", name, zero="xy")
        if column == 0 and len(result.records) <= MOST:
            axes.legend()
    return figure


def _band(figure: Figure, axes: Axes, result: Sensitivity, damper: str, metric: str) -> None:
    """One curve as a band, coloured by the effect of the force at each velocity."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import Normalize

    curve = result.curves[damper]
    middle = len(curve.velocity) // 2
    at_rest = (np.insert(a, middle, 0.0) for a in (curve.velocity, curve.force, result.curve_effects(damper)[metric]))
    velocity, force, effect = at_rest
    force[middle] = np.interp(0.0, curve.velocity, curve.force)
    half_width = 0.06 * float(np.ptp(force) or 1.0)
    fine = np.linspace(velocity[0], velocity[-1], 301)
    low, high = np.interp(fine, velocity, force) - half_width, np.interp(fine, velocity, force) + half_width
    cells = [
        [(fine[i], low[i]), (fine[i + 1], low[i + 1]), (fine[i + 1], high[i + 1]), (fine[i], high[i])]
        for i in range(len(fine) - 1)
    ]
    largest = float(np.nanmax(np.abs(effect))) or 1.0
    band = PolyCollection(cells, cmap="RdBu_r", norm=Normalize(-largest, largest), edgecolors="face", linewidths=0.2)
    band.set_array(np.interp(0.5 * (fine[1:] + fine[:-1]), velocity, effect))
    axes.add_collection(band)
    axes.plot(velocity, force, color=_style.BLACK, linewidth=1.0)
    axes.set_xlim(velocity[0], velocity[-1])
    axes.autoscale(axis="y")
    figure.colorbar(band, ax=axes, label="change for +100 N (upwards) [%]")
    _style.dress(axes, _style.VELOCITY, _style.FORCE, f"{damper}: {_style.metric_words(metric)}", zero="xy")
