"""The commands of a law and of the laws inside."""

import dataclasses
from typing import Any

import equinox as eqx

from jaxdamp.parameters import get


def command_paths(tree: Any, prefix: str = "") -> list[str]:
    """Paths of the commands in a law and in the laws inside.

    Arguments:
        tree: a law, a vehicle or another module.
        prefix: put before each path.
    """
    if isinstance(tree, tuple | list):
        return [path for i, item in enumerate(tree) for path in command_paths(item, f"{prefix}{i}.")]
    if not isinstance(tree, eqx.Module):
        return []
    paths = []
    for field in dataclasses.fields(tree):
        if (field.metadata.get("setting") or {}).get("command"):
            paths.append(prefix + field.name)
        else:
            paths += command_paths(getattr(tree, field.name), f"{prefix}{field.name}.")
    return paths


def commands_of(law: eqx.Module) -> list[float]:
    """The commands that a law and the laws inside are at, each once."""
    return sorted({float(get(law, path)) for path in command_paths(law)})
