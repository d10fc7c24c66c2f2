"""Checks for a level, a delay or a gain of the force that changes midway in a record, and stays changed."""

import numpy as np
from jaxtyping import Float, Int

from jaxdamp.bench.analysis import FoldedCycles
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.preflight.finding import Examined, Finding


_FEWEST = 6  # parts of a record, from which a change in it can be told from scatter
_FEW = 3  # cycles, of which two are on one side of a change, so that they show how well the force repeats
_PLACES = 32  # in a cycle, where a change is looked for
_ABOVE = 2.0  # times the noise: the force does not repeat
_REPEATS = 0.15  # of the squares about the mean cycle, left on both sides of a change; a uniform drift leaves 0.2
_MOST = 40  # parts of a motion that does not repeat
_CLEAR = 8.0  # standard errors of the difference of the two levels
_BETTER = 0.4  # of the squares that a straight line leaves: a drift is no change midway
_LEVEL = 0.02  # of the range of the force
_DELAY = 0.004  # of a period
_GAIN = 0.05


def changes(e: Examined) -> list[Finding]:
    """A level, a delay or a gain of the force with one value before and another one behind an instant.

    In each cycle, or part of a motion that does not repeat, the force is described by F = o + (1 + g) F₀(v) - τ dF₀/dt,
    with the mean curve F₀(v) of the record; each of o, τ and g is then tested for a step. Where the command varies they
    change with it. In three to five cycles only a delay is looked for, by the force at equal parts of the cycles.
    """
    parts = _parts(e)
    if e.run.command_channel is not None:
        return []
    if e.cycles is not None and _FEW <= len(e.cycles.starts) < _FEWEST:
        return _late_in_few_cycles(e, e.cycles)
    if len(parts) < _FEWEST:
        return []
    offset, delay, gain = _of_parts(e, parts)
    force = e.run.force[e.moving]
    span = float(np.ptp(np.quantile(force, (0.01, 0.99))))
    kinds = (
        ("delay changes", delay, _least_delay(e), "s"),
        ("force level changes", offset, _LEVEL * span, "N"),
        ("gain changes", gain, _GAIN, ""),
    )
    for name, series, least, unit in kinds:
        step = _step(series)
        if step is not None and abs(step[0]) > least:
            size, last = step
            place = (int(parts[last]), int(parts[min(last + 2, len(parts) - 1)]) - 1)
            return _said(e, name, size, unit, place)
    return []


def _said(e: Examined, name: str, size: float, unit: str, place: tuple[int, int]) -> list[Finding]:
    number = {"s": f"{1e3 * size:+.3g} ms later", "N": f"{size:+.3g} N higher", "": f"{100 * size:+.3g} % larger"}[unit]
    words = f"the force is {number} from about {e.run.time[place[0]]:.3g} s on, and not before"
    why = "A delay, a plug or a range that changed during the record. Use the record on one side of it:"
    return e.finding("warning", name, words, size, unit, place, f"{why} `process(between=...)`.")


def _late_in_few_cycles(e: Examined, cycles: FoldedCycles) -> list[Finding]:
    """A delay that begins midway in three to five cycles.

    Cycles repeat on both sides of it, and the mean one of one side, shifted in time, is that of the other side.
    """
    force = cycles.force
    (count, points), noise = force.shape, e.noise["force"] ** 2
    places = np.arange(points // 2, force.size - points // 2 + 1, max(points // _PLACES, 1))
    squares = _squares(force, places)
    left, at = float(squares.min()), int(places[squares.argmin()])
    (full, other, there, full_first), about_mean = _sides(force, at), float(np.sum((force - force.mean(axis=0)) ** 2))
    degrees = (count - 1) * points
    above = about_mean - noise * degrees
    inside = left - noise * (degrees - np.count_nonzero(there))
    if about_mean < _ABOVE * noise * degrees or inside > _REPEATS * above:
        return []
    shifts = np.arange(-(points // 4), points // 4 + 1)
    squares = [np.sum((other - np.roll(full, shift))[there] ** 2) for shift in shifts]
    best = int(np.argmin(squares))
    delay = float((shifts[best] if full_first else -shifts[best]) * np.mean(cycles.periods) / points)
    if squares[best] > _BETTER * squares[len(shifts) // 2] or abs(delay) <= _least_delay(e):
        return []
    begin = cycles.starts[at // points] + cycles.periods[at // points] * (at % points) / points
    sample = int(np.searchsorted(e.run.time, begin))
    return _said(e, "delay changes", delay, "s", (sample, min(sample + points // _PLACES, len(e.run) - 1)))


def _squares(force: Float[np.ndarray, "cycles points"], places: Int[np.ndarray, " places"]) -> np.ndarray:
    """Squares about the mean cycles before and behind each of several places."""
    (count, points), centred = force.shape, force - force.mean()
    sums, squares = (np.pad(np.cumsum(part, axis=0), ((1, 0), (0, 0))) for part in (centred, centred**2))
    point = np.arange(points)
    before = np.clip((places[:, None] - point + points - 1) // points, 0, count)
    means = (sums[before, point] ** 2 / np.maximum(before, 1), (sums[-1] - sums[before, point]) ** 2)
    return np.sum(squares[-1] - means[0] - means[1] / np.maximum(count - before, 1), axis=1)


def _sides(force: Float[np.ndarray, "cycles points"], at: int) -> tuple[Samples, Samples, np.ndarray, bool]:
    """Mean cycles before and behind an instant: the one known as a whole, the other, where that is; which is first."""
    before = (np.arange(force.size) < at).reshape(force.shape)
    counts = [part.sum(axis=0) for part in (before, ~before)]
    means = [np.sum(force * part, axis=0) / np.maximum(n, 1) for part, n in zip((before, ~before), counts, strict=True)]
    first = bool(counts[0].min() > 0)
    return means[1 - first], means[first], counts[first] > 0, first


def _least_delay(e: Examined) -> float:
    return max(_DELAY / e.run.frequency, 1.0 / e.run.sampling_rate)


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


def _step(series: Float[np.ndarray, " parts"]) -> tuple[float, int] | None:
    """The step of a series and the last part before it, if it is clear and no drift.

    The part in which it lies belongs to neither level.
    """
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
    return size, int(last[at])
