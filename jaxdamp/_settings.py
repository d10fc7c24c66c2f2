"""Keywords of a call that classes of typed keywords describe: checked, and completed by their defaults."""

import inspect
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import TypeVar, cast


S = TypeVar("S", bound=Mapping[str, object])  # a `TypedDict`


def completed(function: Callable[..., object], given: Mapping[str, object], defaults: S) -> S:
    """The keywords of a call with the defaults of those that are not given.

    Arguments:
        function: that is called; it may have further arguments of its own.
        given: the keywords.
        defaults: of all that there are.

    Raises:
        TypeError: a keyword that there is not, with the nearest one.
    """
    for name in given:
        if name not in defaults:
            own = [p.name for p in inspect.signature(function).parameters.values() if p.kind is p.KEYWORD_ONLY]
            near = get_close_matches(name, [*own, *defaults], 1)
            hint = f"did you mean {near[0]!r}?" if near else f"it has {', '.join([*own, *defaults])}."
            raise TypeError(f"{function.__name__} has no argument {name!r}: {hint}")
    return cast(S, {**defaults, **given})


def part(settings: Mapping[str, object], of: S) -> S:
    """Those of the keywords that a smaller class has, given by its defaults."""
    return cast(S, {name: settings[name] for name in of})
