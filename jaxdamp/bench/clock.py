"""The instants of a record: a clock that jitters is resampled, one with gaps is cut into parts."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from jaxdamp.bench import sampling
from jaxdamp.bench.motion import Samples


_EPOCH = 1e8  # seconds: a larger time counts from 1970, not from the start of the record
_MOST_PARTS = 20


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of a record without gap.

    Arguments:
        samples: which samples of the file it holds.
        stored: their instants in the file [s].
        time: uniform instants [s].
        resample: whether the channels have to be interpolated at these instants.
        notes: what was done to the time.
    """

    samples: slice
    stored: Samples
    time: Samples
    resample: bool
    notes: tuple[str, ...]

    def of(self, values: Float[np.ndarray, " file_time"]) -> Samples:
        """A channel of the file at the instants of this part."""
        return np.interp(self.time, self.stored, values[self.samples]) if self.resample else values[self.samples]


def regular_parts(time: Samples, where: str, lines: Sequence[int] | None = None) -> list[Part]:
    """The stretches of a record between gaps in time, each on uniform instants.

    Arguments:
        time: instants as the file states them [s].
        where: the file, for messages.
        lines: number of the line of each sample.

    Raises:
        ValueError: time goes back or stands still, or there are more than 20 gaps.
    """
    notes: tuple[str, ...] = ()
    if abs(time[0]) > _EPOCH:
        notes = (f"time counts from the first sample, which the file puts at {time[0]:.3f} s",)
        time = time - time[0]
    sampling.check_order(time, where, lines)
    gaps = sampling.gaps(time)
    if len(gaps) >= _MOST_PARTS:
        sampling.refuse_gaps(time, gaps, where, lines)
    edges = [0, *(int(gap) + 1 for gap in gaps), len(time)]
    parts = []
    for number, (start, stop) in enumerate(pairwise(edges), 1):
        cut = f"part {number} of {len(gaps) + 1} between gaps in time, {time[start]:.6g} to {time[stop - 1]:.6g} s"
        parts.append(_part(time, slice(start, stop), (*notes, cut) if len(gaps) else notes))
    return parts


def _part(time: Samples, samples: slice, notes: tuple[str, ...]) -> Part:
    stored = time[samples]
    if len(stored) < sampling.FEWEST or sampling.is_uniform(stored):
        return Part(samples, stored, stored, False, notes)
    rounded = sampling.without_rounding(stored)
    if rounded is not None:
        grid, note = rounded
        return Part(samples, stored, grid, False, (*notes, note))
    grid = np.linspace(stored[0], stored[-1], len(stored))
    off = float(np.max(np.abs(stored - grid))) / (grid[1] - grid[0])
    note = (
        f"the clock jitters by up to {off:.2g} of a step: all channels resampled by linear interpolation at "
        f"{1 / (grid[1] - grid[0]):.6g} Hz"
    )
    return Part(samples, stored, grid, True, (*notes, note))
