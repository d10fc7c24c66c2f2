"""The C text of exported functions: header with a struct of numbers, and source."""

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxdamp.codegen import C, PrintedFunction, Program
from jaxdamp.export._law_program import LawNumber


LANGUAGE = C()
INCLUDES = """\
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
"""


# A compiler's time grows faster than the length of a function: a minute for the thousands of lines of a full car.
_NOT_OPTIMISED = """\
#if defined(__clang__)
__attribute__((noinline, optnone))
#elif defined(__GNUC__)
__attribute__((optimize("O0")))
#endif
"""


class CFunction(NamedTuple):
    """A function of the source.

    Attributes:
        comment: what it computes.
        head: its declaration.
        program: its statements.
        targets: the arguments that take the parts of the result; the result is returned where there are none.
        optimised: whether the compiler may optimise it; not if it is long and called rarely.
    """

    comment: str
    head: str
    program: Program
    targets: Sequence[str] = ()
    optimised: bool = True


class CSource(NamedTuple):
    """What a header and a source are written from.

    Attributes:
        name: before the name of everything.
        about: lines of the comment above the header.
        dtype: the type of all numbers.
        numbers: the members of the struct.
        constants: names of whole numbers with their values, and comments.
        functions: all functions but that which sets the numbers.
    """

    name: str
    about: list[str]
    dtype: str
    numbers: list[LawNumber]
    constants: list[tuple[str, int, str]]
    functions: list[CFunction]

    def header(self) -> str:
        """The declarations, for C and C++."""
        real, guard = LANGUAGE.types[self.dtype], f"{self.name.upper()}_H"
        members = [f"    {line}" for number in self.numbers for line in _member(number, real)]
        defines = [f"#define {key} {value}{f' /* {said} */' if said else ''}" for key, value, said in self.constants]
        declared = [("The numbers of the exported model.", self._defaults_head())]
        declared += [(function.comment, function.head) for function in self.functions]
        return "\n".join(
            [
                *(f"{'/*' if k == 0 else ' *'} {comment(line)}".rstrip() for k, line in enumerate(self.about)),
                " */",
                *[f"#ifndef {guard}", f"#define {guard}", "", *defines, ""],
                *["#ifdef __cplusplus", 'extern "C" {', "#endif", ""],
                f"typedef struct {self.name}_parameters {{",
                *(members or [f"    {real} none; /* there are no numbers */"]),
                *[f"}} {self.name}_parameters;", ""],
                *(f"/* {said} */\n{head};" for said, head in declared),
                *["", "#ifdef __cplusplus", "}", "#endif", "", f"#endif /* {guard} */", ""],
            ]
        )

    def definitions(self) -> str:
        """The functions."""
        return "\n".join([self._defaults(), *map(_definition, self.functions)])

    def static(self) -> str:
        """Declarations and functions, visible in their file only."""
        text = f"{self.header()}\n{INCLUDES}\n{self.definitions()}"
        return re.sub(r"(?m)^(void|double|float) (?=\w+\()", r"static \1 ", text)

    def _defaults_head(self) -> str:
        return f"void {self.name}_defaults({self.name}_parameters *p)"

    def _defaults(self) -> str:
        values = [
            f"    p->{n.name}{place} = {number_text(value, self.dtype)};"
            for n in self.numbers
            for place, value in _entries(n)
        ]
        return "\n".join([f"{self._defaults_head()} {{", *(values or ["    p->none = 0;"]), "}", ""])


def array_text(name: str, values: np.ndarray) -> str:
    """A constant array."""
    rows = [", ".join(map(repr, row.tolist())) for row in np.array_split(values, max(len(values) // 5, 1))]
    return f"static const double {name}[{len(values)}] = {{\n    " + ",\n    ".join(rows) + "\n};\n"


def number_text(value: float, dtype: str = "float64") -> str:
    """A number in C, with all digits."""
    text = repr(value) if dtype == "float64" else str(np.float32(value))
    text = text if set(".en") & set(text) else f"{text}.0"
    return text if dtype == "float64" else f"{text}f"


def comment(text: str) -> str:
    """A text inside a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\n", "\n * ")


def _definition(function: CFunction) -> str:
    results: Any = function.program.results
    arguments, outputs, returned = re.findall(r"(\w+)[,)]", function.head), [], None
    if function.targets:
        parts = [results] if len(function.targets) == 1 else results
        for target, part in zip(function.targets, parts, strict=True):
            atoms = [atom for leaf in jax.tree.leaves(part) for atom in leaf.ravel()]
            outputs += [(f"{target}[{k}]", atom) for k, atom in enumerate(atoms)]
    else:
        returned = results.item()
    printed = PrintedFunction(function.head, arguments, function.program.statements, outputs, returned)
    how = "" if function.optimised else _NOT_OPTIMISED
    return f"/* {function.comment} */\n{how}{LANGUAGE.function(printed)}"


def _entries(number: LawNumber) -> Iterable[tuple[str, float]]:
    flat = number.value.ravel().tolist()
    return [(f"[{k}]" if number.value.ndim else "", value) for k, value in enumerate(flat)]


def _member(number: LawNumber, real: str) -> Iterable[str]:
    size = f"[{number.value.size}]" if number.value.ndim else ""
    shape = f", {' x '.join(map(str, number.value.shape))}, row by row" if number.value.ndim > 1 else ""
    kind = "" if number.kind == "parameter" else f", {number.kind}"
    about = f"[{number.unit or '-'}] {number.domain.name}{kind}{shape}: {number.meaning}"
    yield f"/* {number.path} {comment(about)} */"
    yield f"{real} {number.name}{size};"
