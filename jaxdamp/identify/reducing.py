"""Simpler laws: what a law becomes without the parts and numbers that the records do not determine."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp.dampers import (
    AbstractDamper,
    AbstractWrapper,
    PiecewiseLinear,
    StandardError,
    Sum,
    laws_inside,
    with_standard_errors,
)
from jaxdamp.identify.rungs import NEARLY, Failure, Rung, judged_on_held_out, recommendation
from jaxdamp.parameters import nonnegative, parameters, with_values


MOST_FAILURES = 3  # simpler laws that predict worse, before the search for one ends
LOSS = 1.02  # times the error of the whole law: what is not determined is hardly missed
MOST_LAWS = 2  # that are to become simpler

Fitted = Callable[[Rung, AbstractDamper, tuple[str, ...]], Rung | Failure]
Begun = Callable[[], Rung | Failure]
Ahead = Callable[[Rung, AbstractDamper, tuple[str, ...]], Begun | None]


class Simpler(NamedTuple):
    """A law with less in it than another."""

    law: AbstractDamper  # to start from
    words: str  # what it lacks
    weak: int  # how many of the numbers that it lacks were not determined
    share: float  # of these among the numbers that it lacks


def simpler_laws(law: AbstractDamper, weak: Sequence[str], fastest: float, path: str = "") -> Iterator[Simpler]:
    """What a law becomes where one part that holds undetermined numbers is left out, or is replaced by a simpler one.

    A term of a sum and a wrapper (lag, series spring, clearance) are left out; a number that may be zero is zero; a
    curve becomes one of fewer numbers; friction with breakaway, with a shape or with several elements becomes a viscous
    force beside friction that follows the velocity, `CoulombFriction`, and elastic friction, `Dahl`.

    `weak` are the paths of the undetermined numbers, for vectors once for each number; `fastest` is the largest
    velocity [m/s] of the records, `path` the prefix of the paths of this part.

    >>> from jaxdamp.dampers import CoulombFriction, Lag, Linear
    >>> law = Lag(Linear(1500.0) + CoulombFriction(20.0, 0.02), 0.005)
    >>> [simpler.words for simpler in simpler_laws(law, ["lag_time", "law.terms.1.friction_force"], 0.5)]
    ['with Linear + CoulombFriction for Lag(Linear + CoulombFriction)', 'without CoulombFriction']
    """
    inside = [name for name in weak if name.startswith(path)]
    if not inside:
        return
    if isinstance(law, Sum):
        yield from _of_sum(law, inside, fastest, path)
    elif isinstance(law, AbstractWrapper):
        yield from _of_wrapper(law, inside, fastest, path)
    else:
        plain = law.plainer([name.removeprefix(path) for name in inside], fastest)
        if plain is not None:
            held = held_of(plain, fastest)
            words = f"with {_in_words(plain)} for {_in_words(law)}" + f", {', '.join(held)} held" * bool(held)
            yield Simpler(plain, words, len(inside), len(inside) / (_size(law) - _size(plain) + len(held)))
        yield from _at_zero(law, inside, path)


def _of_sum(law: Sum, weak: Sequence[str], fastest: float, path: str) -> Iterator[Simpler]:
    """Without one of its terms, or with a simpler one."""
    for i, term in enumerate(law.terms):
        place, before, after = f"{path}terms.{i}.", law.terms[:i], law.terms[i + 1 :]
        inside = [name for name in weak if name.startswith(place)]
        others = before + after
        if others and inside:
            less = others[0] if len(others) == 1 else Sum(others)
            yield Simpler(less, f"without {_in_words(term)}", len(inside), len(inside) / _size(term))
        for part in simpler_laws(term, inside, fastest, place):
            instead = part.law.terms if isinstance(part.law, Sum) else (part.law,)
            if any(np.asarray(p.value).any() for p in parameters(part.law)):
                yield part._replace(law=Sum((*before, *instead, *after)))


def _of_wrapper(law: AbstractWrapper, weak: Sequence[str], fastest: float, path: str) -> Iterator[Simpler]:
    """The law inside alone, a simpler one inside, or the wrapper without a number of its own."""
    inner = law.inner_law()
    field = next(f.name for f in dataclasses.fields(law) if getattr(law, f.name) is inner)
    inside = [name for name in weak if name.startswith(f"{path}{field}.")]
    outside = [name for name in weak if name not in inside]
    if outside:
        words = f"with {_in_words(inner)} for {_in_words(law)}"
        yield Simpler(inner, words, len(outside), len(outside) / (_size(law) - _size(inner)))
    for part in simpler_laws(inner, inside, fastest, f"{path}{field}."):
        yield part._replace(law=dataclasses.replace(law, **{field: part.law}))
    yield from _at_zero(law, outside, path)


def _at_zero(law: AbstractDamper, weak: Sequence[str], path: str) -> Iterator[Simpler]:
    """With a number at zero that may be zero."""
    for p in parameters(law):
        if p.domain is nonnegative and f"{path}{p.path}" in weak:
            zero = with_values(law, {p.path: np.zeros(np.shape(p.value))})
            yield Simpler(zero, f"with {p.path} = 0", np.size(p.value), 1.0)


def _size(law: AbstractDamper) -> int:
    return sum(np.size(p.value) for p in parameters(law))


def held_of(law: AbstractDamper, fastest: float) -> tuple[str, ...]:
    """Paths of numbers that are not fitted: at zero where they may be, or without effect up to a velocity [m/s]."""
    zero = [p.path for p in parameters(law) if p.domain is nonnegative and not np.asarray(p.value).any()]
    return *zero, *(place + name for place, part in laws_inside(law) for name in part.without_effect(fastest))


def reduced(rungs: Sequence[Rung], fitted: Fitted, progress: Callable[[str], None], ahead: Ahead) -> Iterator[Rung]:
    """A law all of whose numbers are determined, in place of one recommended in spite of doubt or left aside for it.

    Parts with undetermined numbers are left out one after the other, while the error on motion held out stays within
    2 % of that of the whole law, and within 10 % of the smallest. The recommended law is tried first, then, if doubt
    remains, the one with the smallest error. If doubt remains in both, it is a law without doubt that is only within
    the 10 %, or else, of those within the 2 %, the one with the fewest numbers in doubt. Where a law without doubt
    would be recommended, one that predicts better by more than these 2 % is tried.

    `ahead` begins, beside a fit, the one that follows if this one does not predict as well; None where it cannot.
    """
    best = recommendation(rungs).rung
    judged = sorted(judged_on_held_out(rungs), key=lambda rung: rung.error)
    near, floor, simpler = NEARLY * judged[0].error, best.floor, list[Rung]()
    doubted = [rung for rung in judged if rung is not best and rung.error <= near and rung.doubt]
    sources = [best, *doubted] if best.doubt else [rung for rung in doubted[:1] if LOSS * rung.error < best.error]
    if len(rungs) < 2 or best.held_out_rmse is None:
        return
    for source in sources[:MOST_LAWS]:
        progress(source.name)
        as_well = max(min(near, LOSS * source.error), floor)
        simpler += _clearer(source, as_well, max(near, floor) if best.doubt else None, fitted, ahead)
        if simpler and _by_doubt(simpler[-1]) <= (False, 0, as_well):
            break
    yield from sorted(simpler, key=_by_doubt)[:1]


def _clearer(source: Rung, enough: float, most: float | None, fitted: Fitted, ahead: Ahead) -> list[Rung]:
    """The law with less in it, all of whose numbers are determined, if one predicts as well, or nearly so (`most`).

    Otherwise that with the fewest numbers in doubt of those that predict as well, if they are fewer than the whole law
    has; a fit that converged goes before one that did not. Without `most` there is none.
    """
    tried = list(_with_less(source, enough, fitted, ahead))
    sound = [rung for rung in tried if not rung.doubt and rung.error <= (enough if most is None else most)]
    fewer = [rung for rung in tried if rung.error <= enough and _doubts(rung) < _doubts(source)]
    return sorted(sound or fewer * (most is not None), key=_by_doubt)[:1]


def _with_less(source: Rung, enough: float, fitted: Fitted, ahead: Ahead) -> Iterator[Rung]:
    """The law without one part after the other, as long as it predicts as well, and those tried that do not."""
    at, left_out, failed = source, list[str](), set[str]()
    begun: dict[tuple[str, ...], Begun | None] = {}  # by what is left out
    while at.doubt and len(failed) < MOST_FAILURES:
        law, weak, fastest = _doubtful(at)
        options = [part for part in simpler_laws(law, weak, fastest) if part.words not in failed]
        if options:
            part, *others = sorted(options, key=lambda part: (part.share, part.weak), reverse=True)
            for other in others[: len(failed) < MOST_FAILURES - 1]:
                following = (*left_out, other.words)
                begun[following] = begun.get(following) or ahead(source, *_with_held(other.law, fastest))
            waiting, (law, held) = begun.get((*left_out, part.words)), _with_held(part.law, fastest)
            rung = _as_reduced(source, waiting() if waiting else fitted(source, law, held), held)
            if rung:
                yield rung
            if rung and rung.error <= enough:
                at, left_out = rung, [*left_out, part.words]
            else:
                failed.add(part.words)
        elif left_out:
            at, left_out, failed = source, [], {*failed, left_out[0]}  # another way
        else:
            break


def _doubts(rung: Rung) -> tuple[bool, int]:
    """Whether its fit did not converge, and how many numbers of law and machine are in doubt."""
    return not rung.result.converged, sum(bool(e.note) for e in rung.result.parameters)


def _by_doubt(rung: Rung) -> tuple[bool, int, float]:
    return *_doubts(rung), rung.error


def _as_reduced(source: Rung, rung: Rung | Failure, held: tuple[str, ...]) -> Rung | None:
    """The fit of a law with less in it, which says what it is, and that no record determines what is held."""
    if isinstance(rung, Failure):
        return None
    law = rung.result.law
    at = [p for p in parameters(law) if p.path in held]
    words = ", ".join(f"{p.path.rpartition('.')[2]} = {np.max(p.value):.3g}" for p in at)
    reduced = f"{source.name} reduced to {_in_words(law)}{f' with {words}' * bool(words)}"
    unknown = [StandardError(p.path, np.inf, p.unit, identified=False) for p in at]
    law = with_standard_errors(law, [*law.standard_errors, *unknown])
    result = dataclasses.replace(rung.result, law=law)
    return rung._replace(name=f"{source.name}_reduced", result=result, held=held, reduced=reduced)


def _with_held(law: AbstractDamper, fastest: float) -> tuple[AbstractDamper, tuple[str, ...]]:
    """A law to be fitted, and the numbers of it that are held."""
    law = without_zero_terms(law)
    return law, held_of(law, fastest)


def without_zero_terms(law: AbstractDamper) -> AbstractDamper:
    """A sum without terms all of whose numbers are zero, which give no force; other laws as they are."""
    if not isinstance(law, Sum):
        return law
    terms = [term for term in law.terms if any(np.asarray(p.value).any() for p in parameters(term))]
    return terms[0] if len(terms) == 1 else Sum(tuple(terms)) if terms else law


def _doubtful(rung: Rung) -> tuple[AbstractDamper, list[str], float]:
    """The law, the paths of its numbers that are in doubt, and the largest velocity of the records."""
    result = rung.result
    place = "law." if result.rig is not None or result.record_starts else ""
    noted = [e.name.removeprefix(place) for e in result.parameters if e.note and e.name.startswith(place)]
    return result.law, [name.partition("[")[0] for name in noted], max(run.peak_velocity for run in result.runs)


def _in_words(law: AbstractDamper) -> str:
    """Of what a law is made, such as "Lag(Linear) + Spring"."""
    if isinstance(law, Sum):
        return " + ".join(map(_in_words, law.terms))
    inner = f"({_in_words(law.inner_law())})" if isinstance(law, AbstractWrapper) else ""
    knees = f" with {law.knots.size} knees" if isinstance(law, PiecewiseLinear) else ""
    return f"{type(law).__name__}{inner}{knees}"
