"""A law as a text that people read, diff and keep: JSON with class names, numbers and units."""

import dataclasses
import inspect
import json
import os
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import jax
import numpy as np

from jaxdamp import _checks
from jaxdamp._types import Number
from jaxdamp.dampers import UNITS, AbstractDamper, FittedRange, has_fitted_range
from jaxdamp.export._write import write_whole
from jaxdamp.parameters import as_float, check_invariants


FORMAT = "jaxdamp law"
PLAIN, WITH_RANGES = 1, 2  # versions: a file of the second may say what its laws were fitted to
FITTED_TO = "fitted_to"


def to_json(law: AbstractDamper, path: str | os.PathLike[str] | None = None) -> str:
    """Write a law, of any composition, as JSON.

    Every number stands with its unit, all digits are kept: `from_json` gives the same law, bit for bit. Laws that you
    defined yourself are written by the name of their class. The range that a law was fitted to stands with it, under
    "fitted_to".

    Arguments:
        law: the law.
        path: a file to write it to; an existing one is replaced, and never left half-written.

    Returns:
        The text.

    Raises:
        ValueError: something that is not a law, values that are not finite or only known inside `jax.jit`, fields
            other than laws, numbers, words, arrays and tuples of these.

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
    if not isinstance(law, AbstractDamper):
        _checks.refuse("law", "be a damper law", f"a {type(law).__name__}")
    version = WITH_RANGES if has_fitted_range(law) else PLAIN
    text = _layout({"format": FORMAT, "version": version, "law": _plain_law(law)}) + "\n"
    if path is not None:
        write_whole(path, text)
    return text.rstrip("\n")


def from_json(path_or_text: str | os.PathLike[str]) -> AbstractDamper:
    """Read a law that `to_json` wrote.

    A law of your own is found by the name of its class if the module that defines it has been imported before.

    Arguments:
        path_or_text: a file, or the text itself (anything that begins with `{`).

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: not JSON, another format or version, an unknown law, a parameter missing or too many, a value
            that is not finite or outside its domain, another unit.

    >>> from jaxdamp.dampers import Lag, Linear
    >>> from_json(to_json(Lag(Linear(1500.0), lag_time=0.004)))
    Lag(law=Linear(rate=1500.0), lag_time=0.004)
    """
    if isinstance(path_or_text, str) and path_or_text.lstrip().startswith("{"):
        source, text = "the text", path_or_text
    else:
        file = Path(path_or_text).expanduser()
        if not file.is_file():
            raise FileNotFoundError(f"There is no law file {str(file)!r} (text would have to begin with '{{').")
        source, text = str(file), file.read_text(encoding="utf-8")
    try:
        document = json.loads(text, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise ValueError(f"A law must be written in JSON, but {source} is not: {error}.") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        _checks.refuse("path_or_text", f'begin with "format": "{FORMAT}"', source, "Was it written by `to_json`?")
    version = document.get("version")
    if version not in (PLAIN, WITH_RANGES):
        remedy = "Another version of jaxdamp wrote it; read it with that one."
        _checks.refuse("version", f"be {PLAIN} or {WITH_RANGES}", repr(version), remedy)
    _same_names("the law file", ["format", "version", "law"], document)
    law = _law(document["law"], "law")
    if version == PLAIN and has_fitted_range(law):
        remedy = f'Files that say what laws were fitted to are of "version": {WITH_RANGES}.'
        _checks.refuse("the law file", f"have no {FITTED_TO!r} in version {PLAIN}", "one that has", remedy)
    return law


# ---- a law to plain dictionaries


def _plain_law(law: AbstractDamper) -> dict[str, Any]:
    name = type(law).__name__
    if _classes().get(name) is not type(law):
        remedy = "Give your class a name of its own; after redefining it, make the law anew."
        _checks.refuse("law", "be of a class that can be found by its name", f"a {name} unlike another {name}", remedy)
    result: dict[str, Any] = {"class": name}
    for field in _own_fields(law):
        value, where = getattr(law, field.name), f"{name}.{field.name}"
        declared = _declared(field)
        result[field.name] = _plain(value, where) if declared is None else _quantity(value, declared["unit"], where)
    if law.fitted_to is not None:
        _known_number(law.fitted_to.limits, f"{name}.{FITTED_TO}")
        result[FITTED_TO] = {
            quantity.name: {"value": list(quantity.limits), "unit": quantity.unit} for quantity in law.fitted_to.known()
        }
    return result


def _own_fields(law: AbstractDamper | type[AbstractDamper]) -> list[dataclasses.Field]:
    """The fields of a law but for its range, which all laws have."""
    return [field for field in dataclasses.fields(law) if field.name != FITTED_TO]


def _plain(value: Any, where: str) -> Any:
    if isinstance(value, AbstractDamper):
        return _plain_law(value)
    if isinstance(value, tuple):
        return [_plain(item, f"{where}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, jax.Array | np.ndarray):
        return _quantity(value, None, where)
    if isinstance(value, float):
        _checks.finite(where, value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    remedy = "Write the law without it, or keep the parameters with `jaxdamp.parameters`."
    _checks.refuse(
        where, "be a law, a number, a word, an array or a tuple of these", f"a {type(value).__name__}", remedy
    )


def _quantity(value: Any, unit: str | None, where: str) -> dict[str, Any]:
    numbers = _known_number(value, where)
    if not np.issubdtype(numbers.dtype, np.floating):
        _checks.refuse(where, "hold floating-point numbers", f"of type {numbers.dtype}")
    _checks.finite(where, numbers)
    return {"value": numbers.tolist()} | ({} if unit is None else {"unit": unit})


def _known_number(value: Any, where: str) -> np.ndarray:
    numbers = _checks.concrete(value)
    if numbers is None:
        remedy = "Call `to_json` outside `jax.jit`, `jax.vmap`, `jax.grad`."
        _checks.refuse(where, "have a known value", "traced", remedy)
    return numbers


def _layout(value: Any, indent: str = "") -> str:
    """JSON with one field a line; a quantity and a list of numbers stay on one line."""
    deeper = indent + "  "
    if isinstance(value, dict) and "value" not in value:
        lines = [f"{deeper}{json.dumps(key)}: {_layout(item, deeper)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        return "[\n" + ",\n".join(deeper + _layout(item, deeper) for item in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


# ---- plain dictionaries to a law


def _classes() -> dict[str, type]:
    """All laws by the name of their class: those of this package first, of others the one defined last."""
    laws: list[type] = []
    waiting: list[type] = [AbstractDamper]
    while waiting:
        subclasses = waiting.pop().__subclasses__()
        waiting += subclasses
        laws += [c for c in subclasses if not inspect.isabstract(c)]
    ours = [c for c in laws if c.__module__.startswith("jaxdamp.")]
    return {c.__name__: c for c in [*laws, *ours]}


def _law(plain: Any, where: str) -> AbstractDamper:
    if not isinstance(plain, dict) or not isinstance(plain.get("class"), str):
        _checks.refuse(where, 'be written as {"class": "...", ...}', json.dumps(plain)[:80])
    name = plain["class"]
    kind = _classes().get(name)
    if kind is None:
        near = get_close_matches(name, sorted(_classes()), 1)
        hint = f"Did you mean {near[0]!r}? " if near else ""
        _checks.refuse(where, "be a law that is known", f"{name!r}", f"{hint}Import the module of your own laws first.")
    fields = _own_fields(kind)
    covered = _fitted_to(plain.get(FITTED_TO), name)
    # options that a class was given after the file was written have their default
    options = {f.name: f.default for f in fields if _declared(f) is None and isinstance(f.default, bool)}
    plain = options | {key: value for key, value in plain.items() if key != FITTED_TO}
    _same_names(name, ["class"] + [field.name for field in fields], plain)
    law = object.__new__(kind)
    for field in fields:
        declared, here = _declared(field), f"{name}.{field.name}"
        value = plain[field.name]
        value = _value(value, here) if declared is None else _number(value, declared["unit"], here)
        if field.type is Number and np.ndim(value):
            _checks.refuse(here, "be one number", value)
        object.__setattr__(law, field.name, value)
    object.__setattr__(law, FITTED_TO, covered)
    check_invariants(law)
    return law


def _fitted_to(plain: Any, owner: str) -> FittedRange | None:
    """The range of a law, as `_plain_law` writes it."""
    if plain is None:
        return None
    where = f"{owner}.{FITTED_TO}"
    if not isinstance(plain, dict):
        must = 'be written as {"velocity": {"value": [...], "unit": "m/s"}, ...}'
        _checks.refuse(where, must, json.dumps(plain)[:80])
    limits: dict[str, tuple[float, float]] = {}
    for name, quantity in plain.items():
        _checks.one_of(where, name, UNITS)
        if _number(quantity, UNITS[name], f"{where}.{name}").shape != (2,):
            _checks.refuse(f"{where}.{name}", "be the lowest and the highest value", json.dumps(quantity)[:80])
        low, high = quantity["value"]
        limits[name] = float(low), float(high)
    return FittedRange(**limits)


def _value(plain: Any, where: str) -> Any:
    if isinstance(plain, dict) and "value" in plain:
        return _number(plain, None, where)
    if isinstance(plain, dict):
        return _law(plain, where)
    if isinstance(plain, list):
        return tuple(_value(item, f"{where}[{i}]") for i, item in enumerate(plain))
    return plain


def _number(plain: Any, unit: str | None, where: str) -> jax.Array:
    shown = {"value": "..."} | ({} if unit is None else {"unit": unit})
    if not isinstance(plain, dict) or plain.keys() != shown.keys():
        _checks.refuse(where, f"be written as {json.dumps(shown)}", json.dumps(plain)[:80])
    if unit is not None and plain["unit"] != unit:
        _checks.refuse(where, f"be in {unit!r}", f"in {plain['unit']!r}", "Convert the number.")
    try:
        numbers = np.asarray(plain["value"])
    except ValueError:
        numbers = np.asarray(None)
    if numbers.size and not np.issubdtype(numbers.dtype, np.number):
        _checks.refuse(where, "be a number or a list of numbers", json.dumps(plain["value"])[:80])
    _checks.finite(where, numbers)
    return as_float(numbers)


def _declared(field: Any) -> dict[str, Any] | None:
    return field.metadata.get("parameter") or field.metadata.get("setting")


def _same_names(owner: str, expected: list[str], plain: dict[str, Any]) -> None:
    missing = [name for name in expected if name not in plain]
    extra = [name for name in plain if name not in expected]
    if missing or extra:
        faults = [f"lacks {', '.join(missing)}"] * bool(missing) + [f"has {', '.join(extra)} too many"] * bool(extra)
        _checks.refuse(owner, f"hold {', '.join(expected)}", " and ".join(faults))


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"A law must hold finite numbers only, but the text has {name}.")
