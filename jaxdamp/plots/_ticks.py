"""Ticks of axes, as matplotlib's classes: loaded with the first picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axis import Axis, XAxis
from matplotlib.ticker import LogLocator, MaxNLocator

from jaxdamp.plots._style import short


_Ticks = Any  # an array, where matplotlib wants a sequence


class TicksInUnit(MaxNLocator):
    """Round numbers of another unit than the one that is drawn."""

    def __init__(self, factor: float) -> None:
        super().__init__(nbins="auto", steps=[1, 2, 2.5, 4, 5, 10])
        self._factor = factor

    def tick_values(self, vmin: float, vmax: float) -> _Ticks:
        """Where ticks are, in the unit that is drawn."""
        ends = sorted((self._factor * vmin, self._factor * vmax))
        return np.sort(np.asarray(super().tick_values(*ends)) / self._factor)

    def text(self, value: float, _: int | None) -> str:
        """The label of a tick."""
        return f"{round(self._factor * value, 9) + 0.0:g}".replace("-", "−")


class LogTicksInUnit(LogLocator):
    """1, 2 and 5 of each decade of another unit than the one that is drawn, or other multiples of its powers of ten."""

    def __init__(self, factor: float, subs: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
        super().__init__(subs=subs, numticks=30)
        self._factor = abs(factor)

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Where ticks are, in the unit that is drawn."""
        return [tick / self._factor for tick in super().tick_values(self._factor * vmin, self._factor * vmax)]

    def text(self, value: float, _: int | None) -> str:
        """The label of a tick."""
        return short(self._factor * value)


_MANY = 9  # ticks of an axis, as matplotlib has them
_LETTER, _GAP = 0.6, 1.0  # width of a letter in sizes of the font; letters between two labels


class FewTicks(MaxNLocator):
    """The ticks of another locator along an abscissa: at most so many, and no more than their labels have room for."""

    def __init__(self, before: MaxNLocator, most: int) -> None:
        super().__init__()
        self._before, self._most = before, most

    @classmethod
    def along(cls, axis: Axis, most: int = _MANY) -> None:
        """Let the ticks of an axis have room, and be at most so many, if it is horizontal and linear."""
        before = axis.get_major_locator()
        if isinstance(before, cls):
            before._most = most
        elif isinstance(axis, XAxis) and isinstance(before, MaxNLocator):
            axis.set_major_locator(cls(before, most))

    def tick_values(self, vmin: float, vmax: float) -> _Ticks:
        """Where ticks are."""
        axis, ticks = self.axis, np.zeros(0)
        assert isinstance(axis, Axis)
        self._before.set_axis(axis)
        for most in range(min(self._most, max(axis.get_tick_space(), 1)), 0, -1):
            self._before.set_params(nbins=most)
            ticks = np.asarray(self._before.tick_values(vmin, vmax))
            if ticks.size < 2 or _needed(axis, ticks) <= np.ptp(ticks[:2]) / abs(vmax - vmin):
                break
        return ticks


def _needed(axis: Axis, ticks: np.ndarray) -> float:
    """The distance from tick to tick that the longest label needs, as a share of the axis."""
    letters = max(map(len, axis.get_major_formatter().format_ticks(list(ticks))))
    size = float(axis.get_major_ticks(1)[0].label1.get_fontsize())
    width = axis.axes.get_window_extent().width / axis.axes.figure.dpi
    return (letters + _GAP) * _LETTER * size / 72.0 / width
