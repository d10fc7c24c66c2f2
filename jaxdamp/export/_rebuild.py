"""Modules as plain dictionaries of a file, and back."""

import dataclasses
import inspect
import json
import sys

import equinox as eqx
import jax
import numpy as np
from jax.tree_util import Partial
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._tables import Contents
from jaxdamp._types import Number
from jaxdamp.dampers import UNITS, AbstractDamper, FittedRange, StandardError, with_fitted_range, with_standard_errors
from jaxdamp.parameters import as_float


FITTED_TO, STANDARD_ERRORS = "fitted_to", "standard_errors"  # what a law has beside its fields
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


def known_functions() -> Contents:
    """The functions of the roads of this package, of which a road can hold one, by name."""
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("jaxdamp.roads.")]
    functions = [f for module in modules for f in vars(module).values() if inspect.isfunction(f)]
    return {f.__name__: f for f in functions if f.__module__.startswith("jaxdamp.roads.")}


def declared(field: dataclasses.Field) -> Contents | None:
    """The declaration of a field, if it is a parameter or a setting."""
    return field.metadata.get("parameter") or field.metadata.get("setting")


def own_fields(module: eqx.Module | type[eqx.Module]) -> list[dataclasses.Field]:
    """All fields except the note of the fitted range, which all laws have."""
    return [field for field in dataclasses.fields(module) if field.name != "range_note"]


def plain_module(module: eqx.Module) -> Contents:
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
    result: Contents = {"class": name}
    for field in own_fields(module):
        value, where, number = getattr(module, field.name), f"{name}.{field.name}", declared(field)
        result[field.name] = _plain(value, where) if number is None else _quantity(value, number["unit"], where)
    covered = module.fitted_to if isinstance(module, AbstractDamper) else None
    if covered is not None:
        result[FITTED_TO] = {q.name: {"value": list(q.limits), "unit": q.unit} for q in covered.known()}
    if isinstance(module, AbstractDamper) and module.standard_errors:
        result[STANDARD_ERRORS] = {
            e.name: {"value": e.value if np.isfinite(e.value) else None, "unit": e.unit, "identified": e.identified}
            for e in module.standard_errors
        }
    return result


def _plain(value: object, where: str) -> object:
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


def _plain_function(value: Partial, where: str) -> Contents:
    """A function of this package with its fixed arguments."""
    name = getattr(value.func, "__name__", "")
    if value.args or known_functions().get(name) is not value.func:
        remedy = "A road of samples, `roads.from_profile`, can be written."
        _checks.refuse(where, "be a function of this package", repr(value.func), remedy)
    return {"function": name, "options": {key: _plain(item, f"{where}.{key}") for key, item in value.keywords.items()}}


def _quantity(value: object, unit: str | None, where: str) -> Contents:
    numbers = _checks.concrete(value)
    if numbers is None:
        remedy = "Call `to_json` outside `jax.jit`, `jax.vmap`, `jax.grad`."
        _checks.refuse(where, "have a known value", "traced", remedy)
    if not np.issubdtype(numbers.dtype, np.floating):
        _checks.refuse(where, "hold floating-point numbers", f"of type {numbers.dtype}")
    _checks.finite(where, numbers)
    return {"value": numbers.tolist()} | ({} if unit is None else {"unit": unit})


def rebuilt(plain: object, where: str) -> PyTree:
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
    notes = {key: plain[key] for key in (FITTED_TO, STANDARD_ERRORS) if is_law and key in plain}
    given = {key: value for key, value in plain.items() if key not in notes}
    _same_names(name, ["class", *(f.name for f in fields)], {f.name: None for f in later} | given)
    return _filled(object.__new__(kind), given, notes)


def _filled(module: PyTree, given: Contents, notes: Contents) -> PyTree:
    """An empty module with the values of a file; fields that it does not give have their default."""
    name, fields = type(module).__name__, own_fields(type(module))
    for field in fields:
        here, number = f"{name}.{field.name}", declared(field)
        value: PyTree = field.default
        if field.name in given:
            plain = given[field.name]
            value = _value(plain, here) if number is None else _number(plain, number["unit"], here)
        if field.type is Number and np.ndim(value):
            _checks.refuse(here, "be one number", value)
        object.__setattr__(module, field.name, value)
    if not isinstance(module, AbstractDamper):
        return module
    object.__setattr__(module, "range_note", type(module).range_note)
    covered = _fitted_to(notes.get(FITTED_TO), name)
    module = module if covered is None else with_fitted_range(module, covered)
    return with_standard_errors(module, _errors(notes[STANDARD_ERRORS], name)) if STANDARD_ERRORS in notes else module


def _class_named(name: str, where: str) -> type:
    """The class of the library, or of the caller, that a file names."""
    classes = known_classes()
    if name not in classes:
        near = _checks.nearest(name, sorted(classes))
        hint = f"Did you mean {near!r}? " if near else ""
        remedy = f"{hint}Import the module of your own classes first."
        _checks.refuse(where, "be of a class that is known", repr(name), remedy)
    return classes[name]


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


def _errors(plain: object, owner: str) -> list[StandardError]:
    """The standard errors of a law, as `plain_module` writes them."""
    must = 'be written as {"rate": {"value": ..., "unit": "...", "identified": true}, ...}'
    where, errors = f"{owner}.{STANDARD_ERRORS}", []
    for name, error in plain.items() if isinstance(plain, dict) else [("", plain)]:
        if not isinstance(error, dict) or error.keys() != {"value", "unit", "identified"}:
            _checks.refuse(where, must, json.dumps(plain)[:80])
        value, unit, identified = error["value"], error["unit"], error["identified"]
        positive = value is None or (isinstance(value, int | float) and value >= 0)
        if not (positive and isinstance(unit, str) and isinstance(identified, bool)):
            _checks.refuse(f"{where}.{name}", must, json.dumps(error)[:80])
        errors.append(StandardError(name, float("inf") if value is None else float(value), unit, identified))
    return errors


def _value(plain: object, where: str) -> object:
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


def _same_names(owner: str, expected: list[str], plain: Contents) -> None:
    missing = [name for name in expected if name not in plain]
    extra = [name for name in plain if name not in expected]
    if missing or extra:
        faults = [f"lacks {', '.join(missing)}"] * bool(missing) + [f"has {', '.join(extra)} too many"] * bool(extra)
        _checks.refuse(owner, f"hold {', '.join(expected)}", " and ".join(faults))
