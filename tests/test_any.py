"""How often a type is `Any`: whatever is known has a type of its own, and the rest does not grow."""

import ast
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1] / "jaxdamp"
MOST = {  # of each package, 0 of the others; lower a number with the count, never raise it
    "bench": 5, "cli": 5, "codegen": 8, "dampers": 2, "export": 3, "identify": 41, "metrics": 5, "parameters": 4,
    "plots": 4, "sweeps": 1, "testing": 1,
}  # fmt: skip
MOST_OUTSIDE = 17  # of the files beside the packages


def count(path: Path) -> int:
    """How often a file writes `Any`, imports apart."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return sum(isinstance(node, ast.Name) and node.id == "Any" for node in ast.walk(tree))


@pytest.mark.parametrize("package", sorted(path.parent.name for path in ROOT.glob("*/__init__.py")))
def test_types_are_known(package: str) -> None:
    assert sum(map(count, (ROOT / package).rglob("*.py"))) <= MOST.get(package, 0)


def test_types_outside_the_packages_are_known() -> None:
    assert sum(map(count, ROOT.glob("*.py"))) <= MOST_OUTSIDE
