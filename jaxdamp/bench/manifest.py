"""How to read the records of a folder, written beside them: `jaxdamp.toml`."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from jaxdamp import _checks
from jaxdamp._documents import read_toml
from jaxdamp._tables import Contents


NAME = "jaxdamp.toml"
TABLES = ("columns", "units", "gains")
Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]
Kinds = Mapping[str, tuple[type, ...]]  # key of a manifest to what it may be
BENCH_KEYS: Kinds = {
    "sign": (str,),
    "force_sign": (str,),
    "sampling_rate": (int, float),
    "delimiter": (str,),
    "command": (int, float, str, dict),
    "settings": (str, dict),
    "files": (list,),
    "test": (str,),
    "stroke_from_velocity": (bool,),
    "show": (dict,),
    **dict.fromkeys(TABLES, (dict,)),
}
RIDE_KEYS: Kinds = {
    "columns": (dict,),
    "road": (str, int, list),
    "units": (dict,),
    "reversed_channels": (list,),
    "sampling_rate": (int, float),
    "delimiter": (str,),
    "show": (dict,),
}
TABLE_KEYS: Kinds = {key: BENCH_KEYS[key] for key in ("sign", "columns", "units", "delimiter", "show")}
_KIND_NAMES = {"dict": "table", "str": "text", "bool": "true or false", "int": "whole number", "float": "number"}


def with_manifest(
    paths: Paths, manifest: str | os.PathLike[str] | bool | None, given: Contents, keys: Kinds
) -> tuple[list[str | os.PathLike[str]], Contents, tuple[str, ...]]:
    """What is read, how it is read by the call and a manifest together, and a note if there is a manifest.

    Arguments:
        paths: what is to be read; only a single folder has a manifest of its own, which may name the files in it.
        manifest: its path, from here or from the folder; True for `jaxdamp.toml` in the folder, if there is one; False
            or None for none.
        given: arguments of the call, which win; columns, units and gains quantity by quantity.
        keys: of the manifest.
    """
    asked: list[str | os.PathLike[str]] = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    folders = [Path(path) for path in asked if len(asked) == 1 and Path(path).expanduser().is_dir()]
    file = find_manifest(manifest, folders)
    if file is None:
        return asked, given, ()
    stated = _read_manifest(file, keys)
    if "files" in stated and folders:
        asked = [folders[0].expanduser() / pattern for pattern in stated["files"]]
    return asked, _merged(stated, given), (f"read as the manifest {file} says",)


def _merged(stated: Contents, given: Contents) -> Contents:
    """What a manifest says with what was given in the call, which wins."""
    out = {key: value for key, value in stated.items() if key not in ("files", "test", "show")}
    for key, value in given.items():
        if key in TABLES:
            out[key] = {**out.get(key, {}), **(value or {})}
        elif value is not None or key not in out:
            out[key] = value
    if "test" in stated:
        settings = out.get("settings") or {}
        settings = {settings: {}} if isinstance(settings, str) else settings
        out["settings"] = {"*": {"test": stated["test"]}, **settings}
    return out


def find_manifest(manifest: str | os.PathLike[str] | bool | None, folders: Sequence[Path]) -> Path | None:
    """The manifest given, or the one in the folder that is read."""
    if isinstance(manifest, bool | None):
        inside = [folder.expanduser() / NAME for folder in folders if manifest]
        return next((file for file in inside if file.is_file()), None)
    given = Path(manifest).expanduser()
    for file in (given, *(folder.expanduser() / given for folder in folders)):
        if file.is_file():
            return file
    places = "".join(f", nor in {folder}" for folder in folders)
    raise FileNotFoundError(f"There is no manifest {os.fspath(manifest)!r}{places}.")


def _read_manifest(file: Path, keys: Kinds) -> Contents:
    """The arguments that a manifest holds."""
    stated = read_toml(file)
    for key, value in stated.items():
        if key not in keys:
            near = _checks.nearest(key, keys)
            hint = f" Did you mean {near!r}?" if near else ""
            raise ValueError(f"{file}: unknown key {key!r}; there are {', '.join(keys)}.{hint}")
        kinds = keys[key]
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            names = " or ".join(_KIND_NAMES.get(kind.__name__, kind.__name__) for kind in kinds)
            article = "" if kinds == (bool,) else "a "
            raise ValueError(f"{file}: {key} must be {article}{names}, but is {_checks.described(value)}.")
    if "columns" in stated:  # TOML has no None
        stated["columns"] = {role: None if name is False else name for role, name in stated["columns"].items()}
    return stated
