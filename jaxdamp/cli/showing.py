"""Units, sign and words of what a command shows: from its options, or from `jaxdamp.toml` here or in ~/.config."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jaxdamp import _checks
from jaxdamp._display import Display, shown_in
from jaxdamp._documents import read_toml
from jaxdamp.cli.console import Screen
from jaxdamp.cli.wording import in_command_line


FILE, TABLE = "jaxdamp.toml", "show"
KEYS = ("units", "sign")


@contextmanager
def chosen(given: Mapping[str, Any], screen: Screen) -> Iterator[None]:
    """Tables, pictures and CSV as the options say, then a file in this folder, then the file of the user."""
    stated = {key: given[f"show_{key}"] for key in KEYS if given.get(f"show_{key}")}
    sources = []
    for file in _files(given.get("files") or ()) if "show_units" in given else ():
        found = _stated(file)
        sources += [str(file)] if found.keys() - stated.keys() else []
        stated = {**found, **stated}
    display = Display(**stated, wording=in_command_line)
    if display.described:
        where = f" (from {' and '.join(sources)})" if sources else ""
        screen.say(f"{display.described}{where}")
    with shown_in(display):
        yield


def _files(asked: Any) -> list[Path]:
    """The files that may hold settings, the nearest first: of this folder, of a folder that is read, of the user."""
    settings = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    folders = [Path(), *(path for path in map(Path, asked) if path.is_dir()), settings]
    return [file for folder in folders if (file := folder / FILE).is_file()]


def _stated(file: Path) -> dict[str, str]:
    """Units and sign in a file."""
    document = read_toml(file)
    table = document.get(TABLE, {})
    if isinstance(document.get("units"), str):  # as a table they are those of the records in its folder
        _checks.refuse("units", f"stand under [{TABLE}]", f"{document['units']!r} above all tables in {file}")
    wrong = [key for key in table if key not in KEYS or not isinstance(table[key], str)] if table else []
    if not isinstance(table, dict) or wrong:
        _checks.refuse(TABLE, f"hold {' and '.join(KEYS)} as text", f"{table!r} in {file}", 'Such as units = "SI".')
    return table
