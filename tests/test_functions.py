"""No function is long or tangled: what a reader must hold in mind at once has limits."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1] / "jaxdamp"
MOST_LINES = 60  # of a function, without its docstring
MOST_BRANCHES = 15  # cyclomatic complexity: ways through a function
STILL_ABOVE = {"identify": 5}  # functions of packages that are being rewritten; never more
Function = ast.FunctionDef | ast.AsyncFunctionDef
BRANCHES = (ast.If, ast.IfExp, ast.For, ast.AsyncFor, ast.While, ast.ExceptHandler, ast.Assert, ast.match_case)


def branches(node: ast.AST) -> int:
    """Branches, loops, `and`s and `or`s, and comprehensions with their conditions, in functions inside too."""
    total = 0
    for inner in ast.walk(node):
        if isinstance(inner, BRANCHES):
            total += 1
        elif isinstance(inner, ast.BoolOp):
            total += len(inner.values) - 1
        elif isinstance(inner, ast.comprehension):
            total += 1 + len(inner.ifs)
    return total


def lines(function: Function) -> int:
    """Lines of the body."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return (function.end_lineno or 0) - body[0].lineno + 1 if body else 0


def faults(source: str) -> Iterator[str]:
    """The functions that are too long, or have too many branches."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, Function):
            if lines(node) > MOST_LINES:
                yield f"{node.name} has {lines(node)} lines"
            if 1 + branches(node) > MOST_BRANCHES:
                yield f"{node.name} has a complexity of {1 + branches(node)}"


FILES = sorted(ROOT.rglob("*.py"))


@pytest.mark.parametrize("package", sorted({path.relative_to(ROOT).parts[0] for path in FILES}))
def test_functions_are_short_and_plain(package):
    files = [path for path in FILES if path.relative_to(ROOT).parts[0] == package]
    found = [f"{path.relative_to(ROOT)}: {fault}" for path in files for fault in faults(path.read_text("utf-8"))]
    assert len(found) <= STILL_ABOVE.get(package, 0), "\n".join(found)


def test_long_and_tangled_functions_are_found():
    long = "def f():\n" + "    g()\n" * (MOST_LINES + 1)
    tangled = "def f(a):\n    def g():\n        return [x for x in a if x and " + " or ".join("a" * 14) + "]\n"
    assert [*faults(long)] == ["f has 61 lines"]
    assert [fault.split()[0] for fault in faults(tangled)] == ["f", "g"]
    assert not [*faults('def f():\n    """Says\n    much.\n    """\n    return 1\n')]
