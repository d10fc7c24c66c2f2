"""Force over velocity of all settings of a table."""

from typing import TYPE_CHECKING

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import ForceVelocityTable
from jaxdamp.plots import _style


if TYPE_CHECKING:
    import matplotlib.figure


def force_velocity_family(table: ForceVelocityTable) -> "matplotlib.figure.Figure":
    """Force over velocity of every setting of a force-velocity table, dark to light in the order of the settings.

    Arguments:
        table: of `bench.read_table`.

    Raises:
        ValueError: something else.
    """
    _checks.instance("table", table, ForceVelocityTable, "be a force-velocity table", "Take `bench.read_table(path)`.")
    figure = _style.new_figure(9.5, 5.5)
    axes = figure.subplots()
    handles = []
    for index, curve in enumerate(table.curves):
        label = curve.setting or table.name
        colour = _style.graded(index, len(table.curves))
        handles += axes.plot(
            np.asarray(curve.velocity), np.asarray(curve.force), "o-", color=colour, markersize=4.0, label=label
        )
    _style.dress(axes, _style.VELOCITY, _style.FORCE, f"Force over velocity: {table.name}")
    _style.cross(axes)
    _style.legend_beside(figure, handles, "setting" if len(handles) > 1 else "")
    return figure
