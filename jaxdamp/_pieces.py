"""Finished pieces of a long computation, kept on the disk so that the same computation goes on after an interruption.

Pieces are pickled: they are read from a folder of the user's own only, as compiled programs are, never from results.
"""

import hashlib
import io
import pickle
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from jaxdamp._warned import warn
from jaxdamp._writing import write_whole


T = TypeVar("T")
SUFFIX = ".piece"
SHARE = 0.1  # of the free disk, the most that a piece may take
UNPICKLED = (pickle.PicklingError, AttributeError, TypeError)  # a function of the user's that no module holds by name
_folders: list[Path] = []  # where this process keeps its pieces: one for all threads


@contextmanager
def kept_in(folder: Path) -> Iterator[None]:
    """While this lasts, what `piece` computes is kept in a folder, and taken from it."""
    _folders.append(folder)
    try:
        yield
    finally:
        _folders.pop()


def kept_file(name: str) -> Path | None:
    """Where a computation that writes what it has finished by itself keeps it; None where nothing is kept."""
    return _folders[-1] / name if _folders else None


def piece(inputs: tuple[object, ...], compute: Callable[[], T]) -> T:
    """What a function computes; if it was kept, from the same inputs, it is not computed again.

    Arguments:
        inputs: all that the result depends on, and a word for what it is.
        compute: the computation.
    """
    if not _folders:
        return compute()
    try:
        file = _folders[-1] / f"{hashlib.sha256(_plainly_pickled(inputs)).hexdigest()}{SUFFIX}"
    except UNPICKLED as error:
        _not_kept(error)
        return compute()
    stored = _read(file)
    if stored is not None:
        return pickle.loads(stored)
    result = compute()
    try:
        content = pickle.dumps(result)
        if len(content) > SHARE * shutil.disk_usage(file.parent).free:
            raise OSError("it would take more than a tenth of the free disk")
        write_whole(file, hashlib.sha256(content).digest() + content)
    except (OSError, *UNPICKLED) as error:
        _not_kept(error)
    return result


def _not_kept(error: Exception) -> None:
    """The computation is worth more than its pieces."""
    warn(f"A finished piece could not be kept for --resume: {error}.")


def _read(file: Path) -> bytes | None:
    """What was kept; None where nothing was, or where the disk has damaged it."""
    if not file.is_file():
        return None
    text = file.read_bytes()
    return text[32:] if hashlib.sha256(text[32:]).digest() == text[:32] else None


def _plainly_pickled(thing: object) -> bytes:
    """Equal things give equal bytes, whether or not parts of them are the same object in memory."""
    stream = io.BytesIO()
    pickler = pickle.Pickler(stream, protocol=5)
    pickler.fast = True
    pickler.dump(thing)
    return stream.getvalue()
