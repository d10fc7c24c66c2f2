"""Modules from the plain dictionaries of a file."""

import dataclasses
import json
from typing import Any

import jax
import numpy as np
from jax.tree_util import Partial

from jaxdamp import _checks
from jaxdamp._types import Number
from jaxdamp.dampers import UNITS, AbstractDamper, FittedRange, with_fitted_range
from jaxdamp.export._plain import FITTED_TO, declared, known_classes, known_functions, own_fields
from jaxdamp.parameters import as_float


def rebuilt(plain: object, where: str) -> Any:
    """The module that `plain_module` wrote, unchecked.

    Raises:
        ValueError: another form, an unknown class, fields missing or too many, numbers of another unit or form.
    """
    if not isinstance(plain, dict) or not isinstance(plain.get("class"), str):
        _checks.refuse(where, 'be written as {"class": "...", ...}', json.dumps(plain)[:80])
    name = plain["class"]
    kind = _class_named(name, where)
    fields = own_fields(kind)
    # fields that were added to a class after the file was written get their default
    later = [f for f in fields if declared(f) is None and f.default is not dataclasses.MISSING]
    is_law = issubclass(kind, AbstractDamper)
    given = {key: value for key, value in plain.items() if not (is_law and key == FITTED_TO)}
    _same_names(name, ["class", *(f.name for f in fields)], {f.name: None for f in later} | given)
    return _filled(object.__new__(kind), given, plain.get(FITTED_TO) if is_law else None)


def _filled(module: Any, given: dict[str, Any], fitted_to: Any) -> Any:
    """An empty module with the values of a file; fields that it does not give have their default."""
    name, fields = type(module).__name__, own_fields(type(module))
    for field in fields:
        here = f"{name}.{field.name}"
        value: Any = _of_field(field, given[field.name], here) if field.name in given else field.default
        if field.type is Number and np.ndim(value):
            _checks.refuse(here, "be one number", value)
        object.__setattr__(module, field.name, value)
    if not isinstance(module, AbstractDamper):
        return module
    object.__setattr__(module, "range_note", type(module).range_note)
    covered = _fitted_to(fitted_to, name)
    return module if covered is None else with_fitted_range(module, covered)


def _class_named(name: str, where: str) -> type:
    """The class of the library, or of the caller, that a file names."""
    classes = known_classes()
    if name not in classes:
        near = _checks.nearest(name, sorted(classes))
        hint = f"Did you mean {near!r}? " if near else ""
        remedy = f"{hint}Import the module of your own classes first."
        _checks.refuse(where, "be of a class that is known", repr(name), remedy)
    return classes[name]


def _of_field(field: dataclasses.Field, plain: Any, where: str) -> Any:
    """The value of a field as it is written."""
    number = declared(field)
    return _value(plain, where) if number is None else _number(plain, number["unit"], where)


def _fitted_to(plain: object, owner: str) -> FittedRange | None:
    """The range of a law, as `plain_module` writes it."""
    if plain is None:
        return None
    where = f"{owner}.{FITTED_TO}"
    if not isinstance(plain, dict):
        must = 'be written as {"velocity": {"value": [...], "unit": "m/s"}, ...}'
        _checks.refuse(where, must, json.dumps(plain)[:80])
    limits: dict[str, tuple[float, float]] = {}
    for name, quantity in plain.items():
        _checks.one_of(where, name, UNITS)
        if _number(quantity, UNITS[name], f"{where}.{name}").shape != (2,):
            _checks.refuse(f"{where}.{name}", "be the lowest and the highest value", json.dumps(quantity)[:80])
        low, high = quantity["value"]
        limits[name] = float(low), float(high)
    return FittedRange(**limits)


def _value(plain: object, where: str) -> Any:
    if isinstance(plain, list):
        return tuple(_value(item, f"{where}[{i}]") for i, item in enumerate(plain))
    if not isinstance(plain, dict):
        return plain
    if "value" in plain:
        return _number(plain, None, where)
    if plain.keys() == {"entries"} and isinstance(plain["entries"], dict):
        return {key: _value(item, f"{where}[{key!r}]") for key, item in plain["entries"].items()}
    if plain.keys() == {"function", "options"} and isinstance(plain["options"], dict):
        functions = known_functions()
        _checks.one_of(f"{where}.function", plain["function"], functions)
        options = {key: _value(item, f"{where}.{key}") for key, item in plain["options"].items()}
        return Partial(functions[plain["function"]], **options)
    return rebuilt(plain, where)


def _number(plain: object, unit: str | None, where: str) -> jax.Array:
    shown = {"value": "..."} | ({} if unit is None else {"unit": unit})
    if not isinstance(plain, dict) or plain.keys() != shown.keys():
        _checks.refuse(where, f"be written as {json.dumps(shown)}", json.dumps(plain)[:80])
    if unit is not None and plain["unit"] != unit:
        _checks.refuse(where, f"be in {unit!r}", f"in {plain['unit']!r}", "Convert the number.")
    try:
        numbers = np.asarray(plain["value"])
    except ValueError:
        numbers = np.asarray(None)
    if numbers.size and not np.issubdtype(numbers.dtype, np.number):
        _checks.refuse(where, "be a number or a list of numbers", json.dumps(plain["value"])[:80])
    _checks.finite(where, numbers)
    return as_float(numbers)


def _same_names(owner: str, expected: list[str], plain: dict[str, Any]) -> None:
    missing = [name for name in expected if name not in plain]
    extra = [name for name in plain if name not in expected]
    if missing or extra:
        faults = [f"lacks {', '.join(missing)}"] * bool(missing) + [f"has {', '.join(extra)} too many"] * bool(extra)
        _checks.refuse(owner, f"hold {', '.join(expected)}", " and ".join(faults))
