"""Bench records at the command line: how they are read, checked, processed, divided, and what was decided."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from jaxdamp import _checks, bench, identify
from jaxdamp._checks import Setting
from jaxdamp.bench import BenchRun, BenchSet, ForceVelocityTable, Preflight, by_number, settings_apart
from jaxdamp.cli.console import Screen
from jaxdamp.cli.options import Call
from jaxdamp.cli.wording import in_options
from jaxdamp.cli.words import words


COMMAND = "command"  # stands for what was set on the damper, unless a setting has this name
_COMPRESSION = Setting("sign", "compression-positive")  # what the reader proposes in its notes
_COLOURS = {"error": "red", "warning": "yellow", "note": ""}
_OF_TABLES = ("sign", "columns", "units", "delimiter", "manifest")  # what is said of a force-velocity table too
_LINES = 5  # of findings at the terminal
_CUT_OFF = ("rest before", "rest after")  # findings on what `process(moving=True)` cuts off


@dataclass(frozen=True)
class Reading:
    """How the files are read, and what is done to the records.

    Arguments:
        read: as in `bench.read`.
        steps: as in `bench.Steps`.
        cycles: full cycles to keep: 3 or last:3, or skip:2.
        keep_rest: keep the rest before and after the motion, which is cut off otherwise.
        keep_bad: use records with an error as they are, and fit those that contradict each other together.
    """

    read: Annotated[Call, "bench.read"]
    steps: Annotated[Call, "bench.Steps"]
    cycles: str | None = None
    keep_rest: bool = False
    keep_bad: bool = False

    def raw(self, files: Sequence[Path]) -> BenchSet:
        """The records as they are in the files."""
        return bench.read(list(files), **self.read.arguments())

    def table(self, files: Sequence[Path], side: str | None) -> ForceVelocityTable | None:
        """The force-velocity table that the files are, which has no time and is not processed; None for records."""
        given = {name: self.read.given[name] for name in _OF_TABLES if name in self.read.given}
        if "sampling_rate" in self.read.given or not bench.are_tables(list(files), **given):
            if side is not None:
                _checks.refuse("side", "be given with a force-velocity table", side, "These are records; leave it out.")
            return None
        read = [name for name in self.read.given if name not in _OF_TABLES]
        for option in (*read, *self.steps.given, *(name for name in ("cycles", "keep_rest") if getattr(self, name))):
            remedy = "Its points have no time, and are taken as they are."
            _checks.refuse(option, "be left out with a force-velocity table", "given", remedy)
        return bench.read_table(list(files), side=side, **given)

    def processing(self) -> dict[str, object]:
        """The steps of `BenchRun.process`.

        >>> steps = Call("bench.Steps", {"low_pass": 50.0})
        >>> Reading(Call("bench.read"), steps, cycles="skip:2").processing()
        {'low_pass': 50.0, 'moving': True, 'skip_cycles': 2}
        """
        steps = self.steps.arguments()
        if not self.keep_rest:
            steps["moving"] = True
        if self.cycles is not None:
            kind, _, count = self.cycles.rpartition(":")
            if kind not in ("", "last", "skip") or not count.isdigit():
                _checks.refuse("cycles", "read like 3, last:3 or skip:2", repr(self.cycles))
            steps["skip_cycles" if kind == "skip" else "last_cycles"] = int(count)
        return steps

    def processed(self, runs: BenchSet) -> BenchSet:
        """The records with these steps done."""
        steps = self.processing()
        return runs.process(**steps) if steps else runs

    def checked(
        self, screen: Screen, runs: BenchSet, *, refuse: bool = False, machine: Sequence[str] = ()
    ) -> tuple[BenchSet, Preflight]:
        """The records without an error, and the findings on all but those that processing or the machine answers."""
        late = "delay" in self.steps.given or "delay" in machine
        answered = (() if self.keep_rest else _CUT_OFF) + (("delay",) if late else ())
        with screen.stage("Checking the records"):
            preflight = bench.preflight(runs).without(answered)
        self._show(screen, preflight)
        if self.keep_bad:
            return runs, preflight
        wrong = {name for finding in preflight.of("error") for name in finding.records}
        sound = BenchSet((run for run in runs if run.name not in wrong), runs.left_out)
        keeping = "With --keep-bad, they are used as they are."
        if not len(sound):
            raise ValueError(" ".join([*(finding.sentence for finding in preflight.of("error")), keeping]))
        names = ", ".join(sorted(wrong))
        if wrong and refuse and not self.read.given.get("skip_bad"):
            skipping = f"With --skip-bad, records with an error are left out: {names}."
            raise ValueError(f"{preflight.of('error')[0].sentence} {skipping} {keeping}")
        if wrong:
            screen.points([f"left out, with an error: {names}"], style="red")
        return sound, preflight

    def _show(self, screen: Screen, preflight: Preflight) -> None:
        """The worst findings, or all."""
        sentences = preflight.sentences()
        shown = sentences if screen.verbose else [text for text in sentences if not text.startswith("note")][:_LINES]
        if not shown:
            return
        screen.heading(preflight.summary)
        for sentence in shown:
            screen.points([sentence], style=_COLOURS[sentence.split(",")[0]])
        if len(sentences) > len(shown):
            kinds = dict.fromkeys(finding.name for finding in preflight.findings)
            more = [kind for kind in kinds if not any(kind in text.split(":")[0] for text in shown)]
            screen.points([f"also {', '.join(more)}: --verbose prints all, the page has them"])


def names_of(*, points: bool) -> list[str]:
    """All laws that are not optional; to fit to points of a force-velocity table, those without hysteresis."""
    return [name for name in identify.LAWS if not (points and identify.NAMED_LAWS[name].hysteresis)]


def law_names(asked: Sequence[str], *, points: bool = False) -> list[str]:
    """The laws to fit, each once: those named, with "all" all that are not optional; none for what suits the records.

    To `points` of a force-velocity table only laws without hysteresis are fitted.

    >>> law_names(["linear, besinger", "linear"])
    ['linear', 'besinger']
    """
    if not asked:
        return []
    asked = words("law", asked)
    if not asked:
        _checks.refuse("law", "name a law", "empty", 'See "jaxdamp laws".')
    for name in asked:
        _checks.one_of("law", name, ("all", *identify.NAMED_LAWS))
    return list(dict.fromkeys(law for name in asked for law in (names_of(points=points) if name == "all" else (name,))))


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


def decisions(runs: BenchSet | Sequence[BenchRun]) -> list[str]:
    """What the reader decided, and what it left out; notes that differ in their numbers are said once."""
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
    left_out = runs.left_out if isinstance(runs, BenchSet) else ()
    return sentences + [f"left out: {sentence}" for sentence in left_out]


def value_of(runs: Sequence[BenchRun], name: str) -> Callable[[BenchRun], str]:
    """The setting of a record in words, by the name of the setting, which all records must state."""
    values = {run.name: run.settings.get(name, run.command if name == COMMAND else None) for run in runs}
    lacking = [record for record, value in values.items() if value is None]
    if lacking:
        stated = sorted({setting for run in runs for setting in run.settings})
        there = f"There are {', '.join(stated)}." if stated else "A manifest states settings, see docs/reading.md."
        must = "name a setting that every record states"
        _checks.refuse("group_by", must, f"{name!r}, which {', '.join(lacking[:3])} do not state", there)
    return lambda run: value if isinstance(value := values[run.name], str) else f"{value:g}"


def grouped(runs: BenchSet, name: str | None) -> tuple[dict[str, BenchSet], str]:
    """The records by the name of a folder for each value of a setting; all of them by an empty name without one.

    Without a name, records of the same motion that contradict one another are divided as `bench.evaluate` divides them,
    where what they state or a word of their names tells them apart. A sentence says so.
    """
    sentence = ""
    if name is None:
        settings: dict[str, str] = {}
        if all(run.command is None for run in runs):
            settings, sentence = settings_apart(tuple(runs))
        if all(setting == record for record, setting in settings.items()):  # nothing tells them apart
            return {"": runs}, ""
        name, value = "setting", lambda run: settings[run.name]
        runs = BenchSet(sorted(runs, key=lambda run: by_number(settings[run.name])))
    else:
        value = value_of(tuple(runs), name)
    groups: dict[str, list[BenchRun]] = {}
    for run in runs:
        groups.setdefault(value(run), []).append(run)
    folders = {f"{name}_{value}": re.sub(r"[^\w.+-]+", "_", f"{name}_{value}") for value in groups}
    if len(set(folders.values())) < len(folders):
        _checks.refuse("group_by", "give a folder to each value", ", ".join(folders), "Name the values otherwise.")
    parts = zip(folders.values(), groups.values(), strict=True)
    return {folder: BenchSet(part) for folder, part in parts}, sentence
