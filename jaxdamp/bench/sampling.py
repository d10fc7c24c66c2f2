"""Checks of a record's samples before anything is computed from them."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jaxdamp._checks import ArgumentError, Setting
from jaxdamp.bench.motion import Samples


FEWEST = 20  # samples of a record
_GAP = 1.5  # sampling steps that are taken for a gap
_JITTER = 0.02  # sampling steps by which an instant may be off


def uniform_time(rate: float | int, count: int) -> Samples:
    """Instants [s] of samples taken at a rate [Hz], from zero."""
    return np.arange(count) / rate


def check_time(time: Samples, where: str, lines: Sequence[int] | None = None) -> tuple[Samples, str]:
    """The instants of a uniformly sampled record, and a sentence if they had to be made uniform.

    Instants that were only rounded when they were written (three decimals at 300 Hz) are put back on the uniform grid.

    Raises:
        ValueError: time goes back or stands still, samples are missing, or the steps are not uniform.
    """
    what, lines = ("line", lines) if lines else ("sample", range(len(time)))
    steps = np.diff(time)
    without, rate = Setting("columns", {"time": None}), Setting("sampling_rate")
    again = f"leave its column out and give the rate: {without}, {rate}"
    back = np.flatnonzero(steps <= 0)
    if back.size:
        i = int(back[0]) + 1
        raise ArgumentError(
            f"{where}, {what} {lines[i]}: time goes from {time[i - 1]:.9g} s to {time[i]:.9g} s, but must increase. "
            f"Cut the record there; or, if its clock is too coarse, {again}.",
            without,
            rate,
        )
    number = np.arange(len(time)) - (len(time) - 1) / 2
    step = float(np.dot(number, time) / np.dot(number, number))
    off = float(np.max(np.abs(time - time.mean() - step * number)))
    if off <= _JITTER * step:
        return time, ""
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP * usual)
    if gaps.size:
        i = int(gaps[0]) + 1
        raise ArgumentError(
            f"{where}, {what} {lines[i]}: {steps[i - 1] / usual - 1:.0f} samples are missing between {time[i - 1]:.6g} "
            f"and {time[i]:.6g} s ({gaps.size} such gaps in all; the usual step is {usual:.4g} s). Cut the record "
            f"into the parts before and after the gap; or, if its clock is too coarse, {again}.",
            without,
            rate,
        )
    quantum = 10.0 ** -_decimals(time)
    if off <= 0.6 * quantum:
        note = f"time was rounded to {quantum:g} s in the file; it is put back on a grid of {1 / step:.6g} Hz"
        return time[0] + step * np.arange(len(time)), note
    raise ArgumentError(
        f"{where}: the samples are not uniform in time, the steps go from {steps.min():.4g} to {steps.max():.4g} s. "
        f"Resample all channels with numpy.interp to one rate; or, if only the clock jitters, {again}.",
        without,
        rate,
    )


def _decimals(time: Samples) -> int:
    """The number of decimals that writes all instants, at most 9."""
    for digits in range(9):
        if np.all(np.abs(np.round(time, digits) - time) < 1e-10):
            return digits
    return 9


def check_numbers(
    values: Float[np.ndarray, " time"], role: str, where: str, lines: Sequence[int] | None = None
) -> None:
    """Refuse NaN and infinity, naming the first."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        at = f", line {lines[bad[0]]}" if lines else f", sample {bad[0]}"
        raise ValueError(
            f"{where}{at}: the {role} is {values[bad[0]]} ({bad.size} such values in all). Cut the record there or "
            "mend it."
        )


def check_stroke(stroke: Samples, where: str) -> None:
    """Refuse a stroke that stands still."""
    if np.ptp(stroke) <= 1e-9:
        name = Setting("columns", {"stroke": ...})
        raise ArgumentError(
            f"{where}: the stroke is constant ({stroke[0]:.6g} m), so there is no motion to learn from. Is it the "
            f"right column? Name it with {name}.",
            name,
        )


def check_count(count: int, where: str) -> None:
    """Refuse a record that is too short."""
    if count < FEWEST:
        raise ValueError(
            f"{where} has only {count} samples, too few: a record needs at least {FEWEST}, better 30 per cycle."
        )
