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
    """Multiples of the powers of ten of another unit than the one that is drawn."""

    def __init__(self, factor: float, subs: Sequence[float]) -> None:
        super().__init__(subs=subs, numticks=30)
        self._factor = abs(factor)

    def tick_values(self, vmin: float, vmax: float) -> _Ticks:
        """Where ticks are, in the unit that is drawn."""
        return np.asarray(super().tick_values(self._factor * vmin, self._factor * vmax)) / self._factor


_IN_DECADE = (1.0, 2.0, 5.0)


class LogTicks(LogTicksInUnit):
    """1, 2 and 5 of each decade, or decades alone, as labels have room; within a part of one, round numbers."""

    def __init__(self, factor: float = 1.0) -> None:
        super().__init__(factor, _IN_DECADE)

    def tick_values(self, vmin: float, vmax: float) -> _Ticks:
        """Where ticks are, in the unit that is drawn."""
        ends = self._factor * vmin, self._factor * vmax
        steps = 10.0 ** np.arange(np.floor(np.log10(min(ends))), np.ceil(np.log10(max(ends))) + 1.0)
        ticks = np.ravel(steps[:, None] * _IN_DECADE)
        ticks = ticks[(ticks >= min(ends)) & (ticks <= max(ends))]
        choices = [ticks, steps]
        if ticks.size < 2:
            choices = [MaxNLocator(most, steps=[1, 2, 5, 10]).tick_values(*ends) for most in range(_MANY, 0, -1)]
        for ticks in (np.asarray(each) / self._factor for each in choices):
            if _have_room(self.axis, ticks, vmin, vmax):
                break
        return ticks

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
            if _have_room(axis, ticks, vmin, vmax):
                break
        return ticks


def _have_room(axis: object, ticks: np.ndarray, vmin: float, vmax: float) -> bool:
    """Whether the labels of ticks do not meet, if the axis is horizontal."""
    if not isinstance(axis, XAxis) or ticks.size < 2:
        return True
    at, ends = (axis.get_transform().transform(np.asarray(values, dtype=float)) for values in (ticks, (vmin, vmax)))
    return bool(_needed(axis, ticks) <= np.diff(at).min() / abs(np.ptp(ends)))


def _needed(axis: Axis, ticks: np.ndarray) -> float:
    """The distance from tick to tick that the longest label needs, as a share of the axis."""
    letters = max(map(len, axis.get_major_formatter().format_ticks(list(ticks))))
    size = float(axis.get_major_ticks(1)[0].label1.get_fontsize())
    width = axis.axes.get_window_extent().width / axis.axes.figure.dpi
    return (letters + _GAP) * _LETTER * size / 72.0 / width
