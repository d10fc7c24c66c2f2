"""Laws, vehicles and roads as readable JSON with class names, numbers and units."""

import json
import os
from pathlib import Path
from typing import NoReturn

import equinox as eqx
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp._documents import parse_json, read_text
from jaxdamp._tables import Contents
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper, has_fitted_range, has_standard_errors
from jaxdamp.export._rebuild import FITTED_TO, STANDARD_ERRORS, plain_module, rebuilt
from jaxdamp.parameters import checked
from jaxdamp.roads import AbstractRoad, WhiteRoad
from jaxdamp.vehicles import AbstractVehicle


KINDS: Contents = {  # kinds of files, the most specific first
    "law": AbstractDamper,
    "vehicle": AbstractVehicle,
    "road": (AbstractRoad, WhiteRoad),
    "module": eqx.Module,
}
FORMATS = {f"jaxdamp {kind}": kind for kind in KINDS}
PLAIN, WITH_RANGES, WITH_ERRORS = 1, 2, 3  # versions of the format: fitted ranges came second, standard errors third


def to_json(module: eqx.Module, path: str | os.PathLike[str] | None = None) -> str:
    """Write a law, a vehicle, a road or any other module of this package or of your own as JSON.

    Every number has its unit and all digits: `from_json` gives exactly the same module. Your own classes are written by
    their name. The fitted range of a law is written as "fitted_to", the standard errors of its fit as
    "standard_errors", with null where the records say nothing: a tuning of the
    law then leaves alone what they do not determine.

    Arguments:
        module: any composition.
        path: a file to write; an existing one is replaced, and never left incomplete.

    Returns:
        The text.

    Raises:
        ValueError: something else, values that are not finite or only known inside `jax.jit`, fields other than
            modules, numbers, words, arrays and tuples of these.

    >>> from jaxdamp.dampers import Linear
    >>> print(to_json(Linear(1500.0)))
    {
      "format": "jaxdamp law",
      "version": 1,
      "law": {
        "class": "Linear",
        "rate": {"value": 1500.0, "unit": "N s/m"}
      }
    }
    """
    must = "be a law, a vehicle, a road or another module"
    _checks.instance("module", module, eqx.Module, must, "Write for example `to_json(result.law, 'law.json')`.")
    kind = next(kind for kind, classes in KINDS.items() if isinstance(module, classes))
    text = _layout({"format": f"jaxdamp {kind}", "version": _version(module), kind: plain_module(module)}) + "\n"
    if path is not None:
        write_whole(path, text)
    return text.rstrip("\n")


def from_json(path_or_text: str | os.PathLike[str]) -> PyTree:
    """Read what `to_json` wrote.

    Your own classes are identified by name; import the module that defines them first. Values are checked as by the
    constructors.

    Arguments:
        path_or_text: a file, or the text itself (anything that begins with `{`).

    Returns:
        The law, vehicle, road or other module.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: not JSON, another format or version, an unknown class, a parameter missing or too many, a value
            that is not finite or outside its domain, another unit.

    >>> from jaxdamp.dampers import Lag, Linear
    >>> from_json(to_json(Lag(Linear(1500.0), lag_time=0.004)))
    Lag(law=Linear(rate=1500.0), lag_time=0.004)
    """
    if isinstance(path_or_text, str) and path_or_text.lstrip().startswith("{"):
        source, text = "the text", path_or_text
    else:
        file = Path(path_or_text).expanduser()
        if file.is_dir():
            _checks.refuse("path_or_text", "be a file", f"the folder {str(file)!r}", "Add the name of the file.")
        if not file.is_file():
            raise FileNotFoundError(f"There is no file {str(file)!r} (text would have to begin with '{{').")
        source, text = str(file), read_text(file, "JSON")
    try:
        document = parse_json(text, parse_constant=_no_constant)
    except ValueError as error:
        raise ValueError(f"It must be written in JSON, but {source} is not: {error}.") from error
    kind = FORMATS.get(str(document.get("format"))) if isinstance(document, dict) else None
    if kind is None:
        formats = " or ".join(f'"{name}"' for name in FORMATS)
        _checks.refuse("path_or_text", f'begin with "format": {formats}', source, "Was it written by `to_json`?")
    version = document.get("version")
    if version not in (PLAIN, WITH_RANGES, WITH_ERRORS):
        remedy = "Another version of jaxdamp wrote it; read it with that one."
        _checks.refuse("version", f"be {PLAIN}, {WITH_RANGES} or {WITH_ERRORS}", repr(version), remedy)
    if sorted(document) != sorted(["format", "version", kind]):
        _checks.refuse(f"the {kind} file", f"hold format, version, {kind}", f"of {', '.join(document)}")
    module = checked(rebuilt(document[kind], kind))
    _checks.instance(kind, module, KINDS[kind], f"be a {kind}", "The format of the file says so.")
    if version < (needed := _version(module)):
        entry = STANDARD_ERRORS if needed == WITH_ERRORS else FITTED_TO
        remedy = f'Files with this entry are of "version": {needed}.'
        _checks.refuse(f"the {kind} file", f"have no {entry!r} in version {version}", "one that has", remedy)
    return module


def _version(module: eqx.Module) -> int:
    """The first version of the format that can hold a module."""
    return WITH_ERRORS if has_standard_errors(module) else WITH_RANGES if has_fitted_range(module) else PLAIN


def _layout(value: object, indent: str = "") -> str:
    """JSON with one field a line; a quantity and a list of numbers stay on one line."""
    deeper = indent + "  "
    if isinstance(value, dict) and value and "value" not in value:
        lines = [f"{deeper}{json.dumps(key)}: {_layout(item, deeper)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        return "[\n" + ",\n".join(deeper + _layout(item, deeper) for item in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"A file must hold finite numbers only, but the text has {name}.")
