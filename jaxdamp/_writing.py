"""Writing of files, completely or not at all, and until they are on the disk."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from jaxdamp import _checks


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Write a file so that a reader, or a machine that is switched on again, finds it whole or as it was before."""
    target = Path(path).expanduser()
    if not target.parent.is_dir():
        _checks.refuse("path", "lie in a folder that exists", target, "Make the folder first.")
    if target.is_dir():
        _checks.refuse("path", "be a file", f"the folder {str(target)!r}", "Add the name of the file.")
    with whole(target) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
    return target


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A temporary name in the same folder to write to; it becomes the target when all is written."""
    draft = target.with_name(f".{target.name}.{os.getpid()}.draft")
    try:
        yield draft
        sync(draft)
        os.replace(draft, target)
    except OSError as error:
        if error.filename == str(draft):  # a name that nobody gave
            error.filename = str(target)
        raise
    finally:
        draft.unlink(missing_ok=True)


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk; Windows keeps the names by itself."""
    if path.is_dir() and os.name == "nt":
        return
    handle = os.open(path, os.O_RDWR if path.is_file() and os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def own_place(root: Path, name: str, aside: Callable[[Path], None], *, replace: bool = False) -> Path:
    """The place of a file below a folder, free to be written: nothing is written through a link, or lost.

    Arguments:
        root: the folder.
        name: of the file, from there.
        aside: moves away what is in the way: a link, a file in the place of a folder, what has the name already.
        replace: a file of this name may be replaced.
    """
    place = root / name
    for part in (root / above for above in reversed(Path(name).parents[:-1])):
        if part.is_symlink() or part.is_file():
            aside(part)
    if place.is_symlink() or (place.exists() and not replace):
        aside(place)
    place.parent.mkdir(parents=True, exist_ok=True)
    return place


def renamed(path: Path) -> None:
    """Give a file or a link a free name, by tildes at its end."""
    free = path.with_name(f"{path.name}~")
    while os.path.lexists(free):
        free = free.with_name(f"{free.name}~")
    os.replace(path, free)
