"""The storeys of the package: imports only go down, and a package is entered by its front door."""

import ast
import functools
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1] / "jaxdamp"

STOREYS = [
    {"parameters", "solve", "configuration", "codegen", "blocks"},  # and every private module `_*.py` at the top
    {"dampers", "roads", "metrics"},
    {"vehicles", "rig"},
    {"control"},
    {"simulation", "bench"},
    {"identify", "tune", "sweeps"},
    {"plots", "export"},
    {"report"},
    {"cli", "testing", "__main__"},
]
TOP = len(STOREYS) - 1
# A result draws itself: `.plot()` loads the plots when it is called.
DRAWS_ITSELF = {(own, "plots") for own in ("metrics", "rig", "roads", "vehicles", *STOREYS[4], *STOREYS[5])}
DRAWS_ITSELF |= {("_results", "plots"), ("_results", "report")}  # and writes itself: `.report(path)`
# Known only to someone who asks for them: importing the package loads none.
LATE = [
    "matplotlib",
    "optax",
    "xarray",
    "pint",
    "typer",
    "rich",
    "pandas",
    "scipy.optimize",
    "scipy.signal",
    "scipy.io",
]


WITH_IMPORTS = ast.stmt | ast.excepthandler | ast.match_case  # no expression has one


def storey(part: str) -> int:
    """The storey of a module or package at the top of jaxdamp."""
    if part.startswith("_") and part != "__main__":
        return 0
    found = [i for i, parts in enumerate(STOREYS) if part in parts]
    assert found, f"jaxdamp.{part} has no storey: put it into the table of tests/test_storeys.py"
    return found[0]


def imported_modules(source: str, package: list[str]) -> Iterator[tuple[list[str], bool]]:
    """Every import of a source text inside jaxdamp: the parts of its dotted name, and whether a function does it."""
    waiting: list[tuple[ast.AST, bool]] = [(ast.parse(source), False)]
    while waiting:
        node, late = waiting.pop()
        late |= isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        waiting += [(inner, late) for inner in ast.iter_child_nodes(node) if isinstance(inner, WITH_IMPORTS)]
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = above + (node.module.split(".") if node.module else [])
            names = [[*base, alias.name] for alias in node.names]
        else:
            continue
        yield from ((name, late) for name in names if name[0] == "jaxdamp")


@functools.cache
def public_names(part: str) -> set[str] | None:
    """What a package hands to the others, `__all__` and `X as X` of its `__init__`; None of a single module."""
    door = ROOT / part / "__init__.py"
    if not door.exists():
        return None
    names: set[str] = set()
    for node in ast.parse(door.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names |= set(ast.literal_eval(node.value))
        if isinstance(node, ast.ImportFrom):
            names |= {alias.name for alias in node.names if alias.asname == alias.name}
    return names


def goes_behind_the_door(name: list[str], own: str) -> bool:
    """Whether an import from another package names a file of it, or what its `__init__` does not list."""
    if len(name) < 3 or name[1] == own:
        return False
    names = public_names(name[1])
    return names is not None and (len(name) > 3 or name[2] not in names)


def faults(source: str, package: list[str], own: str) -> list[str]:
    """What is wrong with the imports of a source text in the part `own` of jaxdamp."""
    level, found = storey(own), []
    for name, late in imported_modules(source, package):
        other = name[1] if len(name) > 1 else ""
        if not other.startswith("_") and not any(other in parts for parts in STOREYS):
            if level < TOP:
                found.append(f"{own} imports {'.'.join(name)}, the front of the package, which stands above it")
            continue
        if goes_behind_the_door(name, own):
            found.append(f"{own} imports {'.'.join(name)}, past the lists of jaxdamp.{other}")
        if late and (own, other) in DRAWS_ITSELF:
            continue
        if other != own and 0 < level < TOP and storey(other) >= level:
            found.append(f"{own} (storey {level}) imports {other} (storey {storey(other)})")
        if level == 0 and storey(other) > 0:
            found.append(f"{own} (storey 0) imports {other} (storey {storey(other)})")
    return found


FILES = sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_down(path):
    own = path.relative_to(ROOT).parts[0].removesuffix(".py")
    package = ["jaxdamp", *path.relative_to(ROOT).parts[:-1]]
    assert not faults(path.read_text(encoding="utf-8"), package, own)


@pytest.mark.parametrize(
    ("own", "source"),
    [
        ("dampers", "from jaxdamp.rig import respond"),
        ("dampers", "import jaxdamp.vehicles.base"),
        ("dampers", "from jaxdamp import metrics"),
        ("dampers", "from .. import roads"),
        ("dampers", "from ..simulation import run"),
        ("dampers", "from jaxdamp import simulate"),
        ("dampers", "import jaxdamp"),
        ("dampers", "def f():\n    from jaxdamp.export import to_json"),
        ("identify", "from jaxdamp.tune import minimise"),
        ("identify", "from jaxdamp import plots"),
        ("report", "from jaxdamp.cli import app"),
        ("plots", "from jaxdamp.report import Report"),
        ("rig", "from jaxdamp.vehicles import QuarterCar"),
        ("parameters", "from jaxdamp.dampers import Linear"),
        ("_checks", "import jaxdamp.parameters, jaxdamp.roads"),
    ],
)
def test_imports_that_go_up_or_sideways_are_found(own, source):
    assert faults(source, ["jaxdamp", own], own)


@pytest.mark.parametrize(
    ("own", "source"),
    [
        ("identify", "from jaxdamp.dampers.base import AbstractDamper"),
        ("identify", "from jaxdamp.dampers import base"),
        ("identify", "import jaxdamp.dampers.base"),
        ("vehicles", "from ..dampers.lag import Lag"),
        ("cli", "def f():\n    from jaxdamp.plots.rides import ride"),
    ],
)
def test_imports_past_the_front_door_are_found(own, source):
    (fault,) = faults(source, ["jaxdamp", own], own)
    assert "past the lists" in fault


@pytest.mark.parametrize(
    ("own", "source"),
    [
        ("dampers", "import jax\nfrom jaxdamp import _checks\nfrom jaxdamp.parameters import positive"),
        ("dampers", "from jaxdamp.dampers.base import Sum\nfrom .lag import Lag"),
        ("simulation", "from jaxdamp import metrics\nfrom jaxdamp.vehicles import QuarterCar, presets"),
        ("simulation", "import jaxdamp.vehicles\nfrom jaxdamp.rig import quasi_static"),
        ("identify", "def plot():\n    from jaxdamp import plots"),
        ("cli", "import jaxdamp\nfrom jaxdamp.report import Report"),
        ("report", "from jaxdamp import plots\nfrom jaxdamp.export import to_csv"),
        ("_domains", "from jaxdamp import _checks\nfrom jaxdamp.parameters import real"),
    ],
)
def test_imports_that_go_down_are_allowed(own, source):
    assert not faults(source, ["jaxdamp", own], own)


@pytest.mark.parametrize("path", sorted((ROOT / "codegen").glob("*.py")), ids=lambda p: p.name)
def test_the_printer_knows_nothing_of_the_library(path):
    """It could be a package of its own."""
    source = path.read_text(encoding="utf-8")
    assert {name[1] for name, _ in imported_modules(source, ["jaxdamp", "codegen"])} <= {"codegen"}
    words = r"\b(dampers?|vehicles?|laws?|suspension|roads?|rides?|tyres?|strokes?)\b"
    assert not re.search(words, source, re.IGNORECASE)


def test_a_module_without_a_storey_is_found():
    with pytest.raises(AssertionError, match=r"jaxdamp\.attic has no storey"):
        storey("attic")


# ---- importing


def run(code: str) -> str:
    """What a fresh interpreter prints, errors and warnings included."""
    command = [sys.executable, "-W", "error::SyntaxWarning", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT.parent)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def test_importing_prints_nothing_changes_nothing_and_is_light():
    code = f"""
import os, jax
before, environment = dict(jax.config.values), dict(os.environ)
import jaxdamp
import sys, warnings
assert dict(jax.config.values) == before, "a setting of jax changed"
assert not jax.config.jax_enable_x64
assert dict(os.environ) == environment, "the environment changed"
assert not warnings.filters or all("jaxdamp" not in str(f) for f in warnings.filters)
heavy = [name for name in {LATE!r} if name in sys.modules]
assert not heavy, f"loaded with the package: {{heavy}}"
from jax._src import xla_bridge
assert not xla_bridge._backends, "the backend has started"
"""
    assert run(code) == ""


PACKAGES = sorted(
    path.parent.name for path in ROOT.glob("*/__init__.py") if path.read_text(encoding="utf-8").strip()
) + sorted(path.stem for path in ROOT.glob("*.py") if path.stem != "__init__")


@pytest.mark.slow
def test_each_part_can_be_imported_first():
    """Each in its own process; importing `jaxdamp.x` runs the front of the package, so that is replaced by a shell."""
    code = f"""
import importlib, os, sys, types
import diffrax, jax, matplotlib.figure, optimistix  # once for all
for part in {PACKAGES!r}:
    if (child := os.fork()) == 0:
        shell = types.ModuleType("jaxdamp")
        shell.__path__ = [{str(ROOT)!r}]
        sys.modules["jaxdamp"] = shell
        importlib.import_module(f"jaxdamp.{{part}}")
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, part
"""
    assert run(code) == ""
