"""Records in groups by a setting that they state: `--group-by`."""

import re
from collections.abc import Callable, Sequence

from jaxdamp import _checks
from jaxdamp.bench import BenchRun, BenchSet


COMMAND = "command"  # stands for what was set on the damper, unless a setting has this name


def value_of(runs: Sequence[BenchRun], name: str) -> Callable[[BenchRun], str]:
    """The setting of a record in words, by the name of the setting, which all records must state."""
    values = {run.name: run.settings.get(name, run.command if name == COMMAND else None) for run in runs}
    lacking = [record for record, value in values.items() if value is None]
    if lacking:
        known = sorted({known for run in runs for known in run.settings})
        there = f"There are {', '.join(known)}." if known else "A manifest states settings, see docs/reading.md."
        must = "name a setting that every record states"
        _checks.refuse("group_by", must, f"{name!r}, which {', '.join(lacking[:3])} do not state", there)
    return lambda run: value if isinstance(value := values[run.name], str) else f"{value:g}"


def grouped(runs: BenchSet, name: str | None) -> dict[str, BenchSet]:
    """The records by the name of a folder for each value of a setting; all of them by an empty name without one.

    Raises:
        ValueError: a record does not state the setting, or two values would have the same folder.
    """
    if name is None:
        return {"": runs}
    value, groups = value_of(tuple(runs), name), {}
    for run in runs:
        groups.setdefault(value(run), []).append(run)
    folders = {f"{name}_{value}": re.sub(r"[^\w.+-]+", "_", f"{name}_{value}") for value in groups}
    if len(set(folders.values())) < len(folders):
        _checks.refuse("group_by", "give a folder to each value", ", ".join(folders), "Name the values otherwise.")
    return {folder: BenchSet(part) for folder, part in zip(folders.values(), groups.values(), strict=True)}
