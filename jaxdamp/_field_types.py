"""Checks of the fields of a module by their annotations: one number, a vector of numbers, other modules."""

import dataclasses
import functools
import types
import typing
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork
from jaxdamp._types import Number, Vector


_WORDS = {  # abstract classes in words, and what to write
    "AbstractDamper": ("a damper law", "Write a law, such as `dampers.Linear(1500.0)`."),
    "AbstractEngine": ("an engine", "Write an engine, such as `simulation.Adaptive()`."),
    "AbstractLawEngine": ("an engine", "Write an engine, such as `simulation.Adaptive()`."),
    "AbstractRoad": ("a road", "Write a road, such as `roads.iso8608('C', speed=20.0, seed=1)`."),
    "AbstractVehicle": ("a vehicle", "Write a vehicle, such as `vehicles.presets.quarter_car_000()`."),
}


def check_field_types(module: eqx.Module) -> None:
    """Refuse a field whose value does not have the type of its annotation.

    Checked are fields for one number (`Number`), for a vector (`Vector`), and for modules such as laws, bodies and
    corners, also optional or in a tuple. Other annotations are not checked.

    Raises:
        ValueError: a wrong type; the message names the class, the field, the value and the expected type.
    """
    for name, annotation in _annotations(type(module)).items():
        argument, value = f"{type(module).__name__}.{name}", getattr(module, name)
        if annotation is Number:
            if jnp.ndim(value):
                remedy = "One object has one value: `jax.vmap` a function that makes and drives one, or `sweep`."
                _checks.refuse(argument, "be one number", f"an array of shape {jnp.shape(value)}", remedy)
        elif annotation is Vector:
            if jnp.ndim(value) != 1:
                remedy = "Write them in brackets, such as [1.0, 2.0]."
                _checks.refuse(argument, "be numbers in one row", f"an array of shape {jnp.shape(value)}", remedy)
        elif typing.get_origin(annotation) is tuple:
            _checks.instance(argument, value, (tuple, list), "be a tuple", "Write `(one,)` or `(one, other)`.")
            for index, item in enumerate(value):
                check_module(f"{argument}[{index}]", item, typing.get_args(annotation)[:1])
        else:
            check_module(argument, value, typing.get_args(annotation) or (annotation,))


def check_module(argument: str, value: object, kinds: tuple[type, ...], call: str = "") -> None:
    """Refuse anything that is not one of these modules (`NoneType` among them means optional).

    Arguments:
        argument: its name.
        value: what came.
        kinds: classes of modules.
        call: how the function is called, such as `"simulate(vehicle, road)"`, for arguments in the wrong order.
    """
    refuse_fork()
    if isinstance(value, kinds):
        return
    wanted = [kind for kind in kinds if kind is not types.NoneType]
    words = [_WORDS.get(kind.__name__, (f"a {kind.__name__}", "")) for kind in wanted]
    remedy = " ".join(example for _, example in words if example)
    if isinstance(value, type) and issubclass(value, tuple(wanted)):
        remedy = f"Make one of it: `{value.__name__}(...)`."
    elif isinstance(value, int | float) and wanted[0].__name__ == "AbstractDamper":
        remedy = f"If a linear damper is meant, write `dampers.Linear({float(value)})`."
    remedy = f"The call is `{call}`. {remedy}" if call else remedy
    _checks.refuse(argument, f"be {' or '.join(name for name, _ in words)}", _checks.described(value), remedy)


@functools.cache
def _annotations(kind: type) -> dict[str, Any]:
    """The annotations to check of a class, by field."""
    try:
        hints = typing.get_type_hints(kind)
    except NameError:  # names that exist for type checkers only
        hints = {field.name: field.type for field in dataclasses.fields(kind)}
    return {field.name: hints[field.name] for field in dataclasses.fields(kind) if _is_checked(hints[field.name])}


def _is_checked(annotation: object) -> bool:
    if annotation is Number or annotation is Vector:
        return True
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is tuple:
        return len(inside) == 2 and inside[1] is Ellipsis and _is_module(inside[0])
    if origin in (types.UnionType, typing.Union):
        return any(map(_is_module, inside)) and all(_is_module(kind) or kind is types.NoneType for kind in inside)
    return _is_module(annotation)


def _is_module(annotation: object) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, eqx.Module)
