"""The API reference, written from the packages and their docstrings when the site is built."""

import dataclasses
import re
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

import jaxdamp
from jaxdamp._guesses import shared_names


FURTHER = "What the functions above return, and what other packages of the library use; rarely written by a user."


def packages() -> list[str]:
    """Names of the public packages, in alphabetical order."""
    return [f"jaxdamp.{module.name}" for module in iter_modules(jaxdamp.__path__) if is_public(module)]


def is_public(module: Any) -> bool:
    """Whether a module of jaxdamp belongs into the reference; the command line has its own help texts."""
    return module.ispkg and not module.name.startswith("_") and module.name != "cli"


def write_pages(folder: Path) -> None:
    """One page for each package, and the page that lists them."""
    folder.mkdir(exist_ok=True)
    names = packages()
    described: dict[int, str] = {}
    for name in [*names, "jaxdamp"]:
        _write(folder / f"{name}.rst", _page(name, described))
    summaries = [f"- :doc:`{name} <{name}>`: {_summary(name)}" for name in names]
    contents = ["", ".. toctree::", "   :hidden:", "", "   jaxdamp", *(f"   {name}" for name in names), ""]
    _write(folder / "index.rst", "\n".join(["API reference", "=============", "", *summaries, *contents]))


def _page(name: str, described: dict[int, str]) -> str:
    package = import_module(name)
    heading = [name, "=" * len(name), "", f".. automodule:: {name}", "", f".. currentmodule:: {name}", ""]
    lines = [*heading, *_members(name, package.__all__, described)]
    if shared := shared_names(package):
        lines += ["Results and further parts", "-" * 25, "", FURTHER, "", *_members(name, shared, described)]
    return "\n".join(lines)


def _members(name: str, members: list[str], described: dict[int, str]) -> list[str]:
    package = import_module(name)
    return [_member(f"{name}.{member}", getattr(package, member), described) for member in sorted(members)]


def _member(name: str, value: Any, described: dict[int, str]) -> str:
    """The directive for one public name; an object with two homes is described on the first page."""
    if isinstance(value, ModuleType | str):
        return ""
    if not callable(value):
        contents = (
            f"with the keys {', '.join(f'``{key}``' for key in value)}" if isinstance(value, dict) else f"``{value!r}``"
        )
        return f".. py:data:: {name}\n\n   {contents}\n"
    if not value.__module__.startswith("jaxdamp"):
        return f".. py:data:: {name}\n\n   ``{value.__name__}`` of {value.__module__.split('.')[0]}\n"
    if id(value) in described:
        return f".. py:data:: {name}\n\n   the same as `{described[id(value)]}`\n"
    described[id(value)] = name
    kind, options = ("autoclass", "   :members:\n") if isinstance(value, type) else ("autofunction", "")
    return f".. {kind}:: {name}\n{options}"


def _summary(name: str) -> str:
    return (import_module(name).__doc__ or "").strip().splitlines()[0]


def _write(path: Path, text: str) -> None:
    """Unchanged files stay as they are, so that the next build need not read them again."""
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


def declared(kind: type) -> list[str]:
    """The parameters and settings of a class with unit and meaning, as an `Arguments:` section has them."""
    lines = []
    for field in dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ():
        number = field.metadata.get("parameter") or field.metadata.get("setting")
        if number is not None:
            default = "" if field.default is dataclasses.MISSING else f", default {field.default}"
            lines.append(f"- ``{field.name}`` [{number['unit'] or '1'}]: {number['meaning']}{default}")
    return lines


def skip_member(app: Any, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Fields of named tuples have no docstring of their own; the class describes them."""
    return True if (getattr(thing, "__doc__", None) or "").startswith("Alias for field number") else None


def process_docstring(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text: formulas keep their lines, `|v|` is no markup, parameters are listed."""
    lines[:] = _plain(_formulas(lines))
    if what == "class" and (parameters := declared(thing)):
        lines += ["", "Parameters and settings:", "", *parameters, ""]


def _formulas(lines: list[str]) -> list[str]:
    """Indented lines after an empty line become literal blocks, except below the headings of sections."""
    result: list[str] = []
    inside = section = False
    for previous, line in zip(["", *lines], lines, strict=False):
        if re.fullmatch(r"\w+:", line):
            section = True
        elif line and not line.startswith(" ") and previous == "":
            section = False
        if not line.startswith("    ") and line:
            inside = False
        elif line.startswith("    ") and previous == "" and not section and not inside:
            result += ["::", ""]
            inside = True
        result.append(line)
    return result


def _plain(lines: list[str]) -> list[str]:
    """Bars and stars outside code and literal blocks are themselves."""
    result, literal = [], False
    for line in lines:
        if line == "::":
            literal = True
        elif line and not line.startswith(" "):
            literal = False
        if literal or line.lstrip().startswith((">>>", "...")):
            result.append(line)
        else:
            parts = re.split(r"(`+[^`]*`+)", line)
            result.append("".join(p if p.startswith("`") else re.sub(r"[|*_]", r"\\\g<0>", p) for p in parts))
    return result
