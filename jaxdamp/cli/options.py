"""Options of a command, made from the signature and the docstring of its function.

The annotation of an argument says how it is written and read, its default is the default, and the section `Arguments:`
of the docstring is the help. An argument whose type is a class of options becomes an option for each of its fields. An
argument of the type `Annotated[Call, "bench.read"]` becomes an option for each argument of that library function: one
that the function gets is on the command line by itself. `offers` lists what is not taken as it is.
"""

import ast
import contextlib
import functools
import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from jaxdamp import _checks, _unit_registry
from jaxdamp.cli import offers
from jaxdamp.cli.offers import Written
from jaxdamp.cli.signatures import REQUIRED, Argument, Arguments, arguments, options_class
from jaxdamp.cli.words import quantity


PLAIN = {"str": str, "int": int, "float": float, "bool": bool}
PLAIN |= dict.fromkeys(("Path", "os.PathLike[str]", "Sequence[Path]"), Path)
LONGEST = 200  # characters of a first sentence; a longer one ends at its first semicolon
_DICTIONARY = re.compile(r"\{[^{}]*\}")
_PYTHON = re.compile(r"\b(None|True|False|lambda)\b|\bas in `")
_LIMITS = re.compile(r"\{(\w+): \((\w+), ([\w ]+)\)\}")
_UNIT = re.compile(r"\[([^\]\s]+)\]")  # in the text on an argument that is one number
OTHER_UNITS = {"m/s": "72km/h", "s": "5ms", "Hz": "1kHz", "N": "5lbf"}  # examples, by the unit of an option


@dataclass(frozen=True)
class Call:
    """The arguments of a library function that were given as options."""

    target: str  # dotted name of the function inside the package
    given: Arguments = field(default_factory=dict)  # by the name of the argument, also of nested ones

    def arguments(self, **more: object) -> Arguments:
        """All of these, and more, as the function takes them: those of nested options in objects of their classes."""
        values = {**self.given, **more}
        paths = {leaf.argument.name: leaf.path for leaf in _leaves(self.target)}
        return build(self.target, {paths.get(name, (name,)): value for name, value in values.items()})


class Leaf(NamedTuple):
    """An argument that is written as one option."""

    path: tuple[str, ...]  # the names of the arguments that hold it, one inside the other, and its own
    argument: Argument  # with type, default and text
    owner: str  # the function or class whose argument it is

    @property
    def option(self) -> str:
        """The name of the option, with underscores."""
        name = self.argument.name
        return offers.NAMES.get(f"{self.owner} {name}") or offers.NAMES.get(name, name)


def _leaves(target: str, path: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """The arguments of a function, those of nested classes of options one by one, those of called functions not."""
    for argument in arguments(target):
        here = (*path, argument.name)
        if not argument.callee and not _written(argument) and (nested := _nested(argument)):
            yield from _leaves(nested, here)
        else:
            yield Leaf(here, argument, target)


def _nested(argument: Argument) -> str:
    return next((kind for kind in argument.kinds if options_class(kind)), "")


@functools.cache
def leaves(target: str) -> tuple[Leaf, ...]:
    """All that a command could offer: its own arguments, and those of the functions that it calls.

    What a called function must have is the business of the command; so are arguments of the names of its own.
    """
    direct = [leaf for leaf in _leaves(target) if leaf.argument.name != "screen"]
    names = {leaf.option for leaf in direct if not leaf.argument.callee}
    options = []
    for leaf in direct:
        callee = leaf.argument.callee
        called = [inner for inner in _leaves(callee) if inner.argument.default is not REQUIRED] if callee else []
        placed = [inner._replace(path=(*leaf.path, *inner.path)) for inner in called if inner.option not in names]
        options += placed if callee else [leaf]
    return tuple(options)


def offered(target: str) -> dict[Leaf, Written | type]:
    """The options of a command, and how each is written."""
    return {leaf: how for leaf in leaves(target) if not withheld(leaf) and (how := _written(leaf.argument, leaf))}


def withheld(leaf: Leaf) -> str:
    """Why an argument is no option; empty for those that are one."""
    return offers.NOT_OFFERED.get(leaf.owner, {}).get(leaf.argument.name, "")


def _written(argument: Argument, leaf: Leaf | None = None) -> Written | type | None:
    """How the values of an argument are written; None where its type has no words."""
    name, kinds = leaf.option if leaf else offers.NAMES.get(argument.name, argument.name), argument.kinds
    many = [written for kind in kinds for pattern, written in offers.TYPES if re.match(pattern, kind)]
    plain = [PLAIN[kind] for kind in kinds if kind in PLAIN]
    owned = f"{leaf.owner} {name}" if leaf else name
    for key in (owned, name):
        if key in offers.WRITTEN:
            return offers.WRITTEN[key]
    if many:
        return offers.NAMES_OR_NUMBERS if str in plain and "Sequence[float]" in kinds else many[0]
    for kind in (Path, float, int, str, bool):
        if kind in plain:
            return kind
    return None


def parameters(command: str, target: str) -> list[inspect.Parameter]:
    """The options of a command as Typer takes them; what is not given is None."""
    made = []
    for leaf, how in offered(target).items():
        name, argument = leaf.option, leaf.argument
        positional = argument.positional and len(leaf.path) == 1
        default = argument.default
        words: Arguments = {"help": _help(command, name, argument, how)}
        if isinstance(how, Written):
            kind, words["metavar"] = list[str] if how.repeated else str, how.metavar
        elif how is float and (unit := _UNIT.search(argument.text)):
            kind, words["metavar"], words["parser"] = how, "NUMBER[UNIT]", number_in(unit[1])
        else:
            kind = list[Path] if how is Path and "Sequence[Path]" in argument.kinds else how
        if positional:
            words.pop("metavar", None)
            mark = typer.Argument(**words)
        else:
            flag, short = f"--{name.replace('_', '-')}", offers.SHORT.get(name)
            texts = [flag] if kind is not bool else [f"{flag}/--no-{flag[2:]}" if default is True else flag]
            mark = typer.Option(*texts, *([short] if short else []), show_default=False, **words)
        wanted = kind if default is REQUIRED else kind | None
        kinds = inspect.Parameter.KEYWORD_ONLY
        empty = inspect.Parameter.empty if default is REQUIRED else None
        made.append(inspect.Parameter(name, kinds, default=empty, annotation=Annotated[wanted, mark]))
    return made


def values(target: str, given: Mapping[str, object]) -> dict[tuple[str, ...], object]:
    """The values of the options that were given, by the path of each argument."""
    read: dict[tuple[str, ...], object] = {}
    for leaf, how in offered(target).items():
        text = given.get(leaf.option)
        if text not in (None, []):
            read[leaf.path] = how.read(leaf.option, text) if isinstance(how, Written) else text
    return read


def build(target: str, read: Mapping[tuple[str, ...], object]) -> Arguments:
    """The arguments of a function: plain ones, objects of nested classes, and `Call` of what it calls."""
    made: Arguments = {path[0]: value for path, value in read.items() if len(path) == 1}
    for argument in arguments(target):
        inside = {path[1:]: value for path, value in read.items() if path[0] == argument.name and len(path) > 1}
        nested = "" if argument.callee else _nested(argument)
        if argument.callee:
            made[argument.name] = Call(argument.callee, {path[-1]: value for path, value in inside.items()})
        elif nested and (inside or argument.default is REQUIRED):
            module, _, name = nested.rpartition(".")
            made[argument.name] = getattr(import_module(f"jaxdamp.{module}"), name)(**build(nested, inside))
    return made


def number_in(unit: str) -> Callable[[str], float]:
    """The reader of one number in a unit, or in another one that is named.

    >>> number_in("m/s")("20"), number_in("m/s")("72 km/h"), number_in("s")("5ms")
    (20.0, 20.0, 0.005)
    """

    def read(text: str) -> float:
        number, written = quantity(text) or (text, "")
        factor = _unit_registry.ratio(written, unit) if written else 1.0
        with contextlib.suppress(ValueError):
            if factor is not None:
                return float(number) * factor
        raise typer.BadParameter(f"{text!r} is neither a number in {unit} nor one with a unit, such as {example}.")

    if unit not in OTHER_UNITS:
        _checks.refuse("unit", f"be one of {', '.join(OTHER_UNITS)}", unit, "Add an example of it to `OTHER_UNITS`.")
    example = OTHER_UNITS[unit]
    return read


def aliases(command: str, target: str) -> dict[str, str]:
    """Other names of options that work: those of before, and those of the arguments in Python."""
    names = {leaf.argument.name: leaf.option for leaf in offered(target)}
    taken = set(names.values())
    python = {name: option for name, option in names.items() if name != option and name not in taken}
    spelled = {f"--{old.replace('_', '-')}": f"--{new.replace('_', '-')}" for old, new in python.items()}
    return spelled | offers.ALIASES | offers.ALIASES_OF.get(command, {})


def _help(command: str, name: str, argument: Argument, how: Written | type) -> str:
    """The help of an option: the first sentence of what the docstring says, in words of the command line."""
    text = (
        offers.TEXTS.get(f"{command} {name}")
        or offers.TEXTS.get(name)
        or in_words(argument.text or offers.SHARED.get(name, ""))
    )
    example, default = how.example if isinstance(how, Written) else "", argument.default
    if default in (REQUIRED, None, "", (), ...) or isinstance(default, bool):
        shown = ""
    else:
        shown = f" [default: {','.join(map(str, default)) if isinstance(default, tuple | list) else default}]"
    return f"{text}{f' Write {example}.' if example else ''}{shown}"


def in_words(text: str) -> str:
    """The first sentence of a text on an argument, with dictionaries as they are written on the command line.

    >>> in_words('gains of sensors: `{"force": "500 N/V"}`. More.')
    'Gains of sensors: force=500 N/V.'
    """
    text = _LIMITS.sub(lambda match: f"{match[1]}={match[2]}:{match[3]}".upper(), text)
    text = _DICTIONARY.sub(_assignments, text)
    text = re.sub(r" \(see [^)]*\)", "", text)
    sentence = re.split(r"(?<=[\w\])`\"]{2})\.\s", f"{text} ")[0].strip().rstrip(".")
    clauses = [clause for clause in sentence.split("; ") if not _PYTHON.search(clause)]
    text = "; ".join(clauses if len(sentence) <= LONGEST else clauses[:1]).replace("`", "")
    first = text.split(" ")[0].rstrip(",:;")
    return f"{text[:1].upper() if first.isalpha() else text[:1]}{text[1:]}." if text else ""


def _assignments(match: re.Match[str]) -> str:
    try:
        given = ast.literal_eval(match[0])
    except (ValueError, SyntaxError):
        return match[0]
    return ",".join(f"{name}={value}" for name, value in given.items()) if isinstance(given, dict) else match[0]
