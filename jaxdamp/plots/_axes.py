"""Labels and ticks of axes, in the units and the sign that are shown."""

import functools
import re
from typing import TYPE_CHECKING, Literal

from jaxdamp._display import display
from jaxdamp._types import Axes


if TYPE_CHECKING:
    import matplotlib.text


_SLACK = 0.35  # inch, by which a title or label may be longer than its axes


def label_axis(axes: Axes, name: Literal["x", "y"], label: str, *, turns: bool = False, times: float = 1.0) -> None:
    """The label of one axis, and ticks in the unit and the sign that are shown, by the unit in the label.

    `times` brings the numbers drawn to the unit of the label; with `turns` the sign is that of the direction, also if
    the label does not say so. The scale of the axes, linear or not, is chosen before.
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis = axes.xaxis if name == "x" else axes.yaxis
    wrap(axis.set_label_text(display().text(label, read=True)), axes)
    match = re.search(r"\[([^\[\]]+)\]", label)
    shown = display().read(match[1] if match else "", signed=turns or display().signed(label))
    factor = times * shown.factor
    from jaxdamp.plots._ticks import FewTicks, LogTicks, LogTicksInUnit, TicksInUnit

    if factor == 1.0:
        FewTicks.along(axis)
        return
    log = axis.get_scale() == "log"
    ticks = LogTicks(factor) if log else TicksInUnit(factor)
    axis.set_major_locator(ticks)
    axis.set_major_formatter(FuncFormatter(ticks.text))
    if log:
        axis.set_minor_locator(LogTicksInUnit(factor, range(2, 10)))
        axis.set_minor_formatter(NullFormatter())
    FewTicks.along(axis)
    if factor < 0.0 and not log:
        axis.set_inverted(True)
        change = f"{name}lim_changed"
        axes.callbacks.connect(change, lambda _: None if axis.get_inverted() else axis.set_inverted(True))


def wrap(text: "matplotlib.text.Text", axes: Axes) -> None:
    """Break a title or label where it is longer than its axes, as wide as these are when they are drawn.

    A sign in brackets stays with its word: (+ rebound).
    """
    text.set_text(re.sub(r"(?<=\([+−]) ", "\N{NO-BREAK SPACE}", text.get_text()))
    text.set_wrap(True)
    vars(text)["_get_wrap_line_width"] = functools.partial(_longest, text, axes)  # by default the width of the figure


def _longest(text: "matplotlib.text.Text", axes: Axes) -> float:
    """Pixels of the longest line of a title or label."""
    figure = text.get_figure(root=True)
    assert figure is not None
    box, page, slack = axes.get_window_extent(), figure.bbox, _SLACK * figure.dpi
    if text.get_rotation():
        return box.height + slack
    middle = 0.5 * (box.x0 + box.x1)
    room = page.x1 - box.x0 if text.get_horizontalalignment() == "left" else 2.0 * min(middle, page.x1 - middle)
    return min(box.width + slack, room)


def few_ticks(axes: Axes, most: int) -> None:
    """At most so many ticks along the abscissa, in the unit shown."""
    from jaxdamp.plots._ticks import FewTicks

    FewTicks.along(axes.xaxis, most)


def small(count: int) -> float:
    """The size of so many crosses: many leave something of what they lie on to see."""
    return min(4.0, max(60.0 / count**0.5, 1.0))
