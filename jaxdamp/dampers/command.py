"""Laws that take a command: a voltage, a coil current, the click of an adjuster."""

import dataclasses
from typing import Any

import equinox as eqx

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._types import ScalarLike
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.parameters import as_float, check_invariants, get


def _paths(tree: Any, prefix: str = "") -> list[str]:
    if isinstance(tree, tuple | list):
        return [path for i, item in enumerate(tree) for path in _paths(item, f"{prefix}{i}.")]
    if not isinstance(tree, eqx.Module):
        return []
    found = []
    for field in dataclasses.fields(tree):
        if (field.metadata.get("setting") or {}).get("command"):
            found.append(prefix + field.name)
        else:
            found += _paths(getattr(tree, field.name), f"{prefix}{field.name}.")
    return found


def takes_command(law: AbstractDamper) -> bool:
    """Whether there is a command in the law or in a law inside."""
    return bool(_paths(law))


def with_command(law: AbstractDamper, command: ScalarLike) -> AbstractDamper:
    """The same law at another command, wherever it or a law inside takes one.

    >>> from jaxdamp.dampers import Lag, ModifiedBoucWen
    >>> law = with_command(Lag(ModifiedBoucWen.prototype(), 0.002), 1.5)
    >>> float(law.law.voltage)
    1.5

    Raises:
        ValueError: a law without a command; a command outside its domain.
    """
    check_module("law", law, (AbstractDamper,), "with_command(law, command)")
    paths = _paths(law)
    if not paths:
        remedy = "`ModifiedBoucWen` takes a voltage; `Scheduled` makes any law depend on a command."
        _checks.refuse("law", "take a command", f"{law}, which takes none", remedy)
    value = as_float(command)
    changed = eqx.tree_at(lambda t: [get(t, path) for path in paths], law, [value] * len(paths))
    for path in paths:
        check_invariants(get(changed, path.rpartition(".")[0]))
    return changed
