"""Keywords of a call that classes of typed keywords describe: checked, and completed by their defaults."""

from collections.abc import Mapping
from difflib import get_close_matches
from typing import TypeVar, cast


S = TypeVar("S", bound=Mapping[str, object])  # a `TypedDict`


def completed(call: str, given: Mapping[str, object], defaults: S, *further: str) -> S:
    """The keywords of a call with the defaults of those that are not given.

    Arguments:
        call: name of the function.
        given: the keywords.
        defaults: of all that there are.
        further: arguments of the function with names of their own, for the message.

    Raises:
        TypeError: a keyword that there is not, with the nearest one.
    """
    for name in given:
        if name not in defaults:
            near = get_close_matches(name, [*defaults, *further], 1)
            hint = f"did you mean {near[0]!r}?" if near else f"it has {', '.join([*further, *defaults])}."
            raise TypeError(f"{call} has no argument {name!r}: {hint}")
    return cast(S, {**defaults, **given})


def part(settings: Mapping[str, object], of: S) -> S:
    """Those of the keywords that a smaller class has, given by its defaults."""
    return cast(S, {name: settings[name] for name in of})
