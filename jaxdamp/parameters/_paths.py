"""Paths of parameters: matching names and patterns, reading and replacing values."""

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import Any, TypeVar

import equinox as eqx

from jaxdamp import _checks
from jaxdamp.parameters._checking import checked
from jaxdamp.parameters._declaration import as_float, parameters


Tree = TypeVar("Tree")


def get(tree: Any, path: str) -> Any:
    """The value at a path such as `"damper.terms.0.rate"`.

    Arguments:
        tree: a law, a vehicle, or containers of them.
        path: names and indices joined by dots.
    """
    for part in path.split(".") if path else []:
        if isinstance(tree, tuple | list):
            tree = tree[int(part)]
        else:
            tree = tree[part] if isinstance(tree, dict) else getattr(tree, part)
    return tree


def with_values(tree: Tree, values: Mapping[str, Any]) -> Tree:
    """The same tree with other values at exact paths, unchecked: for searches, which respect bounds themselves.

    Arguments:
        tree: the tree.
        values: new values by exact path.

    >>> from jaxdamp.dampers import Linear
    >>> with_values(Linear(1500.0), {"rate": 2000.0}).rate
    2000.0
    """
    paths = list(values)
    return eqx.tree_at(lambda t: [get(t, path) for path in paths], tree, list(values.values())) if paths else tree


def replace(tree: Tree, values: Mapping[str, Any]) -> Tree:
    """The same tree with other values at the given paths (last parts and patterns as in `free_parameters`).

    Values outside their domain are refused, and so are all values that a constructor refuses: violated conditions
    between several parameters, or of a wrapper on the law inside (see `checked`).

    Arguments:
        tree: the tree.
        values: new values by path, in the units of the parameters.

    >>> from jaxdamp.dampers import Linear
    >>> float(replace(Linear(1500.0), {"rate": 2000.0}).rate)
    2000.0
    """
    known = [p.path for p in parameters(tree)]
    return checked(
        with_values(tree, {p: as_float(v) for name, v in values.items() for p in match_paths(known, [name])})
    )


def match_paths(known: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The known paths that patterns name: exactly, by their last part, or with `*`.

    Arguments:
        known: all paths.
        patterns: names, last parts of names, or patterns with `*`.
    """
    chosen = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        hits = [p for p in known if fnmatchcase(p, pattern)] or [p for p in known if fnmatchcase(p, f"*.{pattern}")]
        if not hits:
            near = get_close_matches(pattern, list(known) + [p.rsplit(".", 1)[-1] for p in known], 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ValueError(f"No parameter is named {pattern!r}: {hint}The parameters are {', '.join(known)}.")
        chosen += [p for p in hits if p not in chosen]
    return [p for p in known if p in chosen]


def name_patterns(argument: str, names: Any) -> list[str]:
    """Names or patterns of parameters as a list.

    Arguments:
        argument: its name in messages.
        names: one name or several.

    Raises:
        ValueError: anything else, such as a mapping to values, which would be ignored.
    """
    if isinstance(names, Mapping):
        remedy = "It takes no values: set those by `jaxdamp.parameters.replace`, and ranges by `bounds`."
        _checks.refuse(argument, "be names of parameters", repr(names), remedy)
    listed = [names] if isinstance(names, str) else list(names) if isinstance(names, Iterable) else None
    if listed is None or not all(isinstance(name, str) for name in listed):
        remedy = "Write ['damper.rate'], or a pattern such as ['damper.*_rate']."
        _checks.refuse(argument, "be names of parameters", repr(names), remedy)
    return listed
