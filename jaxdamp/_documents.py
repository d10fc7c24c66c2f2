"""TOML and JSON files: read with limits on size and nesting; what is wrong names the file."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from jaxdamp._tables import Contents


LARGEST = 2**24  # bytes; a law with a network of a million weights
DEEPEST = 20  # parts of a dotted key; a few thousand take minutes and gigabytes to parse
_PART = r"(?:\"[^\"\n]*\"|'[^'\n]*'|[\w-]+)"
_DEEP = re.compile(rf"^[ \t\[]*{_PART}(?:[ \t]*\.[ \t]*{_PART}){{{DEEPEST}}}", re.MULTILINE)


def read_toml(file: Path) -> Contents:
    """What a TOML file says.

    Raises:
        ValueError: no TOML, no text, too large, or nested too deeply.
    """
    text = read_text(file, "TOML")
    if _DEEP.search(text):
        raise ValueError(f"{file} is no valid TOML: a key has more than {DEEPEST} parts. Write tables instead of dots.")
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{file} is no valid TOML: {_said(error)}.") from error


def parse_json(text: str, **options: Any) -> Any:
    """What a JSON text says, with the options of `json.loads`.

    Raises:
        ValueError: no JSON, or nested too deeply.
    """
    try:
        return json.loads(text, **options)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(_said(error)) from error


def read_text(file: Path, kind: str) -> str:
    """The text of a file of settings.

    Raises:
        ValueError: a pipe or a device, larger than such a file is, or no text in UTF-8.
    """
    if file.exists() and not file.is_file() and not file.is_dir():
        raise ValueError(f"{file} is a pipe or a device, not a file of {kind}: save it to a file.")
    size = file.stat().st_size
    if size > LARGEST:
        raise ValueError(f"{file} has {size / 2**20:.0f} MiB, more than a file of {kind} here may have: is it another?")
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{file} is no {kind} in UTF-8 ({error}): save it with this encoding.") from error


def _said(error: Exception) -> str:
    return "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
