"""What the header of a column says: its quantity and its unit."""

import re

from jaxdamp.bench.units import SI, Conversion, conversion, ratio


ROLES = tuple(SI)
COMMAND_HEADER = "measured command"  # of a record that the library writes
_WORDS = {
    "time": "time zeit temps tempo tiempo elapsed clock timestamp datetime uhrzeit epoch t".split(),
    "stroke": (
        "stroke displacement disp position pos travel weg hub course déplacement corsa carrera desplazamiento lvdt"
        " extension x s"
    ).split(),
    "velocity": "velocity vel geschwindigkeit vitesse velocità velocidad xdot speed v".split(),
    "force": "force load kraft dämpferkraft effort forza fuerza frc loadcell f".split(),
    "temperature": "temperature temp temperatur température temperatura thermocouple t".split(),
    "command": [],  # see `_is_command`
}
_COMMANDS = {"current", "strom", "spulenstrom", "voltage", "spannung"}
_OF_COMMANDS = {"coil", "valve", "damper", "mr", "solenoid", "measured", "actual", "ventil", "spule", "daempfer"}
REBOUND = {"rebound", "reb", "extension", "droop", "zugstufe", "ausfederung"}
COMPRESSION = {"compression", "bump", "jounce", "druckstufe", "einfederung"}
NOT_MEASURED = {*"setpoint command cmd demand target soll sollwert consigne reference ref error".split()}


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit in a header that sets the unit apart: in brackets, behind a comma or behind a slash.

    A number in brackets, as of a column of a matrix, is no unit.

    >>> split_header("Displacement, in"), split_header("force [N]"), split_header("v/(m/s)"), split_header("x_mm")
    (('Displacement', 'in'), ('force', 'N'), ('v', 'm/s'), ('x_mm', None))
    >>> split_header("data[0]")
    ('data[0]', None)
    """
    bracket = re.fullmatch(r"(.*?)\s*/?\s*[\[({<]\s*([^\[\](){}<>]*?)\s*[\])}>]", header)
    if bracket and not bracket[2].isdigit():
        return bracket[1].strip(), bracket[2] or None
    for mark in (r"\s*,\s*", r"\s+/\s+", r"/"):
        parts = re.split(mark, header, maxsplit=1)
        if len(parts) == 2 and all(parts) and not (mark == "/" and re.search(r"[_\s]", parts[0])):
            return parts[0].strip(), parts[1].strip()
    return header.strip(), None


def tail_unit(name: str, role: str) -> tuple[str, Conversion] | None:
    """The unit behind an underscore or a space, the longest that is one: "v_mm_s" is mm/s."""
    pieces = re.split(r"[_\s]+", name)
    for start in range(1, len(pieces)):
        unit = conversion(role, "_".join(pieces[start:]))
        if unit is not None:
            return "_".join(pieces[:start]), unit
    return None


def words_in(name: str) -> list[str]:
    """The words of a name in lower case, also those that only their capitals set apart."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word.lower() for word in re.split(r"[^A-Za-zÀ-ÿ]+", apart) if word]


def direction_of(header: str) -> int:
    """The direction in which a header says that its column is positive: 1 rebound, -1 compression, 0 none or both.

    >>> direction_of("bump travel [mm]"), direction_of("damper (compression negative) [mm]"), direction_of("stroke_mm")
    (-1, 1, 0)
    """
    words = {*words_in(header)}
    way = bool(words & REBOUND) - bool(words & COMPRESSION)
    return -way if words & {"negative", "neg", "minus"} else way


def role_of(header: str, unit: str = "") -> str | None:
    """The quantity that a header names; its unit decides between several ("T_degC" is no time).

    Whole words count more than single letters, and the last word more than those before it, as in "load cell
    temperature". Columns of set points are none.
    """
    name, written = split_header(header)
    return "command" if _is_command(name) else _motion_role(name, unit or written)


def _motion_role(name: str, written: str | None) -> str | None:
    """The quantity of a name and its unit, if it is no command."""
    signal = signal_unit(name)
    words = words_in(name.removesuffix(signal))
    if NOT_MEASURED.intersection(words):
        return None
    by_words = [role for word in reversed(words) for role in ROLES if len(word) > 1 and word in _WORDS[role]]
    by_letter = [role for role in ROLES if words and words[0] in _WORDS[role] and len(words[0]) == 1]
    for role in by_words + by_letter:
        if (conversion(role, written) if written else tail_unit(name, role)) is not None:
            return role
    return next(iter(by_words + (by_letter if len(words) <= 2 else [])), None)


def _is_command(name: str) -> bool:
    """Whether a name is that of a measured command: the current or voltage of a coil or valve, and nothing else."""
    tail = tail_unit(name, "command")
    words = words_in(tail[0] if tail else name)
    return words == COMMAND_HEADER.split() or bool(
        _COMMANDS.intersection(words) and _COMMANDS | _OF_COMMANDS >= {*words}
    )


def signal_unit(name: str) -> str:
    """The unit of a sensor's signal behind an underscore or a space, as in "F_mV"; empty if there is none."""
    tail = re.split(r"[_\s]+", name)[-1] if re.search(r"[_\s]", name) else ""
    return tail if tail and ratio(tail, "V") is not None else ""
