"""What was set on the damper for each record, from a table, from the names of the files, or from the records."""

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench.contradictions import contradictions, same_motion
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.units import conversion


TEMPERATURE = "temperature"  # the setting that states how warm the damper is when a record begins

Settings = Mapping[str, float | int | str]
_FIELD = re.compile(r"\{(\w*)\}")
_NUMBER = re.compile(r"[+-]?\d+(?:[.,]\d+)?")
_NEAR = 0.85  # similarity of a name to another one from which it is taken for a misspelling
_RECUR = 0.3  # share of the pairs of one motion that contradict, from which several settings were recorded


def settings_by_name(names: Sequence[str], given: str | Mapping[str, Settings]) -> dict[str, dict]:
    """The settings of each record by pattern, in which `{name}` stands for a value in the record's name.

    A pattern alone is one without further settings, which all records must fit.

    >>> settings_by_name(["5mm_0.5A", "5mm_1A"], "*_{current}A")
    {'5mm_0.5A': {'current': 0.5}, '5mm_1A': {'current': 1.0}}
    """
    settings: dict[str, dict] = {name: {} for name in names}
    table = {given: {}} if isinstance(given, str) else given
    must = 'map patterns to settings, {"*_hot": {"temperature": "80 degC"}}, or be a pattern such as "*_{current}A"'
    _checks.instance("settings", table, Mapping, must)
    for pattern, values in table.items():
        _checks.instance("settings", values, Mapping, must)
        expression = _expression(pattern)
        fitting = {name: match for name in names if (match := expression.fullmatch(name))}
        missing = [name for name in names if name not in fitting]
        if not fitting or (missing and isinstance(given, str)):
            remedy = f"It does not fit {', '.join(missing[:8])}."
            _checks.refuse("settings", "have patterns that fit the records", repr(pattern), remedy)
        for name, match in fitting.items():
            _add(settings[name], {**values, **{key: _value(text) for key, text in match.groupdict().items()}}, name)
    return settings


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


def refuse_misspelt(name: str, names: Iterable[str]) -> None:
    """Refuse a setting whose name is nearly one that has a meaning, which would state nothing.

    Longer names, such as "oil_temperature", and those that are near to nothing are the user's own.

    Arguments:
        name: of the setting.
        names: names that have a meaning.

    Raises:
        ValueError: such a name.
    """
    others = {word.lower(): word for word in names if word != name}
    near = get_close_matches(name.lower(), others, 1, _NEAR)
    if near and (near[0] == name.lower() or near[0] not in name.lower()):
        remedy = f"Did you mean {others[near[0]]!r}? If not, name it otherwise: it would be taken for that."
        _checks.refuse("settings", "have names that are spelt right", repr(name), remedy)


def _add(settings: dict, more: Settings, name: str) -> None:
    for key, value in more.items():
        refuse_misspelt(key, [TEMPERATURE])
        if settings.setdefault(key, value) != value:
            must = f"give each setting one value, as {key} of {name!r}"
            _checks.refuse("settings", must, f"{settings[key]!r} and {value!r}")


def initial_temperature(run: BenchRun) -> float | None:
    """Temperature [K] of the damper at the first sample: by its channel, or by the setting `temperature` with a unit.

    Arguments:
        run: a record, such as one with the setting `{"temperature": "80 degC"}`.

    Raises:
        ValueError: a setting without a unit of temperature.

    >>> import dataclasses
    >>> t = np.arange(200) / 100
    >>> run = BenchRun.from_arrays("hot", t, np.sin(9 * t), np.cos(9 * t))
    >>> initial_temperature(dataclasses.replace(run, settings={"temperature": "80 degC"}))
    353.15
    """
    if run.temperature is not None:
        return float(run.temperature[0])
    stated = run.settings.get(TEMPERATURE)
    if stated is None:
        return None
    value, unit = number_and_unit(stated)
    by = None if value is None else conversion("temperature", unit)
    if value is None or by is None:
        remedy = 'Write `settings={"temperature": "80 degC"}`, or K, or degF.'
        _checks.refuse("settings", f"state the temperature of {run.name!r} with its unit", repr(stated), remedy)
    kelvin = float(by(np.asarray(value)))
    _checks.positive("temperature", kelvin, f"It is {stated!r} of {run.name!r}.")
    return kelvin


def number_and_unit(stated: float | int | str) -> tuple[float | None, str]:
    """The number and the unit of a setting such as "20 bar"; no number where it does not begin with one.

    Arguments:
        stated: the value of a setting; a plain number has no unit.

    >>> number_and_unit("20 bar"), number_and_unit(3), number_and_unit("soft")
    ((20.0, 'bar'), (3.0, ''), (None, 'soft'))
    """
    text = str(stated).strip()
    match = re.match(rf"{_NUMBER.pattern}(?:[eE][+-]?\d+)?", text)
    if match is None:
        return None, text
    return float(match.group().replace(",", ".")), text[match.end() :].strip()


_EDGE = r"(?<![A-Za-z\d.])"
_MINUS = r"(?:(?<![^\s_(])-)?"  # one that joins words is none
_IN_NAMES = (  # how adjusters are written in names, and what the numbers are
    (rf"{_EDGE}({_MINUS}\d+(?:[.,]\d+)?) ?A(?![A-Za-z\d])", ("current",)),
    (rf"{_EDGE}({_MINUS}\d+(?:[.,]\d+)?) ?V(?![A-Za-z\d])", ("voltage",)),
    (rf"{_EDGE}({_MINUS}\d+) ?(?:clicks?|clks?)(?![A-Za-z])", ("clicks",)),
    (rf"{_EDGE}(?:clicks?|clks?)[ _-]?({_MINUS}\d+)(?![\d.])", ("clicks",)),
    (rf"{_EDGE}C ?(\d+)[ _,-]*R ?(\d+)(?![A-Za-z\d.])", ("compression_clicks", "rebound_clicks")),
    (rf"{_EDGE}R ?(\d+)[ _,-]*C ?(\d+)(?![A-Za-z\d.])", ("rebound_clicks", "compression_clicks")),
)


def settings_in_name(name: str) -> dict[str, float]:
    """The settings of adjusters that a name states, as workshops write them.

    >>> settings_in_name("run3_0.5A"), settings_in_name("C4 R6 hot"), settings_in_name("12clk"), settings_in_name("5mm")
    ({'current': 0.5}, {'compression_clicks': 4.0, 'rebound_clicks': 6.0}, {'clicks': 12.0}, {})
    """
    settings: dict[str, float] = {}
    for pattern, names in _IN_NAMES:
        match = re.search(pattern, name, re.IGNORECASE if "click" in pattern else 0)
        values = () if match is None else (float(text.replace(",", ".")) for text in match.groups())
        settings = dict(zip(names, values, strict=False)) | settings
    return settings


def settings_in_names(names: Sequence[str]) -> tuple[dict[str, dict], dict[str, tuple[str, ...]]]:
    """The settings of adjusters in the names of records, and a note for each record that has some.

    A setting counts only if every one of several records states it, and not all the same.
    """
    stated = {name: settings_in_name(name) for name in names}
    keys = [k for k in stated[names[0]] if all(k in in_name for in_name in stated.values())] if len(stated) > 1 else []
    keys = [key for key in keys if len({in_name[key] for in_name in stated.values()}) > 1]
    settings: dict[str, dict] = {name: {key: in_name[key] for key in keys} for name, in_name in stated.items()}
    words = {
        name: ", ".join(f"{key} {value:g}" for key, value in in_name.items()) for name, in_name in settings.items()
    }
    return settings, {name: (f"by its name: {text}",) for name, text in words.items() if text}


def settings_apart(runs: Sequence[BenchRun]) -> tuple[dict[str, str], str]:
    """The setting of each record where records of the same motion contradict one another again and again.

    Settings are what separates all such pairs: something that the records state, or a word of their names; of several
    the one with the fewest values. Where nothing does, each record stands for itself.

    Arguments:
        runs: records without a command.

    Returns:
        The setting by name of the record, empty where the records agree; and a sentence on it.
    """
    alike = sum(same_motion(a, b) for a, b in itertools.combinations(runs, 2))
    apart = [(pair.first, pair.second) for pair in contradictions(runs)]
    if not apart or len(apart) < _RECUR * alike:
        return {}, ""
    begin = f"{len(apart)} of {alike} pairs of records of the same motion differ in force: "
    remedy = "To say it, state what was set on the damper (`command`)."
    kinds = [
        (what, settings)
        for what, settings in _candidates(runs)
        if all(settings[first] != settings[second] for first, second in apart)
    ]
    if not kinds:
        said = "they are not pooled but stand one by one, since neither names nor settings tell them apart. "
        return {run.name: run.name for run in runs}, begin + said + remedy
    what, settings = min(kinds, key=lambda kind: len(set(kind[1].values())))
    values = sorted(set(settings.values()), key=by_number)
    return settings, f"{begin}they are taken as settings {', '.join(values)}, by {what}. {remedy}"


def _candidates(runs: Sequence[BenchRun]) -> list[tuple[str, dict[str, str]]]:
    """What may tell records apart: settings that all of them state, words of their names, settings in their names.

    What differs from record to record, such as a running number, tells nothing, unless it is written as an adjuster is.
    """
    words = {run.name: re.split(r"[_\s,;()]+|-(?=\D)", run.name) for run in runs}
    places = range(-1, -min(map(len, words.values())) - 1, -1)
    named = [("a word of their names", {name: parts[i] for name, parts in words.items()}) for i in places]
    shared = [
        (what, settings)
        for what, settings in (*_stated(runs), *named)
        if len(set(settings.values())) < len(runs) or len(runs) == 2 or all(map(settings_in_name, settings.values()))
    ]
    return [*shared, *_in_names(runs)]


def _stated(runs: Sequence[BenchRun]) -> list[tuple[str, dict[str, str]]]:
    """The settings that all records state, without those that were read from their names."""
    keys = [key for key in runs[0].settings if all(key in run.settings for run in runs)]
    keys = [key for key in keys if any(settings_in_name(run.name).get(key) != run.settings[key] for run in runs)]
    return [(f"`{key}`", {run.name: f"{run.settings[key]}" for run in runs}) for key in keys]


def _in_names(runs: Sequence[BenchRun]) -> list[tuple[str, dict[str, str]]]:
    """The settings that all names state, one by one and together."""
    by_name = {run.name: settings_in_name(run.name) for run in runs}
    keys = [key for key in by_name[runs[0].name] if all(key in settings for settings in by_name.values())]
    single = [(f"`{key}`", {name: f"{settings[key]:g}" for name, settings in by_name.items()}) for key in keys]
    short = {key: key.removesuffix("_clicks") for key in keys}
    words = {name: " ".join(f"{short[key]} {settings[key]:g}" for key in keys) for name, settings in by_name.items()}
    return [*single, *([(" and ".join(f"`{key}`" for key in keys), words)] if len(keys) > 1 else [])]


def by_number(text: str) -> tuple[float, str]:
    """What names of settings are sorted by: their first number.

    Arguments:
        text: name of a setting, such as "0.5A".
    """
    number = _NUMBER.search(text)
    return (float(number.group().replace(",", ".")) if number else float("inf"), text)
