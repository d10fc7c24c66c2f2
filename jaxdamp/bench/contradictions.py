"""Records that contradict each other: the same motion, another force."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.bench.motion import crossings, extended, mean_in_bins, mean_where
from jaxdamp.bench.runs import BenchRun


ALIKE = 0.05  # relative difference of amplitudes, of frequencies, and of periods, of the same motion
SAME_SHAPE = 0.1  # RMS difference of two strokes over a cycle, relative to their amplitude, of the same motion
OTHER_FORCE = 0.1  # RMS difference of two forces, relative to their RMS, from which they contradict
BEYOND_SCATTER = 5.0  # and relative to what the cycles of one record differ by
_BINS = 24  # of a cycle
_NAMED = 3  # pairs in a sentence


class Contradiction(NamedTuple):
    """Two records of the same motion whose forces differ by more than one of them scatters.

    Attributes:
        first: name of one record.
        second: name of the other.
        difference: RMS over a cycle of the difference of their forces [N].
        share: the difference over the RMS of their forces [-].
        scatter: RMS by which the mean cycle of one of them is uncertain [N]; 0 for a single cycle.
    """

    first: str
    second: str
    difference: float  # RMS over a cycle [N]
    share: float  # of the RMS of their forces
    scatter: float  # RMS by which the mean cycle of one of them is uncertain [N]; 0 for a single cycle


class _Cycle(NamedTuple):
    """The mean cycle of a record, from one upward passage of mid-stroke to the next."""

    stroke: Float[np.ndarray, " bins"]  # m, from its mean; NaN where no sample is
    force: Float[np.ndarray, " bins"]  # N
    scatter: float  # standard error of the mean force, RMS over the bins [N]


def contradictions(runs: Sequence[BenchRun], *, same_command: bool = False) -> list[Contradiction]:
    """Pairs of records with the same motion and forces that no one law can both give, the worst first.

    The same motion: amplitude and frequency within 5 %, and strokes over a cycle that agree within 10 % of the
    amplitude. Another force: mean cycles that differ by more than 10 % of their RMS and by five times what the cycles
    of one record scatter. So a repetition does not contradict, nor does a little warmth; another coil current, click
    or gas pressure does. Records that state different commands contradict all the same: whether a law follows the
    command is for the law to say. Motions that do not repeat from cycle to cycle are not compared.

    Arguments:
        runs: the records.
        same_command: whether only records that state the same command, or none, are compared.

    >>> from jaxdamp.bench import SineTest, VirtualDyno
    >>> from jaxdamp.dampers import Linear
    >>> test = SineTest(0.01, 2.0)
    >>> soft, hard = (VirtualDyno(Linear(c)).run([test])[0] for c in (1000.0, 1500.0))
    >>> [round(found.share, 2) for found in contradictions([soft, hard])]
    [0.39]
    """
    pairs = itertools.combinations(runs, 2)
    pairs = [(a, b) for a, b in pairs if not (same_command and _differ(a, b)) and same_motion(a, b)]
    cycles = {id(run): _mean_cycle(run) for run in {id(run): run for pair in pairs for run in pair}.values()}
    pairs_apart = []
    for a, b in pairs:
        one, other = cycles[id(a)], cycles[id(b)]
        if one is None or other is None or _rms(one.stroke - other.stroke) > SAME_SHAPE * a.amplitude:
            continue
        difference, level = _rms(one.force - other.force), np.hypot(_rms(one.force), _rms(other.force)) / np.sqrt(2.0)
        scatter = max(one.scatter, other.scatter)
        if difference > OTHER_FORCE * level and difference > BEYOND_SCATTER * scatter:
            pairs_apart.append(Contradiction(a.name, b.name, difference, float(difference / level), scatter))
    return sorted(pairs_apart, key=lambda pair: -pair.share)


def _differ(a: BenchRun, b: BenchRun) -> bool:
    """Whether the commands of two records differ; one that varies differs from cycle to cycle."""
    return a.command != b.command or a.command_channel is not None or b.command_channel is not None


def contradictions_in_words(contradictions: Sequence[Contradiction]) -> list[str]:
    """A sentence on records that contradict each other, none if there are none.

    Arguments:
        contradictions: of `contradictions`.
    """
    if not contradictions:
        return []
    pairs = pairs_in_words(contradictions)
    return [
        f"Records of the same motion differ in force, so no law of the motion follows them all: {pairs}. Fit them"
        " apart, or state what was set on the damper (`command`) and fit a law that takes it."
    ]


def pairs_in_words(contradictions: Sequence[Contradiction]) -> str:
    """The worst pairs of records that contradict each other, with their differences.

    Arguments:
        contradictions: of `contradictions`, at least one.
    """
    pairs = "; ".join(
        (f"two records {pair.first}" if pair.first == pair.second else f"{pair.first} and {pair.second}")
        + f" by {pair.difference:.0f} N ({100 * pair.share:.0f} % of their RMS force"
        + (f", where the mean cycle of one is known to {pair.scatter:.2g} N)" if pair.scatter else ")")
        for pair in contradictions[:_NAMED]
    )
    return pairs + (f"; and {len(contradictions) - _NAMED} pairs more" if len(contradictions) > _NAMED else "")


def same_motion(a: BenchRun, b: BenchRun) -> bool:
    """Whether the amplitudes of two records, and their frequencies, agree within 5 %."""
    pairs = ((a.frequency, b.frequency), (a.amplitude, b.amplitude))
    return all(abs(p - q) <= ALIKE * max(p, q) for p, q in pairs)


def _rms(values: Float[np.ndarray, " bins"]) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _mean_cycle(run: BenchRun) -> _Cycle | None:
    """The mean cycle; `None` if the record has no full one, or none that is like the others."""
    rising, _ = crossings(run.time, run.stroke)
    instants = extended(run.time, run.stroke, rising, 1 / run.frequency)
    count = len(instants) - 1
    periods = np.diff(instants)
    if count < 1 or np.median(np.abs(periods / np.median(periods) - 1.0)) > ALIKE:
        return None
    within = (run.time >= instants[0]) & (run.time < instants[-1])
    phase = np.interp(run.time[within], instants, np.arange(count + 1.0))
    bins = np.minimum((phase * _BINS).astype(int), count * _BINS - 1)
    channels = (mean_in_bins(bins, values[within], count * _BINS) for values in (run.stroke, run.force))
    stroke, force = (folded.reshape(count, _BINS) for folded in channels)
    path, mean = (mean_where(folded.T, np.isfinite(folded.T)) for folded in (stroke, force))
    if np.nanmedian(np.abs(stroke - path)) > SAME_SHAPE * run.amplitude:
        return None
    scatter = float(np.sqrt(np.nanmean((force - mean) ** 2) / (count - 1))) if count > 1 else 0.0
    return _Cycle(path - np.nanmean(path), mean, scatter)


def repeats(runs: Sequence[BenchRun]) -> list[list[BenchRun]]:
    """Records of the same motion side by side."""
    groups: list[list[BenchRun]] = []
    for run in runs:
        group = next((group for group in groups if same_motion(group[0], run)), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return groups
