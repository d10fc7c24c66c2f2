"""The C functions of a vehicle, and of a controller alone."""

from collections.abc import Sequence

from jaxdamp.export._c_text import CFunction, CSource, Functions
from jaxdamp.export._controlled_program import ControlledProgram
from jaxdamp.export._controller_program import ControllerProgram, Line
from jaxdamp.export._law_program import identifier
from jaxdamp.export._vehicle_program import VehicleProgram
from jaxdamp.vehicles import Channel


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


def _constants(program: VehicleProgram, prefix: str) -> list[tuple[str, int, str]]:
    """Lengths of the arrays, and the number of each channel."""
    sizes = [("WHEELS", program.wheels), ("STATES", len(program.states)), ("OUTPUTS", len(program.channels))]
    sizes += [("MATRICES", program.sizes["m"]), ("CARRY", program.sizes["c"])]
    constants = [(f"{prefix}_{key}", value, "") for key, value in sizes]
    return constants + _numbered(f"{prefix}_Y", program.channels)


def _numbered(prefix: str, lines: Sequence[Channel] | Sequence[Line]) -> list[tuple[str, int, str]]:
    """The number of each entry of an array."""
    return [
        (f"{prefix}_{identifier(line.name).upper()}", k, f"[{line.unit or '-'}] {line.description}")
        for k, line in enumerate(lines)
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
    constants += _numbered(f"{upper}_U", program.inputs) + _numbered(f"{upper}_Y", program.outputs)
    about = [
        f"Controller of {', '.join(program.dampers)}: {program.vehicle.policy!r}",
        "",
        "SI units, z up; strokes and their rates are positive in extension, forces where they resist extension.",
        f"u holds {upper}_INPUTS measured signals, y {upper}_OUTPUTS commands and demands, see below.",
        f"m holds {upper}_MATRICES numbers, set by {name}_prepare; c holds {upper}_CARRY, set by {name}_start.",
        *_about_instants(program, f"{name}_step", *program.notes),
    ]
    return CSource(name, about, program.dtype, program.numbers, constants, functions)
