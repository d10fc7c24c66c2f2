"""Checks of modules: types of fields, domains, and conditions between fields."""

import dataclasses
from typing import TypeVar

import equinox as eqx
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._traced import behind
from jaxdamp.parameters._declaration import Module, domain_of, modules_inside, readable


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
