"""Ties: parameters that share one value, such as those of the front and the rear dampers."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxdamp import _checks
from jaxdamp.parameters._declaration import Parameter
from jaxdamp.parameters._paths import expression, match_paths


EXAMPLE = "Write for example tie={'front.damper.**': 'rear.damper.**'}: the front takes the values of the rear."


def resolve_ties(known: Sequence[Parameter], tie: Mapping[str, str] | None) -> dict[str, str]:
    """The path whose value each tied parameter takes.

    Arguments:
        known: all parameters of the tree.
        tie: names or patterns of the parameters that follow, each with the name or pattern of those they follow; what a
            `*` or `**` stands for must be the same on both sides. A name without `*` may lead several parameters.

    Raises:
        ValueError: names that fit no parameter or no partner; a parameter tied twice or in a circle; partners of
            another unit, shape or domain, or with another value to start from.
    """
    if not isinstance(tie, Mapping | None):
        _checks.refuse("tie", "be a mapping of names to names", repr(tie), EXAMPLE)
    by_path, leaders = {p.path: p for p in known}, {}
    for follower, leader in (tie or {}).items():
        if not isinstance(follower, str) or not isinstance(leader, str):
            _checks.refuse("tie", "be a mapping of names to names", repr(tie), EXAMPLE)
        candidates = match_paths(list(by_path), [leader])
        for path in match_paths(list(by_path), [follower]):
            partner = _partner(path, follower, leader, candidates)
            if partner == path:
                continue
            if leaders.setdefault(path, partner) != partner:
                remedy = f"It is tied to {leaders[path]} already."
                _checks.refuse(f"tie[{follower!r}]", f"tie {path} once", f"tied to {partner} too", remedy)
            _check_alike(f"tie[{follower!r}]", by_path[path], by_path[partner])
    return {path: _last(path, leaders) for path in leaders}


def _wildcards(pattern: str, path: str) -> tuple[str, ...] | None:
    """What each `*` of a pattern stands for in a path that it matches, as a whole or by its last parts."""
    inner = expression(pattern)
    found = re.fullmatch(inner, path) or re.fullmatch(rf"(?:.*\.)?{inner}", path)
    return found and found.groups()


def _partner(path: str, follower: str, leader: str, candidates: Sequence[str]) -> str:
    """The parameter that one of the followers takes its value from."""
    chosen = candidates
    if "*" in leader:
        chosen = [c for c in candidates if _wildcards(leader, c) == _wildcards(follower, path)]
    if len(chosen) != 1:
        found = f"{len(chosen)} of them, {', '.join(chosen)}" if chosen else "none"
        remedy = f"{EXAMPLE} The parameters that {leader!r} names are {', '.join(candidates)}."
        _checks.refuse(f"tie[{follower!r}]", f"name one parameter that {path} takes its value from", found, remedy)
    return chosen[0]


def _check_alike(argument: str, follower: Parameter, leader: Parameter) -> None:
    """Refuse to tie parameters that cannot have one value, or that start from different ones."""

    def kind(p: Parameter) -> str:
        size = "one number" if p.value.ndim == 0 else f"numbers in shape {p.value.shape}"
        return f"{size}, {p.domain.name}" + f" [{p.unit}]" * bool(p.unit)

    if kind(follower) != kind(leader):
        both = f"{follower.path} is {kind(follower)}; {leader.path} is {kind(leader)}"
        _checks.refuse(argument, "tie parameters of one kind", f"of two: {both}")
    values: list[Any] = [_checks.concrete(p.value) for p in (follower, leader)]
    if not any(value is None for value in values) and not np.array_equal(*values):
        both = f"{follower.path} = {values[0]} and {leader.path} = {values[1]}"
        remedy = f"Set them equal first, with `jaxdamp.parameters.replace(..., {{{follower.path!r}: ...}})`."
        _checks.refuse(argument, "tie parameters that start from one value", f"of two: {both}", remedy)


def _last(path: str, leaders: Mapping[str, str]) -> str:
    """The end of a chain of ties."""
    seen = [path]
    while seen[-1] in leaders:
        seen.append(leaders[seen[-1]])
        if seen[-1] in seen[:-1]:
            _checks.refuse("tie", "not lead back to its own start", " -> ".join(seen), EXAMPLE)
    return seen[-1]
