"""What the words on the command line mean: columns, units, laws, records to hold out."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from jaxdamp import _checks, bench, identify
from jaxdamp._checks import Setting
from jaxdamp.bench import BenchRun, BenchSet
from jaxdamp.cli.wording import in_options


_COMPRESSION = Setting("sign", "compression-positive")  # what the reader proposes in its notes
ROLES = ("time", "stroke", "velocity", "force", "temperature")
NAME = r"[\w.]+"  # of any channel


def law_names(asked: Sequence[str]) -> list[str]:
    """The laws to fit: all that are not optional, or those named, each once; "linear,besinger" names two.

    >>> law_names(["linear, besinger", "linear"])
    ['linear', 'besinger']
    """
    asked = [name.strip() for text in asked for name in text.split(",") if name.strip()]
    if not asked:
        _checks.refuse("law", "name a law", "empty", 'See "jaxdamp laws".')
    for name in asked:
        _checks.one_of("law", name, ("all", *identify.NAMED_LAWS))
    return list(identify.LAWS) if "all" in asked else list(dict.fromkeys(asked))


def assignments(option: str, texts: Sequence[str], roles: Sequence[str] | None = ROLES) -> dict[str, str]:
    """What "stroke=x_mm,force=Load, N" assigns to the quantities of a record; any names if `roles` is None.

    >>> assignments("columns", ["time=t,stroke=Displacement, in", "force=2"])
    {'time': 't', 'stroke': 'Displacement, in', 'force': '2'}
    """
    assigned = {}
    for text in texts:
        for part in re.split(rf",(?=\s*(?:{'|'.join(roles or [NAME])})\s*=)", text):
            role, equals, value = (piece.strip() for piece in part.partition("="))
            if not equals or not value:
                raise ValueError(f"Option --{option} must read like stroke=..., but is {part!r}.")
            if roles is not None:
                _checks.one_of(option, role, roles)
            assigned[role] = value
    return assigned


def column_numbers(columns: Mapping[str, str]) -> dict[str, str | int | None]:
    """Headers stay, digits are numbers of columns, "none" leaves a quantity out."""
    special: dict[str, None] = {"none": None}
    return {
        role: int(value) if value.isdigit() else special.get(value.lower(), value) for role, value in columns.items()
    }


def commands(texts: Sequence[str]) -> Mapping[str, float] | None:
    """What "*_0.5A=0.5,*_1A=1" states of the records; None where nothing is stated.

    >>> commands(["*_0.5A=0.5,*_1A=1"])
    {'*_0.5A': 0.5, '*_1A': 1.0}
    """
    stated = {}
    for part in (part for text in texts for part in text.split(",")):
        pattern, _, number = part.rpartition("=")
        try:
            stated[pattern.strip()] = float(number)
        except ValueError:
            pattern = ""
        if not pattern:
            raise ValueError(f"Option --command must read like '*_0.5A=0.5', but is {part!r}.")
    return stated or None


def split(runs: BenchSet, patterns: Sequence[str]) -> tuple[BenchSet, BenchSet]:
    """The records to fit and those to hold out, which are named by name, file or pattern."""
    if not patterns:
        return runs, BenchSet()
    names = [name for pattern in patterns for name in _names_of(runs, pattern)]
    try:
        held, fitted = runs.select(names), runs.without(names)
    except KeyError as error:
        raise ValueError(f"Option --held-out: {error.args[0]}") from error
    if not len(fitted):
        raise ValueError("Option --held-out leaves no record to fit: hold out fewer.")
    return fitted, held


def _names_of(runs: BenchSet, pattern: str) -> list[str]:
    """The records of a file, or the pattern without the ending of a file."""
    path = Path(pattern).expanduser()
    if path.is_file():
        here = [run.name for run in runs if Path(run.source).resolve() == path.resolve()]
        if here:
            return here
    suffix = path.suffix
    return [pattern.removesuffix(suffix) if suffix.lower() in bench.READERS else pattern]


def decisions(runs: Sequence[BenchRun]) -> list[str]:
    """What the reader decided; notes that differ only in their numbers are said once, with those of the first."""
    kinds: dict[str, list[str]] = {}
    for run in runs:
        for text in run.notes:
            note = in_options(text, (_COMPRESSION,))
            kinds.setdefault(re.sub(r"[+-]?\d[\d.]*(?:e[+-]?\d+)?", "#", note), []).append(note)
    sentences = []
    for notes in kinds.values():
        who = "all records" if len(notes) == len(runs) else f"{len(notes)} records"
        alike = "" if len(set(notes)) == 1 else ", numbers of the first"
        sentences.append(notes[0] if len(runs) == 1 else f"{notes[0]} ({who}{alike})")
    return sentences
