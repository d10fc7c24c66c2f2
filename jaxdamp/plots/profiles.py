"""The cost of other values of one parameter."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.identify import ProfileCurve
from jaxdamp.plots import _style


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
