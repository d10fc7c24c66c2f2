"""Modules as plain dictionaries, ready for JSON.

A module is `{"class": name, field: ...}`, a number or an array `{"value": ..., "unit": ...}`, a mapping
`{"entries": ...}`, a function of this package with arguments `{"function": name, "options": ...}`.
"""

import dataclasses
import inspect
import sys
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.tree_util import Partial

from jaxdamp import _checks
from jaxdamp.dampers import AbstractDamper


FITTED_TO = "fitted_to"
BORROWED = ("equinox", "lineax", "optimistix", "diffrax")  # whose modules are no part of a law, a vehicle or a road


def known_classes() -> dict[str, type[eqx.Module]]:
    """All modules by the name of their class: those of this package first, of others the one defined last."""
    classes: list[type[eqx.Module]] = []
    waiting: list[type[eqx.Module]] = [eqx.Module]
    while waiting:
        subclasses = waiting.pop().__subclasses__()
        waiting += subclasses
        classes += [c for c in subclasses if not inspect.isabstract(c) and c.__module__.split(".")[0] not in BORROWED]
    ours = [c for c in classes if c.__module__.startswith("jaxdamp.")]
    return {c.__name__: c for c in [*classes, *ours] if not c.__name__.startswith("Abstract")}


def known_functions() -> dict[str, Any]:
    """The functions of the roads of this package, of which a road can hold one, by name."""
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("jaxdamp.roads.")]
    functions = [f for module in modules for f in vars(module).values() if inspect.isfunction(f)]
    return {f.__name__: f for f in functions if f.__module__.startswith("jaxdamp.roads.")}


def declared(field: dataclasses.Field) -> dict[str, Any] | None:
    """The declaration of a field, if it is a parameter or a setting."""
    return field.metadata.get("parameter") or field.metadata.get("setting")


def own_fields(module: eqx.Module | type[eqx.Module]) -> list[dataclasses.Field]:
    """All fields except the note of the fitted range, which all laws have."""
    return [field for field in dataclasses.fields(module) if field.name != "range_note"]


def plain_module(module: eqx.Module) -> dict[str, Any]:
    """A module with all modules inside."""
    name = type(module).__name__
    if type(module).__module__.split(".")[0] in BORROWED:
        remedy = (
            "Save its numbers by `equinox.tree_serialise_leaves(path, law)`, and read them into a law made by the same "
            "constructor; `NeuralHysteresis` is a network that can be written."
        )
        must = "be of this package or your own: a module of another package holds functions, which no file does"
        _checks.refuse("module", must, f"a {type(module).__module__.split('.')[0]} {name}", remedy)
    if known_classes().get(name) is not type(module):
        remedy = "Give your class a unique name; after redefining it, create its objects again."
        wrong = f"a {name} that differs from another {name}"
        _checks.refuse("module", "be of a class that can be found by its name", wrong, remedy)
    result: dict[str, Any] = {"class": name}
    for field in own_fields(module):
        value, where, number = getattr(module, field.name), f"{name}.{field.name}", declared(field)
        result[field.name] = _plain(value, where) if number is None else _quantity(value, number["unit"], where)
    covered = module.fitted_to if isinstance(module, AbstractDamper) else None
    if covered is not None:
        result[FITTED_TO] = {q.name: {"value": list(q.limits), "unit": q.unit} for q in covered.known()}
    return result


def _plain(value: object, where: str) -> Any:
    if isinstance(value, eqx.Module) and not isinstance(value, Partial):
        return plain_module(value)
    if type(value) is tuple:
        return [_plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    if type(value) is dict and all(isinstance(key, str) for key in value):
        return {"entries": {key: _plain(item, f"{where}[{key!r}]") for key, item in value.items()}}
    if isinstance(value, Partial):
        return _plain_function(value, where)
    if isinstance(value, jax.Array | np.ndarray):
        return _quantity(value, None, where)
    if isinstance(value, float):
        _checks.finite(where, value)
    if value is None or type(value) in (bool, int, float, str):
        return value
    remedy = "Remove it, or save the parameters with `jaxdamp.parameters`."
    must = "be a law, a number, a word, an array, another module or a tuple of these"
    _checks.refuse(where, must, f"a {type(value).__name__}", remedy)


def _plain_function(value: Partial, where: str) -> dict[str, Any]:
    """A function of this package with its fixed arguments."""
    name = getattr(value.func, "__name__", "")
    if value.args or known_functions().get(name) is not value.func:
        remedy = "A road of samples, `roads.from_profile`, can be written."
        _checks.refuse(where, "be a function of this package", repr(value.func), remedy)
    return {"function": name, "options": {key: _plain(item, f"{where}.{key}") for key, item in value.keywords.items()}}


def _quantity(value: Any, unit: str | None, where: str) -> dict[str, Any]:
    numbers = _known_number(value, where)
    if not np.issubdtype(numbers.dtype, np.floating):
        _checks.refuse(where, "hold floating-point numbers", f"of type {numbers.dtype}")
    _checks.finite(where, numbers)
    return {"value": numbers.tolist()} | ({} if unit is None else {"unit": unit})


def _known_number(value: object, where: str) -> np.ndarray:
    numbers = _checks.concrete(value)
    if numbers is None:
        remedy = "Call `to_json` outside `jax.jit`, `jax.vmap`, `jax.grad`."
        _checks.refuse(where, "have a known value", "traced", remedy)
    return numbers
