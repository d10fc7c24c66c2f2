"""The folder that a command writes: whole or not at all, and never over what is not its own."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


MANIFEST = "manifest.json"
FORMAT = "jaxdamp results"


@contextmanager
def results_folder(target: Path, command: str, *, force: bool = False) -> Iterator[Path]:
    """A draft folder to write into, which takes the place of the target when all is done.

    A target that does not exist, is empty, or was written by a command before is replaced, file by file: files that
    others put there stay. Any other folder is refused, unless `force` is set, and even then only files of the same
    names are replaced.

    Arguments:
        target: the folder to write.
        command: name of the command, for the manifest.
        force: write into a folder of others.

    Raises:
        ValueError: the target is a file, or a folder with other contents.
    """
    target = target.expanduser()
    earlier = _earlier_files(target, force)
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".draft", dir=target.parent))
    try:
        yield draft
        files = written(draft)
        manifest = {"format": FORMAT, "command": command, "files": [*files, MANIFEST]}
        (draft / MANIFEST).write_text(json.dumps(manifest, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        _publish(draft, target, earlier)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def written(folder: Path) -> list[str]:
    """All files below a folder, in order, as paths relative to it."""
    return sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())


def _earlier_files(target: Path, force: bool) -> list[str]:
    """The files that a command wrote into the target before."""
    if not target.exists():
        return []
    if not target.is_dir():
        raise ValueError(f"{str(target)!r} is a file: name a folder with --out.")
    if not any(target.iterdir()):
        return []
    try:
        manifest = json.loads((target / MANIFEST).read_text(encoding="utf-8"))
        if manifest["format"] == FORMAT:
            return [name for name in manifest["files"] if ".." not in Path(name).parts and not Path(name).is_absolute()]
    except (OSError, ValueError, KeyError, TypeError):
        pass
    if force:
        return []
    raise ValueError(
        f"The folder {str(target)!r} is not empty and was not written by jaxdamp: name another one with --out, or "
        "pass --force to write into it (files of the same names are replaced, all others stay)."
    )


def _publish(draft: Path, target: Path, earlier: list[str]) -> None:
    """Move the draft into place."""
    mask = os.umask(0)
    os.umask(mask)
    draft.chmod(0o777 & ~mask)
    if not target.exists():
        draft.rename(target)
        return
    fresh = written(draft)
    for name in fresh:
        place = target / name
        place.parent.mkdir(parents=True, exist_ok=True)
        os.replace(draft / name, place)
    for name in set(earlier) - set(fresh):
        (target / name).unlink(missing_ok=True)
        for folder in (target / name).parents:
            if folder == target or not folder.is_dir() or any(folder.iterdir()):
                break
            folder.rmdir()
