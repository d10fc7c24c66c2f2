"""Natural modes: frequency, damping ratio and shape."""

import numpy as np

from jaxdamp._types import Figure
from jaxdamp.plots import _style
from jaxdamp.vehicles import Modes


def modes(result: Modes) -> Figure:
    """The amplitude of every coordinate in each damped oscillation, signed as in the undamped motion.

    Heights [m] and angles [rad] are compared as numbers, the largest of a mode is 1.

    Arguments:
        result: of `vehicles.modes`.
    """
    shapes = result.damped_shapes.T  # one row for each oscillation
    count, rows = len(shapes), np.arange(len(result.coordinates), dtype=float)
    figure = _style.new_figure(max(2.4 * count + 1.5, 5.0), 1.6 + 0.35 * len(rows))
    panels = np.atleast_1d(figure.subplots(1, max(count, 1), sharey=True))
    for axes, shape, frequency, ratio in zip(panels, shapes, result.frequency, result.damping_ratio, strict=False):
        amplitude = np.abs(shape) * np.where(np.real(shape) < 0, -1.0, 1.0)
        axes.barh(rows, amplitude, 0.6, color=[_style.COLOURS[1 if a < 0 else 0] for a in amplitude])
        axes.set_xlim(-1.1, 1.1)
        _style.dress(axes, "amplitude [–]", "", f"{frequency:.3g} Hz, damping ratio {ratio:.2g}")
        _style.cross(axes, horizontal=False)
    panels[0].set_yticks(rows, result.coordinates)
    panels[0].invert_yaxis()
    return figure
