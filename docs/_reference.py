"""The API reference, written from the packages and their docstrings when the site is built."""

import ast
import dataclasses
import re
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from _laws import cards
from _signatures import Names

import jaxdamp
from jaxdamp._guesses import shared_names


FURTHER = "What the functions above return, and what other packages of the library use; rarely written by a user."
TYPES = """Types
=====

What the types in signatures are short for, and classes that results hold. A shape stands in quotes behind the type of
an array: ``Float[Array, " time"]`` has one axis, ``""`` none.
"""
GALLERY = """Laws
----

Force over velocity for sines of ±20 mm at 0.5, 1, 2 and 4 Hz, dark to light, with the numbers of the
:doc:`gallery </notebooks/gallery>`, which also shows the effect of each parameter.
"""


def packages() -> list[str]:
    """Names of the public packages, in alphabetical order."""
    return [f"jaxdamp.{module.name}" for module in iter_modules(jaxdamp.__path__) if is_public(module)]


def is_public(module: Any) -> bool:
    """Whether a module of jaxdamp belongs into the reference; the command line has its own help texts."""
    return module.ispkg and not module.name.startswith("_") and module.name != "cli"


def public_names() -> dict[str, str]:
    """Full name in the reference of each class and function, by where it is defined."""
    found: dict[str, str] = {}
    for package in [*packages(), "jaxdamp"]:
        module = import_module(package)
        for name in [*module.__all__, *shared_names(module)]:
            value = getattr(module, name)
            if callable(value) and getattr(value, "__module__", "").startswith("jaxdamp"):
                found.setdefault(f"{value.__module__}.{value.__qualname__}", f"{package}.{name}")
    return found


def write_pages(folder: Path, hysteresis: dict[str, str]) -> None:
    """One page for each package, class and function, the types, and the page that lists all.

    Arguments:
        folder: where the pages go.
        hysteresis: whether the loops of a law differ from a line, by the name of its class.
    """
    folder.mkdir(exist_ok=True)
    names = packages()
    described: dict[int, str] = {}
    for name in [*names, "jaxdamp"]:
        page, members = _page(name, described, hysteresis if name == "jaxdamp.dampers" else {})
        _write(folder / f"{name}.rst", page)
        for member, text in members.items():
            head = [":orphan:", "", member, "=" * len(member), "", f"Of :doc:`{name}`.", ""]  # in no sidebar
            _write(folder / f"{name}.{member}.rst", "\n".join([*head, text]))
    for law in hysteresis:
        _write(folder / f"jaxdamp.dampers.{law}.rst", _law_page(law))
    _write(folder / "laws.txt", _thumbnails(hysteresis))
    _write(folder / "types.rst", "\n".join([TYPES, *_types(NAMES)]))
    summaries = [f"- :doc:`{name} <{name}>`: {_summary(import_module(name))}" for name in names]
    listed = ["   jaxdamp", *(f"   {name}" for name in names), "   types", ""]
    contents = ["", ".. toctree::", "   :hidden:", "", *listed]
    _write(folder / "index.rst", "\n".join(["API reference", "=============", "", *summaries, *contents]))


def _page(name: str, described: dict[int, str], laws: dict[str, str]) -> tuple[str, dict[str, str]]:
    """The page of a package, and what stands on those of its classes and functions."""
    package = import_module(name)
    lines = [name, "=" * len(name), "", f".. automodule:: {name}", "", f".. currentmodule:: {name}", ""]
    if laws:
        lines += [*_gallery(laws), "All names", "-" * 9, ""]
    shared, pages = shared_names(package), {}
    for members in (package.__all__, shared):
        if members is shared and shared:
            lines += ["Results and further parts", "-" * 25, "", FURTHER, ""]
        lines += _list(name, list(members), described, laws)
        for member in sorted(set(members) - set(laws)):
            value = getattr(package, member)
            own = _is_own(value) and id(value) not in described
            text = _member(f"{name}.{member}", value, described)
            if own:
                pages[member] = text
            else:
                lines.append(text)
    return "\n".join(lines), pages


def _list(name: str, members: list[str], described: dict[int, str], laws: dict[str, str]) -> list[str]:
    """The names of a page with their first sentences."""
    package = import_module(name)
    here = [m for m in sorted(members) if _is_own(getattr(package, m)) and id(getattr(package, m)) not in described]
    return [*(f"- :py:obj:`~{name}.{m}`: {_summary(getattr(package, m))}" for m in here if m not in laws), ""]


def _gallery(laws: dict[str, str]) -> list[str]:
    """The table of all laws, each with the link to its page."""
    known, lines = cards()[1], [GALLERY]
    head = ["   * - law", "     - force over velocity", "     - hysteresis", "     - formula"]
    for group in dict.fromkeys(known[law].group for law in laws):
        lines += [group, "~" * len(group), "", ".. list-table::", "   :header-rows: 1", "   :widths: 18 20 12 50", ""]
        lines += head
        for law in (law for law in laws if known[law].group == group):
            lines += [
                f"   * - :doc:`{law} <jaxdamp.dampers.{law}>`",
                f"     - .. image:: ../pictures/laws/{law}_small.png",
            ]
            lines += [f"          :alt: Loops of {law}", f"          :target: jaxdamp.dampers.{law}.html"]
            parts = re.split(r"\\quad|(?<=[,;])(?:\\ )+", known[law].formula)  # between which a line may break
            lines += [f"     - {laws[law]}", f"     - {' '.join(f':math:`{part.strip()}`' for part in parts)}"]
        lines.append("")
    hidden = [".. toctree::", "   :hidden:", "", *(f"   jaxdamp.dampers.{law}" for law in sorted(laws)), ""]
    return [*lines, *hidden]


def _thumbnails(laws: dict[str, str]) -> str:
    """A small picture of each law with the link to its page, for the home page."""
    rows = (
        f".. image:: pictures/laws/{law}_small.png\n   :alt: {law}\n   :width: 92px\n"
        f"   :target: reference/jaxdamp.dampers.{law}.html\n"
        for law in laws
    )
    return "\n".join(rows)


def _law_page(law: str) -> str:
    """Formula, loops and interface of a law."""
    card = cards()[1][law]
    lines = [law, "=" * len(law), "", ".. math::", "", f"   {card.formula}", ""]
    lines += [f".. image:: ../pictures/laws/{law}.png", f"   :alt: Force of {law} over velocity and over stroke", ""]
    lines += ["The loops are those of", "", ".. code-block:: python", "", f"   {card.code}", ""]
    return "\n".join([*lines, _member(f"jaxdamp.dampers.{law}", getattr(jaxdamp.dampers, law), {})])


def _types(names: Names) -> list[str]:
    """What the names in public signatures are short for, and the classes among them."""
    for full in public_names().values():
        package, _, name = full.rpartition(".")
        thing = getattr(import_module(package), name)
        members = vars(thing).items() if isinstance(thing, type) else ()
        for each in [thing, *(member for key, member in members if callable(member) and not key.startswith("_"))]:
            names.signature(each)
    short, classes = [], []
    for name, value in sorted(names.further.items(), key=lambda item: item[0].rpartition(".")[2].lower()):
        module, _, word = name.rpartition(".")
        place = [f".. py:currentmodule:: {module}", ""]
        if not isinstance(value, ast.ClassDef):
            short += [*place, f".. py:type:: {word}", f"   :canonical: {names.linked(value, module)}", ""]
        elif getattr(getattr(import_module(module), word, None), "__module__", "") == module:
            classes += [f".. autoclass:: {name}", ""]
        else:  # for type checkers only
            short += [*place, f".. py:type:: {word}", "", f"   {ast.get_docstring(value)}", ""]
    return [*short, *classes]


def _is_own(value: Any) -> bool:
    """Whether a public name is a class or function of the library."""
    return callable(value) and getattr(value, "__module__", "").startswith("jaxdamp")


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
        return f".. py:data:: {name}\n\n   the same as :py:obj:`{described[id(value)]}`\n"
    described[id(value)] = name
    kind, options = ("autoclass", "   :members:\n") if isinstance(value, type) else ("autofunction", "")
    return f".. {kind}:: {name}\n{options}"


def _summary(thing: Any) -> str:
    """The first line of a docstring, as `process_docstring` prepares it."""
    return _plain((thing.__doc__ or "").strip().splitlines()[:1] or [""])[0]


def process_signature(
    app: Any, what: str, name: str, thing: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str, str | None] | None:
    """Types as the code writes them, which autodoc would spell out."""
    return NAMES.signature(thing) if signature and what in ("function", "method", "class") else None


def _write(path: Path, text: str) -> None:
    """Unchanged files stay as they are, so that the next build need not read them again."""
    if not path.exists() or path.read_text() != text:
        path.write_text(text)


NAMES = Names(public_names())


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
