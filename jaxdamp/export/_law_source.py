"""The C functions of a law."""

from collections.abc import Sequence

from jaxdamp.export._c_text import LANGUAGE, CFunction, CSource
from jaxdamp.export._law_program import LawProgram


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
