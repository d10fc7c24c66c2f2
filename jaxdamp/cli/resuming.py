"""`--resume`: a command goes on with what the same command had finished when it was stopped, killed or switched off.

While a long command runs, its finished pieces (`jaxdamp._pieces`) are in a folder of the user's cache, beside the
arguments and the sums of the files that were given; the folder is deleted when the command has ended well.
"""

import hashlib
import json
import shutil
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from importlib.metadata import version
from pathlib import Path

import typer

from jaxdamp._files import FOLDER_SUFFIXES, cache_home, find_files
from jaxdamp._pieces import kept_in
from jaxdamp._writing import write_whole
from jaxdamp.cli.application import own_words


COMMANDS = ("fit", "tune", "sweep", "report")
RUN = "run.json"
PARTS = (".piece", ".nc")  # of `_pieces.piece`, and the file of a sweep
OLDEST = 30 * 86400.0  # s, after which what was kept for a run that nobody resumed is deleted
_NO_MATTER = ("block", "out", "replace", "resume", "verbose", "report", "show_units", "show_sign")  # to numbers
_now: dict[str, dict[str, str]] = {}  # the command that is running, in words


def noted(command: str, given: Mapping[str, object]) -> AbstractContextManager[None]:
    """While this lasts, what the command was given is known; one is refused that would resume another."""
    resumes = command in COMMANDS and given.get("each") is None  # the fits of a line have a store of their own
    now = _described(command, given) if resumes else {}
    alone = given.get("block") is None  # parts go on by their store
    before = _before(target_of(command, given)) if alone and given.get("resume") else {}
    differences = differences_between(before, now)
    if differences:
        again = "Give what was given then, or leave out --resume to begin anew."
        raise ValueError(f"What was interrupted cannot be resumed: {'; '.join(differences)}. {again}")
    return _known(now)


def differences_between(before: Mapping[str, dict[str, str]], now: Mapping[str, dict[str, str]]) -> list[str]:
    """What a command is given otherwise than before, in words."""
    return [
        _difference(name, before[kind].get(name), now[kind].get(name), is_file=kind == "files")
        for kind in before
        for name in dict.fromkeys([*before[kind], *now[kind]])
        if before[kind].get(name) != now[kind].get(name)
    ]


def given_now() -> Mapping[str, dict[str, str]]:
    """What the running command is given; empty if it was called from Python."""
    return _now


@contextmanager
def _known(now: Mapping[str, dict[str, str]]) -> Iterator[None]:
    _now.update(now)
    try:
        yield
    finally:
        _now.clear()


def _difference(name: str, before: str | None, now: str | None, *, is_file: bool) -> str:
    """How something differs from before, in words."""
    if is_file:
        return f"{name} {'was not read' if before is None else 'is not given' if now is None else 'has changed'}"
    return f"{name} is {now or 'not given'} now, and was {before or 'not given'}"


def target_of(command: str, given: Mapping[str, object]) -> Path:
    """The folder that a command writes."""
    return Path(str(given["out"] or f"jaxdamp-{command}"))


def kept(target: Path) -> int:
    """How many finished parts are kept of an interrupted run that wrote this folder."""
    return sum(file.suffix in PARTS for file in _folder(target).glob("*"))


def offer(target: Path) -> str:
    """What can be done with the pieces that are kept, in a sentence; empty if there are none."""
    return "The same command with --resume goes on from there." if _now and kept(target) else ""


@contextmanager
def keeping(target: Path, *, resume: bool) -> Iterator[None]:
    """While this lasts, the finished pieces of the command are kept, and those of before are taken up."""
    if not _now:  # called from Python, or short
        yield
        return
    folder, finished = _folder(target), kept(target)
    if resume:
        typer.echo("Resumed with what an interrupted run had finished." if finished else "Nothing is there to resume.")
    elif finished:
        typer.echo("What an interrupted run had finished is computed anew, without --resume.", err=True)
        shutil.rmtree(folder, ignore_errors=True)
    try:
        _forget_old(folder.parent)
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o700)
        write_whole(folder / RUN, json.dumps(_now, indent=1, ensure_ascii=False) + "\n")
    except OSError as error:
        typer.echo(f"Nothing is kept for --resume: {str(folder)!r} cannot be written ({error.strerror}).", err=True)
        yield
        return
    with kept_in(folder):
        yield
    shutil.rmtree(folder, ignore_errors=True)  # not reached where the command was stopped or has failed


def _folder(target: Path) -> Path:
    name = hashlib.sha256(str(target.expanduser().resolve()).encode()).hexdigest()[:24]
    return cache_home() / "unfinished" / name


def _before(target: Path) -> dict[str, dict[str, str]]:
    """What the interrupted run was given; empty if nothing of one is kept."""
    try:
        return json.loads((_folder(target) / RUN).read_text(encoding="utf-8")) if kept(target) else {}
    except (OSError, ValueError):
        return {}


def _described(command: str, given: Mapping[str, object]) -> dict[str, dict[str, str]]:
    """The command, its options, the sums of all files among them, and the versions of what computes."""
    options = {name: value for name, value in given.items() if value is not False and value not in (None, [])}
    called = own_words()
    words = {
        called.get(name, name).removeprefix("Option "): _in_words(value)
        for name, value in options.items()
        if name not in _NO_MATTER
    }
    read = given.get("files")
    files = set(find_files(read, FOLDER_SUFFIXES)) if isinstance(read, list | tuple) else set[Path]()
    files |= {folder / "jaxdamp.toml" for folder in {Path.cwd(), *(file.parent for file in files)}}
    for value in options.values():
        files |= {Path(str(part)).expanduser() for part in (value if isinstance(value, list) else [value])}
    sums = {f"{file}": _sum(file) for file in sorted(files) if file.is_file()}
    versions = {name: version(name) for name in ("jaxdamp", "jax", "numpy")} | {"Python": sys.version.split()[0]}
    return {"command": {"the command": command}, "options": words, "files": sums, "versions": versions}


def _in_words(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _sum(file: Path) -> str:
    """A short sum of a file, or that it has none: what reads it says so, or leaves it out."""
    try:
        return sha256(file)[:16]
    except OSError as error:
        return f"not opened ({error.strerror})"


def sha256(file: Path) -> str:
    """The sum of a file."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _forget_old(place: Path) -> None:
    """Delete what was kept for runs that nobody resumed for long."""
    for run in place.glob(f"*/{RUN}"):
        if time.time() - run.stat().st_mtime > OLDEST:
            shutil.rmtree(run.parent, ignore_errors=True)
