"""Old names that keep working for a release, with a warning."""

import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def old_names(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package for names that it lists no longer.

    Arguments:
        package: its dotted name.
        homes: for each old name the module of the package that defines it.
    """

    def __getattr__(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        text = f"`{package}.{name}` is no public name any more: objects of it are returned, not made."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return __getattr__
