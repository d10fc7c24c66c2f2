"""Names of laws, parameters and ride metrics as people say them."""

import html
import re


_PEOPLE = {
    "besinger": "Besinger", "bouc wen": "Bouc–Wen", "dahl": "Dahl", "lu gre": "LuGre", "lugre": "LuGre",
    "karadayi masada": "Karadayi–Masada", "stribeck": "Stribeck", "coulomb": "Coulomb",
}  # fmt: skip
_BESIDE = ("series spring", "lag", "series spring dahl")  # at the end of the name of a law: what stands beside the law
_METRICS = (  # patterns in the names of ride metrics, and how people say them
    (r"^weighted_rms_(.*)", r"\1, weighted RMS"),
    (r"^vibration_dose_value_(.*)", r"\1, vibration dose value"),
    (r"^(rms|peak)_(.*)", r"\2, \1"),
    (r"(.*)_(peak_to_peak|rms|mean)$", r"\1, \2"),
    (r"\bsprung_|_sprung_", "body_"),
    (r"working_space", "suspension travel"),
    (r"dynamic_tyre_load", "tyre load variation"),
    (r"_", " "),
    (r"\brms\b", "RMS"),
    (r"peak to peak", "peak–peak"),
)


def in_words(name: str) -> str:
    """The name of a law, parameter or setting as people say it.

    >>> in_words("besinger_lag"), in_words("front.damper.rebound_rate")
    ('Besinger + lag', 'front damper rebound rate')
    """
    text = name.replace(".", " ").replace("_", " ").strip()
    for part in _BESIDE:
        lead = text.removesuffix(f" {part}")
        text = f"{lead} + {part.replace(' dahl', ' + dahl')}" if lead != text and lead in _PEOPLE else text
    for plain, said in _PEOPLE.items():
        text = re.sub(rf"\b{plain}\b", said, text)
    return text


def metric_words(name: str) -> str:
    """The name of a ride metric as people say it; of anything else, its words.

    >>> metric_words("weighted_rms_sprung_acceleration"), metric_words("front_working_space_peak_to_peak")
    ('body acceleration, weighted RMS', 'front suspension travel, peak–peak')
    """
    said = name
    for pattern, words in _METRICS:
        said = re.sub(pattern, words, said)
    return in_words(said)


def path_words(path: str) -> str:
    """The path of a parameter, or the name of a metric, as people say it.

    >>> path_words("front.damper.law.lag_time"), path_words("law.law.rebound_rate"), path_words("rig.force_offset")
    ('front damper lag time', 'rebound rate', 'machine: force offset')
    """
    return metric_words(re.sub(r"\blaw\.", "", path).replace("rig.", "machine: "))


_RAISED = str.maketrans("-.0123456789", "⁻·⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset(text: str) -> str:
    """A text as it is printed: a true minus before numbers, raised powers.

    >>> typeset("-0.3 m/s^1.75")
    '−0.3 m/s¹·⁷⁵'
    """
    return re.sub(r"(?<![\w])-(?=\d)", "−", raised(text))


def raised(text: str) -> str:
    """A text with raised powers.

    >>> raised("-0.3 m/s^1.75")
    '-0.3 m/s¹·⁷⁵'
    """
    return re.sub(r"\^(-?[\d.]*\d)", lambda power: power[1].translate(_RAISED), text)


# Of the library: lower case, with no digits but those of a preset (half_car_002); no file or record, nothing in a call.
_NAME = re.compile(r"\b(?:(?:(?:[a-z][a-z_]*|\d)\.)*[a-z]+(?:_[a-z]+)+(?:_\d{3})?|m113_\w+)\b(?!\.[a-z]{3,4}\b|[(=])")


def said(text: str) -> str:
    """A sentence for people: names of the library and roads of the command line in words, arrows, minus and powers.

    >>> said("weighted_rms_sprung_acceleration 0.78 -> 0.71 m/s^2 (-8.9 %) on iso:C, front.damper.law.lag_time at 5")
    'body acceleration, weighted RMS 0.78 → 0.71 m/s² (−8.9 %) on ISO class C, front damper lag time at 5'
    >>> said("50mm_0.1Hz and Front_A are predicted worst by besinger_lag in m113_003")
    '50mm_0.1Hz and Front_A are predicted worst by Besinger + lag in m113 003'
    """
    return _printed(_NAME.sub(lambda match: path_words(match[0]), text)).replace("`", "")


_PATH = re.compile(rf"\b(?:law|rig|(?:\w+\.)*damper)(?:\.[a-z]\w*|\.\d)+(?![\w(=])|{_NAME.pattern}")
# What a reader types: code, options with their values, quoted names.
_TYPED = re.compile(r"(`[^`]*`|--[\w-]+(?:[ =][^\s,.]\S*)?|\"[^\"]*\"|'[^'\s]*')")


def said_as_html(text: str) -> str:
    """A remark as `said`, but what a reader types stays as it is; names of the library are where a mouse rests.

    >>> said_as_html("law.rebound_rate is at a bound: hold it with --freeze law.rebound_rate")
    '<span title="law.rebound_rate">rebound rate</span> is at a bound: hold it with --freeze law.rebound_rate'
    """
    parts = [html.escape(part if typed % 2 else _printed(part)) for typed, part in enumerate(_TYPED.split(text))]
    parts[::2] = [_PATH.sub(lambda m: f'<span title="{m[0]}">{path_words(m[0])}</span>', part) for part in parts[::2]]
    return "".join(parts)


def _printed(text: str) -> str:
    """A text with roads of the command line in words, and with arrows, minus and powers as they are printed."""
    text = re.sub(r"\biso:([A-H])\b", r"ISO class \1", text)
    text = re.sub(r"\bbump:([\d.]+):([\d.]+)", lambda at: f"a bump of {1e3 * float(at[1]):g} mm × {at[2]} m", text)
    for plain, printed in (("->", "→"), ("<=", "≤"), (">=", "≥"), ("**", "·")):
        text = text.replace(plain, printed)
    return typeset(text)


def first_upper(words: str) -> str:
    """Words that begin a sentence; units and names inside stay as they are."""
    return words[:1].upper() + words[1:]


def class_words(part: object) -> str:
    """The name of a class in words: "digressive progressive" of a DigressiveProgressive, "half car" of a HalfCar."""
    return in_words(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(part).__name__).lower())
