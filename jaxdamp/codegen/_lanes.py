"""The body of a loop over steps as C for many points side by side."""

from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from typing import NamedTuple, final

import numpy as np

from jaxdamp.codegen import _arrays, _program
from jaxdamp.codegen._branches import where, without_need
from jaxdamp.codegen._jaxprs import Inner, printing
from jaxdamp.codegen._languages import FUNCTIONS
from jaxdamp.codegen._loop_passes import Kept, kept_values, sums_of_products, with_operands
from jaxdamp.codegen._lowering import evaluated
from jaxdamp.codegen._program import (
    Atom,
    Atoms,
    Branch,
    Declare,
    Define,
    Statement,
    Table,
    Variable,
    Writer,
    array_of,
    changed,
    constant,
    each,
    names,
    names_in,
    operands_of,
    pruned,
)
from jaxdamp.codegen._runs import LIMITS, OfPoint, Step, assigned, in_vectors


OF_POINT, OF_STEP = 1, 2  # what a number depends on: bits, both of them where it differs from point to point and step
OF_BOTH = OF_POINT | OF_STEP
_NAN = constant(np.nan, "float64")
_SPOILT = ("for (int i = 0; i < STATE; i++)", "    state[i][lane] += missing;")
WIDTH = 16  # of the printed block in the template


@final
class Operand(NamedTuple):
    """An input of the body."""

    shape: tuple[int, ...]  # of one point
    level: int  # `OF_POINT`, `OF_STEP`, both or neither
    value: np.ndarray | None = None  # where it is known while printing


class Loop(NamedTuple):
    """A printed loop."""

    parts: dict[str, str | list[str]]  # lines of C by what they depend on, and counts
    laned: tuple[bool, ...]  # which of the carried values differ from point to point
    steps: dict[str, Step]  # what depends on point and step

    @property
    def text(self) -> str:
        """C for points side by side in vectors; in loops inside a step, points wait for each other."""
        return _filled("lanes.c", self.parts | in_vectors(self.steps))

    @property
    def kernel(self) -> str:
        """CUDA for a point in each thread, which has its own loops and branches; compiled as C, threads are a loop."""
        return _filled("kernel.cu", self.parts | {name: step.lines() for name, step in self.steps.items()})


def lanes_in_c(body: Inner, constants: Sequence[Operand], carry: Sequence[Operand], row: Sequence[Operand]) -> Loop:
    """Print a loop whose body maps (constants, carry, row) to the carry of the next step.

    What depends neither on the point nor on the step is computed once, what depends on the point alone before the
    loop, what depends on the step alone once for all points.

    Raises:
        NotImplementedError: the body cannot be printed.
    """
    carry = list(carry)
    while True:
        writer, names_of = Writer(), _Names()
        operands = [names_of.atoms(operand, "shared", "own") for operand in constants]
        before = [names_of.atoms(operand, "now", "state") for operand in carry]
        rows = [names_of.atoms(operand, "row", "row") for operand in row]
        with printing(vectors=True):
            after = evaluated(writer, body, [*operands, *before, *rows])
        results = [atom for array in after for atom in array.ravel()]
        statements = pruned(writer.statements, names(results))
        levels = _levels(statements, names_of.levels)
        grown = [
            operand._replace(level=operand.level | max((_level(atom, levels) for atom in array.ravel()), default=0))
            for operand, array in zip(carry, after, strict=True)
        ]
        if grown == carry:
            parts, steps = _parts(statements, levels, names_of, before, after)
            return Loop(parts, tuple(c.level & OF_POINT > 0 for c in carry), steps)
        carry = grown  # what seemed the same for all points is not


class _Names:
    """Names of inputs, numbered in the order of the buffers that hold them."""

    def __init__(self) -> None:
        self.levels: dict[str, int] = {}
        self.counts: dict[str, int] = dict.fromkeys(("shared", "own", "now", "state", "row"), 0)

    def atoms(self, operand: Operand, common: str, of_points: str) -> Atoms:
        if operand.value is not None:
            return _arrays.constants(operand.value)
        laned = operand.level & OF_POINT > 0
        buffer = of_points if laned else common

        def named(_: tuple[int, ...]) -> Variable:
            name = f"{buffer}[{self.counts[buffer]}]" + ("[lane]" if laned else "")
            self.counts[buffer] += 1
            self.levels[name] = operand.level
            return Variable(name, "float64")

        return array_of(operand.shape, named)


def _level(atom: Atom | None, levels: dict[str, int]) -> int:
    return levels[atom.name] if isinstance(atom, Variable) else 0


def _levels(statements: Iterable[Statement], given: dict[str, int]) -> dict[str, int]:
    """What each value depends on; what loops and branches assign is taken to depend on all."""
    levels = dict(given)
    for statement in each(statements):
        if isinstance(statement, Declare):
            levels[statement.target.name] = OF_BOTH
        elif isinstance(statement, Define | Table):
            level = 0
            for atom in operands_of(statement):
                level |= _level(atom, levels)
            in_step = isinstance(statement, Table) and level & OF_POINT  # an array is not passed on to steps
            levels[statement.target.name] = OF_BOTH if in_step else level
    return levels


def _cheaper(
    statements: list[Statement], levels: dict[str, int], carried: dict[str, Atom]
) -> tuple[list[Statement], dict[str, Atom], list[Kept], dict[str, Variable], dict[str, bool]]:
    """What a step computes, in fewer operations; left as it is if it has branches.

    With what is carried, values kept from the step before, limits, and conditions of a step without functions.
    """
    if any(isinstance(s, Branch) for s in each(statements)):
        return statements, carried, [], {}, {}
    repeated, carried, statements = _with_kept(_loaded(statements, levels), levels, carried)
    inside = {name for name, level in levels.items() if level == OF_BOTH}
    statements, limits = _limited(sums_of_products(statements, inside, carried), levels)
    conditions = _without_functions(statements, levels, names(carried.values()))
    return statements, carried, repeated, limits, conditions


def _parts(
    statements: list[Statement], levels: dict[str, int], inputs: _Names, before: list[Atoms], after: list[Atoms]
) -> tuple[dict[str, str | list[str]], dict[str, Step]]:
    printer = OfPoint()
    statements, carried, repeated, limits, conditions = _cheaper(statements, levels, _carried(before, after))
    parts: dict[int, list[Statement]] = {level: [] for level in range(4)}
    parts[OF_BOTH] = _sorted(statements, levels, parts)
    hoisted = _read_later(parts[OF_POINT], parts[OF_BOTH], carried.values())
    store = [f"{_hoisted_name(i)} = {v.name};" for i, v in enumerate(hoisted)]
    store += _missing(limits)
    store += printer.lines(dict.fromkeys(s for value in repeated for s in value.first), 0)
    store += [f"{_kept_name(i)} = {value.target.name};" for i, value in enumerate(repeated)]
    ends = [(name, new) for name, new in carried.items() if Variable(name, "float64") != new]
    steps = _steps(parts[OF_BOTH], conditions, {v: _hoisted_name(i) for i, v in enumerate(hoisted)}, ends)
    counts = inputs.counts
    return {
        **{name: str(counts[name]) for name in ("shared", "own", "now", "state")},
        "rows": str(counts["row"]),
        "hoisted": str(len(hoisted)),
        "kept": str(len(repeated)),
        "once": [*printer.lines(parts[0], 0)],
        "of_point": [*printer.lines(parts[OF_POINT], 0), *store],
        "of_step": [*printer.lines(parts[OF_STEP], 0)],
        "simple": " && ".join("!" * (not value) + name for name, value in conditions.items()) or "false",
        "next": assigned((target, printer.atom(value)) for target, value in ends if target.startswith("now")),
    }, steps


def _steps(
    statements: list[Statement], conditions: dict[str, bool], places: dict[Variable, str], ends: list[tuple[str, Atom]]
) -> dict[str, Step]:
    """A step, and the same where conditions are what they have to be."""
    ends = [(target, value) for target, value in ends if not target.startswith("now")]
    simpler = where(statements, conditions, names(value for _, value in ends))
    return {
        "of_both": Step(places, statements, ends),
        "of_simple": Step(places, simpler, ends) if conditions else Step({}, [], []),
    }


def _sorted(statements: list[Statement], levels: dict[str, int], parts: dict[int, list[Statement]]) -> list[Statement]:
    """What depends on point and step; the others are added to the parts of what they depend on, out of loops too."""
    left: list[Statement] = []
    for s in statements:
        level = levels.get(s.target.name, OF_BOTH) if isinstance(s, Define | Table) else OF_BOTH
        if isinstance(s, _program.Loop):
            s = _program.Loop(_sorted(s.body, levels, parts))
        (left if level == OF_BOTH else parts[level]).append(s)
    return left


def _read_later(statements: list[Statement], inside: list[Statement], results: Iterable[Atom]) -> list[Variable]:
    """The values of statements that are read in every step."""
    used = names(results) | names_in(inside)
    return [s.target for s in statements if isinstance(s, Define | Table) and s.target.name in used]


def _carried(before: list[Atoms], after: list[Atoms]) -> dict[str, Atom]:
    """The next value of each carried number by its name."""
    old, new = (np.concatenate([atoms.ravel() for atoms in arrays]) for arrays in (before, after))
    return {str(variable.name): atom for variable, atom in zip(old, new, strict=True)}


def _kept_name(number: int) -> str:
    return f"kept[{number}][lane]"


def _hoisted_name(number: int) -> str:
    return f"hoisted[{number}][lane]"


def _without_functions(statements: list[Statement], levels: dict[str, int], results: set[str]) -> dict[str, bool]:
    """What conditions that are the same for all points and steps have to be, so that no step takes a function.

    The knees of a curve, for instance, take exponentials only where they are rounded. None if functions are taken in
    any case, or in none.
    """
    written = [*each(statements)]
    functions = {s.target.name for s in written if isinstance(s, Define) and s.operation in FUNCTIONS - {"sqrt"}}
    functions = {name for name in functions if levels.get(name, OF_BOTH) == OF_BOTH}
    conditions = without_need(written, results, functions)
    return {} if conditions is None or any(map(levels.__getitem__, conditions)) else conditions


def _loaded(statements: list[Statement], levels: dict[str, int]) -> list[Statement]:
    """The same, with what selections choose from read before them: a choice of two places would be a gather."""
    loaded: dict[Atom, Atom] = {}
    loads: list[Statement] = []
    for s in each(statements):
        for atom in s.operands[1:] if isinstance(s, Define) and s.operation == "select" else ():
            if isinstance(atom, Variable) and "[" in atom.name and atom not in loaded:
                target = Variable(f"loaded{len(loaded)}", atom.dtype)
                levels[target.name], loaded[atom] = levels[atom.name], target
                loads.append(Define(target, "copy", (atom,)))

    def reading(s: Statement) -> Statement:
        return with_operands(s, loaded) if isinstance(s, Define) and s.operation == "select" else s

    return loads + changed(statements, reading)


def _with_kept(
    statements: list[Statement], levels: dict[str, int], carried: dict[str, Atom]
) -> tuple[list[Kept], dict[str, Atom], list[Statement]]:
    """The values that the step before has computed, what is then carried, and the statements that read them."""
    still = {name: Variable(name, "float64") for name, level in levels.items() if not level & OF_STEP}
    repeated = [
        value
        for value in kept_values(statements, still | carried, carried.values())
        if levels[value.target.name] == levels[value.again.name] == OF_BOTH
    ]
    given: dict[Atom, Atom] = {value.target: Variable(_kept_name(i), "float64") for i, value in enumerate(repeated)}
    levels |= {_kept_name(i): OF_BOTH for i in range(len(repeated))}
    carried = carried | {_kept_name(i): value.again for i, value in enumerate(repeated)}
    carried = {name: given.get(new, new) for name, new in carried.items()}
    reading = changed(statements, lambda s: with_operands(s, given))
    return repeated, carried, pruned(reading, names(carried.values()))


def _limited(statements: list[Statement], levels: dict[str, int]) -> tuple[list[Statement], dict[str, Variable]]:
    """Limits that are the same in all steps as one vector operation each, and those of them that may be NaN."""
    limits: dict[str, Variable] = {}

    def limited(s: Statement) -> Statement:
        if not isinstance(s, Define) or s.operation not in LIMITS or s.target.dtype != "float64":
            return s
        if levels.get(s.target.name) != OF_BOTH:
            return s
        still = [atom != _NAN and not _level(atom, levels) & OF_STEP for atom in s.operands]
        if not any(still):
            return s
        value, limit = s.operands if still[1] else s.operands[::-1]
        if isinstance(limit, Variable):
            limits[limit.name] = limit
        return Define(s.target, f"limiting {s.operation}", (value, limit))

    return changed(statements, limited), limits


def _missing(limits: Iterable[str]) -> list[str]:
    """A point with a limit that is NaN is NaN from the start."""
    tests = [f"({name} != {name} ? NAN : 0.0)" for name in limits]
    return [f"const double missing = {' + '.join(tests)};", *_SPOILT] if tests else []


def _filled(template: str, marks: Mapping[str, str | list[str]]) -> str:
    text = resources.files("jaxdamp.codegen").joinpath(template).read_text(encoding="utf-8")
    for mark, lines in marks.items():
        block = lines if isinstance(lines, str) else "\n".join(" " * WIDTH + line for line in lines)
        text = text.replace(f"@{mark}@", block)
    return text
