"""Names of metrics: the ones that were renamed, the choice among those that there are, and values by name."""

import inspect
import warnings
from collections.abc import Collection, Sequence
from typing import Any, final

import jax

from jaxdamp import _checks


# Old name: new name, of the functions here and of ride metrics, alone or after the name of a corner ("front_…"). An
# entry stays for one release.
RENAMED = {"working_space_peak": "working_space_peak_to_peak"}

_INSIDE = ("jaxdamp", "jaxtyping", "equinox", "jax")  # packages that a warning's place is not looked for in


def current_name(name: str, known: Collection[str]) -> str:
    """The name that a metric has now: of a renamed one the new name, with a `FutureWarning`; else the name itself."""
    new = _new_name(name, known)
    if new is None:
        return name
    _warn(f"The metric {name!r} is now called {new!r}; use that name.")
    return new


def _warn(text: str) -> None:
    """Warn at the line of the code that uses this package."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").split(".")[0] in _INSIDE:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, FutureWarning, stacklevel=level)


def _new_name(name: Any, known: Collection[str]) -> str | None:
    if isinstance(name, str) and name not in known:
        for old, new in RENAMED.items():
            corner = name.removesuffix(old)
            if corner != name and corner[-1:] in ("", "_") and corner + new in known:
                return corner + new
    return None


def current_names(argument: str, names: Sequence[str], known: Collection[str]) -> list[str]:
    """These metrics by the names that they have now.

    Raises:
        ValueError: one that is not known, with the nearest that is; one word in place of a list of them.
    """
    if isinstance(names, str):
        _checks.refuse(argument, "be a list of names", repr(names), f"Write `{argument}=[{names!r}]`.")
    found = [current_name(name, known) for name in names]
    for name in found:
        _checks.one_of(argument, name, known)
    return found


@final
@jax.tree_util.register_pytree_with_keys_class
class MetricValues(dict):
    """Values of metrics by name: a `dict` that knows names which were changed and suggests the nearest to a wrong one.

    To JAX it is a tree of its values, in the order of their names, as a `dict` is.

    >>> values = MetricValues(rms_sprung_acceleration=1.2)
    >>> values["rms_sprung_accel"]
    Traceback (most recent call last):
        ...
    KeyError: "no metric 'rms_sprung_accel'; did you mean 'rms_sprung_acceleration'?"
    """

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

    def get(self, name: Any, default: Any = None) -> Any:
        """The value of a metric, or the default where there is none of this name."""
        return self[name] if name in self else default

    def tree_flatten_with_keys(self) -> tuple[list[tuple[Any, Any]], tuple[str, ...]]:
        """Values with their names, and the names."""
        names = sorted(self)
        return [(jax.tree_util.DictKey(name), self[name]) for name in names], tuple(names)

    @classmethod
    def tree_unflatten(cls, names: tuple[str, ...], values: Sequence[Any]) -> "MetricValues":
        """Of names and values."""
        return cls(zip(names, values, strict=True))
