"""Keywords of a call that classes of typed keywords describe: checked, completed by their defaults, and listed."""

import functools
import inspect
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import TypeVar, cast, get_args


Function = TypeVar("Function", bound=Callable[..., object])
S = TypeVar("S", bound=Mapping[str, object])  # a `TypedDict`


def with_defaults(
    defaults: Mapping[str, object], *, check: Callable[[Mapping[str, object]], None] | None = None, **others: object
) -> Callable[[Function], Function]:
    """A function of `**settings: Unpack[Settings]` that always gets all of these keywords.

    Its signature has one keyword for each of them, which `help` shows and editors complete.

    Arguments:
        defaults: of all keywords that `Settings` describes.
        check: refuses wrong values of them, before the function is called.
        others: defaults that this function has instead.

    Raises:
        TypeError: by the function, for a keyword that there is not, with the nearest one.
    """
    filled = {**defaults, **others}

    def decorated(function: Function) -> Function:
        signature = inspect.signature(function)
        *first, settings = signature.parameters.values()
        kinds = {
            n: getattr(k, "__forward_arg__", k) for n, k in get_args(settings.annotation)[0].__annotations__.items()
        }
        keyword = functools.partial(inspect.Parameter, kind=inspect.Parameter.KEYWORD_ONLY)
        described = [keyword(name, default=value, annotation=kinds[name]) for name, value in filled.items()]
        names = {p.name: p for p in (*first, *described)}

        @functools.wraps(function)
        def call(*args: object, **given: object) -> object:
            for name in given:
                if name not in names:
                    near = get_close_matches(name, names, 1)
                    listed = ", ".join(n for n, p in names.items() if p.kind is p.KEYWORD_ONLY)
                    hint = f"did you mean {near[0]!r}?" if near else f"it has {listed}."
                    raise TypeError(f"{function.__name__} has no argument {name!r}: {hint}")
            complete = {**filled, **given}
            if check is not None:
                check(complete)
            return function(*args, **complete)

        call.__dict__["__signature__"] = signature.replace(parameters=[*names.values()])
        return cast(Function, call)

    return decorated


def part(settings: Mapping[str, object], of: S) -> S:
    """Those of the keywords that a smaller class has, given by its defaults."""
    return cast(S, {name: settings[name] for name in of})
