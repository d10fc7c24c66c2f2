"""The C functions of a law and of a vehicle."""

from collections.abc import Sequence

from jaxdamp.export._c_text import LANGUAGE, CFunction, CSource
from jaxdamp.export._law_program import LawProgram, identifier
from jaxdamp.export._vehicle_program import VehicleProgram


DERIVATIVES = ("force", "advance", "state_rate")  # functions whose derivatives can be written


def law_source(program: LawProgram, name: str, derivatives: Sequence[str] = ()) -> CSource:
    """Struct and functions of a law in C, with the derivatives of some of them."""
    real, states = LANGUAGE.types[program.dtype], f"{name.upper()}_STATES"
    p, dp, state = f"const {name}_parameters *p", f"const {name}_parameters *dp", f"const {real} *state"

    def numbers(names: str) -> str:
        return ", ".join(f"{real} {each}" for each in names.split())

    functions = [
        CFunction("The states at rest.", f"void {name}_init({p}, {real} *state)", program.initial_state, ["state"]),
        CFunction("The force.", f"{real} {name}_force({p}, {numbers('x v')}, {state})", program.force),
        CFunction(
            "The states after a step dt [s] over which the motion goes from (x0, v0) to (x1, v1).",
            f"void {name}_advance({p}, {numbers('x0 v0 x1 v1 dt')}, {real} *state)",
            program.advance,
            ["state"],
        ),
        CFunction(
            "The time derivative of the states [1/s].",
            f"void {name}_state_rate({p}, {numbers('x v')}, {state}, {real} *rate)",
            program.state_rate,
            ["rate"],
        ),
    ]
    if "force" in derivatives:
        functions.append(
            CFunction(
                "The change of the force for small changes dp, dx, dv, dstate.",
                f"{real} {name}_force_derivative({p}, {dp}, {numbers('x dx v dv')}, {state}, const {real} *dstate)",
                program.force_derivative,
            )
        )
    if "advance" in derivatives:
        functions.append(
            CFunction(
                "The change of the states after a step: dstate before is replaced by that after.",
                f"void {name}_advance_derivative({p}, {dp}, {numbers('x0 dx0 v0 dv0 x1 dx1 v1 dv1 dt')}, {state}, "
                f"{real} *dstate)",
                program.advance_derivative,
                ["dstate"],
            )
        )
    if "state_rate" in derivatives:
        functions.append(
            CFunction(
                "The change of the time derivative of the states.",
                f"void {name}_state_rate_derivative({p}, {dp}, {numbers('x dx v dv')}, {state}, const {real} *dstate, "
                f"{real} *drate)",
                program.state_rate_derivative,
                ["drate"],
            )
        )
    about = [
        repr(program.law),
        "",
        "SI units. Stroke x [m] and velocity v [m/s] are positive in extension (rebound), force [N] is positive",
        f"when it resists extension. `state` holds {states} numbers, set by {name}_init.",
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
    ]
    return CSource(name, about, program.dtype, program.numbers, constants, functions)


def _functions(program: VehicleProgram, name: str, derivatives: bool) -> list[CFunction]:
    """The functions, with what each of them does."""
    real = LANGUAGE.types[program.dtype]
    p, dp = (f"const {name}_parameters *{each}" for each in ("p", "dp"))

    def inputs(names: str) -> str:
        return ", ".join(f"const {real} *{each}" for each in names.split())

    functions = [
        CFunction(
            "What follows from the numbers and the step dt [s]: m. To be called after every change of them.",
            f"void {name}_prepare({p}, {real} dt, {real} *m)",
            program.prepare,
            ["m"],
            optimised=False,
        ),
        CFunction(
            "At rest in the static equilibrium on the road: c.",
            f"void {name}_start({inputs('m h r')}, {real} *c)",
            program.start,
            ["c"],
        ),
        CFunction(
            "A step later, while the road goes straight from (h0, r0) to (h1, r1).",
            f"void {name}_step({inputs('m h0 r0 h1 r1')}, {real} *c)",
            program.step,
            ["c"],
        ),
        CFunction(
            "To be called after another prepare during a run; ratio: of the step to the one before.",
            f"void {name}_resume({inputs('m h r')}, {real} ratio, {real} *c)",
            program.resume,
            ["c"],
        ),
        CFunction(
            "The channels y in the states x, such as the first numbers of c.",
            f"void {name}_outputs({inputs('m x h r')}, {real} *y)",
            program.outputs,
            ["y"],
        ),
        CFunction(
            "The time derivatives of the states x, for solvers of differential equations.",
            f"void {name}_state_rate({inputs('m x h r')}, {real} *rate)",
            program.state_rate,
            ["rate"],
        ),
    ]
    if derivatives:
        functions.append(
            CFunction(
                "The changes drate and dy for small changes dp, dx, dh, dr.",
                f"void {name}_derivative({p}, {dp}, {inputs('x dx h dh r dr')}, {real} *drate, {real} *dy)",
                program.derivative,
                ["drate", "dy"],
            )
        )
    return functions


def _constants(program: VehicleProgram, prefix: str) -> list[tuple[str, int, str]]:
    """Lengths of the arrays, and the number of each channel."""
    sizes = [("WHEELS", program.wheels), ("STATES", len(program.states)), ("OUTPUTS", len(program.channels))]
    sizes += [("MATRICES", program.sizes["m"]), ("CARRY", program.sizes["c"])]
    constants = [(f"{prefix}_{key}", value, "") for key, value in sizes]
    for number, channel in enumerate(program.channels):
        meaning = f"[{channel.unit or '-'}] {channel.description}"
        constants.append((f"{prefix}_Y_{identifier(channel.name).upper()}", number, meaning))
    return constants
