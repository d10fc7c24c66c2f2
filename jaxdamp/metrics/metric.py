"""`Metric`: a statistic of a channel."""

import dataclasses
from collections.abc import Mapping
from typing import final

from jaxdamp import _checks
from jaxdamp.metrics.statistics import STATISTICS, Statistic
from jaxdamp.metrics.weighted import check_weighting


@final
@dataclasses.dataclass(frozen=True, init=False)
class Metric:
    """A statistic of a channel of a vehicle. It is accepted wherever the name of a ride metric is.

    Arguments:
        channel: name of the channel, one of `vehicle.units`.
        statistic: a name out of `STATISTICS` ("rms", "peak", "maximum", "vibration_dose_value", ...), `percentile(95)`,
            or a `Statistic` of your own.
        weighting: frequency weighting of ISO 2631-1 for an acceleration, such as "Wd"; "default" is the one for the
            direction of the channel, Wk for heights and We for angles. None for no weighting.
        by: a second channel, by which the first is multiplied.
        from_rest: whether the channel is measured from its value in static equilibrium on the first road heights.
        window: part of the run that is evaluated, start and end [s], both included; the whole run if left out. The
            weighting filter starts with the run.
        name: name of the metric; composed of the other arguments if left out.

    Raises:
        ValueError: an unknown statistic or weighting; a window that ends before it begins.

    >>> Metric("sprung_acceleration", "rms", weighting="Wd").name
    'Wd_rms_sprung_acceleration'
    >>> Metric("stroke", "maximum", window=(1.0, 2.5)).name
    'maximum_stroke_1_to_2.5_s'
    """

    channel: str
    statistic: Statistic
    weighting: str | None
    by: str
    from_rest: bool
    window: tuple[float, float] | None
    name: str

    def __init__(
        self,
        channel: str,
        statistic: str | Statistic,
        weighting: str | None = None,
        *,
        by: str = "",
        from_rest: bool = False,
        window: tuple[float, float] | None = None,
        name: str = "",
    ) -> None:
        if isinstance(statistic, str):
            _checks.one_of("statistic", statistic, STATISTICS)
            statistic = STATISTICS[statistic]
        if weighting not in (None, "default"):
            check_weighting(weighting)
        if weighting is not None and from_rest:
            remedy = "A weighting removes constants by itself: leave `from_rest` out."
            _checks.refuse("from_rest", "not be used with a weighting", from_rest, remedy)
        if window is not None:
            window = (float(window[0]), float(window[1]))
            if not 0.0 <= window[0] < window[1]:
                _checks.refuse("window", "begin at 0 s or later and end after that", window)
        prefix = "" if weighting is None else "weighted_" if weighting == "default" else f"{weighting}_"
        parts = f"{prefix}{statistic.name}_{channel}" + f"_by_{by}" * bool(by)
        ends = "" if window is None else f"_{window[0]:g}_to_{window[1]:g}_s"
        values = (channel, statistic, weighting, by, from_rest, window, name or parts + ends)
        for field, value in zip(dataclasses.fields(self), values, strict=True):
            object.__setattr__(self, field.name, value)

    def weighted_by(self, weighting: str | None) -> "Metric":
        """The same metric, of the same name, with another weighting."""
        rest = {"by": self.by, "from_rest": self.from_rest, "window": self.window, "name": self.name}
        return Metric(self.channel, self.statistic, weighting, **rest)

    def unit(self, units: Mapping[str, str]) -> str:
        """Its unit, from those of the channels."""
        unit = units[self.channel]
        return self.statistic.unit(f"{unit} {units[self.by]}".strip() if self.by else unit)

    def samples(self, count: int, dt: float, begin: float = 0.0) -> tuple[int, int]:
        """Numbers of the first and the last sample that count.

        Arguments:
            count: samples of the run, or of the part of it that is looked at.
            dt: their interval [s].
            begin: time of the first one [s].

        Raises:
            ValueError: a window that is not inside the run, or holds fewer than two samples.
        """
        if self.window is None:
            return 0, count - 1
        first, last = (round((time - begin) / dt) for time in self.window)
        if first < 0 or last > count - 1 or last <= first:
            must = f"lie in {begin:g} to {begin + (count - 1) * dt:g} s and hold two instants, {dt:g} s apart, or more"
            _checks.refuse(f"window of {self.name!r}", must, self.window)
        return first, last
