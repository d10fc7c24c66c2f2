"""Programs of scalar statements: what a JAX function is translated to, and what a language prints."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt


# Only what IEEE 754 defines to the last bit: the text must not depend on the machine that prints it.
_EXACT: dict[str, Callable[..., object]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "neg": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "max": np.maximum,
    "min": np.minimum,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "eq": np.equal,
    "ne": np.not_equal,
    "and": np.bitwise_and,
    "or": np.bitwise_or,
    "xor": np.bitwise_xor,
    "not": np.invert,
    "select": lambda chosen, yes, no: yes if chosen else no,
}


def folded(operation: str, values: Sequence[Any], dtype: str) -> object:
    """The result of an operation on known numbers; `None` if it is left to the program."""
    if operation == "convert":
        return np.asarray(values[0]).astype(dtype)[()]
    with np.errstate(all="ignore"):
        if operation == "div" and dtype.startswith("float"):
            return np.divide(*values)
        return _EXACT[operation](*values) if operation in _EXACT else None


def simplified(operation: str, texts: Sequence[str]) -> int | None:
    """Which operand a sum or a product is equal to, where another one is zero or one and all numbers are finite.

    The operands are texts: numbers as Python writes them, or names. None if no operand is the result.
    """
    zeros, ones = [text in ("0.0", "-0.0") for text in texts], [text == "1.0" for text in texts]
    if operation == "mul":
        return next((place for place in (0, 1) if zeros[place] or ones[1 - place]), None)
    if operation == "div":
        return 0 if zeros[0] or ones[1] else None
    if operation == "add" and zeros[0]:
        return 1
    return 0 if operation in ("add", "sub") and zeros[1] else None


@dataclass(frozen=True)
class Variable:
    """A scalar or an array of the program.

    Attributes:
        name: in the printed text.
        dtype: its type.
    """

    name: str
    dtype: str


@dataclass(frozen=True)
class Constant:
    """A number, held as Python writes it: 0.0 and −0.0 differ.

    Attributes:
        text: the number.
        dtype: its type.
    """

    text: str
    dtype: str


Atom: TypeAlias = Variable | Constant
Atoms: TypeAlias = npt.NDArray[np.object_]  # an array of JAX: one atom for each number
COUNTER = "int32"  # the type of what counts the rounds of a loop


def array_of(shape: tuple[int, ...], entry: Callable[[tuple[int, ...]], object]) -> Atoms:
    """An array of what a function gives at each place."""
    result = np.empty(shape, object)
    for index in np.ndindex(*shape):
        result[index] = entry(index)
    return result


def constant(value: object, dtype: str) -> Constant:
    """A number of a type."""
    number = np.dtype(dtype).type(value)
    return Constant(repr(number.item()) if dtype != "float32" else str(number), dtype)


@dataclass(frozen=True)
class Define:
    """A value that does not change: the result of an operation."""

    target: Variable
    operation: str
    operands: tuple[Atom, ...]


@dataclass(frozen=True)
class Declare:
    """A variable that is assigned later; an array if it has a size."""

    target: Variable
    start: Atom | None = None
    size: int | None = None


@dataclass(frozen=True)
class Table:
    """An array of given entries."""

    target: Variable
    entries: tuple[Atom, ...]


@dataclass(frozen=True)
class Assign:
    """A new value of a declared variable, or of one entry of it."""

    target: Variable
    value: Atom
    index: Atom | None = None


@dataclass(frozen=True)
class Leave:
    """The end of a loop as soon as a condition does not hold."""

    unless: Atom


@dataclass(frozen=True)
class Loop:
    """Statements repeated until `Leave`."""

    body: "list[Statement]"


@dataclass(frozen=True)
class Branch:
    """The statements of one of several cases, numbered from zero."""

    case: Atom
    bodies: "list[list[Statement]]"


Statement: TypeAlias = Define | Declare | Table | Assign | Leave | Loop | Branch


@dataclass
class Writer:
    """Collects statements; an operation with the same operands is computed once in a block."""

    finite: bool = False  # whether all numbers are finite, so that a product with zero is zero
    statements: list[Statement] = field(default_factory=list)  # of the present block
    _known: list[dict[tuple, Variable]] = field(default_factory=lambda: [{}])
    _count: int = 0

    def new(self, dtype: str, letter: str = "t") -> Variable:
        """A variable with a new name."""
        self._count += 1
        return Variable(f"{letter}{self._count}", dtype)

    def put(self, statement: Statement) -> None:
        """Add a statement to the present block."""
        self.statements.append(statement)

    def define(self, operation: str, operands: tuple[Atom, ...], dtype: str) -> Atom:
        """The result of an operation, computed now if all operands are numbers."""
        known_numbers = [_number(operand) for operand in operands if isinstance(operand, Constant)]
        if len(known_numbers) == len(operands):
            value = folded(operation, known_numbers, dtype)
            if value is not None:
                return constant(value, dtype)
        if self.finite and len(operands) == 2:
            texts = [operand.text if isinstance(operand, Constant) else operand.name for operand in operands]
            place = simplified(operation, texts)
            if place is not None:
                return operands[place]
        key = operation, operands, dtype
        for defined in reversed(self._known):
            if key in defined:
                return defined[key]
        target = self._known[-1][key] = self.new(dtype)
        self.put(Define(target, operation, operands))
        return target

    def declare(self, dtype: str, start: Atom | None = None, size: int | None = None) -> Variable:
        """A variable to be assigned."""
        target = self.new(dtype, "u")
        self.put(Declare(target, start, size))
        return target

    def table(self, entries: Iterable[Atom], dtype: str) -> Variable:
        """An array of these entries."""
        target = self.new(dtype, "table")
        self.put(Table(target, tuple(entries)))
        return target

    def assign(self, pairs: Iterable[tuple[Variable, Atom]]) -> None:
        """Assign all at once: values are read before any variable changes."""
        pairs = [(target, value) for target, value in pairs if target != value]
        targets = {target for target, _ in pairs}
        before = [(target, self._copy(value) if value in targets else value) for target, value in pairs]
        for target, value in before:
            self.put(Assign(target, value))

    def _copy(self, value: Atom) -> Variable:
        target = self.new(value.dtype)
        self.put(Define(target, "copy", (value,)))
        return target

    @contextmanager
    def block(self) -> Iterator[list[Statement]]:
        """Statements written inside go into a list of their own."""
        outer, inner = self.statements, []
        self.statements = inner
        self._known.append({})
        yield inner
        self._known.pop()
        self.statements = outer

    @contextmanager
    def counted(self, length: int) -> Iterator[Variable]:
        """Statements written inside are repeated so many times; gives the number of the round, from zero."""
        count = self.declare(COUNTER, constant(0, COUNTER))
        with self.block() as body:
            self.put(Leave(self.define("lt", (count, constant(length, COUNTER)), "bool")))
            yield count
            self.assign([(count, self.define("add", (count, constant(1, COUNTER)), COUNTER))])
        self.put(Loop(body))


def _number(atom: Constant) -> object:
    kind = np.dtype(atom.dtype).type
    if atom.dtype == "bool":
        return kind(atom.text == "True")
    return kind(float(atom.text) if atom.dtype.startswith("float") else int(atom.text))


def pruned(statements: list[Statement], needed: set[str]) -> list[Statement]:
    """Without what nothing uses; `needed` are the names used afterwards, and the names used here are added to it."""
    used_statements: list[Statement] = []
    for statement in reversed(statements):
        used = _pruned_statement(statement, needed)
        if used is not None:
            used_statements.append(used)
    return used_statements[::-1]


def _pruned_statement(statement: Statement, needed: set[str]) -> Statement | None:
    if isinstance(statement, Loop):
        if not needed & written([statement]):
            return None
        while True:  # what an earlier statement of the body uses may come from a later one, a round before
            before = len(needed)
            body = pruned(statement.body, needed)
            if len(needed) == before:
                return Loop(body)
    if isinstance(statement, Branch):
        needed |= names([statement.case])
        return Branch(statement.case, [pruned(body, needed) for body in statement.bodies])
    if not isinstance(statement, Leave) and statement.target.name not in needed:
        return None
    needed |= names(operands_of(statement))
    return statement


def _with_inner(statements: Iterable[Statement]) -> Iterator[Statement]:
    """Every statement, and those inside loops and branches."""
    for s in statements:
        yield s
        for body in [s.body] if isinstance(s, Loop) else s.bodies if isinstance(s, Branch) else ():
            yield from _with_inner(body)


def written(statements: Iterable[Statement]) -> set[str]:
    """The names of the variables that statements define or assign, those inside loops and branches too."""
    return {s.target.name for s in _with_inner(statements) if not isinstance(s, Loop | Branch | Leave)}


def operands_of(statement: Statement) -> list[Atom | None]:
    """What a statement reads, a branch or a loop by itself."""
    if isinstance(statement, Loop):
        return []
    if isinstance(statement, Branch):
        return [statement.case]
    if isinstance(statement, Define):
        return list(statement.operands)
    if isinstance(statement, Declare):
        return [statement.start]
    if isinstance(statement, Table):
        return list(statement.entries)
    return [statement.unless] if isinstance(statement, Leave) else [statement.value, statement.index]


def each(statements: Iterable[Statement]) -> Iterator[Statement]:
    """Every statement but loops, those inside loops too."""
    for s in statements:
        yield from each(s.body) if isinstance(s, Loop) else (s,)


def changed(statements: Iterable[Statement], change: Callable[[Statement], Statement]) -> list[Statement]:
    """The same with every statement changed but loops, those inside loops too."""
    return [Loop(changed(s.body, change)) if isinstance(s, Loop) else change(s) for s in statements]


def names(atoms: Iterable[Atom | None]) -> set[str]:
    """The names of the variables among them."""
    return {atom.name for atom in atoms if isinstance(atom, Variable)}


def names_in(statements: Iterable[Statement]) -> set[str]:
    """The names of the variables that statements read, those inside loops and branches too."""
    return names(atom for s in _with_inner(statements) for atom in operands_of(s))
