"""The body of a loop over steps as C for many points side by side."""

import re
from collections.abc import Iterable, Iterator, Sequence
from importlib import resources
from typing import NamedTuple, TypeGuard, final

import numpy as np

from jaxdamp.codegen import _arrays
from jaxdamp.codegen._branches import where, without_need
from jaxdamp.codegen._jaxprs import Inner, printing
from jaxdamp.codegen._languages import FUNCTIONS, C
from jaxdamp.codegen._loop_passes import Kept, kept_values, sums_of_products
from jaxdamp.codegen._lowering import evaluated
from jaxdamp.codegen._program import (
    Atom,
    Atoms,
    Declare,
    Define,
    Statement,
    Table,
    Variable,
    Writer,
    array_of,
    constant,
    names,
    names_in,
    operands_of,
    pruned,
)


OF_POINT, OF_STEP = 1, 2  # what a number depends on: bits, both of them where it differs from point to point and step
OF_BOTH = OF_POINT | OF_STEP
# {1} is not NaN; a NaN of {0} is the result, as that of the second operand of a vector minimum is
_LIMITS = {"min": "{1} < {0} ? {1} : {0}", "max": "{1} > {0} ? {1} : {0}"}
_NAN = constant(np.nan, "float64")
_SPOILT = ("for (int i = 0; i < STATE; i++)", "    state[i][lane] += missing;")
WIDTH = 16  # of the printed block in the template
_VECTORS = "abcd"  # of a block that a step takes in turn, operation by operation: each waits for its own last result
_LONG = 700  # lines of a step that keep a processor busy with one vector, and a compiler with four for minutes


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
    straight: bool  # whether a step is without loops and branches

    @property
    def text(self) -> str:
        """C for points side by side in vectors, which cannot follow loops and branches inside a step."""
        if not self.straight:
            message = "A loop or a branch inside a step cannot be printed for many points side by side."
            raise NotImplementedError(message)
        vectors = _VECTORS[: 4 if len(self.parts["of_both"]) <= _LONG else 1]
        in_turn = {name: list(_in_turn(self.parts[name], vectors)) for name in ("of_both", "of_simple")}
        return _filled("lanes.c", self.parts | in_turn | {"vectors": str(len(vectors))})

    @property
    def kernel(self) -> str:
        """CUDA for a point in each thread, which has its own loops and branches; compiled as C, threads are a loop."""
        return _filled("kernel.cu", self.parts)


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
            parts = _parts(statements, levels, names_of, before, after)
            return Loop(parts, tuple(c.level & OF_POINT > 0 for c in carry), _is_straight(statements))
        carry = grown  # what seemed the same for all points is not


class _InLanes(C):
    """C with limits that are the same in all steps, and conditions as numbers by a choice: a cast is no vector."""

    def own(self, operation: str, texts: list[str], dtypes: list[str], dtype: str) -> str | None:
        """As in C."""
        if operation == "convert" and dtypes == ["bool"] and dtype == "float64":
            return f"{texts[0]} ? 1.0 : 0.0"
        first, _, limit = operation.partition("limiting ")
        return super().own(operation, texts, dtypes, dtype) if first else _LIMITS[limit].format(*texts)


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


def _is_straight(statements: list[Statement]) -> TypeGuard[list[Define | Table]]:
    """Whether there are no loops and branches among statements."""
    return all(isinstance(statement, Define | Table) for statement in statements)


def _levels(statements: Iterable[Statement], known: dict[str, int]) -> dict[str, int]:
    """What each value depends on; what loops and branches assign is taken to depend on all."""
    levels = dict(known)
    for statement in statements:
        if isinstance(statement, Declare):
            levels[statement.target.name] = OF_BOTH
        elif isinstance(statement, Define | Table):
            level = 0
            for atom in operands_of(statement):
                level |= _level(atom, levels)
            levels[statement.target.name] = level
    return levels


def _parts(
    statements: list[Statement], levels: dict[str, int], inputs: _Names, before: list[Atoms], after: list[Atoms]
) -> dict[str, str | list[str]]:
    printer = _InLanes()
    carried = _carried(before, after)
    repeated, limits, conditions = list[Kept](), dict[str, Variable](), dict[str, bool]()
    if _is_straight(statements):
        repeated, carried, straight = _with_kept(_loaded(statements, levels), levels, carried)
        inside = {name for name, level in levels.items() if level == OF_BOTH}
        straight = sums_of_products(straight, inside, carried)
        straight, limits = _limited(straight, levels)
        conditions = _without_functions(straight, levels, names(carried.values()))
        statements = [*straight]
    parts = _by_level(statements, levels)
    hoisted = _read_later(parts[OF_POINT], parts[OF_BOTH], carried.values())
    load = [f"const {printer.types[v.dtype]} {v.name} = hoisted[{i}][lane];" for i, v in enumerate(hoisted)]
    store = [f"hoisted[{i}][lane] = {v.name};" for i, v in enumerate(hoisted)]
    store += _missing(limits)
    store += printer.lines(dict.fromkeys(s for value in repeated for s in value.first), 0)
    store += [f"{_kept_name(i)} = {value.target.name};" for i, value in enumerate(repeated)]
    ends = [(name, printer.atom(new)) for name, new in carried.items() if Variable(name, "float64") != new]
    simpler = where(parts[OF_BOTH], conditions, names(carried.values()))
    of_both, of_simple = (
        [*load, *printer.lines(body, 0), *_assigned(ends, now=False)] for body in (parts[OF_BOTH], simpler)
    )
    counts = inputs.counts
    return {
        **{name: str(counts[name]) for name in ("shared", "own", "now", "state")},
        "rows": str(counts["row"]),
        "hoisted": str(len(hoisted)),
        "kept": str(len(repeated)),
        "once": [*printer.lines(parts[0], 0)],
        "of_point": [*printer.lines(parts[OF_POINT], 0), *store],
        "of_step": [*printer.lines(parts[OF_STEP], 0)],
        "of_both": of_both,
        "simple": _all(conditions),
        "of_simple": of_simple if conditions else [],
        "next": _assigned(ends, now=True),
    }


def _all(conditions: dict[str, bool]) -> str:
    """Whether all conditions are what they have to be; false if there are none."""
    return " && ".join("!" * (not value) + name for name, value in conditions.items()) or "false"


def _by_level(statements: list[Statement], levels: dict[str, int]) -> dict[int, list[Statement]]:
    """Statements by what they depend on."""
    parts: dict[int, list[Statement]] = {level: [] for level in range(4)}
    for s in statements:
        parts[levels.get(s.target.name, OF_BOTH) if isinstance(s, Define | Table) else OF_BOTH].append(s)
    return parts


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


def _without_functions(statements: list[Define | Table], levels: dict[str, int], results: set[str]) -> dict[str, bool]:
    """What conditions that are the same for all points and steps have to be, so that no step takes a function.

    The knees of a curve, for instance, take exponentials only where they are rounded. None if functions are taken in
    any case, or in none.
    """
    functions = {s.target.name for s in statements if isinstance(s, Define) and s.operation in FUNCTIONS - {"sqrt"}}
    functions = {name for name in functions if levels.get(name, OF_BOTH) == OF_BOTH}
    conditions = without_need(statements, results, functions)
    return {} if conditions is None or any(map(levels.__getitem__, conditions)) else conditions


def _loaded(statements: list[Define | Table], levels: dict[str, int]) -> list[Define | Table]:
    """The same, with what selections choose from read before them: a choice of two places would be a gather."""
    loaded: dict[Atom, Variable] = {}
    written: list[Define | Table] = []
    for s in statements:
        if isinstance(s, Define) and s.operation == "select":
            for atom in s.operands[1:]:
                if isinstance(atom, Variable) and "[" in atom.name and atom not in loaded:
                    loaded[atom] = Variable(f"loaded{len(loaded)}", atom.dtype)
                    levels[loaded[atom].name] = levels[atom.name]
                    written.append(Define(loaded[atom], "copy", (atom,)))
            s = Define(s.target, s.operation, tuple(loaded.get(atom, atom) for atom in s.operands))
        written.append(s)
    return written


def _with_kept(
    statements: list[Define | Table], levels: dict[str, int], carried: dict[str, Atom]
) -> tuple[list[Kept], dict[str, Atom], list[Define | Table]]:
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

    def reading(s: Define | Table) -> Define | Table:
        atoms = tuple(given.get(a, a) for a in (s.operands if isinstance(s, Define) else s.entries))
        return Define(s.target, s.operation, atoms) if isinstance(s, Define) else Table(s.target, atoms)

    left = pruned([reading(s) for s in statements], names(carried.values()))
    return repeated, carried, [s for s in left if isinstance(s, Define | Table)]


def _limited(
    statements: list[Define | Table], levels: dict[str, int]
) -> tuple[list[Define | Table], dict[str, Variable]]:
    """Limits that are the same in all steps as one vector operation each, and those of them that may be NaN."""
    limits: dict[str, Variable] = {}

    def limited(s: Define | Table) -> Define | Table:
        if not isinstance(s, Define) or s.operation not in _LIMITS or s.target.dtype != "float64":
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

    return [limited(s) for s in statements], limits


def _missing(limits: Iterable[str]) -> list[str]:
    """A point with a limit that is NaN is NaN from the start."""
    tests = [f"({name} != {name} ? NAN : 0.0)" for name in limits]
    return [f"const double missing = {' + '.join(tests)};", *_SPOILT] if tests else []


def _assigned(pairs: list[tuple[str, str]], *, now: bool) -> list[str]:
    """What is the same for all points, or the rest, all at once: values are read before any of them changes."""
    pairs = [pair for pair in pairs if pair[0].startswith("now") == now]
    copies = [f"const double after{i} = {value};" for i, (_, value) in enumerate(pairs)]
    return copies + [f"{target} = after{i};" for i, (target, _) in enumerate(pairs)]


def _in_turn(lines: Iterable[str], vectors: str) -> Iterator[str]:
    """Each line for one vector after the other, with names of its own for what it defines."""
    lines = list(lines)
    own = {"lane", *(name for line in lines for name in re.findall(r"^ *const \w+ (\w+)", line))}
    for line in lines:
        for vector in vectors:
            yield re.sub(r"[A-Za-z]\w*", lambda word, v=vector: word[0] + v * (word[0] in own), line)


def _filled(template: str, marks: dict[str, str | list[str]]) -> str:
    text = resources.files("jaxdamp.codegen").joinpath(template).read_text(encoding="utf-8")
    for mark, lines in marks.items():
        block = lines if isinstance(lines, str) else "\n".join(" " * WIDTH + line for line in lines)
        text = text.replace(f"@{mark}@", block)
    return text
