"""Paths of parameters: matching names and patterns, reading and replacing values, and the checks of modules."""

import dataclasses
import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import TypeVar

import equinox as eqx
import numpy as np
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._traced import behind
from jaxdamp.parameters._declaration import (
    Module,
    Parameter,
    as_float,
    domain_of,
    modules_inside,
    parameters,
    readable,
)


Tree = TypeVar("Tree")


def check_parameters(module: eqx.Module) -> None:
    """Refuse fields of a wrong type and values outside their domain (inside `jax.jit` they are not known).

    Arguments:
        module: the law, vehicle or other module.
    """
    check_field_types(module)
    for field in dataclasses.fields(module):
        declared = field.metadata.get("parameter") or field.metadata.get("setting")
        value = behind(getattr(module, field.name)) if declared else None
        if declared is None or value is None:
            continue
        argument = f"{type(module).__name__}.{field.name}"
        _checks.finite(argument, value)
        domain = domain_of(declared, module)
        size = np.ndim(getattr(module, field.name))
        each = [value] if value.ndim <= size or not size else value.reshape(-1, *value.shape[-size:])  # of a batch
        if not all(map(domain.contains, each)):
            unit = f" [{declared['unit']}]" if declared["unit"] else ""
            _checks.refuse(argument, f"be {domain.name}{unit}", value, f"It is the {declared['meaning']}.")


class AbstractDeclared(Module):
    """A module with declared parameters, which are checked when it is made, and which prints as a line with them."""

    def __check_init__(self) -> None:
        check_parameters(self)

    def __repr__(self) -> str:
        return readable(self)


def checked(tree: Tree) -> Tree:
    """The same tree, after repeating the checks of the constructors of all modules in it.

    For trees whose values were set without a constructor: fields of a wrong type, values outside their domains, and
    violated conditions between fields or on a law inside are refused (traced values are not checked). Modules inside
    are checked before those around them, and base classes before derived ones, so that the error names the cause.

    Arguments:
        tree: the tree.

    Raises:
        ValueError: as the constructors of the modules.
    """
    for _, module in reversed(list(modules_inside(tree))):
        for kind in reversed(type(module).__mro__):
            if "__check_init__" in kind.__dict__:
                kind.__dict__["__check_init__"](module)
    return tree


def get(tree: object, path: str) -> PyTree:
    """The value at a path such as `"damper.terms.0.rate"`.

    Arguments:
        tree: a law, a vehicle, or containers of them.
        path: names and indices joined by dots.

    Raises:
        LookupError: there is nothing at this path.
    """
    whole = tree
    for part in path.split(".") if path else []:
        try:
            if isinstance(tree, tuple | list):
                tree = tree[int(part)]
            else:
                tree = tree[part] if isinstance(tree, dict) else getattr(tree, part)
        except (AttributeError, LookupError, ValueError):
            paths = [p.path for p in parameters(whole)]
            raise LookupError(f"Nothing is at the path {path!r}: {_nearest(paths, path)}") from None
    return tree


def with_values(tree: Tree, values: Mapping[str, object]) -> Tree:
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


def replace(tree: Tree, values: Mapping[str, object]) -> Tree:
    """The same tree with other values at the given paths (last parts and patterns as in `free_parameters`).

    Values outside their domain are refused, and so are all values that a constructor refuses: violated conditions
    between several parameters, or of a wrapper on the law inside (see `checked`); and two values of one parameter.

    Arguments:
        tree: the tree.
        values: new values by path, in the units of the parameters; also of commands, by their names.

    >>> from jaxdamp.dampers import Linear
    >>> float(replace(Linear(1500.0), {"rate": 2000.0}).rate)
    2000.0
    """
    chosen = named_parameters(tree, values)
    by_path: dict[str, object] = {}
    named: dict[str, str] = {}
    for name, value in values.items():
        for path in match_parameters(chosen, [name]):
            if path in named:
                both = f"{named[path]!r} and {name!r}, which both name {path}"
                _checks.refuse("values", "name each parameter once", both, "Write the paths of all of them.")
            named[path], by_path[path] = name, as_float(value, name)
    return checked(with_values(tree, by_path))


def named_parameters(tree: object, names: Iterable[str]) -> list[Parameter]:
    """All parameters, and those commands (coil currents, clicks) whose own name, without `*`, ends one of the names.

    Arguments:
        tree: a law, a vehicle or any module.
        names: names and patterns, as in `match_paths`.

    >>> from jaxdamp.dampers import Linear, Scheduled
    >>> law = 2.0 * Scheduled((Linear(900.0), Linear(1500.0)), levels=[0.0, 1.0], command=0.5)
    >>> [[p.path for p in named_parameters(law, [name])][-2] for name in ("*.command", "law.*")]
    ['law.command', 'law.laws.1.rate']
    """
    every = parameters(tree, commands=True)
    paths = [p.path for p in every]
    hits = [matching(paths, name) for name in names if _may_name_commands(name)]
    named = set(itertools.chain(*hits)) if all(hits) else set(paths)  # all are offered in place of a wrong name
    return [p for p in every if not p.command or p.path in named]


def _may_name_commands(name: str) -> bool:
    return "*" not in name.rpartition(".")[2]


def match_parameters(every: Sequence[Parameter], names: Sequence[str]) -> list[str]:
    """The paths that names and patterns stand for (`match_paths`), those of commands only by their own name.

    Arguments:
        every: of `named_parameters`.
        names: names and patterns.
    """
    hits = [match_paths([p.path for p in every if not p.command or _may_name_commands(name)], [name]) for name in names]
    return [p.path for p in every if any(p.path in paths for paths in hits)]


def match_paths(paths: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The known paths that names and patterns stand for.

    A name is a whole path, or the last parts of paths if no path is equal to it. In a pattern a `*` stands for text
    without a dot, `**` for any text: `"guides.*.stiffness"` is the stiffness of every guide, `"guides.**.stiffness"`
    also that of laws inside the guides, `"damper.**"` everything in the damper. A pattern without a dot, such as
    `"*_rate"`, is compared with the last part of every path.

    Arguments:
        paths: all paths.
        patterns: names, last parts of names, or patterns with `*` and `**`.

    Raises:
        ValueError: a name or pattern that fits no path; the message names the nearest ones.

    >>> paths = ["damper.law.rebound_rate", "damper.lag_time", "mass"]
    >>> match_paths(paths, ["*_rate"]), match_paths(paths, ["damper.*"]), match_paths(paths, ["damper.**"])
    (['damper.law.rebound_rate'], ['damper.lag_time'], ['damper.law.rebound_rate', 'damper.lag_time'])
    """
    chosen = []
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        hits = matching(paths, pattern)
        if not hits:
            raise ValueError(f"No parameter is named {pattern!r}: {_nearest(paths, pattern)}")
        chosen += [p for p in hits if p not in chosen]
    return [p for p in paths if p in chosen]


def matching(paths: Sequence[str], pattern: str) -> list[str]:
    """The known paths that one name or pattern stands for, as in `match_paths`; none if there is no such path.

    Arguments:
        paths: all paths.
        pattern: a name, last parts of a name, or a pattern.
    """
    exact = re.compile(expression(pattern))
    whole = [] if "*" in pattern and "." not in pattern else [path for path in paths if exact.fullmatch(path)]
    inside = re.compile(rf"(?:.*\.)?{expression(pattern)}")
    return whole or [path for path in paths if inside.fullmatch(path)]


def expression(pattern: str) -> str:
    """The regular expression of a pattern, with a group for the text that each `*` or `**` stands for."""
    groups = {"*": r"([^.]*)", "**": "(.*)", "**.": r"((?:.*\.)?)"}  # the last: any number of parts, also none
    pieces = re.split(r"((?<![^.])\*\*\.|\*\*|\*)", pattern)
    return "".join(groups.get(piece) or re.escape(piece) for piece in pieces)


def _nearest(paths: Sequence[str], pattern: str) -> str:
    """What could be meant by a name or pattern that fits no path."""
    every = f"The parameters are {', '.join(paths)}."
    if "*" not in pattern:
        near = get_close_matches(pattern, list(paths) + [p.rsplit(".", 1)[-1] for p in paths], 1)
        return (f"did you mean {near[0]!r}? " if near else "") + every
    across = re.sub(r"\*+", "**", pattern)
    if across != pattern and (deeper := matching(paths, across)):
        return f"a `*` stands for text without a dot. {across!r} would be {listed(deeper)}."
    near = get_close_matches(pattern, paths, 3, 0.3)
    return (f"the nearest are {', '.join(near)}. " if near else "") + every


def listed(paths: Sequence[str], most: int = 6) -> str:
    """Paths in words, the first ones of many.

    Arguments:
        paths: the paths.
        most: how many are written out.
    """
    return ", ".join(paths[:most]) + f" and {len(paths) - most} more" * (len(paths) > most)


def matched_in_words(paths: Sequence[str], **patterns: Iterable[str] | None) -> str:
    """What each pattern with `*` stands for, as in "freeze 'guides.*.stiffness' = guides.0.stiffness"; else empty.

    Arguments:
        paths: all paths.
        patterns: names and patterns by the argument that they were given for; None for none.
    """
    return "; ".join(
        f"{argument} {pattern!r} = {listed(matching(paths, pattern))}"
        for argument, given in patterns.items()
        for pattern in ([given] if isinstance(given, str) else given or ())
        if "*" in pattern
    )


def name_patterns(argument: str, names: object) -> list[str]:
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
        remedy = "Write ['damper.rate'], or a pattern such as ['damper.**_rate']."
        _checks.refuse(argument, "be names of parameters", repr(names), remedy)
    return listed


BY_NAME = {  # what a mapping from names is to be, and how to write it
    "bounds": ("be a mapping of names to limits", "Write for example bounds={'rate': (1000.0, 5000.0)}."),
    "priors": (
        "be a mapping of names to means and standard deviations",
        "Write for example priors={'rebound_rate': (2500.0, 200.0)}.",
    ),
    "tie": (
        "be a mapping of names to names",
        "Write for example tie={'front.damper.**': 'rear.damper.**'}: the front takes the values of the rear.",
    ),
}


def check_by_name(argument: str, given: object) -> None:
    """Refuse what is neither `None` nor a mapping from names or patterns of parameters.

    Arguments:
        argument: "bounds", "priors" or "tie".
        given: its value.
    """
    must, remedy = BY_NAME[argument]
    names = [*given, *(given.values() if argument == "tie" else ())] if isinstance(given, Mapping) else []
    if not isinstance(given, Mapping | None) or not all(isinstance(name, str) for name in names):
        _checks.refuse(argument, must, repr(given), remedy)
