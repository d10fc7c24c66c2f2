"""Signatures with the types that the code names, each as a full name that Sphinx can link."""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


LEFT_OUT = ("self", "range_note")  # what nobody writes
Definition = ast.ClassDef | ast.expr  # a class, or what a name is short for


class Text(str):
    """A word that a signature prints as it is."""

    def __repr__(self) -> str:
        return str(self)


class Names:
    """The full names behind the names in annotations; `public` has those under which the reference describes a thing.

    Arguments:
        public: names of the reference by where the thing is defined, such as `jaxdamp.bench.reading.read`.
    """

    def __init__(self, public: dict[str, str]) -> None:
        self.public = public
        self.further: dict[str, Definition] = {}  # defined in the library, and not in the reference

    def linked(self, annotation: ast.expr, module: str) -> str:
        """An annotation whose names are full, with the `~` that shows their last word only."""
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            annotation = ast.parse(annotation.value, mode="eval").body
        return ast.unparse(_Full(self, module).visit(deepcopy(annotation)))

    def full(self, name: str, module: str) -> str:
        """The name of the reference, of another library, or of the definition."""
        place, word, definition = origin(module, name)
        if isinstance(definition, ast.Constant):
            return str(definition.value)  # of a package that is imported late
        if isinstance(definition, ast.Call):
            return name  # a type variable
        defined = f"{place}.{word}".lstrip(".")
        if definition is not None and defined not in self.public:
            self.further[defined] = definition
        return self.public.get(defined, defined)

    def signature(self, thing: Any, name: str = "") -> tuple[str, str | None] | None:
        """Arguments and returned type of a function, method or class; None where Python knows no signature."""
        try:
            shape = inspect.signature(thing)
            function, words = _annotations(thing)
        except (TypeError, ValueError, OSError):
            return None
        linked = {name: Text(self.linked(annotation, module)) for name, (annotation, module) in words.items()}
        parameters = [
            p.replace(annotation=linked.get(p.name, p.empty), default=_default(p.default, function, p.name))
            for p in shape.parameters.values()
            if p.name not in LEFT_OUT
        ]
        empty = inspect.Signature.empty
        return str(shape.replace(parameters=parameters, return_annotation=empty)), linked.get("return")


class _Full(ast.NodeTransformer):
    def __init__(self, names: Names, module: str) -> None:
        self.names, self.module = names, module

    def visit_Name(self, node: ast.Name) -> ast.expr:
        full = self.names.full(node.id, self.module)
        return ast.Name(f"~{full}" if "." in full else full)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        return self.visit_Name(ast.Name(ast.unparse(node)))


def origin(module: str, name: str) -> tuple[str, str, Definition | None]:
    """Where a name of a module comes from: module, name there, and its definition if it is in the library."""
    if not module.startswith("jaxdamp"):
        return module, name, None
    head, _, rest = name.partition(".")
    if head in (imports := _imports(module)):
        source, imported = imports[head]
        if not rest:
            return origin(source, imported)
        return origin(f"{source}.{imported}".rstrip("."), rest)
    definition = _definitions(module).get(head)
    return (module if definition is not None else "", name, definition)


@cache
def _imports(module: str) -> dict[str, tuple[str, str]]:
    """Names that a module imports, each with the module it comes from and the name there."""
    found = {}
    for node in ast.walk(_tree(module)):
        if isinstance(node, ast.ImportFrom):
            found |= {alias.asname or alias.name: (node.module or "", alias.name) for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.asname or alias.name: (alias.name, "") for alias in node.names}
    return found


@cache
def _definitions(module: str) -> dict[str, Definition]:
    """Classes and aliases of a module; where type checkers see another one, theirs."""
    found: dict[str, Definition] = {}
    body = _tree(module).body
    guarded = [node for guard in body if isinstance(guard, ast.If) for node in guard.body]
    for node in [*body, *guarded]:
        if isinstance(node, ast.ClassDef):
            found[node.name] = node
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found[node.targets[0].id] = node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            found[node.target.id] = node.value
    return found


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse(Path(str(import_module(module).__file__)).read_text())


def _annotations(thing: Any) -> tuple[ast.FunctionDef | None, dict[str, tuple[ast.expr, str]]]:
    """The function that takes the arguments, if one is written, and the annotations with the module of each."""
    if not isinstance(thing, type):
        function, module = _source(inspect.unwrap(getattr(thing, "__func__", thing)))
        return function, {name: (annotation, module) for name, annotation in _arguments(function)}
    fields: dict[str, tuple[ast.expr, str]] = {}
    written = None
    for kind in reversed([kind for kind in thing.__mro__ if kind.__module__.startswith("jaxdamp")]):
        body = _definitions(kind.__module__).get(kind.__name__)
        for node in body.body if isinstance(body, ast.ClassDef) else ():
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                fields[node.target.id] = node.annotation, kind.__module__
            if isinstance(node, ast.FunctionDef) and node.name == "__init__":
                written = node
                fields |= {name: (annotation, kind.__module__) for name, annotation in _arguments(node)}
    fields.pop("return", None)
    return written, fields


def _source(function: Any) -> tuple[ast.FunctionDef, str]:
    node = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    if not isinstance(node, ast.FunctionDef):
        raise TypeError(function)
    return node, function.__module__


def _arguments(node: ast.FunctionDef) -> Iterator[tuple[str, ast.expr]]:
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
    yield from ((argument.arg, argument.annotation) for argument in every if argument and argument.annotation)
    if node.returns:
        yield "return", node.returns


def _default(value: Any, function: ast.FunctionDef | None, name: str) -> Any:
    """A default as the code writes it; of a field, its value where this is short."""
    if value is inspect.Parameter.empty:
        return value
    if function is not None:
        positional = [*function.args.posonlyargs, *function.args.args]
        given = dict(zip(reversed([a.arg for a in positional]), reversed(function.args.defaults), strict=False))
        given |= {a.arg: d for a, d in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True) if d}
        if name in given:
            return Text(ast.unparse(given[name]))
    plain = isinstance(value, str | int | float | bool | None) or (isinstance(value, tuple) and len(repr(value)) < 40)
    return value if plain and not re.search(r"[<{]", repr(value)) else Text("...")
