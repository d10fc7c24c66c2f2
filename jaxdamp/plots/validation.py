"""How well laws predict records that they were not fitted to."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.identify import CrossValidation
from jaxdamp.plots import _style


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
