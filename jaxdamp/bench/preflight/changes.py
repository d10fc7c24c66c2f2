"""Checks for a level, a delay or a gain of the force that changes midway in a record, and stays changed."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.bench.motion import Samples
from jaxdamp.bench.preflight.finding import Examined, Finding


_FEWEST = 6  # parts of a record, from which a change in it can be told from scatter
_MOST = 40  # parts of a motion that does not repeat
_CLEAR = 8.0  # standard errors of the difference of the two levels
_BETTER = 0.4  # of the squares that a straight line leaves: a drift is no change midway
_LEVEL = 0.02  # of the range of the force
_DELAY = 0.004  # of a period
_GAIN = 0.05


class _Step(NamedTuple):
    """The two levels that a series is best described by."""

    size: float
    last: int  # of the first level


def changes(e: Examined) -> list[Finding]:
    """A level, a delay or a gain of the force with one value before and another one behind an instant.

    In each cycle, or part of a motion that does not repeat, the force is described by F = o + (1 + g) F₀(v) - τ dF₀/dt,
    with the mean curve F₀(v) of the record; each of o, τ and g is then tested for a step.
    """
    parts = _parts(e)
    if len(parts) < _FEWEST:
        return []
    offset, delay, gain = _of_parts(e, parts)
    force = e.run.force[e.moving]
    span = float(np.ptp(np.quantile(force, (0.01, 0.99))))
    cut = "Use the record on one side of it: `process(between=...)`."
    kinds = (
        ("delay", "delay changes", delay, max(_DELAY / e.run.frequency, 1.0 / e.run.sampling_rate), "s"),
        ("force level", "force level changes", offset, _LEVEL * span, "N"),
        ("gain", "gain changes", gain, _GAIN, ""),
    )
    for _, name, series, least, unit in kinds:
        step = _step(series)
        if step is not None and abs(step.size) > least:
            place = (int(parts[step.last]), int(parts[min(step.last + 2, len(parts) - 1)]) - 1)
            words = {
                "s": f"the force is {1e3 * step.size:+.3g} ms later from about {e.run.time[place[0]]:.3g} s on",
                "N": f"the force is {step.size:+.3g} N higher from about {e.run.time[place[0]]:.3g} s on",
                "": f"the force is {100 * step.size:+.3g} % larger from about {e.run.time[place[0]]:.3g} s on",
            }[unit]
            why = "A delay, a plug or a range that changed during the record. "
            return e.finding("warning", name, f"{words}, and not before", step.size, unit, place, why + cut)
    return []


def _parts(e: Examined) -> np.ndarray:
    """First samples of the cycles, or of parts of a motion that does not repeat, and the end of the last one."""
    if e.cycles is not None:
        starts = np.searchsorted(e.run.time, np.append(e.cycles.starts, e.cycles.starts[-1] + e.cycles.periods[-1]))
        return np.unique(np.clip(starts, e.moving.start, e.moving.stop))
    count = min(_MOST, e.run.cycles)
    return np.linspace(e.moving.start, e.moving.stop, max(count, 1) + 1).astype(int)


def _of_parts(e: Examined, parts: np.ndarray) -> tuple[Samples, Samples, Samples]:
    """Level [N], delay [s] and gain [-] of each part against the mean curve of the force over the velocity."""
    whole = slice(int(parts[0]) - e.moving.start, int(parts[-1]) - e.moving.start)
    above = e.above_curve[whole]
    curve = e.run.force[e.moving][whole] - above
    slope = -np.gradient(curve) * e.run.sampling_rate
    columns = np.stack([np.ones_like(curve), slope, curve - curve.mean(), above])
    first = parts[:-1] - parts[0]
    products = np.stack([np.add.reduceat(columns * row, first, axis=1) for row in columns], axis=0)
    gram, right = products[:3, :3].transpose(2, 0, 1), products[:3, 3].T
    scale = np.sqrt(np.einsum("nii->ni", gram))
    terms = np.linalg.solve(gram / (scale[:, :, None] * scale[:, None, :]), (right / scale)[..., None])[..., 0] / scale
    return terms[:, 0], terms[:, 1], terms[:, 2]


def _step(series: Float[np.ndarray, " parts"]) -> _Step | None:
    """The step of a series, if it is clear and no drift; the part in which it lies belongs to neither level."""
    n = len(series)
    x = series - series.mean()
    sums, squares = np.cumsum(x), np.cumsum(x**2)
    last = np.arange(1, n - 3)  # of the first level: two parts at least on each side of the one with the change
    before, behind = last + 1.0, n - last - 2.0
    means = sums[last] / before, (sums[-1] - sums[last + 1]) / behind
    left = squares[last] - before * means[0] ** 2 + (squares[-1] - squares[last + 1]) - behind * means[1] ** 2
    at = int(np.argmin(left))
    error = np.sqrt(max(left[at], 1e-300) / (n - 3) * (1 / before[at] + 1 / behind[at]))
    time = np.arange(n) - 0.5 * (n - 1)
    drift = float(np.sum((x - np.dot(time, x) / np.dot(time, time) * time) ** 2))
    size = float(means[1][at] - means[0][at])
    if abs(size) < _CLEAR * error or left[at] > _BETTER * drift:
        return None
    return _Step(size, int(last[at]))
