"""What a record says of its damper without a law: steady cycles, peak-velocity points, the loop over velocity."""

import itertools
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp import _checks
from jaxdamp.bench.motion import at_peak, mean_where, moving_span
from jaxdamp.bench.runs import BenchRun
from jaxdamp.bench.sets import as_runs


STEADY = 0.1  # by which the stroke range of a steady cycle may differ from the median one


class PeakVelocityPoints(NamedTuple):
    """Points of the force-velocity curve, of shape (records, 2): compression in column 0, rebound in column 1.

    A row for each record, in their order. `np.ravel` of both gives the points of a curve.

    Attributes:
        velocity: peak velocities [m/s], positive in rebound.
        force: forces there [N], positive when they resist extension.
    """

    velocity: Float[np.ndarray, "records 2"]  # m/s, positive in rebound
    force: Float[np.ndarray, "records 2"]  # N, positive when it resists extension


class VelocityLoops(NamedTuple):
    """Mean cycles of records, of shape (records, points), at equal steps of time over the period.

    A row for each record, in their order. A loop is closed: its first point follows its last one.

    Attributes:
        time: from the first point of the cycle [s].
        stroke: [m], positive in rebound.
        velocity: [m/s], positive in rebound.
        force: [N], positive when it resists extension.
        cycles: number of cycles in the mean of each record.
    """

    time: Float[np.ndarray, "records points"]  # s, from the first point of the cycle
    stroke: Float[np.ndarray, "records points"]  # m, positive in rebound
    velocity: Float[np.ndarray, "records points"]  # m/s, positive in rebound
    force: Float[np.ndarray, "records points"]  # N, positive when it resists extension
    cycles: tuple[int, ...]  # over so many the mean of each record is taken


class FoldedCycles(NamedTuple):
    """The steady cycles of one record at equal fractions of their periods.

    Attributes:
        starts: beginning of each cycle [s], shape (cycles,).
        periods: duration of each cycle [s], shape (cycles,).
        stroke: [m], positive in rebound, shape (cycles, points).
        velocity: [m/s], positive in rebound, shape (cycles, points).
        force: [N], positive when it resists extension, shape (cycles, points).
    """

    starts: Float[np.ndarray, " cycles"]  # s
    periods: Float[np.ndarray, " cycles"]  # s
    stroke: Float[np.ndarray, "cycles points"]  # m, positive in rebound
    velocity: Float[np.ndarray, "cycles points"]  # m/s, positive in rebound
    force: Float[np.ndarray, "cycles points"]  # N, positive when it resists extension


def steady_cycles(run: BenchRun) -> list[slice]:
    """The samples of each full cycle whose stroke range is within 10 % of the median one.

    So the cycles in which a machine runs up or down are left out. Empty for a record without a full cycle.

    Arguments:
        run: the record.
    """
    return [_samples(run, *ends) for ends in _steady_instants(run)]


def last_steady_cycle(run: BenchRun) -> slice:
    """The samples of the last steady cycle (`steady_cycles`), or all of them in a record without a full cycle.

    Arguments:
        run: the record.
    """
    return next(reversed(steady_cycles(run)), slice(None))


def moving_part(run: BenchRun) -> slice:
    """The samples of the motion, without the rest before and after it, which `process(moving=True)` cuts off.

    Arguments:
        run: a record.
    """
    first, last = moving_span(run.time, run.stroke, run.frequency)
    return slice(first, last + 1)


def peak_velocity_points(runs: BenchRun | Iterable[BenchRun]) -> PeakVelocityPoints:
    """Force at the compression and the rebound peak of the velocity, in the last steady cycle of each record.

    The points of a peak-velocity-pick-off (PVP) test. Each is the mean over the samples within 2 % of the peak, so that
    one noisy sample decides nothing, or over the central half of strokes at constant velocity; a record without a full
    cycle is searched as a whole, and where it moves in one direction only, the other point is NaN.

    Arguments:
        runs: one record or several.

    Returns:
        Velocity [m/s] and force [N], each of shape (records, 2).

    Raises:
        ValueError: no record.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Bilinear
    >>> runs = bench.VirtualDyno(Bilinear(2600.0, 1200.0)).run([bench.SineTest(0.01, f) for f in (1.0, 2.0)])
    >>> points = bench.peak_velocity_points(runs)
    >>> np.round(points.force / points.velocity)
    array([[1200., 2600.],
           [1200., 2600.]])
    """
    rows = []
    for run in as_records(runs, "peak_velocity_points(runs)"):
        part = last_steady_cycle(run)
        stroke, velocity, force = (values[None, part] for values in (run.stroke, run.velocity, run.force))
        at_peaks = [at_peak(stroke, sign * velocity) for sign in (-1.0, 1.0)]
        rows.append([(mean_where(velocity, at)[0], mean_where(force, at)[0]) for at in at_peaks])
    points = np.array(rows, dtype=float)
    return PeakVelocityPoints(points[..., 0], points[..., 1])


def continuous_velocity_loop(runs: BenchRun | Iterable[BenchRun], points: int = 200) -> VelocityLoops:
    """The loop of force over velocity of each record: the mean of its steady cycles, at equal steps of time.

    What a continuous-velocity-pick-off (CVP) test shows: compression and rebound, opening and closing. Cycles are cut
    where the stroke passes its middle, read at equal fractions of their own period by straight lines between the
    samples, and averaged, so that white noise falls with the root of their number. The first point is the first one
    with the stroke above its middle on the way into rebound.

    Arguments:
        runs: one record or several; their frequencies may differ.
        points: of a loop.

    Returns:
        Time, stroke, velocity and force, each of shape (records, points), and the number of cycles averaged.

    Raises:
        ValueError: no record, one without a full cycle, fewer than 4 points.

    >>> from jaxdamp import bench
    >>> from jaxdamp.dampers import Linear
    >>> run = bench.VirtualDyno(Linear(2000.0), force_noise=20.0).run(bench.SineTest(0.01, 2.0, cycles=50))[0]
    >>> loops = bench.continuous_velocity_loop(run)
    >>> error = loops.force - 2000.0 * loops.velocity
    >>> loops.force.shape, loops.cycles, bool(np.std(error) < 4.0)  # N
    ((1, 200), (50,), True)
    """
    if points < 4:
        _checks.refuse("points", "be 4 or more", points)
    folded = [fold_cycles(run, points) for run in as_records(runs, "continuous_velocity_loop(runs)")]
    means = [np.stack([part.mean(axis=0) for part in (f.stroke, f.velocity, f.force)]) for f in folded]
    stroke, velocity, force = np.stack(means, axis=1)
    time = np.stack([f.periods.mean() * (np.arange(points) / points) for f in folded])
    return VelocityLoops(time, stroke, velocity, force, tuple(len(f.periods) for f in folded))


def as_records(runs: BenchRun | Iterable[BenchRun], call: str) -> tuple[BenchRun, ...]:
    """One record or several, but not none."""
    chosen = as_runs(runs, call=call)
    if not chosen:
        _checks.refuse("runs", "hold at least one record", "empty")
    return chosen


def _samples(run: BenchRun, start: float, stop: float) -> slice:
    first, last = np.searchsorted(run.time, (start, stop))
    return slice(int(first), int(last) + 1)


def _steady_instants(run: BenchRun) -> list[tuple[float, float]]:
    cycles = list(itertools.pairwise(run.cycle_instants.tolist()))
    if not cycles:
        return []
    ranges = np.array([np.ptp(run.stroke[_samples(run, *ends)]) for ends in cycles])
    steady = np.abs(ranges / np.median(ranges) - 1.0) < STEADY
    return [ends for ends, yes in zip(cycles, steady, strict=True) if yes] or cycles[-1:]


def fold_cycles(run: BenchRun, points: int | None = None) -> FoldedCycles:
    """The steady cycles of a record (`steady_cycles`), each read at equal fractions of its own period.

    They begin with the first point whose stroke lies above its middle on the way into rebound.

    Arguments:
        run: the record.
        points: of a cycle; as many as it has samples, at least 64, if left out.

    Raises:
        ValueError: a record without a full cycle.
    """
    instants = _steady_instants(run)
    if not instants:
        remedy = "Take `run.velocity` and `run.force` of a record without one as they are."
        _checks.refuse("runs", "be records with a full cycle", f"{run.name!r}, without one", remedy)
    ends = np.array(instants)
    periods = ends[:, 1] - ends[:, 0]
    points = max(64, round(float(np.mean(periods)) * run.sampling_rate)) if points is None else points
    times = ends[:, :1] + periods[:, None] * (np.arange(points) / points)
    channels = [np.interp(times, run.time, channel) for channel in (run.stroke, run.velocity, run.force)]
    path = channels[0].mean(axis=0)
    above = path > 0.5 * (path.max() + path.min())
    first = int(np.argmax(above & ~np.roll(above, 1)))
    return FoldedCycles(ends[:, 0], periods, *(np.roll(channel, -first, axis=1) for channel in channels))
