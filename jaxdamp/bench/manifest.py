"""How to read the records of a folder, written beside them: `jaxdamp.toml`."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxdamp import _checks
from jaxdamp._documents import read_toml


NAME = "jaxdamp.toml"
TABLES = ("columns", "units", "gains")
KEYS = ("sign", "force_sign", "sampling_rate", "delimiter", "command", "settings", "files", "test")
KEYS += ("stroke_from_velocity", *TABLES)
_KINDS = {
    "sign": str,
    "force_sign": str,
    "delimiter": str,
    "test": str,
    "sampling_rate": (int, float),
    "command": (int, float, str, dict),
    "settings": (str, dict),
    "files": list,
    "stroke_from_velocity": bool,
}
_KIND_NAMES = {"dict": "table", "str": "text", "bool": "true or false"}


def find_manifest(manifest: str | os.PathLike[str] | bool, paths: Sequence[str | os.PathLike[str]]) -> Path | None:
    """The manifest given, or the one in the folder that is read.

    Arguments:
        manifest: its path, from here or from the folder; True for `jaxdamp.toml` in the folder, if there is one; False
            for none.
        paths: what is read; only a single folder has a manifest of its own.
    """
    folders = [path for path in map(Path, paths) if path.expanduser().is_dir()] if len(paths) == 1 else []
    if isinstance(manifest, bool):
        inside = [folder.expanduser() / NAME for folder in folders if manifest]
        return next((file for file in inside if file.is_file()), None)
    given = Path(manifest).expanduser()
    for file in (given, *(folder.expanduser() / given for folder in folders)):
        if file.is_file():
            return file
    places = "".join(f", nor in {folder}" for folder in folders)
    raise FileNotFoundError(f"There is no manifest {os.fspath(manifest)!r}{places}.")


def read_manifest(file: Path) -> dict[str, Any]:
    """The arguments of `bench.read` that a manifest holds, and its `files` and `test`.

    Raises:
        ValueError: no TOML, an unknown key, or a value of the wrong kind, naming file and key.
    """
    given = read_toml(file)
    for key, value in given.items():
        if key not in KEYS:
            near = _checks.nearest(key, KEYS)
            hint = f" Did you mean {near!r}?" if near else ""
            raise ValueError(f"{file}: unknown key {key!r}; there are {', '.join(KEYS)}.{hint}")
        kinds = _KINDS.get(key, dict)
        if not isinstance(value, kinds) or (isinstance(value, bool) and kinds is not bool):
            names = " or ".join(_KIND_NAMES.get(k.__name__, k.__name__) for k in _as_tuple(kinds))
            article = "" if kinds is bool else "a "
            raise ValueError(f"{file}: {key} must be {article}{names}, but is {_checks.described(value)}.")
    if "columns" in given:  # TOML has no None
        given["columns"] = {role: None if name is False else name for role, name in given["columns"].items()}
    return given


def _as_tuple(kinds: Any) -> tuple[type, ...]:
    return kinds if isinstance(kinds, tuple) else (kinds,)


def merged(manifest: Mapping[str, Any], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest with what was given in the call, which wins; columns, units and gains quantity by quantity."""
    out = {key: value for key, value in manifest.items() if key not in ("files", "test")}
    for key, value in arguments.items():
        if key in TABLES:
            out[key] = {**out.get(key, {}), **(value or {})}
        elif value is not None or key not in out:
            out[key] = value
    if "test" in manifest:
        rest = out["settings"] or {}
        out["settings"] = {"*": {"test": manifest["test"]}, **({rest: {}} if isinstance(rest, str) else rest)}
    return out
