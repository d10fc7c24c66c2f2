"""How a fit was reached and what it could be: the course of a training, the cost of other values, a design of tests."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.identify import ExperimentDesign, ProfileCurve, Training, extent
from jaxdamp.plots import _style


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
    _style.dress(left, "stroke, zero to peak [mm]", "peak velocity [m/s]", "Tests")
    left.set_xscale("log")
    left.set_yscale("log")
    _style.dress(right, "expected standard error [% of the value]", "", "Parameters")
    right.set_xscale("log")
    right.set_yticks(rows + 0.2 * (len(sets) - 1), design.free.names)
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
    line = axes.plot(
        curve.values, curve.cost, "o-", color=_style.COLOURS[0], markersize=3.5, label="others fitted again"
    )
    half = max(curve.linear_interval[1] - best, best - curve.linear_interval[0])
    if np.isfinite(half) and half > 0:
        points = np.linspace(curve.values[0], curve.values[-1], 201)
        parabola = curve.level * ((points - best) / half) ** 2
        line += axes.plot(points, parabola, "--", color=_style.GREY, label="standard error")
    for end in curve.interval:
        if np.isfinite(end):
            axes.axvline(end, color=_style.COLOURS[0], linewidth=0.8)
    axes.axhline(curve.level, color="0.6", linewidth=0.8)
    unit = f" [{curve.unit}]" if curve.unit else ""
    _style.dress(axes, f"{curve.name}{unit}", "cost [squared standard errors]", "Profile")
    axes.set_ylim(0.0, 3.0 * curve.level)
    _style.legend_beside(figure, line)
    return figure
