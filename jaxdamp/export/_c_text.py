"""C text of functions printed by `codegen`: of a law, of a vehicle, and of a controller alone."""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import PyTree

from jaxdamp import _checks
from jaxdamp.codegen import C, PrintedFunction, Program
from jaxdamp.dampers import AbstractDamper, laws_inside
from jaxdamp.export._controlled_program import ControlledProgram
from jaxdamp.export._controller_program import ControllerProgram, Line
from jaxdamp.export._law_program import LawNumber, LawProgram, identifier
from jaxdamp.export._vehicle_program import VehicleProgram
from jaxdamp.vehicles import AbstractVehicle, Channel


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
    """A function of the source."""

    comment: str  # what it computes
    head: str  # its declaration
    program: Program  # its statements
    targets: Sequence[str] = ()  # arguments that take the parts of the result, which is returned where there are none
    optimised: bool = True  # whether the compiler may optimise it; not if it is long and called rarely


class Functions(NamedTuple):
    """Makes the functions of a model."""

    name: str  # before the name of everything
    dtype: str  # the type of all numbers

    def __call__(self, signature: str, program: Program, comment: str, *, optimised: bool = True) -> CFunction:
        """The function of a signature such as "step p dt *m > c".

        Its name, what it reads (p and dp are the parameters and their changes, a star stands before an array), and
        behind the sign the arrays that it fills, without which it returns a number.
        """
        real = LANGUAGE.types[self.dtype]
        (name, *reads), fills = (part.split() for part in f"{signature} > ".split(" > ")[:2])

        def argument(word: str) -> str:
            if word in ("p", "dp"):
                return f"const {self.name}_parameters *{word}"
            return f"const {real} {word}" if word.startswith("*") else f"{real} {word}"

        arguments = ", ".join([*map(argument, reads), *(f"{real} *{each}" for each in fills)])
        head = f"{'void' if fills else real} {self.name}_{name}({arguments})"
        return CFunction(comment, head, program, fills, optimised)


class CSource(NamedTuple):
    """What a header and a source are written from."""

    name: str  # before the name of everything
    about: list[str]  # lines of the comment above the header
    dtype: str  # the type of all numbers
    numbers: list[LawNumber]  # the members of the struct
    constants: list[tuple[str, float, str]]  # names of numbers with their values, and comments
    functions: list[CFunction]  # all functions but that which sets the numbers

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
    results: PyTree = function.program.results
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


def _fitted(model: AbstractDamper | AbstractVehicle) -> list[str]:
    """The ranges of the records that laws were fitted to."""
    laws = [(path.removesuffix("."), law.fitted_to) for path, law in laws_inside(model)]
    return [f"{path or 'The law'} was fitted to: {span.words()}." for path, span in laws if span is not None]


DERIVATIVES = ("force", "advance", "state_rate")  # functions whose derivatives can be written


def law_source(program: LawProgram, name: str, derivatives: Sequence[str] = ()) -> CSource:
    """Struct and functions of a law in C, with the derivatives of some of them."""
    states, c = f"{name.upper()}_STATES", Functions(name, program.dtype)
    step = "The states after a step dt [s] over which the motion goes from (x0, v0) to (x1, v1)."
    functions = [
        c("init p x > state", program.initial_state, "The states at rest at stroke x."),
        c("force p x v *state", program.force, "The force."),
        c("advance p x0 v0 x1 v1 dt > state", program.advance, step),
        c("state_rate p x v *state > rate", program.state_rate, "The time derivative of the states [1/s]."),
    ]
    if "force" in derivatives:
        said = "The change of the force for small changes dp, dx, dv, dstate."
        functions.append(c("force_derivative p dp x dx v dv *state *dstate", program.force_derivative, said))
    if "advance" in derivatives:
        said = "The change of the states after a step: dstate before is replaced by that after."
        read = "p dp x0 dx0 v0 dv0 x1 dx1 v1 dv1 dt *state"
        functions.append(c(f"advance_derivative {read} > dstate", program.advance_derivative, said))
    if "state_rate" in derivatives:
        said, read = "The change of the time derivative of the states.", "p dp x dx v dv *state *dstate"
        functions.append(c(f"state_rate_derivative {read} > drate", program.state_rate_derivative, said))
    about = [
        repr(program.law),
        "",
        "SI units. Stroke x [m] and velocity v [m/s] are positive in extension (rebound), force [N] is positive",
        f"when it resists extension. `state` holds {states} numbers, set by {name}_init.",
        *_fitted(program.law),
    ]
    return CSource(name, about, program.dtype, program.numbers, [(states, program.states, "")], functions)


def vehicle_source(program: VehicleProgram, name: str, derivatives: bool = False) -> CSource:
    """Struct and functions of a vehicle in C; derivatives are written if wanted."""
    functions = _functions(program, name, derivatives)
    constants = _constants(program, name.upper())
    wheels = ", ".join(height.name.removeprefix("z_") for height in program.heights)
    upper = name.upper()
    about = [
        repr(program.vehicle),
        "",
        f"SI units, z up. h [m] and r [m/s] hold heights of the road and their rates, in this order: {wheels}.",
        f"m holds {upper}_MATRICES numbers, set by {name}_prepare; c holds {upper}_CARRY, set by {name}_start.",
        f"The first {upper}_STATES numbers of c are the states x: {', '.join(name for name, _ in program.states)}.",
        f"y holds {upper}_OUTPUTS channels.",
        f"Steps longer than {upper}_LONGEST_STEP are too long for laws as steep as these: `simulate` divides them.",
        *_fitted(program.vehicle),
    ]
    if isinstance(program, ControlledProgram):
        about += _about_instants(program, f"{name}_step", "Behind them c holds where the controller is.")
    return CSource(name, about, program.dtype, program.numbers, constants, functions)


def _functions(program: VehicleProgram, name: str, derivatives: bool) -> list[CFunction]:
    """The functions, with what each of them does; of a vehicle without a controller those of its states too."""
    c = Functions(name, program.dtype)
    prepare = "What follows from the numbers and the step dt [s]: m. To be called after every change of them."
    step = "A step later, while the road goes straight from (h0, r0) to (h1, r1)."
    resume = "To be called after another prepare during a run; ratio: of the step to the one before."
    functions = [
        c("prepare p dt > m", program.prepare, prepare, optimised=False),
        c("start *m *h *r > c", program.start, "At rest in the static equilibrium on the road: c."),
        c("step *m *h0 *r0 *h1 *r1 > c", program.step, step),
        c("resume *m *h *r ratio > c", program.resume, resume),
    ]
    if isinstance(program, ControlledProgram):
        return [*functions, c("outputs *m *c *h *r > y", program.outputs, "The channels y.")]
    outputs = "The channels y in the states x, such as the first numbers of c."
    rates = "The time derivatives of the states x, for solvers of differential equations."
    functions.append(c("outputs *m *x *h *r > y", program.outputs, outputs))
    functions.append(c("state_rate *m *x *h *r > rate", program.state_rate, rates))
    if derivatives:
        changes = "The changes drate and dy for small changes dp, dx, dh, dr."
        functions.append(c("derivative p dp *x *dx *h *dh *r *dr > drate dy", program.derivative, changes))
    return functions


def _about_instants(program: ControlledProgram | ControllerProgram, step: str, *lines: str) -> list[str]:
    """What a program must know of the instants of a controller."""
    delay = f" and the delay of {program.delay:g} s" if program.delay else ""
    whole = f"the period of {program.vehicle.period:g} s{delay} must be a whole number of steps dt"
    return [*lines, f"At every {step} the sensors are read, and where a period ends a command is decided: {whole}."]


def _constants(program: VehicleProgram, prefix: str) -> list[tuple[str, float, str]]:
    """Lengths of the arrays, the longest step, and the number of each channel."""
    sizes = [("WHEELS", program.wheels), ("STATES", len(program.states)), ("OUTPUTS", len(program.channels))]
    sizes += [("MATRICES", program.sizes["m"]), ("CARRY", program.sizes["c"])]
    constants: list[tuple[str, float, str]] = [(f"{prefix}_{key}", value, "") for key, value in sizes]
    constants.append((f"{prefix}_LONGEST_STEP", program.longest_step, "s, of laws as they are exported"))
    return constants + numbered(f"{prefix}_Y", program.channels)


def numbered(prefix: str, lines: Sequence[Channel] | Sequence[Line]) -> list[tuple[str, float, str]]:
    """The number of each entry of an array."""
    names: dict[str, str] = {}
    for line in lines:
        if (other := names.setdefault(identifier(line.name).upper(), line.name)) != line.name:
            must = "have channels with names that differ in C, by more than case and special characters"
            _checks.refuse("law", must, f"one with {other!r} and {line.name!r}", "Rename a part of the vehicle.")
    return [
        (f"{prefix}_{key}", k, comment(f"[{line.unit or '-'}] {line.description}"))
        for k, (key, line) in enumerate(zip(names, lines, strict=True))
    ]


def controller_source(program: ControllerProgram, name: str) -> CSource:
    """Struct and functions of a controller in C."""
    upper, c = name.upper(), Functions(name, program.dtype)
    prepare = "What follows from the numbers and the interval dt [s] of the steps: m. After every change of them."
    resume = "After another prepare with another dt; ratio: of the interval to the one before."
    functions = [
        c("prepare p dt > m", program.prepare, prepare),
        c("start *m *u > c", program.start, "The first sample: c."),
        c("step *m *u > c", program.step, "The next instant, dt later."),
        c("resume ratio > c", program.resume, resume),
        c("outputs *c > y", program.output, "Commands and demands of the last sample: y."),
    ]
    sizes = {"INPUTS": len(program.inputs), "OUTPUTS": len(program.outputs)}
    sizes |= {"MATRICES": program.sizes["m"], "CARRY": program.sizes["c"]}
    constants = [(f"{upper}_{key}", value, "") for key, value in sizes.items()]
    constants += numbered(f"{upper}_U", program.inputs) + numbered(f"{upper}_Y", program.outputs)
    about = [
        f"Controller of {', '.join(program.dampers)}: {program.vehicle.policy!r}",
        "",
        "SI units, z up; strokes and their rates are positive in extension, forces where they resist extension.",
        f"u holds {upper}_INPUTS measured signals, y {upper}_OUTPUTS commands and demands, see below.",
        f"m holds {upper}_MATRICES numbers, set by {name}_prepare; c holds {upper}_CARRY, set by {name}_start.",
        *_about_instants(program, f"{name}_step", *program.notes),
    ]
    return CSource(name, about, program.dtype, program.numbers, constants, functions)
