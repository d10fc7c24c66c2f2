"""Every public name has a docstring, so that the API reference has no gaps."""

import inspect
from importlib import import_module
from pkgutil import iter_modules

import pytest

import jaxdamp


PACKAGES = [m.name for m in iter_modules(jaxdamp.__path__) if m.ispkg and not m.name.startswith("_")]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_has_a_docstring(package: str) -> None:
    module = import_module(f"jaxdamp.{package}")
    assert module.__doc__
    undocumented = []
    for name in module.__all__:
        value = getattr(module, name)
        if callable(value) and value.__module__.startswith("jaxdamp"):
            members = vars(value) if isinstance(value, type) else {}
            methods = {f"{name}.{k}": v for k, v in members.items() if inspect.isfunction(v) and k == v.__name__}
            public = {name: value} | {k: v for k, v in methods.items() if "._" not in k}
            undocumented += [k for k, v in public.items() if not inspect.getdoc(v)]
    assert not undocumented, f"without a docstring: {', '.join(undocumented)}"
