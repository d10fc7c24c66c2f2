"""The folder that a command writes: never over what is there, and never half-written without saying so."""

import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jaxdamp.cli import interrupt
from jaxdamp.cli.interrupt import Interrupted


MANIFEST = "manifest.json"
UNFINISHED = "UNFINISHED.txt"
FORMAT = "jaxdamp results"


class Results:
    """A draft folder to write into, and the folder that its files are moved to.

    Attributes:
        draft: where to write.
        target: what the user named.
        missing: what was still to come at the last `publish`, in words.
    """

    def __init__(self, target: Path, command: str, earlier: list[str]) -> None:
        self.target, self._command, self._earlier = target, command, earlier
        self._published: set[str] = set()
        self.missing = "everything"
        self.draft = self._new_draft()

    def _new_draft(self) -> Path:
        return Path(tempfile.mkdtemp(prefix=f".{self.target.name}.", suffix=".draft", dir=self.target.parent))

    @property
    def published(self) -> list[str]:
        """The files that are in place so far, without those that tell of them."""
        return sorted(self._published - {MANIFEST, UNFINISHED})

    def publish(self, missing: str = "") -> None:
        """Move what is written so far into place.

        Arguments:
            missing: what is still to come, in words, for a file that stays in the folder until all is there.
        """
        self.missing = missing
        with interrupt.undisturbed():
            results = {*self.published, *written(self.draft)}
            files = [*sorted(results), *([UNFINISHED] if missing else []), MANIFEST]
            if missing:
                text = f"These results of jaxdamp {self._command} are not complete. Missing: {missing}.\n"
                (self.draft / UNFINISHED).write_text(text, encoding="utf-8")
            manifest = {"format": FORMAT, "command": self._command, "complete": not missing, "files": files}
            text = json.dumps(manifest, indent=1, ensure_ascii=False) + "\n"
            (self.draft / MANIFEST).write_text(text, encoding="utf-8")
            self._move(files)
            shutil.rmtree(self.draft, ignore_errors=True)
            if missing:
                self.draft = self._new_draft()

    def _move(self, files: list[str]) -> None:
        """Move the draft into place and take away what only an earlier run or stage wrote."""
        fresh = written(self.draft)
        if not self.target.exists():
            mask = os.umask(0)
            os.umask(mask)
            self.draft.chmod(0o777 & ~mask)
            self.draft.rename(self.target)
        for name in fresh if self.draft.exists() else ():
            place = self.target / name
            place.parent.mkdir(parents=True, exist_ok=True)
            os.replace(self.draft / name, place)
        for name in {*self._earlier, *self._published} - set(files):
            (self.target / name).unlink(missing_ok=True)
            for folder in (self.target / name).parents:
                if folder == self.target or not folder.is_dir() or any(folder.iterdir()):
                    break
                folder.rmdir()
        self._published, self._earlier = set(files), []

    def discard(self) -> str:
        """Remove the draft, and say what is in place."""
        shutil.rmtree(self.draft, ignore_errors=True)
        if not self.published:
            return ""
        return f"{str(self.target)!r} holds what was finished before. Not written: {self.missing}."


@contextmanager
def results_folder(target: Path, command: str, *, replace: bool = False) -> Iterator[Results]:
    """Results to write; they are in place when all is done, or from the first `publish` on.

    The target must not exist, or be empty. With `replace`, what a command wrote there before is replaced as soon as
    there is something new, file by file: files that others put there stay, unless they have the name of a new one.

    Arguments:
        target: the folder to write.
        command: name of the command, for the manifest.
        replace: write into a folder that is not empty.

    Raises:
        ValueError: the target is a file, is not empty, or cannot be written.
        Interrupted: Ctrl-C, with words on what was written. What is finished is in place then.
    """
    target = target.expanduser()
    results = _opened(target, command, replace)
    try:
        with interrupt.closing(results.discard):
            yield results
            results.publish()
    except Interrupted as stop:
        raise Interrupted(_kept(results)) from stop
    except OSError as error:
        if error.filename is None or not str(error.filename).startswith(str(results.draft)):
            raise
        place = target / Path(error.filename).relative_to(results.draft)
        raise _unwritable(place, error) from error
    finally:
        shutil.rmtree(results.draft, ignore_errors=True)


@contextmanager
def another_page(page: Path | None, target: Path, *, replace: bool = False) -> Iterator[None]:
    """A copy of the report of a results folder in another place, written when all is done.

    Arguments:
        page: the file to write; None for no copy.
        target: the results folder.
        replace: replace a file that is there.

    Raises:
        ValueError: the file is there already, or is a folder.
    """
    if page is not None and (page.is_dir() or (page.exists() and not replace)):
        what = "is a folder: name a file" if page.is_dir() else "is there already: name another file"
        raise ValueError(f"{str(page)!r} {what} with --report{', or pass --replace' * page.is_file()}.")
    yield
    if page is not None:
        page.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(target.expanduser() / "report.html", page)


def _opened(target: Path, command: str, replace: bool) -> Results:
    """The results of a folder that may be written."""
    earlier = _earlier_files(target, replace)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.exists() and not os.access(target, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return Results(target, command, earlier)
    except OSError as error:
        raise _unwritable(target, error) from error


def _unwritable(place: Path, error: OSError) -> ValueError:
    return ValueError(f"{str(place)!r} cannot be written ({error.strerror}): name another folder with --out.")


def _kept(results: Results) -> str:
    """Put what is finished into place after an interruption, and say so."""
    if written(results.draft):
        results.publish(results.missing)
    if not results.published:
        return "Interrupted. Nothing was written."
    names = results.published
    shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return (
        f"Interrupted. {str(results.target)!r} holds what was finished: {shown}. Not written: {results.missing}, as "
        f"{UNFINISHED} in it says too."
    )


def written(folder: Path) -> list[str]:
    """All files below a folder, in order, as paths relative to it."""
    return sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())


def _earlier_files(target: Path, replace: bool) -> list[str]:
    """The files that a command wrote into the target before; a refusal where nothing may be replaced."""
    if not target.exists():
        return []
    if not target.is_dir():
        raise ValueError(f"{str(target)!r} is a file: name a folder with --out.")
    if not any(target.iterdir()):
        return []
    by = ""
    try:
        manifest = json.loads((target / MANIFEST).read_text(encoding="utf-8"))
        ours, by = manifest["format"] == FORMAT, manifest.get("command", "")
        files = [name for name in manifest["files"] if ".." not in Path(name).parts and not Path(name).is_absolute()]
    except (OSError, ValueError, KeyError, TypeError):
        ours, files = False, []
    if replace:
        return files if ours else []
    if ours:
        raise ValueError(
            f"The folder {str(target)!r} holds the results of an earlier run of jaxdamp {by}: "
            "name another one with --out, or pass --replace to replace them."
        )
    raise ValueError(
        f"The folder {str(target)!r} is not empty and was not written by jaxdamp: name another one with --out, or "
        "pass --replace to write into it (files of the same names are replaced, all others stay)."
    )
