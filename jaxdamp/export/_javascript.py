"""Printed programs of laws, vehicles and roads as JavaScript."""

from collections.abc import Sequence
from typing import Any

import jax

from jaxdamp.codegen import JavaScript, PrintedFunction, Program, lower, symbols
from jaxdamp.export._law_program import LawProgram
from jaxdamp.export._ride_program import RideProgram
from jaxdamp.roads import cosine_bump


_LANGUAGE = JavaScript()


def law_functions(law: LawProgram) -> dict[str, str]:
    """`initial(p, state)`, `force(p, x, v, state)`, `advance(p, ..., dt, state)`, `margins(p, y)`, by names."""
    return {
        "initial": _filled("initial(p, state)", law.initial_state, "state"),
        "force": _returned("force(p, x, v, state)", law.force),
        "advance": _filled("advance(p, x0, v0, x1, v1, dt, state)", law.advance, "state"),
        "margins": _filled("margins(p, y)", law.margins, "y"),
    }


def vehicle_functions(vehicle: RideProgram) -> dict[str, str]:
    """The functions of `RideProgram`, by names; results go into the arrays m, c, g and y."""
    return {
        "prepare": _filled("prepare(p, q, dt, m)", vehicle.prepare, "m"),
        "start": _filled("start(m, h, r, c)", vehicle.start, "c"),
        "begin": _filled("begin(m, c, h, r, g)", vehicle.begin, "g"),
        "step": _filled("step(m, c, h0, r0, h1, r1)", vehicle.step, "c"),
        "observe": _filled("observe(m, c, g, h, r)", vehicle.observe, "g"),
        "end": _filled("end(m, g, y)", vehicle.end, "y"),
    }


def bump_function() -> str:
    """`bump(t, height, length, speed)`: the height of a cosine bump that begins at 1 s."""

    def bump(t: Any, height: Any, length: Any, speed: Any) -> Any:
        return cosine_bump(height, start=1.0, length=length, speed=speed).height(t[None])[0, 0]

    names = ("t", "height", "length", "speed")
    return _returned(f"bump({', '.join(names)})", lower(bump, *map(symbols, names)))


def closed(name: str, functions: dict[str, str]) -> str:
    """One object of functions that see each other and nothing else."""
    return f"const {name} = (() => {{\n{''.join(functions.values())}return {{ {', '.join(functions)} }};\n}})();\n"


def _returned(head: str, program: Program) -> str:
    return _function(head, program, (), program.results.item())


def _filled(head: str, program: Program, target: str) -> str:
    values = [atom for leaf in jax.tree.leaves(program.results) for atom in leaf.ravel()]
    return _function(head, program, [(f"{target}[{k}]", value) for k, value in enumerate(values)], None)


def _function(head: str, program: Program, outputs: Sequence[Any], returned: Any) -> str:
    return _LANGUAGE.function(PrintedFunction(f"function {head}", (), program.statements, outputs, returned))
