"""The limits of the numbers of an FMU, and the texts about its signals, as tables of its source."""

import json
import re
from collections.abc import Iterator, Sequence

import numpy as np

from jaxdamp.export._c_text import CFunction, Functions
from jaxdamp.export._law_program import AbstractProgram, LawNumber
from jaxdamp.parameters import Domain, around_zero


GREATEST, _LEAST = float(np.finfo(float).max), float(np.finfo(float).tiny)
_ANY = (-GREATEST, GREATEST)  # an infinite number and NaN lie outside


def in_fmi(path: str) -> str:
    """A path as the name of a variable, with numbers in brackets: `terms.0.knots` becomes `terms[0].knots`."""
    return re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", path)


def limits(domain: Domain, place: int = 0) -> tuple[float, float]:
    """The lowest and the highest value that one number may have; without a limit the lowest and the highest number.

    An open end at zero, as of a positive number, is the next normal number: FMI has closed ends only.
    """
    if domain is around_zero:
        return [(-GREATEST, 0.0), (0.0, GREATEST)][place]
    ends = []
    for end, inward in ((domain.lower, 1.0), (domain.upper, -1.0)):
        if not np.isfinite(end):
            ends.append(-inward * GREATEST)
        elif domain.contains(np.array([end])):
            ends.append(float(end))
        else:
            ends.append(inward * _LEAST if end == 0.0 else float(np.nextafter(end, inward * np.inf)))
    return ends[0], ends[1]


def tables(program: AbstractProgram, numbers: Sequence[str], outputs: Sequence[str]) -> str:
    """What checks.c reads: limits of all numbers, names of outputs, conditions between parameters."""
    rows = list(_rows(program.numbers, numbers)) or [_row("none", "finite", *_ANY, rises=False)]
    parts = (said.partition(" ") for said in program.conditions)
    conditions = [f"    {_text(in_fmi(path) + ' ' + said)}," for path, _, said in parts]
    condition = ["static const char *const model_conditions[] = {", *conditions, "};"]
    return "\n".join(
        [
            "/* What each number may be; `rises`: it must be greater than the one before. */",
            "static const struct {",
            "    const char *name, *must;",
            "    double lower, upper;",
            "    int rises;",
            "} model_limits[] = {",
            *rows,
            "};",
            f"static const char *const model_output_names[] = {{{', '.join(map(_text, outputs))}}};",
            f"#define MODEL_CONDITIONS {len(conditions)}",
            *(condition if conditions else []),
            "",
        ]
    )


def margins(program: AbstractProgram) -> list[CFunction]:
    """The function for the conditions between parameters; none if there are none."""
    said = "By how much each condition between parameters holds."
    return [Functions("model", program.dtype)("margins p > y", program.margins, said)] if program.conditions else []


def _rows(numbers: Sequence[LawNumber], names: Sequence[str]) -> Iterator[str]:
    each = ((number, index) for number in numbers for index in np.ndindex(*number.value.shape))
    for name, (number, index) in zip(names, each, strict=True):
        place = index[-1] if index else 0
        ends = limits(number.domain, place)
        must = "finite" if ends == _ANY else number.domain.name
        yield _row(name, must, *ends, rises=number.domain.ordered and place > 0)


def _row(name: str, must: str, lower: float, upper: float, *, rises: bool) -> str:
    return f"    {{{_text(name)}, {_text(must)}, {lower!r}, {upper!r}, {int(rises)}}},"


def _text(words: str) -> str:
    """A text of C, which the logger of an importer takes as a format."""
    return json.dumps(words.replace("%", "%%"), ensure_ascii=False)
