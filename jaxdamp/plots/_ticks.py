"""Ticks of axes, as matplotlib's classes: loaded with the first picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator

from jaxdamp.plots._style import short


class TicksInUnit(MaxNLocator):
    """Round numbers of another unit than the one that is drawn."""

    def __init__(self, factor: float) -> None:
        super().__init__(nbins="auto", steps=[1, 2, 2.5, 4, 5, 10])
        self._factor = factor

    def tick_values(self, vmin: float, vmax: float) -> Any:
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


class FewTicks(MaxNLocator):
    """At most so many ticks of another locator, and no more than the labels have room for."""

    def __init__(self, before: MaxNLocator, most: int) -> None:
        super().__init__()
        self._before, self._most = before, most

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Where ticks are."""
        room = int(0.6 * self.axis.get_tick_space())  # pyright: ignore[reportOptionalMemberAccess]
        self._before.set_params(nbins=max(min(self._most, room), 1))
        return self._before.tick_values(vmin, vmax)
