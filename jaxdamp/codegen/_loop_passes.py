"""What makes the printed body of a loop cheaper: values kept from the step before, sums as fused multiply-adds."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

from jaxdamp.codegen._program import (
    Assign,
    Atom,
    Constant,
    Declare,
    Define,
    Leave,
    Loop,
    Statement,
    Table,
    Variable,
    each,
    names,
    names_in,
    operands_of,
    pruned,
)


CYCLES = {"add": 4.0, "sub": 4.0, "mul": 4.0, "div": 14.0, "sqrt": 20.0, "exp": 40.0, "pow": 80.0}  # about
WORTH_KEEPING = 4  # operations, of which a store and a load of the next step take the place


class Kept(NamedTuple):
    """A value of the body that the step before has computed already, at its end."""

    target: Variable  # its name in the body
    again: Variable  # what it will be in the next step, computed in this one
    first: list[Define]  # the statements that compute it before the first step


def kept_values(statements: Sequence[Statement], after: Mapping[str, Atom], results: Iterable[Atom]) -> list[Kept]:
    """Values of the carried numbers that the body computes again from what they will be in the next step.

    What is evaluated at the beginning and at the end of each step, for instance: once is enough. `after` holds what
    each carried number is in the next step, and numbers that stay the same.
    """
    moved, defined = _computed_before(statements, after)
    outside = names(results)
    outside |= names_in(s for s in statements if not isinstance(s, Define) or s.target.name not in defined)
    values = []
    for name in filter(defined.__contains__, sorted(outside)):
        first = [s for s in pruned(list(defined.values()), {name}) if isinstance(s, Define)]
        again = moved[name]
        if len(first) >= WORTH_KEEPING and isinstance(again, Variable) and again.dtype == "float64":
            values.append(Kept(defined[name].target, again, first))
    return values


def _computed_before(
    statements: Sequence[Statement], after: Mapping[str, Atom]
) -> tuple[dict[str, Atom], dict[str, Define]]:
    """What numbers will be in the next step, and the statements whose value there is computed in this one."""
    targets = {(s.operation, s.operands, s.target.dtype): s.target for s in statements if isinstance(s, Define)}
    moved: dict[str, Atom] = dict(after)
    defined: dict[str, Define] = {}
    for s in statements:
        if not isinstance(s, Define) or any(isinstance(a, Variable) and a.name not in moved for a in s.operands):
            continue
        operands = tuple(moved[a.name] if isinstance(a, Variable) else a for a in s.operands)
        again = targets.get((s.operation, operands, s.target.dtype))
        if again is not None and again != s.target:
            moved[s.target.name], defined[s.target.name] = again, s
    return moved, defined


def _ready(statements: Sequence[Define | Table], inside: set[str], after: Mapping[str, Atom]) -> dict[str, float]:
    """After how many clock cycles of a step each value is known, those of the step before counted from its end."""
    ready: dict[str, float] = {}
    for _ in range(2):  # in the first round nobody knows yet when the step before was done
        end = max([0.0, *ready.values()])
        ready = {name: ready.get(new.name, 0.0) - end for name, new in after.items() if isinstance(new, Variable)}
        for s in statements:
            if isinstance(s, Define) and s.target.name in inside:
                before = max((ready.get(name, -end) for name in names(s.operands)), default=-end)
                ready[s.target.name] = before + CYCLES.get(s.operation, 2.0)
    return ready


def sums_of_products(statements: Sequence[Statement], inside: set[str], after: Mapping[str, Atom]) -> list[Statement]:
    """The same with products added last to each sum, one after the other, so that each is one multiply-add.

    Among products, what is computed last is added last, so that as little as possible waits for it. A sum stays on its
    side of a loop. `inside` is computed in every step; `after` holds the value of each carried number in the next one.
    """
    uses = Counter(a.name for a in after.values() if isinstance(a, Variable))
    for s in each(statements):
        uses.update(a.name for a in operands_of(s) if isinstance(a, Variable))

    def in_run(run: list[Define | Table]) -> Iterator[Statement]:
        chains, replaced = _Sums(run, inside, after, uses).chains()
        for s in run:
            if s.target.name in chains:
                yield from _chain(s.target, chains[s.target.name])
            elif s.target.name not in replaced:
                yield s

    def in_block(block: Sequence[Statement]) -> Iterator[Statement]:
        for straight, run in groupby(block, lambda s: isinstance(s, Define | Table)):
            if straight:
                yield from in_run([s for s in run if isinstance(s, Define | Table)])
            else:
                yield from (Loop([*in_block(s.body)]) if isinstance(s, Loop) else s for s in run)

    return [*in_block(statements)]


class _Sums:
    """The sums among statements, with the sums inside them whose value is used nowhere else, by how often it is."""

    def __init__(
        self, statements: Sequence[Define | Table], inside: set[str], after: Mapping[str, Atom], uses: Counter[str]
    ) -> None:
        self._uses = uses
        self._ready = _ready(statements, inside, after)
        self._parts = {s.target.name: s for s in statements if isinstance(s, Define) and s.target.name in inside}

    def chains(self) -> tuple[dict[str, list[tuple[bool, Atom]]], set[str]]:
        """The terms of each sum with several products, the products last; and the names of the sums inside them."""
        sums = [s for s in self._parts.values() if s.operation in ("add", "sub") and s.target.dtype == "float64"]
        nested = {within.target.name for s in sums for within in self._inner(s)}
        chains, replaced = {}, set()
        for s in sums:
            terms = sorted(self._terms(s, False), key=self._place)
            has_number = any(isinstance(atom, Constant) for _, atom in terms)  # may be there to round another term
            products = sum(self._is_product(atom) for _, atom in terms)
            if s.target.name not in nested and not has_number and products > 1:
                chains[s.target.name] = terms
                replaced |= {within.target.name for within in self._inner(s)}
        return chains, replaced

    def _part(self, atom: Atom | None, *operations: str) -> Define | None:
        """The statement of a value that is used once."""
        if not isinstance(atom, Variable) or self._uses[atom.name] != 1:
            return None
        s = self._parts.get(atom.name)
        return s if s is not None and s.operation in operations and s.target.dtype == "float64" else None

    def _is_product(self, atom: Atom) -> bool:
        return self._part(atom, "mul") is not None

    def _place(self, term: tuple[bool, Atom]) -> tuple[bool, float, bool]:
        """By which terms are sorted."""
        minus, atom = term
        return self._is_product(atom), self._ready.get(atom.name, 0.0) if isinstance(atom, Variable) else 0.0, minus

    def _inner(self, s: Define) -> list[Define]:
        """The sums whose only use is in this one, and those in them."""
        sums = [within for atom in s.operands if (within := self._part(atom, "add", "sub")) is not None]
        return sums + [deeper for within in sums for deeper in self._inner(within)]

    def _terms(self, s: Define, minus: bool) -> list[tuple[bool, Atom]]:
        """Whether they are subtracted, and terms."""
        terms = []
        for negative, atom in zip((minus, minus != (s.operation == "sub")), s.operands, strict=True):
            within = self._part(atom, "add", "sub")
            terms += [(negative, atom)] if within is None else self._terms(within, negative)
        return terms


def _chain(target: Variable, terms: list[tuple[bool, Atom]]) -> list[Define]:
    """A sum, term by term from the first that is not subtracted."""
    start = next(i for i, (minus, _) in enumerate(terms) if not minus)  # there is one, as the first of a sum is
    total, others = terms[start][1], [*terms[:start], *terms[start + 1 :]]
    chain = []
    for i, (less, atom) in enumerate(others):
        to = target if i == len(others) - 1 else Variable(f"{target.name}_{i}", target.dtype)
        chain.append(Define(to, "sub" if less else "add", (total, atom)))
        total = to
    return chain


def with_operands(s: Statement, given: Mapping[Atom, Atom]) -> Statement:
    """A statement that reads others in place of some variables."""
    if isinstance(s, Define):
        return Define(s.target, s.operation, tuple(given.get(a, a) for a in s.operands))
    if isinstance(s, Table):
        return Table(s.target, tuple(given.get(a, a) for a in s.entries))
    if isinstance(s, Leave):
        return Leave(given.get(s.unless, s.unless))
    if isinstance(s, Declare) and s.start is not None:
        return Declare(s.target, given.get(s.start, s.start), s.size)
    if isinstance(s, Assign):
        return Assign(s.target, given.get(s.value, s.value), s.index and given.get(s.index, s.index))
    return s
