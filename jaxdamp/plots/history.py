"""The course of a training."""

from jaxdamp._types import Figure
from jaxdamp.identify import Training
from jaxdamp.plots import _style


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
    axes.yaxis.set_major_formatter(lambda value, _: _style.short(value))
    axes.yaxis.set_minor_formatter(lambda value, _: _style.short(value))
    _style.dress(axes, "step", "root of the mean squared force error [N]", training.stopped)
    _style.legend_beside(figure, handles)
    return figure
