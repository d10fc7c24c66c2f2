"""Every public name has a docstring that mentions every argument, so that the API reference has no gaps."""

import ast
import enum
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Unpack, get_origin

import pytest

import jaxdamp
from jaxdamp._guesses import shared_names
from jaxdamp.cli import signatures
from jaxdamp.dampers import AbstractDamper


PACKAGES = [m.name for m in iter_modules(jaxdamp.__path__) if m.ispkg and not m.name.startswith("_")]
UNITS = {  # of arguments that mean the same wherever they stand
    "dt": "s", "duration": "s", "time": "s", "speed": "m/s", "velocity": "m/s", "velocities": "m/s", "stroke": "m",
    "force": "N", "frequency": "Hz", "sampling_rate": "Hz", "rmse": "N",
}  # fmt: skip


def public(package: str) -> Iterator[tuple[str, Any]]:
    """The functions and classes that a package offers, to users or to other packages."""
    module = import_module(f"jaxdamp.{package}")
    assert module.__doc__
    for name in [*module.__all__, *shared_names(module)]:
        value = getattr(module, name)
        if callable(value) and value.__module__.startswith("jaxdamp"):
            yield name, value


def arguments(value: Any) -> list[str]:
    """The arguments of a function or class, without fields that are declared with unit and meaning."""
    if isinstance(value, type) and (issubclass(value, enum.Enum | Exception | dict) or inspect.isabstract(value)):
        return []
    fields = getattr(value, "__dataclass_fields__", {})
    declared = {name for name, field in fields.items() if {"parameter", "setting"} & set(field.metadata)}
    given = {"range_note"} if isinstance(value, type) and issubclass(value, AbstractDamper) else set()
    given |= {"args", "kwargs"} if getattr(value, "_is_protocol", False) else set()
    return [name for name in inspect.signature(inspect.unwrap(value)).parameters if name not in declared | given]


def documentation(value: Any) -> str:
    """The docstring, of a class with those of the classes that it derives from."""
    if not isinstance(value, type):
        return inspect.getdoc(value) or ""
    return "\n".join(inspect.getdoc(kind) or "" for kind in value.__mro__ if kind.__module__.startswith("jaxdamp"))


def described(name: str, text: str) -> str:
    """What a section says of an argument, `name: words` with its further lines; or that it stands in a sentence."""
    found = re.search(rf"^ *(?:\w+, )*\**{name}(?:, \w+)*: (.*(?:\n {{8,}}.*)*)", text, re.M)
    return found[1] if found else "in a sentence" * bool(re.search(rf"\b{name}\b", text))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_of_a_package_is_in_one_of_its_lists(package: str) -> None:
    """`__all__` holds what a user writes; `X as X` is only returned or used by other packages."""
    module = import_module(f"jaxdamp.{package}")
    listed = [*module.__all__, *shared_names(module)]
    assert len(listed) == len(set(listed)) and all(hasattr(module, name) for name in listed)
    tree = ast.parse(inspect.getsource(module))
    imported = {alias.asname or alias.name for n in tree.body if isinstance(n, ast.ImportFrom) for alias in n.names}
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert imported <= {*listed, *used}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_has_a_docstring(package: str) -> None:
    undocumented = []
    for name, value in public(package):
        members = vars(value) if isinstance(value, type) else {}
        methods = {f"{name}.{k}": v for k, v in members.items() if inspect.isfunction(v) and k == v.__name__}
        names = {name: value} | {k: v for k, v in methods.items() if "._" not in k}
        undocumented += [k for k, v in names.items() if not inspect.getdoc(v)]
    assert not undocumented, f"without a docstring: {', '.join(undocumented)}"


@pytest.mark.parametrize("package", [package for package in PACKAGES if package != "cli"])
def test_every_argument_is_mentioned_with_its_unit(package: str) -> None:
    missing = []
    for name, value in public(package):
        text = documentation(value)
        for argument in arguments(value):
            said = described(argument, text)
            if not said:
                missing.append(f"{name}({argument})")
            unit = UNITS.get(argument, "") if said != "in a sentence" else ""
            if unit and f"[{unit}" not in said and "as in" not in said and "in the unit" not in said:
                missing.append(f"{name}({argument} [{unit}])")
    assert not missing, f"not documented: {', '.join(missing)}"


@pytest.mark.parametrize("package", [package for package in PACKAGES if package != "cli"])
def test_typed_keywords_are_described_with_unit_and_default(package: str) -> None:
    """Those of `**settings: Unpack[Settings]`: by the class, or by the function."""
    missing = []
    for name, value in public(package):
        given = inspect.signature(inspect.unwrap(value)).parameters.values() if inspect.isfunction(value) else ()
        if any(get_origin(p.annotation) is Unpack for p in given):
            keywords = {argument.name: argument for argument in signatures.arguments(f"{package}.{name}")}
            for keyword in keywords.keys() - {p.name for p in given}:
                said, unit = keywords[keyword].text, UNITS.get(keyword, "")
                if not ((not unit or f"[{unit}" in said) if said else f"`{keyword}`" in documentation(value)):
                    missing.append(f"{name}({keyword})")
                if keywords[keyword].default is ...:
                    missing.append(f"default of {name}({keyword})")
    assert not missing, f"not documented: {', '.join(missing)}"
