"""The C functions of a vehicle."""

from jaxdamp.export._c_text import LANGUAGE, CFunction, CSource
from jaxdamp.export._law_program import identifier
from jaxdamp.export._vehicle_program import VehicleProgram


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
