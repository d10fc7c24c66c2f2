"""Errors of laws, how a fit was reached and what it could be, and a design of tests."""

import functools
from typing import TYPE_CHECKING

import numpy as np

from jaxdamp._display import display
from jaxdamp._types import Axes, Figure
from jaxdamp.bench import white_noise
from jaxdamp.identify import (
    Comparison,
    CrossValidation,
    ExperimentDesign,
    ProfileCurve,
    Training,
    VehicleComparison,
    extent,
)
from jaxdamp.plots import _style


if TYPE_CHECKING:
    from matplotlib.lines import Line2D


def ladder(comparison: Comparison | VehicleComparison) -> Figure:
    """Bars of the error of each law or vehicle, on the fitted records and on motion that was held out.

    Arguments:
        comparison: of `identify.compare`.
    """
    rungs = sorted(comparison.rungs, key=lambda rung: rung.error)
    held = any(rung.held_out_rmse is not None for rung in rungs)
    rows = np.arange(len(rungs), dtype=float)
    thickness = 0.38 if held else 0.6
    figure = _style.new_figure(8.5, 1.4 + (0.55 if held else 0.4) * len(rungs))
    axes = figure.subplots()
    groups = [("fitted records", [r.rmse for r in rungs], -0.5 * thickness * held, _style.COLOURS[0])]
    if held:
        scores = [np.nan if r.held_out_rmse is None else r.held_out_rmse for r in rungs]
        label = "held-out records" if comparison.held_out else "motion held out"
        groups.append((label, scores, 0.5 * thickness, _style.COLOURS[1]))
    handles, shown = [], display().of("N" if isinstance(comparison, Comparison) else "")
    for label, values, shift, colour in groups:
        bars = axes.barh(rows + shift, values, thickness, color=colour, label=label)
        axes.bar_label(bars, fmt=lambda value: _style.short(shown(value)), padding=3, fontsize="small")
        handles.append(bars)
    if isinstance(comparison, VehicleComparison):
        title = f"{_style.in_words(comparison.best.name)}: held-out fit {comparison.best.held_out_fit_percent:.1f} %"
        label = "RMS error, as a multiple of the smallest in the fitted drives   (free parameters in brackets)"
        _style.dress(axes, label, "", title)
    else:
        handles += _dress_in_newtons(axes, comparison)
        alike = [_style.in_words(rung.name) for rung in comparison.recommendation.alike]
        words = f"{' and '.join(alike)} predict alike within the scatter; the simplest is recommended."
        _style.note_below(figure, [words] * (len(alike) > 1))
    axes.grid(False, axis="y")
    axes.set_yticks(rows, [f"{_style.in_words(r.name)} ({r.parameters})" for r in rungs])
    axes.get_yticklabels()[[r.name for r in rungs].index(comparison.best.name)].set_fontweight("bold")
    axes.invert_yaxis()
    axes.margins(x=0.1)
    _style.legend_above(figure, handles, 2)
    return figure


def _dress_in_newtons(axes: Axes, comparison: Comparison) -> list["Line2D"]:
    """Title and axes of errors in newtons and in percent of the largest force; the line of the noise if it is known."""
    runs, best = comparison.best.result.runs, comparison.best
    largest = max(float(np.abs(run.force).max()) for run in runs)
    share = f"{_style.quantity(best.error, 'N')} = {_style.short(100.0 * best.error / largest)} % of the largest force"
    title = f"{_style.in_words(best.name)}: {share}"
    _style.dress(axes, "RMSE of the force [N]   (free parameters in brackets)", "", title)
    factor = 100.0 / largest
    to_percent, back = functools.partial(np.multiply, factor), functools.partial(np.multiply, 1.0 / factor)
    shares = axes.secondary_xaxis("top", functions=(to_percent, back))
    shares.set_xlabel("% of the largest force")
    if all(run.of_points for run in runs):
        return []
    noise = float(np.sqrt(np.mean([white_noise(run.force) ** 2 for run in runs])))
    label = f"noise of the force, {_style.quantity(noise, 'N')}"
    return [axes.axvline(noise, color=_style.BLACK, linestyle=":", linewidth=1.2, label=label)]


def cross_validation(result: CrossValidation) -> Figure:
    """Fit percent of every held-out record, a row for each law, a colour for each group; black bars are the means.

    Arguments:
        result: of `identify.cross_validate`.
    """
    laws = sorted(result.laws, key=result.fit_percent)
    figure = _style.new_figure(8.5, 1.6 + 0.4 * len(laws))
    axes = figure.subplots()
    handles = []
    count = len(result.groups)
    for number, group in enumerate(result.groups):
        folds = [fold for fold in result.folds if fold.group == group]
        rows = np.array([laws.index(fold.law) for fold in folds]) + 0.5 * ((number + 0.5) / count - 0.5)
        values = [fold.fit_percent for fold in folds]
        colour, label = (
            _style.COLOURS[number % len(_style.COLOURS)],
            "all" if group is None else _style.brief(f"{group}"),
        )
        handles += axes.plot(values, rows, "o", markersize=5, alpha=0.8, color=colour, label=label)
    means = [result.fit_percent(law) for law in laws]
    handles += axes.plot(means, np.arange(len(laws)), "|", markersize=16, color=_style.BLACK, label="mean", mew=2)
    _style.dress(axes, "fit of the record held out [%]", "", "Each record held out in turn")
    axes.set_yticks(np.arange(len(laws)), [_style.in_words(law) for law in laws])
    low = max(min(fold.fit_percent for fold in result.folds), -20.0)
    axes.set_xlim(left=min(low - 3.0, 50.0), right=100.0)
    _style.legend_beside(figure, handles)
    return figure


def experiment(design: ExperimentDesign) -> Figure:
    """The runs over stroke and velocity, and the relative standard errors beside those of the programme.

    Arguments:
        design: of `identify.design_experiment`.
    """
    figure = _style.new_figure(11.0, 4.5)
    left, right = figure.subplots(1, 2)
    sets = [("design", design.tests, design.covariance)]
    if design.programme_covariance is not None:
        sets.append(("programme", design.programme, design.programme_covariance))
    values, handles = np.abs(np.asarray(design.free.values)), []
    rows = np.arange(values.size)
    for number, (name, tests, covariance) in enumerate(sets):
        style = {"color": _style.COLOURS[number], "alpha": 0.8}
        reach = np.array([extent(test) for test in tests])
        label = f"{name}, {len(tests)} runs"
        handles += left.plot(reach[:, 0], reach[:, 1], "os"[number], markersize=7 - 2 * number, label=label, **style)
        errors = 100.0 * np.sqrt(np.diag(covariance)) / np.where(values > 0, values, np.nan)
        right.barh(rows + 0.4 * number, errors, height=0.36, **style)
    left.set(xscale="log", yscale="log")
    _style.dress(left, "stroke, zero to peak [mm]", "peak velocity [m/s]", "Tests")
    _style.dress(right, "expected standard error [% of the value]", "", "Parameters")
    right.set_xscale("log")
    right.set_yticks(rows + 0.2 * (len(sets) - 1), list(map(_style.path_words, design.free.names)))
    _style.legend_above(figure, handles)
    return figure


def training_history(training: Training) -> Figure:
    """Errors over the steps of a training, on its records and on those held out, and the step of the result.

    Arguments:
        training: of `identify.train`.
    """
    figure = _style.new_figure(8.0, 4.0)
    axes = figure.subplots()
    handles = []
    lines = (("training records", training.history), ("held-out records", training.held_out_history))
    for number, (label, values) in enumerate(lines):
        handles += axes.plot(training.steps, values, label=label, linewidth=1.8, **_style.line_style(number))
    handles.append(axes.axvline(training.best_step, color=_style.GREY, linestyle=":", label="result"))
    axes.set_yscale("log")
    _style.plain_log_axis(axes.yaxis)
    _style.dress(axes, "step", "RMSE of the force [N]", training.stopped)
    _style.legend_beside(figure, handles)
    return figure


def profile(curve: ProfileCurve) -> Figure:
    """Cost over value, with the 95 % interval and the parabola that the standard error stands for.

    Arguments:
        curve: of `FitResult.profile`.
    """
    figure = _style.new_figure(7.5, 4.5)
    axes = figure.subplots()
    best = float(curve.values[np.argmin(curve.cost)])
    line = axes.plot(curve.values, curve.cost, "o-", color=_style.COLOURS[0], ms=3.5, label="others fitted again")
    half = max(curve.linear_interval[1] - best, best - curve.linear_interval[0])
    if np.isfinite(half) and half > 0:
        points = np.linspace(curve.values[0], curve.values[-1], 201)
        parabola = curve.level * ((points - best) / half) ** 2
        line += axes.plot(points, parabola, "--", color=_style.GREY, label="standard error")
    for end in curve.interval:
        if np.isfinite(end):
            axes.axvline(end, color=_style.COLOURS[0], linewidth=0.8)
    axes.axhline(curve.level, color="0.6", linewidth=0.8)
    label = _style.labelled(_style.path_words(curve.name), curve.unit)
    _style.dress(axes, label, "cost [squared standard errors]", "Profile")
    axes.set_ylim(0.0, 3.0 * curve.level)
    _style.legend_beside(figure, line)
    return figure
