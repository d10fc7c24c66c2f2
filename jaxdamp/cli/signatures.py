"""Signatures and docstrings of functions and classes, read from their source.

Nothing is imported: the help of a command states the arguments of library functions before JAX is loaded.
"""

import ast
import contextlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias


Arguments: TypeAlias = dict[str, Any]  # of a function or a command, by name
ROOT = Path(__file__).parents[1]
REQUIRED = object()  # the default of an argument without one
_SECTIONS = re.compile(r"^(Arguments|Attributes|Returns|Raises|Yields):\n", re.M)
_ENTRY = re.compile(r"^    ([\w, ]+): (.*(?:\n     .*)*)", re.M)


class Argument(NamedTuple):
    """An argument of a function, or a field of a class of options."""

    name: str  # of the argument
    kinds: tuple[str, ...]  # of its annotation, but for None: "float", or the dotted name of a class of this package
    default: object  # `REQUIRED` without one, an ellipsis if it is an expression
    text: str  # what the docstring says of it
    positional: bool = False  # whether it stands before the star of the signature
    callee: str = ""  # the function or class whose arguments it holds, of `Annotated[Call, "bench.read"]`


@cache
def arguments(target: str) -> tuple[Argument, ...]:
    """The arguments of a function or class; those of `**settings: Unpack[Settings]` are the fields of `Settings`.

    Arguments:
        target: its dotted name inside the package, as it is imported: "bench.read".

    >>> [argument.name for argument in arguments("bench.Steps")][:3]
    ['delay', 'low_pass', 'between']
    """
    module, node = definition(target)
    texts = _texts(ast.get_docstring(node) or "")
    if isinstance(node, ast.ClassDef):
        initial = [part for part in node.body if isinstance(part, ast.FunctionDef) and part.name == "__init__"]
        if not initial:
            fields, stated = {one.name: one for one in _fields(module, node)}, _defaults(module, node.name)
            return tuple(one._replace(default=stated.get(name, one.default)) for name, one in fields.items())
        return tuple(_parameters(module, initial[0], texts))[1:]
    assert isinstance(node, ast.FunctionDef)
    return tuple(_parameters(module, node, texts))


def description(target: str) -> str:
    """What the docstring of a function says before its sections."""
    text = ast.get_docstring(definition(target)[1]) or ""
    return _SECTIONS.split(text)[0].strip()


def definition(target: str) -> tuple[str, ast.FunctionDef | ast.ClassDef]:
    """The definition of a function or class, and the module that holds it.

    Raises:
        LookupError: nothing of this name, or something else.
    """
    package, _, name = target.rpartition(".")
    module, node = _find(f"jaxdamp.{package}".rstrip("."), name)
    if not isinstance(node, ast.FunctionDef | ast.ClassDef):
        raise LookupError(f"{target} is no function or class.")
    return module, node


def options_class(kind: str) -> bool:
    """Whether an annotation names a class of this package whose fields all have defaults, such as `bench.Steps`."""
    try:
        node = definition(kind)[1]
        fields = arguments(kind) if isinstance(node, ast.ClassDef) and not node.name.startswith("Abstract") else ()
    except LookupError:
        return False
    return bool(fields) and all(each.callee or each.default is not REQUIRED for each in fields)


@cache
def _statements(module: str) -> tuple[ast.stmt, ...]:
    path = ROOT.joinpath(*module.split(".")[1:])
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    if not file.is_file():
        raise LookupError(f"There is no module {module}.")
    body = ast.parse(file.read_text(encoding="utf-8")).body
    return tuple(inner for outer in body for inner in (outer.body if isinstance(outer, ast.If) else [outer]))


@cache
def _find(module: str, name: str) -> tuple[str, ast.stmt]:
    """The statement that defines a name of a module, and the module where it stands."""
    for node in _statements(module):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name and not _overloaded(node):
            return module, node
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        if any(isinstance(target, ast.Name) and target.id == name for target in targets):
            return module, node
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("jaxdamp"):
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    return _find(str(node.module), alias.name)
    raise LookupError(f"{module} defines no {name}.")


def _overloaded(node: ast.FunctionDef | ast.ClassDef) -> bool:
    return any(ast.unparse(decorator).split(".")[-1] == "overload" for decorator in node.decorator_list)


def _parameters(module: str, node: ast.FunctionDef, texts: dict[str, str]) -> Iterator[Argument]:
    early, late = [*node.args.posonlyargs, *node.args.args], node.args.kwonlyargs
    required: list[ast.expr | None] = [None] * (len(early) - len(node.args.defaults))
    defaults = [*required, *node.args.defaults, *node.args.kw_defaults]
    for index, (argument, default) in enumerate(zip([*early, *late], defaults, strict=True)):
        made = _argument(module, argument.arg, argument.annotation, default, texts.get(argument.arg, ""))
        yield made._replace(positional=index < len(early))
    keywords = node.args.kwarg and node.args.kwarg.annotation
    if isinstance(keywords, ast.Subscript) and ast.unparse(keywords.value) == "Unpack":
        yield from arguments(f"{module}.{ast.unparse(keywords.slice)}".removeprefix("jaxdamp."))


def _fields(module: str, node: ast.ClassDef) -> Iterator[Argument]:
    """The fields of a class, those of the classes of this package that it derives from first."""
    texts, partial = _texts(ast.get_docstring(node) or ""), any(word.arg == "total" for word in node.keywords)
    for base in node.bases:
        with contextlib.suppress(LookupError):
            inherited = arguments(f"{module}.{ast.unparse(base)}".removeprefix("jaxdamp."))
            yield from (one._replace(text=texts.get(one.name, one.text)) for one in inherited)
    for part in node.body:
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
            made = _argument(module, part.target.id, part.annotation, part.value, texts.get(part.target.id, ""))
            yield made._replace(default=...) if partial and made.default is REQUIRED else made


def _defaults(module: str, kind: str) -> dict[str, object]:
    """The defaults of a class of typed keywords: the table of its module that is annotated with it."""
    tables = [node for node in _statements(module) if isinstance(node, ast.AnnAssign)]
    return next((_items(module, table) for table in tables if ast.unparse(table.annotation) == kind), {})


def _items(module: str, table: ast.stmt) -> dict[str, object]:
    """What a table of defaults holds, those of the tables that it takes up too."""
    if not isinstance(table, ast.AnnAssign) or not isinstance(table.value, ast.Dict):
        return {}
    items: dict[str, object] = {}
    for key, value in zip(table.value.keys, table.value.values, strict=True):
        inner = {} if key else _items(*_find(module, ast.unparse(value)))
        items |= {ast.literal_eval(key): _value(module, value)} if key else inner
    return items


def _argument(
    module: str, name: str, annotation: ast.expr | None, default: ast.expr | None, text: str = ""
) -> Argument:
    callee = ""
    if isinstance(annotation, ast.Subscript) and ast.unparse(annotation.value) == "Annotated":
        assert isinstance(annotation.slice, ast.Tuple)
        callee = ast.literal_eval(annotation.slice.elts[1])
    kinds = () if callee or annotation is None else tuple(dict.fromkeys(_kinds(module, annotation)))
    return Argument(name, kinds, REQUIRED if default is None else _value(module, default), text, callee=callee)


def _kinds(module: str, node: ast.expr) -> Iterator[str]:
    """The alternatives of an annotation, those of aliases of this package too."""
    if isinstance(node, ast.BinOp):
        yield from _kinds(module, node.left)
        yield from _kinds(module, node.right)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield from _kinds(module, ast.parse(node.value, mode="eval").body)
    elif isinstance(node, ast.Name):
        try:
            home, statement = _find(module, node.id)
        except LookupError:  # of another package
            yield node.id
            return
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None:
            yield from _kinds(home, statement.value)
        else:
            yield f"{home}.{node.id}".removeprefix("jaxdamp.")
    elif not (isinstance(node, ast.Constant) and node.value is None):
        yield ast.unparse(node)


def _value(module: str, node: ast.expr) -> object:
    """A default that is a literal or the name of one; otherwise an ellipsis."""
    try:
        if isinstance(node, ast.Name):
            home, statement = _find(module, node.id)
            assert isinstance(statement, ast.Assign | ast.AnnAssign)
            return ... if statement.value is None else _value(home, statement.value)
        return ast.literal_eval(node)
    except (ValueError, LookupError, AssertionError):
        return ...


def _texts(docstring: str) -> dict[str, str]:
    """What the sections on arguments and attributes say of each name."""
    parts = _SECTIONS.split(docstring)
    texts: dict[str, str] = {}
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        if title in ("Arguments", "Attributes"):
            for names, text in _ENTRY.findall(body):
                texts |= dict.fromkeys((name.strip() for name in names.split(",")), " ".join(text.split()))
    return texts
