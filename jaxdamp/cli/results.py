"""The folder that a command writes: never over what is there, and never half-written without saying so."""

import errno
import getpass
import glob
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from filelock import FileLock, Timeout

from jaxdamp._tables import Contents
from jaxdamp._writing import own_place, renamed, sync, write_whole
from jaxdamp.cli import interrupt, resuming
from jaxdamp.cli.interrupt import Interrupted


MANIFEST = "manifest.json"
UNFINISHED = "UNFINISHED.txt"
PREVIOUS = ".previous"
FORMAT = "jaxdamp results"
DRAFT = ".draft"
FULL = {errno.ENOSPC, errno.EDQUOT}


class Results:
    """A draft folder to write into, and the folder that its files are moved to.

    Attributes:
        draft: where to write.
        target: what the user named.
        missing: what was still to come at the last `publish`, in words.
    """

    def __init__(self, target: Path, command: str, earlier: list[str], begun: dict[str, str] | None = None) -> None:
        self.target, self._command, self._earlier = target, command, earlier
        self._published = begun or {}  # hashes by file
        self._begun = begun is not None  # what is in the folder is of this very run
        self._made: set[str] = set()  # names of what this process has written, unlike what it resumes
        self.missing = "everything"
        self.draft = self._new_draft()

    def _new_draft(self) -> Path:
        return Path(tempfile.mkdtemp(prefix=f".{self.target.name}.", suffix=DRAFT, dir=self.target.parent))

    @property
    def published(self) -> list[str]:
        """The files that are in place so far, without those that tell of them."""
        return sorted(self._published)

    def publish(self, missing: str = "") -> None:
        """Move what is written so far into place.

        A folder that does not exist yet appears with all of it at once. In one that exists, `UNFINISHED.txt` is there
        before the first file is touched, and what an earlier run wrote goes to `.previous` before the first new file
        comes: whenever the process ends, no old file stands beside a new one without this note.
        """
        self.missing = missing
        with interrupt.undisturbed():
            fresh = written(self.draft)
            for name in fresh:
                sync(self.draft / name)
            published = set(self._published)
            self._made.update(fresh)
            self._published |= {name: resuming.sha256(self.draft / name) for name in fresh}
            if not self.target.exists():
                self._tell(self.draft, missing)
                mask = os.umask(0)
                os.umask(mask)
                self.draft.chmod(0o777 & ~mask)
                self.draft.rename(self.target)
            else:
                self._move(fresh, published, missing)
            sync(self.target.parent)
            self._begun = True
            shutil.rmtree(self.draft, ignore_errors=True)
            if missing:
                self.draft = self._new_draft()

    def _move(self, fresh: list[str], published: set[str], missing: str) -> None:
        """Move the draft into a folder that exists; the files of this run there are replaced, others and links kept."""
        if not self._begun:
            self._keep_previous(fresh)
        moved = f'what was being moved here when the run ended; nothing if {MANIFEST} has "complete": true'
        self._tell(self.target, missing or moved)
        for name in fresh:
            os.replace(self.draft / name, own_place(self.target, name, self._keep, replace=name in published))
        if not missing:
            self._drop_outdated()
        self._tell(self.target, missing)
        if not missing:
            (self.target / UNFINISHED).unlink(missing_ok=True)

    def _drop_outdated(self) -> None:
        """Remove what the interrupted run wrote and the resumed one did not, such as files of a law now surpassed."""
        outdated = sorted(self._published.keys() - self._made)
        _remove_unchanged(self.target, {"files": outdated, "sha256": self._published, "complete": True})
        self._published = {name: was for name, was in self._published.items() if name in self._made}

    def _keep_previous(self, fresh: list[str]) -> None:
        """Move what an earlier run wrote, and files of the names to come, to `.previous`; the one before is dropped."""
        named = dict.fromkeys([*self._earlier, *fresh])
        there = [name for name in named if (self.target / name).is_file() and _inside(self.target, name)]
        if not there:
            return
        previous, old = self.target / PREVIOUS, self.target / MANIFEST
        _remove_unchanged(previous, _manifest(previous))
        previous.mkdir(exist_ok=True)
        if old.is_file():
            shutil.copyfile(old, previous / MANIFEST)
        self._tell(self.target, f"everything; the results of the run before are in {PREVIOUS}", [*there])
        for name in there:
            self._keep(self.target / name)
            _remove_empty((self.target / name).parent, self.target)

    def _keep(self, place: Path) -> None:
        """Move a file of the folder, or a link, to `.previous`."""
        name = place.relative_to(self.target).as_posix()
        os.replace(place, own_place(self.target / PREVIOUS, name, renamed))

    def _tell(self, folder: Path, missing: str, besides: list[str] | None = None) -> None:
        """Write the manifest, and first the note on what is missing."""
        if missing:
            text = f"These results of jaxdamp {self._command} are not complete. Missing: {missing}."
            write_whole(folder / UNFINISHED, f"{text} {resuming.offer(self.target)}".rstrip() + "\n")
        files = [*sorted({*self.published, *(besides or [])}), *([UNFINISHED] if missing else []), MANIFEST]
        manifest = {
            "format": FORMAT,
            "command": self._command,
            "complete": not missing,
            "files": files,
            "sha256": self._published,
        }
        write_whole(folder / MANIFEST, json.dumps(manifest, indent=1, ensure_ascii=False) + "\n")

    def discard(self) -> str:
        """Remove the draft, and say what is in place."""
        shutil.rmtree(self.draft, ignore_errors=True)
        there = f"{str(self.target)!r} holds what was finished before. Not written: {self.missing}."
        return f"{there if self.published else 'Nothing was written.'} {resuming.offer(self.target)}".rstrip()


@contextmanager
def results_folder(target: Path, command: str, *, replace: bool = False, resume: bool = False) -> Iterator[Results]:
    """Results to write; they are in place when all is done, or from the first `publish` on.

    The target must not exist, or be empty. With `replace`, what the same command wrote there before, and any file that
    has the name of a new one, is moved to `.previous` inside as soon as there is something new; all other files stay.
    Nothing outside the folder is touched, wherever links lead, and no second command writes at the same time.

    Raises:
        ValueError: the target is a file, is not empty, holds the results of another command, is being written by
            another process, or cannot be written.
        Interrupted: Ctrl-C, with words on what was written. What is finished is in place then.
    """
    target = target.expanduser()
    with _only_writer(target), resuming.keeping(target, resume=resume):
        yield from _written(_opened(target, command, replace, resume and _resumed(target, command)))


@contextmanager
def _only_writer(target: Path) -> Iterator[None]:
    """Refuse a second process that writes the same folder; the lock ends with the process, however that ends."""
    name = hashlib.sha256(str(target.resolve()).encode()).hexdigest()[:24]
    lock = FileLock(Path(tempfile.gettempdir()) / f"jaxdamp-{getpass.getuser()}-{name}.lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(
            f"Another command is writing {str(target)!r}: wait for it, or name another folder with --out."
        ) from None
    try:
        yield
    finally:
        lock.release()


def _written(results: Results) -> Iterator[Results]:
    """Give the results to be filled, and end them well or badly."""
    target = results.target
    try:
        with interrupt.closing(results.discard):
            yield results
            results.publish()
    except Interrupted as stop:
        raise Interrupted(_kept(results)) from stop
    except OSError as error:
        if error.filename is None and error.errno in FULL:  # raised by a write into a file that is open
            raise _unwritable(target, error) from error
        if error.filename is None or not str(error.filename).startswith(str(results.draft)):
            raise
        place = target / Path(error.filename).relative_to(results.draft)
        raise _unwritable(place, error) from error
    finally:
        shutil.rmtree(results.draft, ignore_errors=True)


def refuse_target(target: Path, command: str, *, replace: bool, resume: bool = False) -> None:
    """Refuse a folder that the command may not write."""
    target = target.expanduser()
    if not (resume and _resumed(target, command)):
        _earlier_files(target, command, replace)


def _resumed(target: Path, command: str) -> bool:
    """Whether the folder holds what an interrupted run wrote that can be resumed."""
    manifest = _manifest(target) if resuming.kept(target) else {}
    if manifest.get("command") != command or manifest.get("complete"):
        return False
    hashes = manifest.get("sha256", {})
    changed = [
        name for name, was in hashes.items() if (target / name).is_file() and resuming.sha256(target / name) != was
    ]
    if changed:
        raise ValueError(
            f"{str(target / changed[0])!r} was changed since the run was interrupted, and --resume would replace it: "
            "move it to another folder."
        )
    return True


def _opened(target: Path, command: str, replace: bool, resumed: bool) -> Results:
    """The results of a folder that may be written."""
    earlier = [] if resumed else _earlier_files(target, command, replace)
    for draft in sorted(target.parent.glob(f".{glob.escape(target.name)}.*{DRAFT}")):
        text = f"{str(draft)!r} was left by a run that was killed: look into it for results, or delete it."
        typer.echo(text, err=True)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists() and not os.access(target, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return Results(target, command, earlier, _manifest(target)["sha256"] if resumed else None)
    except OSError as error:
        raise _unwritable(target, error) from error


def _unwritable(place: Path, error: OSError) -> ValueError:
    return ValueError(f"{str(place)!r} cannot be written ({error.strerror}): name another folder with --out.")


def _kept(results: Results) -> str:
    """Put what is finished into place after an interruption, and say so."""
    if written(results.draft):
        results.publish(results.missing)
    offer = resuming.offer(results.target)
    if not results.published:
        return f"Interrupted. Nothing was written. {offer}".rstrip()
    names = results.published
    shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return (
        f"Interrupted. {str(results.target)!r} holds what was finished: {shown}. Not written: {results.missing}, as "
        f"{UNFINISHED} in it says too. {offer}"
    ).rstrip()


def written(folder: Path) -> list[str]:
    """All files below a folder, in order, as paths relative to it."""
    files = (file.relative_to(folder) for file in folder.rglob("*") if file.is_file())
    return sorted(file.as_posix() for file in files if file.parts[0] != PREVIOUS)


def _earlier_files(target: Path, command: str, replace: bool) -> list[str]:
    """The files that the same command wrote into the target before; a refusal where nothing may be replaced."""
    if not target.exists():
        return []
    if not target.is_dir():
        raise ValueError(f"{str(target)!r} is a file: name a folder with --out.")
    if not any(target.iterdir()):
        return []
    manifest = _manifest(target)
    by = manifest.get("command", "")
    if manifest and by != command:
        raise ValueError(
            f"The folder {str(target)!r} holds the results of jaxdamp {by}, which jaxdamp {command} does not replace: "
            "name another one with --out."
        )
    if replace and (target / PREVIOUS).is_symlink():
        raise ValueError(f"{str(target / PREVIOUS)!r} is a link, and earlier results are kept there: remove the link.")
    if replace:
        return _unchanged(target, manifest)
    if manifest:
        raise ValueError(
            f"The folder {str(target)!r} holds the results of an earlier run of jaxdamp {by}: "
            f"name another one with --out, or pass --replace to replace them (they are kept in {PREVIOUS} inside)."
        )
    raise ValueError(
        f"The folder {str(target)!r} is not empty and was not written by jaxdamp: name another one with --out, or "
        f"pass --replace to write into it (files of the same names are kept in {PREVIOUS} inside, all others stay)."
    )


def _manifest(folder: Path) -> Contents:
    """What the manifest of a folder says; empty if no command wrote one there."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        return manifest if manifest["format"] == FORMAT and isinstance(manifest["files"], list) else {}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}


def _unchanged(folder: Path, manifest: Contents) -> list[str]:
    """The files of a manifest that are inside the folder, wherever links lead, and as they were written."""
    hashes = manifest.get("sha256", {})
    files = []
    for name in manifest.get("files", []):
        name = str(name)
        path = folder / name
        if name == MANIFEST or not _inside(folder, name) or not path.is_file():
            continue
        if name == UNFINISHED or not manifest.get("complete") or hashes.get(name) == resuming.sha256(path):
            files.append(name)
    return files


def _inside(folder: Path, name: str) -> bool:
    """Whether a file is inside the folder, wherever links lead, and no link itself."""
    path = folder / name
    return path.resolve().is_relative_to(folder.resolve()) and not path.is_symlink()


def _remove_unchanged(folder: Path, manifest: Contents) -> None:
    """Delete the files of a manifest, but for those that somebody changed since or put there."""
    for name in _unchanged(folder, manifest):
        (folder / name).unlink()
        _remove_empty((folder / name).parent, folder)


def _remove_empty(folder: Path, root: Path) -> None:
    """Remove a folder and those above it, up to the root, as long as they are empty."""
    while folder != root and folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent
