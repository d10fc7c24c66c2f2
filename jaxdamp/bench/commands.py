"""What was set on the damper and held while it was measured: one number, one for each record, or a setting."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from jaxdamp import _checks
from jaxdamp.bench.runs import BenchRun


Command = float | int | str | Mapping[str, float | int]


def commanded(runs: list[tuple[str, BenchRun]], command: Command | None) -> list[BenchRun]:
    """The records with the commands given."""
    if command is None:
        return [run for _, run in runs]
    if isinstance(command, str):
        return [_held(run, _setting(run, command)) for _, run in runs]
    if not isinstance(command, Mapping):
        return [_held(run, command) for _, run in runs]
    patterns = {base: [key for key in command if fnmatchcase(base, key)] for base, _ in runs}
    _check_patterns(command, patterns)
    return [_held(run, command[patterns[base][0]]) for base, run in runs]


def _held(run: BenchRun, command: float | int) -> BenchRun:
    """The record with a command that is held, whatever its column shows."""
    note = (f"column of the command left out, since it is stated as {command:g}",) * (run.command_channel is not None)
    return replace(run.held_at(command), notes=(*run.notes, *note))


def _check_patterns(command: Mapping[str, float | int], patterns: Mapping[str, Sequence[str]]) -> None:
    """Refuse commands for no record, and records with none or several commands."""
    fitting = {key for keys in patterns.values() for key in keys}
    unused = ", ".join(repr(key) for key in command if key not in fitting)
    if unused:
        _checks.refuse("command", "name records that are read", unused, f"There are {', '.join(patterns)}.")
    doubtful = [f"{name} ({len(keys)})" for name, keys in patterns.items() if len(keys) != 1]
    if doubtful:
        must = "fit each record with exactly one pattern"
        _checks.refuse("command", must, f"fitting otherwise for {', '.join(doubtful)}")


def _setting(run: BenchRun, name: str) -> float:
    """The setting of a record that is its command."""
    value = run.settings.get(name)
    if not isinstance(value, int | float):
        settings = ", ".join(f"{key}={value!r}" for key, value in run.settings.items()) or "none"
        must = f"name a setting that is a number, also of {run.name!r}"
        _checks.refuse("command", must, repr(name), f"Its settings: {settings}.")
    return float(value)
