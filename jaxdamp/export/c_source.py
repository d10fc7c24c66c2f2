"""A law as portable C."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.codegen import C, PrintedFunction, Program
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export._law_program import LawNumber, LawProgram, identifier
from jaxdamp.export._self_test import self_test
from jaxdamp.export._write import write_whole


_LANGUAGE = C()
DERIVATIVES = ("force", "advance", "state_rate")  # functions of a law whose derivatives can be printed
INCLUDES = """\
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
"""


def to_c(
    law: AbstractDamper,
    path: str | os.PathLike[str],
    *,
    derivatives: bool = False,
    precision: str = "float64",
) -> list[Path]:
    """Write a law as C source, header and a test program.

    The source is C99 that compiles as C++ too, without allocation, global state or anything but <math.h>: it runs in
    real time. A struct holds the parameters and settings, with units and allowed values as comments; `NAME_defaults`
    sets those of this law. `NAME_init` gives the states at rest, `NAME_force` the force, `NAME_advance` the states
    after a step, as the methods of the law do, and `NAME_state_rate` their rate for solvers of differential equations.
    The test program repeats a motion and compares the forces with those computed here:
    `cc NAME.c NAME_test.c -lm && ./a.out`.

    Arguments:
        law: any law or composition.
        path: the source file `NAME.c` to write, beside which `NAME.h` and `NAME_test.c` are written, or a folder for
            files named after the class. Existing files are replaced.
        derivatives: also write `NAME_force_derivative`, `NAME_advance_derivative` and `NAME_state_rate_derivative`:
            the change of the results for given changes of parameters, motion and states.
        precision: "float64", or "float32" for processors that compute in single precision.

    Returns:
        The paths of header, source and test program.

    Raises:
        ValueError: a folder that does not exist, a name that C does not allow, another precision.
        NotImplementedError: an operation of the law that cannot be printed; the message names it.
    """
    check_module("law", law, (AbstractDamper,), "to_c(law, path)")
    source = source_path(law, path)
    program, name, chosen = LawProgram(law, precision), source.stem, DERIVATIVES if derivatives else ()
    texts = {
        source.with_suffix(".h"): header(program, name, chosen),
        source: f'#include "{name}.h"\n\n{INCLUDES}\n{functions(program, name, chosen)}',
        source.with_name(f"{name}_test.c"): self_test(program, name),
    }
    return [write_whole(file, text) for file, text in texts.items()]


def source_path(law: AbstractDamper, path: str | os.PathLike[str]) -> Path:
    """The source file, in a folder with the name of the class."""
    given = Path(path).expanduser()
    if given.is_dir():
        return given / f"{re.sub(r'(?<=[a-z])(?=[A-Z])', '_', type(law).__name__).lower()}.c"
    if given.suffix != ".c" or identifier(given.stem) != given.stem:
        must = "be a folder or a file NAME.c whose name is an identifier of C"
        _checks.refuse("path", must, str(given), f"Try {identifier(given.stem) + '.c'!r}.")
    return given


def header(program: LawProgram, name: str, derivatives: Sequence[str] = ()) -> str:
    """The header: the struct of the numbers and the functions."""
    real = _LANGUAGE.types[program.dtype]
    members = [f"    {line}" for number in program.numbers for line in _member(number, real)]
    signatures = [f"{head};" for head in heads(name, real, derivatives).values()]
    guard = f"{name.upper()}_H"
    return "\n".join(
        [
            f"/* {_comment(repr(program.law))}",
            " *",
            " * SI units. Stroke x [m] and velocity v [m/s] are positive in extension (rebound), force [N] is positive",
            f" * when it resists extension. `state` holds {name.upper()}_STATES numbers, set by {name}_init.",
            " */",
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            f"#define {name.upper()}_STATES {program.states}",
            "",
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            "",
            f"typedef struct {name}_parameters {{",
            *(members or [f"    {real} none; /* the law has no numbers */"]),
            f"}} {name}_parameters;",
            "",
            *signatures,
            "",
            "#ifdef __cplusplus",
            "}",
            "#endif",
            "",
            f"#endif /* {guard} */",
            "",
        ]
    )


def heads(name: str, real: str, derivatives: Sequence[str]) -> dict[str, str]:
    """The heads of the functions, each with the comment above it, by their names."""
    p, state = f"const {name}_parameters *p", f"const {real} *state"
    dp = f"const {name}_parameters *dp"

    def numbers(names: str) -> str:
        return ", ".join(f"{real} {each}" for each in names.split())

    known = {
        "defaults": ("The numbers of the exported law.", f"void {name}_defaults({name}_parameters *p)"),
        "init": ("The states at rest.", f"void {name}_init({p}, {real} *state)"),
        "force": ("The force.", f"{real} {name}_force({p}, {numbers('x v')}, {state})"),
        "advance": (
            "The states after a step dt [s] over which the motion goes from (x0, v0) to (x1, v1).",
            f"void {name}_advance({p}, {numbers('x0 v0 x1 v1 dt')}, {real} *state)",
        ),
        "state_rate": (
            "The time derivative of the states [1/s].",
            f"void {name}_state_rate({p}, {numbers('x v')}, {state}, {real} *rate)",
        ),
        "force_derivative": (
            "The change of the force for small changes dp, dx, dv, dstate.",
            f"{real} {name}_force_derivative({p}, {dp}, {numbers('x dx v dv')}, {state}, const {real} *dstate)",
        ),
        "advance_derivative": (
            "The change of the states after a step: dstate before is replaced by that after.",
            f"void {name}_advance_derivative({p}, {dp}, {numbers('x0 dx0 v0 dv0 x1 dx1 v1 dv1 dt')}, {state}, "
            f"{real} *dstate)",
        ),
        "state_rate_derivative": (
            "The change of the time derivative of the states.",
            f"void {name}_state_rate_derivative({p}, {dp}, {numbers('x dx v dv')}, {state}, const {real} *dstate, "
            f"{real} *drate)",
        ),
    }
    return {
        key: f"/* {comment} */\n{head}"
        for key, (comment, head) in known.items()
        if not key.endswith("derivative") or key.removesuffix("_derivative") in derivatives
    }


def functions(program: LawProgram, name: str, derivatives: Sequence[str] = (), static: bool = False) -> str:
    """The definitions of the functions that the header declares; visible in their file only if `static`."""
    known = heads(name, _LANGUAGE.types[program.dtype], derivatives)
    printed = [
        _defaults(program, known["defaults"]),
        _filled(known["init"], program.initial_state, program.initial_state.results, "state"),
        _returned(known["force"], program.force),
        _filled(known["advance"], program.advance, program.advance.results, "state"),
        _filled(known["state_rate"], program.state_rate, program.state_rate.results, "rate"),
    ]
    if "force" in derivatives:
        printed.append(_returned(known["force_derivative"], program.force_derivative))
    for of, target in (("advance", "dstate"), ("state_rate", "drate")):
        if of in derivatives:
            changed: Program = getattr(program, f"{of}_derivative")
            printed.append(_filled(known[f"{of}_derivative"], changed, changed.results, target))
    text = "\n".join(printed)
    return re.sub(r"(?m)^(void|double|float) (?=\w+\()", r"static \1 ", text) if static else text


def _defaults(program: LawProgram, head: str) -> str:
    values = [
        f"    p->{n.name}{place} = {number_text(value, program.dtype)};"
        for n in program.numbers
        for place, value in _entries(n)
    ]
    return "\n".join([f"{head} {{", *(values or ["    p->none = 0;"]), "}", ""])


def _entries(number: LawNumber) -> Iterable[tuple[str, float]]:
    flat = number.value.ravel().tolist()
    return [(f"[{k}]" if number.value.ndim else "", value) for k, value in enumerate(flat)]


def number_text(value: float, dtype: str = "float64") -> str:
    """A number in C, with all digits."""
    text = repr(value) if dtype == "float64" else str(np.float32(value))
    text = text if set(".en") & set(text) else f"{text}.0"
    return text if dtype == "float64" else f"{text}f"


def _returned(head: str, program: Program) -> str:
    return _LANGUAGE.function(PrintedFunction(head, _arguments(head), program.statements, (), program.results.item()))


def _filled(head: str, program: Program, values: np.ndarray, target: str) -> str:
    outputs = [(f"{target}[{k}]", value) for k, value in enumerate(values)]
    return _LANGUAGE.function(PrintedFunction(head, _arguments(head), program.statements, outputs))


def _arguments(head: str) -> list[str]:
    """The names of the arguments in a head."""
    return re.findall(r"(\w+)[,)]", head.splitlines()[-1])


def _member(number: LawNumber, real: str) -> Iterable[str]:
    size = f"[{number.value.size}]" if number.value.ndim else ""
    shape = f", {' x '.join(map(str, number.value.shape))}, row by row" if number.value.ndim > 1 else ""
    kind = "" if number.kind == "parameter" else f", {number.kind}"
    about = f"[{number.unit or '-'}] {number.domain.name}{kind}{shape}: {number.meaning}"
    yield f"/* {number.path} {_comment(about)} */"
    yield f"{real} {number.name}{size};"


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\n", "\n * ")
