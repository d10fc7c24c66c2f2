"""Effects that a fit on a bench left out, recognised by their patterns in its residual.

They are of a machine, of a damper, of a sensor. A force that the model does not have leaves its own pattern in the
residual: a constant for an offset, the rate of the force for a delay, the force times the dissipated energy for heat.
The patterns are compared with the residual after both have been cleared of everything that the free parameters explain.
What tells causes apart:

- a delay shifts all frequencies by one time, a filter the high ones less, the memory of a damper each record and
  direction by another;
- the mains have a line, a clock that jitters scatters the force in proportion to its rate of change, and noise of the
  velocity makes the predicted force noisy;
- no law of the velocity has a force at rest, so that another curve with one is a constant force;
- a fault of the machine explains all that repeats from cycle to cycle: if some of it is left, it is the law. A spring
  in series is nearly a filter and a mass: the second of two such effects has to explain all that the first left.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxdamp._triangles import unit_columns
from jaxdamp.bench import clock_jitter, mains_lines, white_noise
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.noise import correlation_time
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.residual_patterns import (
    LATE,
    MEANINGS,
    OF_LAW,
    OR_MEMORY,
    Pattern,
    Record,
    column,
    filled,
    hysteresis,
    proportional,
    records_of,
)
from jaxdamp.identify.search import SearchEnd


LEAST_SHARE = 0.02  # of the squared residual, from which an effect is named that moves no number
LEAST_F = 12.0  # F statistic with independent samples only, from which an effect is named
LARGE_SHARE, LEAST_F_OF_LARGE = 0.1, 5.0  # a large share is named with less certainty
CLEAR_F = 40.0  # from which a small share is named, of the first effect
MOVED = 3.0  # standard errors by which such a small one must move the fitted numbers
AS_GOOD = 12.0  # deviance above the least, within which the first effect in the order of the list is named
PENALTY = 2.0  # deviance for each further number of an effect, in logarithms of the number of independent samples
OF_THE_LAW = 0.01  # of what repeats from cycle to cycle, above which effects of a machine do not explain it
OF_PHASE = ("delay", "lag", "mass")  # effects that shift the phase, as memory of a damper does
SURE = 5.0  # standard errors from which something repeats
SCATTER = 0.2  # share of the squared residual by a clock that jitters or a noisy velocity, from which it is named
FINE = 5  # order of the differences that show the noise of the velocity also where samples are few
STATIC = 0.5  # force at rest, relative to its RMS, from which another curve is a constant force
OF_ITS_OWN = 1e-5  # share of a pattern that no fitted number has, below which it cannot be shown
REFINED = 4  # times that the size of a delay or a lag is refined
FIRST_SIZE = 1e-6  # s, of a delay or a lag
MOST_EFFECTS = 3
MAINS_GRID = 0.05  # Hz, to which lines of the mains are rounded
MOST = 0.5  # of the squared residual
LAST_WORD = "Compare laws before anything is added to the machine."


class _Named(NamedTuple):
    """An effect that was found, and what is left without it."""

    effect: Pattern
    sizes: np.ndarray
    said: np.ndarray  # sizes as they stand in words
    share: float  # of the squared residual
    rest: np.ndarray
    span: np.ndarray  # with the effect

    @property
    def words(self) -> str:
        """Share and size."""
        return f"{_percent(self.share)} % {{}} like {self.effect.words(self.said)}"


class LeftOut(NamedTuple):
    """What a fit left out, as its residual shows.

    Attributes:
        sentences: in words.
        delay: of the force [s], that most of the squared residual is like; None if it is not.
        of_law: whether it is something of the damper, which the law misses.
    """

    sentences: Sequence[str]
    delay: float | None = None
    of_law: bool = False


def left_out(problem: Problem, best: SearchEnd) -> LeftOut:
    """A sentence on each effect that the residual shows, or one on the law where no effect of a machine explains it.

    Offset, gas spring, mass, friction, delay, low-pass filter, heat, zero that drifts, gain of a record, clearance;
    curve and memory of the damper; the mains, a clock that jitters, a noisy velocity.
    """
    used = problem.used
    if problem.is_rounding(best.squares) or np.count_nonzero(used) <= 2 * best.values.size:
        return LeftOut(())
    span = np.linalg.qr(unit_columns(best.jacobian)[0][used])[0]
    residual = span_free(span, -best.residual[used])
    records = list(records_of(problem, best))
    if not records:
        return LeftOut(())
    squares, repeated = float(residual @ residual), _repeated(residual, records)
    of_mains, residual, span = _mains(problem, records, residual, span)
    scatter, least = _scatter(problem, records, squares)
    named = _search(problem, records, residual, span, squares, least)
    asked = _to_explain(named, repeated, records)
    if named:
        residual = named[-1].rest
    left, alike = _repeated(residual, records), _alike(residual, records)
    sure = SURE * float(residual @ residual) * np.sqrt(alike / residual.size)
    static = [explained.effect.name for explained in named] == ["offset"]
    if (named and named[-1].effect.name in OF_LAW) or (
        not static and repeated > 0 and left > max(OF_THE_LAW * asked, sure)
    ):
        missed = _of_the_law(named, left / repeated if repeated > 0 else 1.0, is_memoryless(problem.law))
        return LeftOut([*scatter, missed, *of_mains], _delay(named), of_law=True)
    looks = ((one.words.format("of the squared residual look"), one.effect.remedy) for one in named)
    words = (f"{look}, which the fit leaves out: {remedy}." for look, remedy in looks)
    return LeftOut([*scatter, *words, *of_mains], _delay(named))


def _delay(named: Sequence[_Named]) -> float | None:
    """The delay [s] that most of the residual is like, unless memory of the damper explains it better."""
    if named and named[-1].effect.name == "hysteresis":
        return None
    sizes = (float(one.sizes[0]) for one in named if one.effect.name == "delay" and one.share > MOST)
    return next(sizes, None)


def _to_explain(named: Sequence[_Named], repeated: float, records: Sequence[Record]) -> float:
    """What repeats that a machine has to explain: of several effects that shift the phase, that before the last."""
    shifts = [i for i, explained in enumerate(named) if explained.effect.name in OF_PHASE]
    return _repeated(named[shifts[-1] - 1].rest, records) if len(shifts) > 1 else repeated


def _percent(share: float) -> str:
    """In whole percent; shares below one percent keep a digit."""
    return f"{100 * share:.0f}" if share >= 0.01 else f"{100 * share:.1g}"


def _of_the_law(named: Sequence[_Named], left: float, memoryless: bool) -> str:
    """A sentence on what the law misses; a law with memory is not told to take another curve without."""
    parts = [explained.words.format("is") for explained in named if explained.effect.name not in OF_LAW]
    alike = f" (of the squared residual {', '.join(parts)})" * bool(parts)
    if named and named[-1].effect.name in OF_LAW:
        effect = named[-1].effect
        misses = f"By the residual, the law misses {effect.words(named[-1].said)}{alike}"
        if memoryless:
            return f"{misses}: {effect.remedy}. {LAST_WORD}"
        of_memory = effect.remedy if effect.name == "hysteresis" else ""
        return f"{misses}: {of_memory}." if of_memory else f"{misses}. {LAST_WORD}"
    return (
        f"The residual repeats from cycle to cycle, and no effect of the test machine explains"
        f" {_percent(min(left, 1.0))} % of that{alike}: the law misses something of the damper. {LAST_WORD}"
    )


def span_free(span: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values, in one column or several, without what an orthonormal basis, in columns, has of them."""
    return values - span @ (span.T @ values)


def _alike(residual: np.ndarray, records: Sequence[Record]) -> float:
    """Samples for each independent one."""
    return correlation_time([residual[record.at] for record in records])


def _repeated(residual: np.ndarray, records: Sequence[Record]) -> float:
    """The part of the sum of squares that returns one cycle later, over records of two cycles or more."""
    parts = (
        float(residual[at[:-cycle]] @ residual[at[cycle:]]) * at.size / (at.size - cycle)
        for _, at, _, _, cycle in records
        if cycle
    )
    return sum(parts, start=0.0)


def _search(
    problem: Problem, records: Sequence[Record], residual: np.ndarray, span: np.ndarray, squares: float, least: float
) -> list[_Named]:
    """The effects that explain most, one after the other, until one is of the law."""
    effects = [*proportional(problem, records), *_late(problem, records, residual, span)]
    numbers, named = span.shape[1], list[_Named]()
    while len(named) < MOST_EFFECTS:
        late = {
            explained.effect.name: float(explained.sizes[0]) for explained in named if explained.effect.name in LATE
        }
        memory = hysteresis(problem, records, span[:, :numbers], late)
        explained = _clearest([*effects, memory], span, residual, records, squares, numbers)
        if explained is None or explained.share < least:
            break
        if not named and _is_static(explained):
            constant = (_explained(e, span, residual, squares) for e in effects if e.name == "offset")
            return [one for one in constant if one is not None]
        named.append(explained)
        effects = [effect for effect in effects if effect.name != explained.effect.name]
        residual, span = explained.rest, explained.span
        if explained.effect.name in OF_LAW:
            break
    return named


def _is_static(explained: _Named) -> bool:
    """Whether another curve is most of all a force at rest."""
    if explained.effect.at_rest is None:
        return False
    size = np.sqrt(
        np.mean((explained.effect.signals @ explained.sizes) ** 2) / np.mean(np.sum(explained.effect.signals, 1) ** 2)
    )
    return bool(abs(float(explained.effect.at_rest @ explained.sizes)) > STATIC * size)


def _late(problem: Problem, records: Sequence[Record], residual: np.ndarray, span: np.ndarray) -> list[Pattern]:
    """A delay and a low-pass filter of the force, with the size that explains most."""
    effects, otherwise = [], OR_MEMORY * is_memoryless(problem.law)
    for name, change in LATE.items():
        size, effect, (words, remedy) = FIRST_SIZE, None, MEANINGS[name]
        for _ in range(REFINED):
            signals = column(records, lambda m, size=size, change=change: change(m, size) / size)
            effect = Pattern(name, signals, name == "delay", filled(words), remedy + otherwise)
            explained = _explained(effect, span, residual, 1.0)
            if explained is None:
                break
            size = float(explained.sizes[0])
        effects += [effect] if effect else []
    return effects


def _clearest(
    effects: Sequence[Pattern],
    span: np.ndarray,
    residual: np.ndarray,
    records: Sequence[Record],
    squares: float,
    numbers: int,
) -> _Named | None:
    """The first effect in the order of the list that explains as much as any, within the noise."""
    explained = [named for effect in effects if (named := _explained(effect, span, residual, squares)) is not None]
    if not explained:
        return None
    rests = np.array([max(float(one.rest @ one.rest), 1e-300) for one in explained])
    counts = np.array([one.span.shape[1] - span.shape[1] for one in explained])
    independent = residual.size / _alike(explained[int(np.argmin(rests))].rest, records)
    deviance = independent * np.log(rests) + PENALTY * np.log(max(independent, 2.0)) * counts
    chosen = int(np.argmax(deviance <= deviance.min() + AS_GOOD))
    one, variance = explained[chosen], rests[chosen] / residual.size * _alike(explained[chosen].rest, records)
    statistic = one.share * squares / variance / counts[chosen]
    if one.share >= LEAST_SHARE:
        return one if statistic >= (LEAST_F_OF_LARGE if one.share >= LARGE_SHARE else LEAST_F) else None
    if span.shape[1] > numbers:
        return None  # beside another effect it may come from what this one is beyond first order
    moved = float(np.linalg.norm(span[:, :numbers].T @ (one.effect.signals @ one.sizes)))
    return one if statistic >= CLEAR_F and moved > MOVED * np.sqrt(variance) else None


def _explained(effect: Pattern, span: np.ndarray, residual: np.ndarray, squares: float) -> _Named | None:
    """What an effect explains of a residual; None if nothing, or if its sign is one that it cannot have."""
    scaled, scale = unit_columns(effect.signals)
    signals = span_free(span, scaled)
    values, directions = np.linalg.eigh(signals.T @ signals)
    shown = values > OF_ITS_OWN**2
    basis = signals @ directions[:, shown] / np.sqrt(values[shown])
    inside = basis.T @ residual
    sizes = directions[:, shown] @ (inside / np.sqrt(values[shown])) / scale
    if not inside.size or not (effect.signed or np.all(sizes > 0)):
        return None
    share = float(inside @ inside) / squares
    said = sizes
    if effect.of_force:  # the force that the law has after the effect is told from it, not the one fitted with it
        force, changed = effect.signals[:, 0], effect.signals @ sizes
        without = np.where(force != 0.0, force - span @ (span.T @ changed), 0.0)
        said = np.atleast_1d(float(changed @ without) / float(without @ without))
    return _Named(effect, sizes, said, share, residual - basis @ inside, np.concatenate([span, basis], axis=1))


def _mains(
    problem: Problem, records: Sequence[Record], residual: np.ndarray, span: np.ndarray
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """A sentence on lines of the mains in the residual, and residual and space without them."""
    lines: dict[float, tuple[float, float]] = {}  # size [N] and mains frequency [Hz] by line
    for number, at, weight, _, _ in records:
        force = residual[at] / np.where(weight > 0, weight, 1.0)
        rate = 1.0 / problem.sample_steps[number]
        for mains, pairs in mains_lines(force, rate, problem.runs[number].frequency).items():
            for line, size in pairs:
                nearest = MAINS_GRID * round(line / MAINS_GRID)
                lines[nearest] = max(lines.get(nearest, (0.0, mains)), (size, mains))
    if not lines:
        return [], residual, span
    columns = np.zeros((residual.size, 2 * len(records) * len(lines)))
    waves = ((line, wave) for line in lines for wave in (np.cos, np.sin))
    for k, (line, wave) in enumerate(waves):
        for j, (_, at, weight, motion, _) in enumerate(records):
            columns[at, k * len(records) + j] = weight * wave(2 * np.pi * line * motion.time)
    explained = _explained(Pattern("mains", columns, True, str, ""), span, residual, float(residual @ residual))
    if explained is None:
        return [], residual, span
    size, mains = float(np.linalg.norm([size for size, _ in lines.values()])), max(lines.values())[1]
    sentence = (
        f"{100 * explained.share:.0f} % of the squared residual are the mains, {mains:.0f} Hz and multiples, of"
        f" {size:.3g} N: Mend the earthing, or filter: `process(low_pass={mains / 2:g})` if the motion allows it."
    )
    return [sentence] * (explained.share >= LEAST_SHARE), explained.rest, explained.span


def _jitter(problem: Problem, records: Sequence[Record], squares: float) -> list[str]:
    """A sentence on a clock whose jitter explains much of the residual: late samples of a force that changes."""
    total, largest = 0.0, 0.0
    for number, _, weight, motion, _ in records:
        size = clock_jitter(problem.runs[number])
        total += float(np.sum((weight * size * np.gradient(motion.force, motion.time)) ** 2))
        largest = max(largest, size)
    share = min(total / squares, 1.0)
    return [
        f"About {100 * share:.0f} % of the squared residual come from a clock that jitters by {1e3 * largest:.2g} ms:"
        " take the clock of the hardware, not of the computer."
    ] * (share >= SCATTER)


def _scatter(problem: Problem, records: Sequence[Record], squares: float) -> tuple[list[str], float]:
    """A sentence on a jittering clock or a noisy velocity, and the share from which effects are named beside it.

    The predicted force has the noise of the velocity too, of which effects can explain a part.
    """
    if of_clock := _jitter(problem, records, squares):
        return of_clock, SCATTER
    total = sum(float(np.sum((weight * white_noise(m.force, FINE)) ** 2)) for _, _, weight, m, _ in records)
    if (share := min(total / squares, 1.0)) < SCATTER:
        return [], share
    largest = max(white_noise(problem.runs[record.number].velocity, FINE) for record in records)
    sentence = (
        f"At least {100 * share:.0f} % of the squared residual come from noise of the velocity, up to {largest:.2g}"
        " m/s, which makes the fitted damping too small: average more, such as by `samples_per_cycle=50`, or leave"
        " the channel out, so that the velocity is derived from the stroke."
    )
    return [sentence], SCATTER
