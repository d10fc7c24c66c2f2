"""Functions of numbers with their derivatives as C: the value once, the derivatives in lanes side by side."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, PyTree

from jaxdamp.codegen._branches import in_branches
from jaxdamp.codegen._languages import C
from jaxdamp.codegen._lowering import Program, Symbols, lower, symbols
from jaxdamp.codegen._program import Atom, Define, Statement, Variable, names, names_in, written


class Signature(NamedTuple):
    """How a printed function with derivatives is called from C.

    The numbers `p` come first. `_prepare(p)` computes what depends on them alone, once for many calls.

    Attributes:
        name: of the function; that of its preparation ends in `_prepare`.
        head: its arguments in C after the numbers, the last one `int slopes`, whether derivatives are wanted.
        value: texts that the results are assigned to.
        slope: texts of their derivatives in lane `k`.
    """

    name: str
    head: str
    value: Sequence[str]
    slope: Sequence[str]


def in_lanes(name: str, count: int) -> Symbols:
    """Derivatives of numbers in lane `k`: `name[0][k]`, `name[1][k]`, ..."""
    lanes = symbols(name, (count,))
    for i in range(count):
        lanes.names[i] = f"{name}[{i}][k]"
    return lanes


def with_slopes(
    signature: Signature,
    function: Callable[..., Array],
    shapes: Sequence[tuple[int, ...]],
    free: Sequence[int],
    states: int,
    rest: Sequence[Symbols] = (),
    moves: Sequence[Symbols] = (),
) -> str:
    """The C text of `function(arrays, states, *rest)` and its derivatives in lanes.

    The text needs the constants `LANES` and `dp[][LANES]`, the derivatives of the free numbers in each lane.

    Arguments:
        signature: how it is called.
        function: of JAX, of a list of arrays, states and other arguments, which gives an array.
        shapes: of the arrays, whose numbers are `p[0]`, `p[1]`, ...
        free: those arrays that the function is differentiated by; each of their numbers has a row of `dp`.
        states: how many states there are, `s[0]`, ..., whose derivatives are `ds[][k]`.
        rest: the other arguments.
        moves: their derivatives in lane `k`; none if they have none.

    Raises:
        NotImplementedError: something that cannot be printed.
    """
    numbers, slopes = sum(map(math.prod, shapes)), sum(math.prod(shapes[i]) for i in free)
    arrays = _cut(symbols("p", (numbers,)), shapes)
    of_arrays = _cut(in_lanes("dp", slopes), [shapes[i] for i in free])

    def both(arrays: list[Array], own: list[Array], of_arrays: list[Array], of_own: list[Array]) -> PyTree:
        def of(some: list[Array], *own: Array) -> PyTree:
            moved = dict(zip(free, some, strict=True))
            return function([moved.get(i, array) for i, array in enumerate(arrays)], *own, *own_still)

        changing, own_still = own[: len(of_own)], own[len(of_own) :]
        return jax.jvp(of, ([arrays[i] for i in free], *changing), (of_arrays, *of_own))

    own, of_own = [symbols("s", (states,)), *rest], [in_lanes("ds", states), *moves]
    program = lower(both, arrays, own, of_arrays, of_own)
    parameters = {f"p[{i}]" for i in range(numbers)}
    tangents = {f"dp[{i}][k]" for i in range(slopes)}
    moving = {name for each in of_own for name in each.names.ravel() if isinstance(name, str)}  # others are known
    return _text(signature, program, parameters, tangents, tangents | moving)


def _cut(flat: Symbols, shapes: Sequence[tuple[int, ...]]) -> list[Symbols]:
    """The numbers of a vector in arrays of these shapes."""
    ends = np.cumsum([math.prod(shape) for shape in shapes])
    return [
        Symbols(flat.names[end - math.prod(shape) : end].reshape(shape), flat.dtype)
        for end, shape in zip(ends, shapes, strict=True)
    ]


def _text(signature: Signature, program: Program, numbers: set[str], of_numbers: set[str], lanes: set[str]) -> str:
    """The text of a program whose results are values and derivatives."""
    value, slope = ([*np.ravel(np.asarray(part, object))] for part in program.results)
    once, lane = _split(program.statements, lanes)
    before, once = _hoisted(once, set(numbers))
    hoisted = numbers | {statement.target.name for statement in before}
    before_lane, lane = _hoisted(lane, hoisted | of_numbers)
    used = names([*value, *slope]) | names_in([*once, *lane])
    if names(value) & written(lane):
        raise NotImplementedError("A value is computed together with its derivatives.")
    once = in_branches(once, lane, names([*value, *slope]))
    stored = [s.target for s in before if s.target.name in used]
    stored_lane = [s.target for s in before_lane if s.target.name in used]
    c, name = C(), signature.name
    lines = [
        f"static _Thread_local double {name}_once[{len(stored) + 1}];",
        f"static _Thread_local double {name}_lane[{len(stored_lane) + 1}][LANES] __attribute__((aligned(64)));",
        f"static void {name}_prepare(const double *restrict p)",
        "{",
        *c.lines(before, 1),
        *_numbered(f"    {name}_once[{{}}] = {{}};", stored),
        "    for (int k = 0; k < LANES; k++) {",
        *c.lines(before_lane, 2),
        *_numbered(f"        {name}_lane[{{}}][k] = {{}};", stored_lane),
        "    }",
        "}",
        f"static void {name}(const double *restrict p, {signature.head})",
        "{",
        *_numbered(f"    const {{type}} {{1}} = {name}_once[{{0}}];", stored),
        *c.lines(once, 1),
        "    if (slopes)",
        "    #pragma omp simd",
        "    for (int k = 0; k < LANES; k++) {",
        *_numbered(f"        const {{type}} {{1}} = {name}_lane[{{0}}][k];", stored_lane),
        *c.lines(lane, 2),
        *_put(slope, signature.slope, "slope", 2),
        "    }",
        *_put(value, signature.value, "value", 1),
        "}",
    ]
    return "\n".join([*lines, ""])


def _numbered(line: str, stored: Sequence[Variable]) -> list[str]:
    """A line for each of some variables, with its number, name and type."""
    return [line.format(i, v.name, type=C().types[v.dtype]) for i, v in enumerate(stored)]


def _put(atoms: Sequence[Atom], targets: Sequence[str], name: str, depth: int) -> list[str]:
    """The lines that assign results, after all of them are computed: a target may be an input too."""
    space = "    " * depth
    before = [f"{space}const double {name}{i} = {C().atom(atom)};" for i, atom in enumerate(atoms)]
    return before + [f"{space}{target} = {name}{i};" for i, target in enumerate(targets)]


def _split(statements: Sequence[Statement], lanes: set[str]) -> tuple[list[Statement], list[Statement]]:
    """Statements that no derivative enters, and the others; a loop assigns variables that were declared before it."""
    pairs, entered = [(names_in([s]), written([s])) for s in statements], set(lanes)
    while True:
        count = len(entered)
        for reads, writes in pairs:
            if not entered.isdisjoint(reads):
                entered |= writes
        if len(entered) == count:
            break
    inside = [not (entered.isdisjoint(reads) and entered.isdisjoint(writes)) for reads, writes in pairs]
    both = list(zip(statements, inside, strict=True))
    return [s for s, yes in both if not yes], [s for s, yes in both if yes]


def _hoisted(statements: Sequence[Statement], constants: set[str]) -> tuple[list[Define], list[Statement]]:
    """Results of operations on what is known before, and the other statements; `known` grows."""
    early: list[Define] = []
    later: list[Statement] = []
    for statement in statements:
        kinds = ("float64", "bool")
        if isinstance(statement, Define) and statement.target.dtype in kinds and names_in([statement]) <= constants:
            early.append(statement)
            constants.add(statement.target.name)
        else:
            later.append(statement)
    return early, later
