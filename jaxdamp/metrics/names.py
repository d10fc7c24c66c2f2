"""Names of metrics: renamed ones, the check of given names, and values by name."""

import inspect
import warnings
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any, final

import jax

from jaxdamp import _checks
from jaxdamp._tables import Compared, Contents, Table, comparison_table, with_unit


# Old name: new name, of the functions here and of ride metrics, alone or after the name of a corner ("front_…"). Remove
# an entry after one release.
RENAMED = {"working_space_peak": "working_space_peak_to_peak"}

_INSIDE = ("jaxdamp", "jaxtyping", "equinox", "jax")  # packages that are skipped in search of the line to warn at


def current_name(name: str, known: Collection[str]) -> str:
    """The current name of a metric: for a renamed one the new name, with a `FutureWarning`.

    Arguments:
        name: of a metric, perhaps an earlier one.
        known: all current names.
    """
    new = _new_name(name, known)
    if new is None:
        return name
    _warn(f"The metric {name!r} is now called {new!r}; use that name.")
    return new


def _warn(text: str) -> None:
    """Warn at the line of user code that called this package."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] in _INSIDE:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, FutureWarning, stacklevel=level)


def _new_name(name: object, known: Collection[str]) -> str | None:
    if isinstance(name, str) and name not in known:
        for old, new in RENAMED.items():
            corner = name.removesuffix(old)
            if corner != name and corner[-1:] in ("", "_") and corner + new in known:
                return corner + new
    return None


def current_names(argument: str, names: Sequence[str], known: Collection[str]) -> list[str]:
    """The current names of these metrics.

    Arguments:
        argument: its name in messages.
        names: of metrics, perhaps earlier ones.
        known: all current names.

    Raises:
        ValueError: an unknown name, with the nearest known one; a single text instead of a list.
    """
    if isinstance(names, str):
        _checks.refuse(argument, "be a list of names", repr(names), f"Write `{argument}=[{names!r}]`.")
    current = [current_name(name, known) for name in names]
    for name in current:
        _checks.one_of(argument, name, known)
    return current


@final
@jax.tree_util.register_pytree_with_keys_class
class MetricValues(dict[str, Any]):
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

    def __missing__(self, name: str) -> Any:
        new = current_name(name, self.keys())
        if new != name:
            return self[new]
        near = _checks.nearest(str(name), map(str, self))
        raise KeyError(
            f"no metric {name!r}; " + (f"did you mean {near!r}?" if near else f"there are {', '.join(self)}")
        )

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or _new_name(name, self.keys()) is not None

    def get(self, name: str, default: object = None) -> Any:
        """The value of a metric, or the default if there is no metric of this name."""
        return self[name] if name in self else default

    def tree_flatten_with_keys(self) -> tuple[list[tuple[object, object]], tuple[tuple[str, str | None], ...]]:
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
