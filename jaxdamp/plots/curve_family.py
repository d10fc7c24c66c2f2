"""Force over velocity of all settings of a table."""

import numpy as np

from jaxdamp import _checks
from jaxdamp._display import display
from jaxdamp._types import Axes, Figure
from jaxdamp.bench import ForceVelocityTable
from jaxdamp.plots import _style


A4 = (8.27, 11.69)  # inch


def force_velocity_family(table: ForceVelocityTable, *, page: bool = False) -> Figure:
    """Force over velocity of every setting of a force-velocity table, dark to light in the order of the settings.

    Arguments:
        table: of `bench.read_table`.
        page: an A4 page to print, with the forces in a table and what was decided below the curves.

    Raises:
        ValueError: something else.
    """
    _checks.instance("table", table, ForceVelocityTable, "be a force-velocity table", "Take `bench.read_table(path)`.")
    figure = _style.new_figure(*(A4 if page else (9.5, 5.5)))
    axes, below = figure.subplots(2, height_ratios=(3, 2)) if page else (figure.subplots(), None)
    handles = []
    for index, curve in enumerate(table.curves):
        look = {"color": _style.graded(index, len(table.curves)), "label": curve.setting or table.name}
        handles += axes.plot(np.asarray(curve.velocity), np.asarray(curve.force), "o-", markersize=4.0, **look)
    _style.dress(axes, _style.VELOCITY, _style.FORCE, f"Force over velocity: {table.name}")
    _style.cross(axes)
    if below is None:
        _style.legend_beside(figure, handles, "setting" if len(handles) > 1 else "")
        return figure
    if len(handles) > 1:
        axes.legend(handles=handles, title="setting", frameon=False, fontsize="small")
    _write_table(below, table)
    _style.note_below(figure, table.notes)
    return figure


def _write_table(axes: Axes, table: ForceVelocityTable) -> None:
    """The forces as a printed table, in the units that are shown."""
    forces = table.table()
    axes.set_axis_off()
    axes.set_title(display().text(forces.title), loc="left", fontsize="medium")
    headings = [heading.replace(" at ", "\n").replace(" [", "\n[") for heading in forces.headings()]
    drawn = axes.table(cellText=forces.texts(), colLabels=headings, loc="upper center", edges="horizontal")
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(7.0)
    for (row, _), cell in drawn.get_celld().items():
        cell.set_height(0.15 if row == 0 else min(0.055, 0.85 / max(len(forces.rows), 1)))
        cell.set_edgecolor("0.85")
