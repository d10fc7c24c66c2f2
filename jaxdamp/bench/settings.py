"""What was set on the damper for each record, from a table or from the names of the files."""

import re
from collections.abc import Mapping, Sequence

from jaxdamp import _checks


Settings = Mapping[str, float | int | str]
_FIELD = re.compile(r"\{(\w*)\}")
_NUMBER = re.compile(r"[+-]?\d+(?:[.,]\d+)?")


def settings_by_name(names: Sequence[str], given: str | Mapping[str, Settings] | None) -> dict[str, dict]:
    """The settings of each record.

    Arguments:
        names: of the records.
        given: pattern to settings; `{name}` in a pattern stands for a value in the record's name. A pattern alone is
            one without further settings, which all records must fit.

    Raises:
        ValueError: a pattern that no record fits, a record that does not fit a pattern given alone, or one setting
            with two values.

    >>> settings_by_name(["5mm_0.5A", "5mm_1A"], "*_{current}A")
    {'5mm_0.5A': {'current': 0.5}, '5mm_1A': {'current': 1.0}}
    """
    found: dict[str, dict] = {name: {} for name in names}
    if given is None:
        return found
    table = {given: {}} if isinstance(given, str) else given
    must = 'map patterns to settings, such as {"*_hot": {"temperature": 80}}, or be a pattern such as "*_{current}A"'
    _checks.instance("settings", table, Mapping, must)
    for pattern, values in table.items():
        _checks.instance("settings", values, Mapping, must)
        expression = _expression(pattern)
        fitting = {name: match for name in names if (match := expression.fullmatch(name))}
        missing = [name for name in names if name not in fitting]
        if not fitting or (missing and isinstance(given, str)):
            records = ", ".join(missing[:8])
            _checks.refuse(
                "settings", "have patterns that fit the records", repr(pattern), f"It does not fit {records}."
            )
        for name, match in fitting.items():
            _add(found[name], {**values, **{key: _value(text) for key, text in match.groupdict().items()}}, name)
    return found


def _expression(pattern: str) -> re.Pattern[str]:
    """The regular expression of a pattern with `*`, `?` and named places."""
    pieces = _FIELD.split(pattern)
    names = pieces[1::2]
    wrong = [name for name in names if not name.isidentifier() or names.count(name) > 1]
    if wrong:
        _checks.refuse("settings", "name each place in braces by a word of its own", repr(pattern))
    texts = ["".join({"*": ".*", "?": "."}.get(c, re.escape(c)) for c in piece) for piece in pieces[::2]]
    places = [f"(?P<{name}>.+?)" for name in names]
    return re.compile("".join(sum(zip(texts, [*places, ""], strict=True), ())), re.DOTALL)


def _value(text: str) -> float | str:
    return float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else text


def _add(settings: dict, more: Settings, name: str) -> None:
    for key, value in more.items():
        if settings.setdefault(key, value) != value:
            must = f"give each setting one value, as {key} of {name!r}"
            _checks.refuse("settings", must, f"{settings[key]!r} and {value!r}")
