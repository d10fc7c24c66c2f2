"""The options of a command are the arguments of its functions: none is missing, and help needs no JAX."""

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import pytest

from jaxdamp.cli import application, offers, options, signatures
from jaxdamp.cli.application import COMMANDS
from jaxdamp.cli.options import Call
from jaxdamp.cli.wording import CALLS
from jaxdamp.dampers import Bilinear
from jaxdamp.export import to_json

from .invoking import jaxdamp, refused


CALLED = sorted({leaf.owner for target in COMMANDS.values() for leaf in options.leaves(target)})
LIBRARY = [owner for owner in CALLED if not owner.startswith("cli.")]
CACHED = (signatures.arguments, signatures._statements, signatures._find, options.leaves, application.command)


@pytest.fixture
def rewrite(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, Callable[[str], str]], None]]:
    """Read a module of the package as if its source were another."""
    read = signatures._statements.__wrapped__
    sources: dict[str, str] = {}

    def statements(module: str) -> tuple[ast.stmt, ...]:
        return tuple(ast.parse(sources[module]).body) if module in sources else read(module)

    def change(module: str, edit: Callable[[str], str]) -> None:
        file = signatures.ROOT.joinpath(*module.split(".")[1:]).with_suffix(".py")
        sources[module] = edit(file.read_text(encoding="utf-8"))
        for function in CACHED:
            function.cache_clear()

    monkeypatch.setattr(signatures, "_statements", statements)
    statements.cache_clear = lambda: None  # pyright: ignore[reportFunctionMemberAccess]
    yield change
    monkeypatch.undo()
    for function in CACHED:
        function.cache_clear()


def _with_trim(source: str) -> str:
    source = source.replace("    *,\n    sign:", "    *,\n    trim: float = 0.25,\n    sign:", 1)
    return source.replace("        sign: ", "        trim: share that is cut off. More of it.\n        sign: ", 1)


def test_a_new_argument_of_a_library_function_is_an_option_by_itself(rewrite) -> None:
    assert "--trim" not in jaxdamp("fit", "--help").output
    rewrite("jaxdamp.bench.read", _with_trim)
    for command in ("fit", "bench", "report", "explore"):
        text = " ".join(jaxdamp(command, "--help").output.split())
        assert "--trim <float> Share that is cut off. [default: 0.25]" in text
    read = options.values("cli.fitting.fit", {"trim": 0.5, "sign": None})
    assert options.build("cli.fitting.fit", {("reading", "read", "trim"): 0.5}) and read == {
        ("reading", "read", "trim"): 0.5
    }


def test_objects_of_options_and_typed_keywords_become_options_of_their_own(rewrite) -> None:
    text = '''
from dataclasses import dataclass
from typing import TypedDict, Unpack

@dataclass
class Steps:
    """Steps.

    Arguments:
        low: the low end.
        names: of laws.
    """
    low: float = 0.5
    names: Sequence[str] = ()

class Base(TypedDict, total=False):
    """Base.

    Arguments:
        over: parameters.
    """
    over: Mapping[str, float] | None

class Settings(Base, total=False):
    """All."""
    hold: tuple[float, float]

def preflight(runs, *, steps: Steps = Steps(), engine: Engine = None, **settings: Unpack[Settings]):
    """Do it."""

def laws(screen, *, how: Annotated[Call, "cli.vehicle_words.preflight"]):
    """List."""
'''
    rewrite("jaxdamp.cli.vehicle_words", lambda source: text)
    found = {
        leaf.option: (leaf.path, getattr(how, "metavar", how))
        for leaf, how in options.offered("cli.vehicle_words.laws").items()
    }
    assert found == {
        "low": (("how", "steps", "low"), float),
        "names": (("how", "steps", "names"), "NAME,..."),
        "over": (("how", "over"), "NAME=NUMBER"),
        "hold": (("how", "hold"), "FIRST:SECOND"),
    }
    given = options.values("cli.vehicle_words.laws", {"names": ["a,b"], "over": ["x=1"], "hold": "1:2"})
    call = options.build("cli.vehicle_words.laws", given)["how"]
    assert call == Call("cli.vehicle_words.preflight", {"names": ["a", "b"], "over": {"x": 1.0}, "hold": (1.0, 2.0)})


def test_a_call_puts_what_is_given_into_its_objects() -> None:
    made = Call("cli.benching.bench_command", {"keep_rest": True, "replace": True}).arguments(baseline=None)
    assert set(made) == {"reading", "how", "output", "baseline"} and made["baseline"] is None
    assert made["reading"].keep_rest and made["output"].replace and made["output"].out is None
    assert made["reading"].read == Call("bench.read") and made["how"] == Call("bench.evaluate")


@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_no_option_is_listed_with_its_reason(command: str) -> None:
    target = COMMANDS[command]
    offered = options.offered(target)
    silent = [
        f"{leaf.owner}({leaf.argument.name}: {leaf.argument.kinds})"
        for leaf in options.leaves(target)
        if leaf not in offered and not options.withheld(leaf)
    ]
    assert not silent, f"write how it is written into `offers.WRITTEN`, or why not into NOT_OFFERED: {silent}"
    built = {str(parameter.name): parameter for parameter in application.command(command).params}
    assert all(getattr(built[leaf.option], "help", "").rstrip(".") for leaf in offered)
    names = [leaf.option for leaf in offered]
    assert len(names) == len(set(names)), "two arguments would be the same option: rename one in `offers.NAMES`"


def test_the_declared_lists_name_arguments_that_are_there() -> None:
    for owner, reasons in offers.NOT_OFFERED.items():
        there = {argument.name for argument in signatures.arguments(owner)}
        assert set(reasons) <= there and all(reasons.values()), owner
    names = {leaf.option for target in COMMANDS.values() for leaf in options.leaves(target)}
    python = {leaf.argument.name for target in COMMANDS.values() for leaf in options.leaves(target)}
    assert {key.split()[-1] for key in [*offers.TEXTS, *offers.WRITTEN]} | set(offers.SHORT) | set(
        offers.SHARED
    ) <= names
    assert {key.split()[-1] for key in offers.NAMES} <= python


@pytest.mark.parametrize("owner", LIBRARY)
def test_a_signature_read_from_source_is_the_signature(owner: str) -> None:
    package, _, name = owner.rpartition(".")
    real = inspect.signature(getattr(import_module(f"jaxdamp.{package}"), name)).parameters
    read = {argument.name: argument for argument in signatures.arguments(owner)}
    plain = [name for name, parameter in real.items() if parameter.kind is not inspect.Parameter.VAR_KEYWORD]
    assert list(read)[: len(plain)] == plain and (len(plain) == len(real) or len(read) > len(plain))
    for name in plain:
        default = signatures.REQUIRED if real[name].default is inspect.Parameter.empty else real[name].default
        assert read[name].default in (default, ...), name
        assert read[name].text, name


def test_help_needs_no_jax_and_speaks_no_python() -> None:
    program = "import sys\nfrom jaxdamp.cli import app\n"
    program += "for name in sys.argv[1:]:\n    try:\n        app([name, '--help'], prog_name='jaxdamp')\n"
    program += "    except SystemExit as end:\n        assert end.code == 0, name\n"
    program += "assert 'jax' not in sys.modules, 'JAX was loaded'\n"
    done = subprocess.run([sys.executable, "-c", program, *COMMANDS], text=True, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Usage: ") == len(COMMANDS)
    assert not re.findall(r"`|\blambda\b|\bNone\b|\bTrue\b|\bFalse\b|jaxdamp\.[a-z]+\.|\{\"|as in ", done.stdout)


def test_names_of_before_and_names_of_python_still_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    to_json(Bilinear(2600.0, 1200.0), tmp_path / "law.json")
    jaxdamp("export", "law.json", "--to", "csv", "--file", "first.csv")
    jaxdamp("export", "law.json", "--to", "csv", "--file=first.csv", "--force")
    assert (tmp_path / "first.csv").is_file()
    call = ("tune", "quarter_car_000", "white:C", "--bounds", "rate=3000:4000", "--out", tmp_path / "out")
    assert "must start between 3000 and 4000" in refused(tmp_path, *call)
    assert "Option --limit must read like" in refused(tmp_path, *call[:3], "--limits", "travel")
    assert "Option --law must be a file that is there" in refused(tmp_path, *call[:3], "--start", "none.json")
    shown = jaxdamp("tune", "--help").output
    assert all(alias not in shown for alias in ("--bounds", "--limits", "--force", "--start "))


COMPOSED = (", or fit a law with settings", "add ", "with `jaxdamp")  # of parts that only a run joins


def test_what_the_command_line_says_otherwise_is_still_said_by_the_library():
    package = Path(application.__file__).parents[1]
    trees = (ast.parse(p.read_text(encoding="utf-8")) for p in package.rglob("*.py") if p.name != "wording.py")
    nodes = [node for tree in trees for node in ast.walk(tree)]
    plain = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    filled = [
        "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
        for node in nodes
        if isinstance(node, ast.JoinedStr)
    ]
    said = "\n".join(plain + filled)
    assert not [call for call in CALLS if not call.startswith(COMPOSED) and not re.search(call, said)]


def test_an_option_in_a_unit_without_an_example_says_what_to_add():
    with pytest.raises(ValueError, match=r"`unit` must be one of m/s, s, Hz, N, but is mm.*`OTHER_UNITS`"):
        options.number_in("mm")
