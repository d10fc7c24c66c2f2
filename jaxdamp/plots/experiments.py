"""A design of an experiment: its runs, and what they are expected to tell."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.identify import ExperimentDesign, extent
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
