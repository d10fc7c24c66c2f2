"""Which files are meant: one file, several, a glob pattern or a folder."""

import glob
import os
import re
from collections.abc import Collection, Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path

from jaxdamp import _checks


MAYBE_NOTES = (".txt", ".dat", ".asc")  # of a folder these are not read: they may be notes
TEXT_SUFFIXES = (".csv", ".tsv", *MAYBE_NOTES)
RECORD_SUFFIXES = (*TEXT_SUFFIXES, ".xlsx", ".xlsm", ".mat", ".tdms", ".mf4", ".mdf", ".parquet")
LARGEST = 2**31  # bytes of a file of records
FOLDER_SUFFIXES = frozenset(RECORD_SUFFIXES) - set(MAYBE_NOTES)  # of the files that a folder stands for


def cache_home() -> Path:
    """The user's folder for what can be computed anew: `~/.cache/jaxdamp`, under `XDG_CACHE_HOME` if that is set."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jaxdamp"


def find_files(
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], suffixes: Collection[str] = (".csv",)
) -> tuple[Path, ...]:
    """The files that the paths name, in natural order within a folder or pattern ("2mm" before "10mm").

    Arguments:
        paths: a file, a folder, a glob pattern, or several of these.
        suffixes: of the files that a folder stands for, in lower case.

    Raises:
        FileNotFoundError: a file does not exist, or a pattern or folder holds nothing.
        ValueError: no path at all, or the same file twice.
    """
    asked = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not asked:
        _checks.refuse("paths", "name at least one file", "empty")
    files = [file for path in asked for file in _expand(path, suffixes)]
    for file in files:
        if files.count(file) > 1:
            must, value = "name every file once", f"naming {file}, which is there {files.count(file)} times"
            _checks.refuse("paths", must, value)
    return tuple(files)


def check_size(file: Path, size: int) -> None:
    """Refuse a file with more bytes than are read.

    Arguments:
        file: for the message.
        size: in bytes, as it lies on the disk or inflated.
    """
    if size > LARGEST:
        much = f"{size / 2**20:.0f} MiB"
        raise ValueError(f"{file} has {much}, more than {LARGEST // 2**20} MiB that are read: cut or export it again.")


def natural_key(text: str) -> list[tuple[int, float, str]]:
    """Sort key that puts "2mm" before "10mm" and "0A" before "0.5A"."""
    parts = re.split(r"(\d+(?:\.\d+)?)", text)
    return [(0, float(part), "") if i % 2 else (1, 0.0, part.lower()) for i, part in enumerate(parts)]


def _expand(path: str | os.PathLike[str], suffixes: Collection[str]) -> Iterator[Path]:
    text, file = os.fspath(path), Path(path).expanduser()
    if file.is_dir():
        yield from _inside(file, suffixes)
    elif file.is_file():
        yield file
    elif file.exists():
        _checks.refuse("paths", "name files or folders", f"{text!r}, a pipe or a device", "Save the records to a file.")
    elif glob.has_magic(text):
        files = [Path(name) for name in glob.glob(str(file), recursive=True) if Path(name).is_file()]
        if not files:
            raise FileNotFoundError(f"No file matches the pattern {text!r}.{_near(file)}")
        yield from sorted(files, key=lambda f: natural_key(str(f)))
    else:
        raise FileNotFoundError(f"There is no file {text!r}.{_near(file)}")


def _inside(folder: Path, suffixes: Collection[str]) -> list[Path]:
    """The files of a folder with these suffixes, in natural order."""
    files = [file for file in folder.iterdir() if file.is_file() and not file.name.startswith((".", "~$"))]
    chosen = [file for file in files if file.suffix.lower() in suffixes]
    if not chosen:
        others = ", ".join(sorted(file.name for file in files if file.suffix.lower() in MAYBE_NOTES)[:5])
        hint = f" It holds {others}: name these files, or a pattern such as '*.txt'." if others else ""
        raise FileNotFoundError(f"Folder {folder} holds no *.csv or other file of records.{hint}")
    return sorted(chosen, key=lambda file: natural_key(file.name))


def _near(file: Path) -> str:
    """A sentence with the names in the same folder that look alike."""
    folder = file.parent
    if not folder.is_dir():
        return f" The folder {str(folder)!r} does not exist either."
    names = sorted(f.name for f in folder.iterdir() if f.is_file() and not f.name.startswith("."))
    near = get_close_matches(file.name, names, 3, cutoff=0.5)
    if near:
        return f" Did you mean {' or '.join(repr(str(folder / name)) for name in near)}?"
    text = [name for name in names if Path(name).suffix.lower() in TEXT_SUFFIXES]
    return f" The folder {str(folder)!r} holds {', '.join(text[:5]) if text else 'no text files'}."
