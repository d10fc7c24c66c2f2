"""Old names that keep working for a release, with a warning."""

import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

from jaxdamp._guesses import answer


def answer_old_names(module: str, public: Sequence[str], homes: Mapping[str, str]) -> None:
    """Give names that a package lists no longer, with a warning; answer others as `answer_guesses` does.

    Arguments:
        module: name of the package.
        public: the names that it has.
        homes: for each old name the module of the package that defines it.
    """

    def find(name: str) -> Any:
        if name not in homes:
            answer(module, name, public)
        text = f"`{module}.{name}` is no public name any more: objects of it are returned, not made."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(import_module(f"{module}.{homes[name]}"), name)

    vars(sys.modules[module])["__getattr__"] = find
