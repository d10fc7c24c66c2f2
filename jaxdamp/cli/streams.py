"""Output where a terminal or pipe lacks characters, as many under Windows: written plainly, never an error."""

import codecs
import io
import sys
import unicodedata


_PLAIN = {"−": "-", "–": "-", "→": "->", "≤": "<=", "≥": ">=", "·": "*", "×": "x", "±": "+-", "…": "...", "µ": "u"}
_PLAIN |= {power: f"^{number}" for number, power in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")} | {"⁻": "^-"}


def plain(character: str) -> str:
    """A character in those that every output has.

    >>> "".join(map(plain, "ζ ≤ −0.3 m/s²"))
    '? <= -0.3 m/s^2'
    """
    if character.isascii():
        return character
    return _PLAIN.get(character) or unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode() or "?"


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(plain, error.object[error.start : error.end])), error.end


def write_plainly() -> None:
    """Let output and error output write what their encoding lacks in plain characters."""
    codecs.register_error("jaxdamp.plain", _replaced)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="jaxdamp.plain")
