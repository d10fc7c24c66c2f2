"""Costly operations only where their results are used: those that one side of `jnp.where` takes go into a branch.

The rounded knees of a curve, for instance, take four exponentials each, which `jnp.where` drops if their width is zero.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, groupby
from typing import NamedTuple

from jaxdamp.codegen._program import (
    Assign,
    Branch,
    Declare,
    Define,
    Loop,
    Statement,
    Variable,
    changed,
    constant,
    names,
    names_in,
    pruned,
)


CHEAP = frozenset(
    "add sub mul div sqrt neg abs max min lt le gt ge eq ne and or xor not select copy convert sign look_up "
    "is_finite".split()
)


class Case(NamedTuple):
    """The value of a condition for which something is used."""

    condition: Variable
    value: bool


def in_branches(
    statements: Sequence[Statement], after: Sequence[Statement], results: set[str], changing: Iterable[str] = ()
) -> list[Statement]:
    """The same statements, with the costly ones that only one side of selections takes in branches.

    What follows them stays as it is, and `results` are used after both in any case. Variables that are `changing`, by
    assignments outside the block, are no conditions.
    """
    changing = {*changing, *(s.target.name for s in statements if isinstance(s, Declare))}
    cases = _cases([*statements, *after], results, changing)
    runs = _runs(statements, cases)
    used = [names_in(run) for _, run in runs]
    shared: set[Variable] = set()
    written: list[Statement] = []
    for number, (of, run) in enumerate(runs):
        if of is None:
            # what a loop assigns is used in any case
            written += [Loop(in_branches(s.body, (), set(), changing)) if isinstance(s, Loop) else s for s in run]
            continue
        outside = results.union(names_in(after), *used[:number], *used[number + 1 :])
        shared |= {s.target for s in run if isinstance(s, Define) and s.target.name in outside}
        body = list(chain.from_iterable(_assigned(s, shared) for s in run))
        written.append(Branch(of.condition, [[], body] if of.value else [body, []]))
    return [*(Declare(v, constant(0, v.dtype)) for v in sorted(shared, key=lambda v: v.name)), *written]


def without_need(statements: Sequence[Statement], results: set[str], costly: set[str]) -> dict[str, bool] | None:
    """What conditions of selections have to be, by name, so that nothing costly is used; None if something always is.

    Statements inside loops stand in the place of these.
    """
    cases = _cases(statements, results, set())
    needed = {cases[name] for name in costly}
    avoiding = {case.condition.name: not case.value for case in needed if case}
    return avoiding if None not in needed and len(avoiding) == len(needed) else None


def where(statements: Sequence[Statement], conditions: Mapping[str, bool], results: set[str]) -> list[Statement]:
    """The statements that are left where conditions of selections are known."""

    def chosen(s: Statement) -> Statement:
        if not isinstance(s, Define) or s.operation != "select":
            return s
        condition, yes, no = s.operands
        value = conditions.get(condition.name) if isinstance(condition, Variable) else None
        return s if value is None else Define(s.target, "copy", (yes if value else no,))

    return pruned(changed(statements, chosen), results)


def _runs(
    statements: Sequence[Statement], cases: Mapping[str, Case | None]
) -> list[tuple[Case | None, list[Statement]]]:
    """Neighbours of one case, if something costly is in it; all others under None."""
    defined = [s for s in statements if isinstance(s, Define)]
    costly = {cases[s.target.name] for s in defined if s.operation not in CHEAP} - {None}

    def case(statement: Statement) -> Case | None:
        of = cases[statement.target.name] if isinstance(statement, Define) else None
        return of if of in costly else None

    return [(of, list(run)) for of, run in groupby(statements, case)]


def _assigned(statement: Statement, shared: set[Variable]) -> list[Statement]:
    """A statement of a branch; a result that is used outside is assigned to a variable declared before it."""
    if not isinstance(statement, Define) or statement.target not in shared:
        return [statement]
    inside = Variable(f"{statement.target.name}_", statement.target.dtype)
    return [Define(inside, statement.operation, statement.operands), Assign(statement.target, inside)]


def _cases(statements: Sequence[Statement], results: set[str], changing: set[str]) -> dict[str, Case | None]:
    """The one case in which each name is used, as a side of selections by one condition; None if it is used in any."""
    places = {s.target.name: i for i, s in enumerate(statements) if isinstance(s, Define)}
    cases: dict[str, Case | None] = dict.fromkeys(results)  # none: always

    def use(taken: Iterable[str], case: Case | None) -> None:
        for name in taken:
            cases[name] = case if cases.get(name, case) == case else None

    for place in range(len(statements) - 1, -1, -1):
        s = statements[place]
        if not isinstance(s, Define):
            use(names_in([s]), None)
            continue
        case = cases.setdefault(s.target.name, None)
        if case and places.get(case.condition.name, -1) >= place:  # not known yet
            case = cases[s.target.name] = None
        condition, *sides = s.operands
        if s.operation == "select" and case is None and isinstance(condition, Variable):
            use([condition.name], None)
            for value, side in zip((True, False), sides, strict=True):
                use(names([side]), None if condition.name in changing else Case(condition, value))
        else:
            use(names(s.operands), case)
    return cases
