"""What makes the printed body of a loop cheaper: values kept from the step before, sums as fused multiply-adds."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from jaxdamp.codegen._program import Atom, Constant, Define, Table, Variable, names, operands_of, pruned


WORTH_KEEPING = 4  # operations, of which a store and a load of the next step take the place


class Kept(NamedTuple):
    """A value of the body that the step before has computed already, at its end.

    Attributes:
        target: its name in the body.
        again: what it will be in the next step, computed in this one.
        first: the statements that compute it before the first step.
    """

    target: Variable
    again: Variable
    first: list[Define]


def kept_values(statements: Sequence[Define | Table], after: Mapping[str, Atom], results: Iterable[Atom]) -> list[Kept]:
    """Values of the carried numbers that the body computes again from what they will be in the next step.

    A law with a lag, for instance, is evaluated at the beginning and at the end of each step: once is enough.

    Arguments:
        statements: of the body.
        after: for each carried number, its value in the next step; for each number that stays the same, itself.
        results: what is carried.
    """
    known = {(s.operation, s.operands, s.target.dtype): s.target for s in statements if isinstance(s, Define)}
    moved: dict[str, Atom] = dict(after)
    defined: dict[str, Define] = {}
    for s in statements:
        if not isinstance(s, Define) or any(isinstance(a, Variable) and a.name not in moved for a in s.operands):
            continue
        operands = tuple(moved[a.name] if isinstance(a, Variable) else a for a in s.operands)
        again = known.get((s.operation, operands, s.target.dtype))
        if again is not None and again != s.target:
            moved[s.target.name], defined[s.target.name] = again, s
    outside = names(results)
    outside |= names(a for s in statements if s.target.name not in defined for a in operands_of(s))
    kept = []
    for name in filter(defined.__contains__, sorted(outside)):
        first = _tree(name, defined)
        again = moved[name]
        if len(first) >= WORTH_KEEPING and isinstance(again, Variable) and again.dtype == "float64":
            kept.append(Kept(defined[name].target, again, first))
    return kept


def _tree(name: str, defined: Mapping[str, Define]) -> list[Define]:
    """The statements that a value takes, in their order."""
    return [s for s in pruned(list(defined.values()), {name}) if isinstance(s, Define)]


def sums_of_products(
    statements: Sequence[Define | Table], inside: set[str], results: Iterable[Atom]
) -> list[Define | Table]:
    """The same with products added last to each sum, one after the other, so that each is one multiply-add.

    Arguments:
        statements: of the body.
        inside: the names of those that are computed in every step for every point.
        results: what is carried.
    """
    uses = Counter(a.name for s in statements for a in operands_of(s) if isinstance(a, Variable))
    uses.update(a.name for a in results if isinstance(a, Variable))
    parts = {s.target.name: s for s in statements if isinstance(s, Define) and s.target.name in inside}

    def part(atom: Atom, *operations: str) -> Define | None:
        """The statement of a value that is used once."""
        s = parts.get(atom.name) if isinstance(atom, Variable) and uses[atom.name] == 1 else None
        return s if s is not None and s.operation in operations and s.target.dtype == "float64" else None

    def inner(s: Define) -> list[Define]:
        """The sums whose only use is in this one, and those in them."""
        found = [within for atom in s.operands if (within := part(atom, "add", "sub")) is not None]
        return found + [deeper for within in found for deeper in inner(within)]

    def terms(s: Define, minus: bool) -> list[tuple[bool, Atom]]:
        """Terms, and whether they are subtracted."""
        found = []
        for negative, atom in zip((minus, minus != (s.operation == "sub")), s.operands, strict=True):
            within = part(atom, "add", "sub")
            found += [(negative, atom)] if within is None else terms(within, negative)
        return found

    sums = [s for s in parts.values() if s.operation in ("add", "sub") and s.target.dtype == "float64"]
    nested = {within.target.name for s in sums for within in inner(s)}
    chains, replaced = {}, set()
    for s in sums:
        whole = sorted(((part(a, "mul") is not None, minus, a) for minus, a in terms(s, False)), key=lambda t: t[:2])
        known = any(isinstance(a, Constant) for _, _, a in whole)  # may be there to round another term
        if s.target.name not in nested and not known and sum(product for product, _, _ in whole) > 1:
            chains[s.target.name] = [(minus, a) for _, minus, a in whole]
            replaced |= {within.target.name for within in inner(s)}
    written: list[Define | Table] = []
    for s in statements:
        if s.target.name in chains:
            written += _chain(s.target, chains[s.target.name])
        elif s.target.name not in replaced:
            written.append(s)
    return written


def _chain(target: Variable, terms: list[tuple[bool, Atom]]) -> list[Define]:
    """A sum, term by term from the first that is not subtracted."""
    start = next((i for i, (minus, _) in enumerate(terms) if not minus), 0)
    (minus, total), *rest = terms[start], *terms[:start], *terms[start + 1 :]
    chain = []
    for i, (less, atom) in enumerate(rest):
        to = target if i == len(rest) - 1 else Variable(f"{target.name}_{i}", target.dtype)
        if minus:  # all are
            chain.append(Define(Variable(f"{target.name}_start", target.dtype), "neg", (total,)))
            total, minus = chain[-1].target, False
        chain.append(Define(to, "sub" if less else "add", (total, atom)))
        total = to
    return chain
