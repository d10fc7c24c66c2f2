"""Wrong guesses of public names, answered with the right one."""

import ast
import inspect
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from types import ModuleType
from typing import NoReturn


GUESSES = {  # what people look for, and where it is
    "jaxdamp.compare": "`jaxdamp.identify.compare`",
    "jaxdamp.fit": "`jaxdamp.identify.fit`",
    "jaxdamp.load": "`jaxdamp.export.from_json(path)` for a law or a vehicle, `jaxdamp.bench.read(paths)` for records",
    "jaxdamp.minimise": "`jaxdamp.tune.minimise`",
    "jaxdamp.minimize": "`jaxdamp.tune.minimise`",
    "jaxdamp.optimize": "`jaxdamp.tune.minimise`",
    "jaxdamp.read": "`jaxdamp.bench.read(paths)`",
    "jaxdamp.save": "`jaxdamp.export.to_json(law, path)`",
    "jaxdamp.bench.from_csv": "`jaxdamp.bench.read(paths)`",
    "jaxdamp.bench.load": "`jaxdamp.bench.read(paths)`",
    "jaxdamp.dampers.load": "`jaxdamp.export.from_json(path)`",
    "jaxdamp.export.load": "`jaxdamp.export.from_json(path)`",
    "jaxdamp.export.save": "`jaxdamp.export.to_json(law, path)`",
    "jaxdamp.roads.iso": "`jaxdamp.roads.iso8608`",
    "jaxdamp.roads.load": "`jaxdamp.roads.read_profile(path, speed)`",
    "jaxdamp.report.GOALS": "`vehicle.goal_metrics`",
    "jaxdamp.report.goal_metrics": "`vehicle.goal_metrics`",
    "jaxdamp.tune.optimize": "`jaxdamp.tune.minimise`",
    "jaxdamp.vehicles.load": "`jaxdamp.export.from_json(path)`",
}


def shared_names(package: ModuleType) -> list[str]:
    """What a package imports as itself (`X as X`): for other packages, or only returned; a user writes `__all__`."""
    imports = [node for node in ast.parse(inspect.getsource(package)).body if isinstance(node, ast.ImportFrom)]
    return sorted(alias.name for node in imports for alias in node.names if alias.asname == alias.name)


def answer(module: str, name: str, public: Sequence[str]) -> NoReturn:
    """Say that a module has no such name, and what may be meant.

    Raises:
        AttributeError: always.
    """
    near = get_close_matches(name, public, 1, 0.55)
    meant = GUESSES.get(f"{module}.{name}") or (f"`{module}.{near[0]}`" if near else "")
    remedy = f"; did you mean {meant}?" if meant and not name.startswith("__") else ""
    raise AttributeError(f"module {module!r} has no attribute {name!r}{remedy}")


def answer_guesses(module: str, public: Sequence[str]) -> None:
    """Answer names that a module does not have. Type checkers do not see it, and go on to find wrong names.

    Arguments:
        module: its name.
        public: the names that it has.
    """
    vars(sys.modules[module])["__getattr__"] = lambda name: answer(module, name, public)


class Elsewhere:
    """An attribute of a class that is not there: looked for, it says what to write instead."""

    def __init__(self, remedy: str) -> None:
        self._remedy = remedy

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"type object {owner.__name__!r} has no attribute {name!r}"

    def __get__(self, instance: object, owner: type) -> NoReturn:
        raise AttributeError(f"{self._name}; did you mean {self._remedy}?")
