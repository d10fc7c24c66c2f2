"""`Metric`, a statistic of a channel; names of metrics, renamed ones too, and values by name."""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any, final

import jax

from jaxdamp import _checks
from jaxdamp._tables import Compared, Contents, Table, comparison_table, with_unit
from jaxdamp._warned import warn
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
        fields = {"by": self.by, "from_rest": self.from_rest, "window": self.window, "name": self.name}
        return Metric(self.channel, self.statistic, weighting, **fields)

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


# Old name: new name, of the functions here and of ride metrics, alone or after the name of a corner ("front_…"). Remove
# an entry after one release.
RENAMED = {"working_space_peak": "working_space_peak_to_peak"}


def current_name(name: str, names: Collection[str]) -> str:
    """The current name of a metric: for a renamed one the new name, with a `FutureWarning`.

    Arguments:
        name: of a metric, perhaps an earlier one.
        names: all current names.
    """
    new = _new_name(name, names)
    if new is None:
        return name
    warn(f"The metric {name!r} is now called {new!r}; use that name.", FutureWarning)
    return new


def _new_name(name: object, names: Collection[str]) -> str | None:
    if isinstance(name, str) and name not in names:
        for old, new in RENAMED.items():
            corner = name.removesuffix(old)
            if corner != name and corner[-1:] in ("", "_") and corner + new in names:
                return corner + new
    return None


def current_names(argument: str, names: Sequence[str], valid: Collection[str]) -> list[str]:
    """The current names of these metrics.

    Arguments:
        argument: its name in messages.
        names: of metrics, perhaps earlier ones.
        valid: all current names.

    Raises:
        ValueError: an unknown name, with the nearest known one; a single text instead of a list.
    """
    if isinstance(names, str):
        _checks.refuse(argument, "be a list of names", repr(names), f"Write `{argument}=[{names!r}]`.")
    current = [current_name(name, valid) for name in names]
    for name in current:
        _checks.one_of(argument, name, valid)
    return current


@final
@jax.tree_util.register_pytree_with_keys_class
class MetricValues(dict):
    """Values of metrics by name: a `dict` that accepts renamed metrics and suggests the nearest name to a wrong one.

    For JAX it is a pytree of its values, sorted by name, like a `dict`.

    Attributes:
        units: the unit of each metric, where it is known.

    >>> values = MetricValues(rms_sprung_acceleration=1.2)
    >>> values["rms_sprung_accel"]
    Traceback (most recent call last):
        ...
    KeyError: "no metric 'rms_sprung_accel'; did you mean 'rms_sprung_acceleration'?"
    """

    units: Mapping[str, str] = MappingProxyType({})

    @classmethod
    def with_units(cls, values: Mapping[str, object], units: Mapping[str, str]) -> "MetricValues":
        """These values and their units."""
        result = cls(values)
        result.units = {name: units[name] for name in result if name in units}
        return result

    def table(self) -> Table:
        """Each metric with its unit and its value, for the values of one vehicle on one road."""
        rows = [Compared(name, self.units.get(name, ""), (float(value),), None) for name, value in self.items()]
        return comparison_table("Ride metrics", "metric", ("value",), rows)

    def to_dict(self) -> Contents:
        """The values with units, ready for JSON; numbers that are not finite are None."""
        return {name: with_unit(value, self.units.get(name, "")) for name, value in self.items()}

    def __missing__(self, name: Any) -> Any:
        new = current_name(name, self.keys())
        if new != name:
            return self[new]
        near = _checks.nearest(str(name), map(str, self))
        raise KeyError(
            f"no metric {name!r}; " + (f"did you mean {near!r}?" if near else f"there are {', '.join(self)}")
        )

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or _new_name(name, self.keys()) is not None

    def get(self, name: object, default: object = None) -> Any:
        """The value of a metric, or the default if there is no metric of this name."""
        return self[name] if name in self else default

    def tree_flatten_with_keys(self) -> tuple[list[tuple[Any, Any]], tuple[tuple[str, str | None], ...]]:
        """Values with their names, and the names with their units."""
        names = sorted(self)
        return [(jax.tree_util.DictKey(name), self[name]) for name in names], tuple(
            (name, self.units.get(name)) for name in names
        )

    @classmethod
    def tree_unflatten(cls, names: tuple[tuple[str, str | None], ...], values: Sequence[object]) -> "MetricValues":
        """The values with these names and units."""
        units = {name: unit for name, unit in names if unit is not None}
        return cls.with_units(dict(zip((name for name, _ in names), values, strict=True)), units)
