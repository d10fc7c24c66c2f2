"""The errors of several laws, on the records fitted and on others."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.identify import Comparison, CrossValidation
from jaxdamp.plots import _style


def ladder(comparison: Comparison) -> Figure:
    """Bars of the RMSE of each law, on the fitted records and on motion that was held out.

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
        groups.append(
            (
                "held-out records" if comparison.held_out else "motion held out",
                scores,
                0.5 * thickness,
                _style.COLOURS[1],
            )
        )
    handles = []
    for label, values, shift, colour in groups:
        bars = axes.barh(rows + shift, values, thickness, color=colour, label=label)
        axes.bar_label(bars, fmt=_style.short, padding=3, fontsize="small")
        handles.append(bars)
    largest, best = max(float(np.abs(run.force).max()) for run in comparison.best.result.runs), comparison.best
    share = f"{_style.short(best.error)} N = {_style.short(100.0 * best.error / largest)} % of the largest force"
    title = f"{_style.in_words(best.name)}: {share}"
    _style.dress(axes, "RMS of the force error [N]   (free parameters in brackets)", "", title)
    factor = 100.0 / largest
    to_percent, back = (lambda x: np.multiply(x, factor)), (lambda x: np.divide(x, factor))
    shares = axes.secondary_xaxis("top", functions=(to_percent, back))
    shares.set_xlabel("% of the largest force")
    axes.grid(False, axis="y")
    axes.set_yticks(rows, [f"{_style.in_words(r.name)} ({r.parameters})" for r in rungs])
    axes.get_yticklabels()[[r.name for r in rungs].index(comparison.best.name)].set_fontweight("bold")
    axes.invert_yaxis()
    axes.margins(x=0.1)
    _style.legend_beside(figure, handles)
    return figure


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
        colour = _style.COLOURS[number % len(_style.COLOURS)]
        handles += axes.plot(
            values, rows, "o", markersize=5, alpha=0.8, color=colour, label="all" if group is None else f"{group}"
        )
    means = [result.fit_percent(law) for law in laws]
    handles += axes.plot(means, np.arange(len(laws)), "|", markersize=16, color=_style.BLACK, label="mean", mew=2)
    _style.dress(axes, "fit of the record held out [%]", "", "Each record held out in turn")
    axes.set_yticks(np.arange(len(laws)), laws)
    low = max(min(fold.fit_percent for fold in result.folds), -20.0)
    axes.set_xlim(left=min(low - 3.0, 50.0), right=100.0)
    _style.legend_beside(figure, handles)
    return figure
