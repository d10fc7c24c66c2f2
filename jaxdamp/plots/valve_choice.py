"""A choice of valving: wanted and reached force."""

import itertools

import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Figure
from jaxdamp.plots import _style
from jaxdamp.tune import ValvingResult


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
    _style.dress(forces, "", _style.FORCE, f"Valving: wanted and reached force, error {result.error_percent:.2g} %")
    _style.dress(errors, _style.VELOCITY, "error [N]")
    for axes in (forces, errors):
        _style.cross(axes)
    _style.legend_above(figure, handles, 4)
    _style.note_below(figure, [result.summary])
    return figure
