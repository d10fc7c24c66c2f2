"""What kind of motion a stroke is: its frequency, its cycles, its amplitude, where its velocity is largest."""

import math

import numpy as np
from jaxtyping import Bool, Float


Samples = Float[np.ndarray, " time"]
_FEWEST_SAMPLES = 16  # of a record of one cycle


def crossings(time: Samples, stroke: Samples) -> tuple[Float[np.ndarray, " rising"], Float[np.ndarray, " falling"]]:
    """Instants [s] at which the stroke passes the middle of its range upwards, and downwards.

    Hysteresis of 15 % of the range to both sides keeps noise and rest from being counted. The instant is where the
    straight line through the samples of the passage is zero.
    """
    low, high = float(np.min(stroke)), float(np.max(stroke))
    x, band = stroke - (low + high) / 2, 0.15 * (high - low)
    side = np.where(x > band, 1, np.where(x < -band, -1, 0))
    outside = np.flatnonzero(side)
    before, after = outside[:-1], outside[1:]
    turns = [np.flatnonzero((side[after] == way) & (side[before] == -way)) for way in (1, -1)]
    rising, falling = (_instants(time, x, before[turn], after[turn]) for turn in turns)
    return rising, falling


def _instants(time: Samples, x: Samples, starts: np.ndarray, stops: np.ndarray) -> Float[np.ndarray, " passages"]:
    """Where x passes zero in each of several passages, between two samples of different sign."""
    if not starts.size:
        return np.zeros(0)
    sizes = stops - starts + 1
    first = np.cumsum(sizes) - sizes
    inside = np.arange(sizes.sum()) + np.repeat(starts - first, sizes)
    begun = time[starts]
    t, y = time[inside] - np.repeat(begun, sizes), x[inside]
    mean_t, mean_y = (np.add.reduceat(values, first) / sizes for values in (t, y))
    centred = t - np.repeat(mean_t, sizes)
    slope = np.add.reduceat(centred * y, first) / np.add.reduceat(centred**2, first)
    onwards = slope * x[stops] > 0
    back = np.divide(mean_y, slope, out=np.zeros_like(slope), where=onwards)
    return np.clip(begun + (mean_t - back), begun, time[stops])


def dominant_frequency(time: Samples, stroke: Samples) -> float:
    """Frequency of the stroke [Hz]: one over the median time between passages of its middle in the same direction.

    Rest before and after the motion does not count. Where no direction is passed twice, it is that of one cycle if the
    record ends where it began, as a mean cycle does, or else the highest line of the spectrum.
    """
    return _frequency(time, stroke, crossings(time, stroke))


def _frequency(time: Samples, stroke: Samples, passages: tuple[np.ndarray, np.ndarray]) -> float:
    periods = np.concatenate([np.diff(instants) for instants in passages])
    if len(periods):
        return float(1 / np.median(periods))
    if (period := single_cycle(time, stroke)) is not None:
        return 1 / period
    x, step = stroke - np.mean(stroke), (time[-1] - time[0]) / (len(time) - 1)
    size = 8 * len(x)
    return float((1 + np.argmax(np.abs(np.fft.rfft(x, size))[1:])) / (size * step))


def single_cycle(time: Samples, stroke: Samples) -> float | None:
    """The period [s] of a record that is one cycle, whose last sample is its first or the one before; else None.

    A transient that begins and ends at rest is no cycle.
    """
    if len(stroke) < _FEWEST_SAMPLES:
        return None
    size, step = float(np.ptp(stroke)), (time[-1] - time[0]) / (len(time) - 1)
    near = np.abs(stroke - stroke[0]) < 0.01 * size
    still = max(int(np.argmin(near)), int(np.argmin(near[::-1])))
    noise = 4.0 * white_noise(stroke)
    rise = 0.5 * (stroke[1] - stroke[0] + stroke[-1] - stroke[-2])
    meets, follows = abs(stroke[-1] - stroke[0]), abs(stroke[-1] + rise - stroke[0])
    alike = abs(stroke[1] - stroke[0] - (stroke[-1] - stroke[-2])) < 0.2 * np.max(np.abs(np.diff(stroke))) + 2 * noise
    if still > 0.1 * len(stroke) or not alike or min(meets, follows) > 0.5 * np.max(np.abs(np.diff(stroke))) + noise:
        return None
    return float((len(stroke) - (meets < follows)) * step)


def cycle_instants(time: Samples, stroke: Samples) -> Float[np.ndarray, " instants"]:
    """Instants [s] at which full cycles begin and, last, at which the last one ends.

    Cycles begin where the stroke passes its middle upwards, or downwards if that gives more of them. A record that
    begins or ends in the middle of the stroke has a full cycle before the first or behind the last passage too.
    """
    passages = crossings(time, stroke)
    period = 1 / _frequency(time, stroke, passages)
    if max(map(len, passages)) < 2 and single_cycle(time, stroke) is not None:
        return np.array([time[0], time[0] + period])
    return max((extended(time, stroke, instants, period) for instants in passages), key=len)


def extended(
    time: Samples, stroke: Samples, instants: Float[np.ndarray, " instants"], period: float
) -> Float[np.ndarray, " more"]:
    """The passages with one more at either end if the record holds another cycle of motion there."""
    if not len(instants):
        return instants
    step, reach = (time[-1] - time[0]) / (len(time) - 1), 0.6 * float(np.ptp(stroke))
    first, last = float(instants[0]), float(instants[-1])
    head, tail = stroke[(time >= first - period) & (time < first)], stroke[(time > last) & (time <= last + period)]
    before = [first - period] if first - period > time[0] - step and len(head) and np.ptp(head) > reach else []
    behind = [last + period] if last + period < time[-1] + 2 * step and len(tail) and np.ptp(tail) > reach else []
    return np.concatenate([before, instants, behind])


def motion_amplitude(time: Samples, stroke: Samples, frequency: float) -> float:
    """Half the range of the stroke [m], zero to peak; noise faster than a twentieth of a period is smoothed."""
    window = round((len(time) - 1) / (time[-1] - time[0]) / frequency / 20)
    window = min(window, len(stroke) - 1) // 2 * 2 + 1
    if window > 5:
        stroke = savitzky_golay(stroke, window, 4)
    return float(np.max(stroke) - np.min(stroke)) / 2


def cycle_works(
    time: Samples, power: Samples, instants: Float[np.ndarray, " instants"]
) -> Float[np.ndarray, " cycles"]:
    """Work [J] of every full cycle, from the power F v [W] and the `cycle_instants`."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2) * step])
    work = np.concatenate([work, [work[-1] + 2 * step * power[-1]]])  # the last cycle may end behind the last sample
    return np.diff(np.interp(instants, np.append(time, time[-1] + 2 * step), work))


def moving_span(time: Samples, stroke: Samples, frequency: float) -> tuple[int, int]:
    """First and last sample of the motion, without the rest before and after it.

    A record rests where, from its first sample on, the stroke stays for a quarter of a period or longer within 1 % of
    the amplitude, or within the noise if that is more, of where it is then; and likewise at its end. A fiftieth of a
    period beyond the motion is left, so that its first and last cycle are whole.
    """
    quarter = max(round(0.25 / frequency * (len(time) - 1) / (time[-1] - time[0])), 2)
    tolerance = max(0.005 * float(np.ptp(stroke)), 5.0 * white_noise(stroke))

    def rest(x: Samples) -> int:
        away = np.flatnonzero(np.abs(x - np.median(x[:quarter])) > tolerance)
        first = int(away[0]) if len(away) else 0
        return max(first - max(quarter // 12, 2), 0) if first >= quarter else 0

    return rest(stroke), len(stroke) - 1 - rest(stroke[::-1])


def white_noise(values: Samples, order: int = 3) -> float:
    """Standard deviation of the white noise in a channel, from its differences; the median leaves out jumps.

    Arguments:
        values: samples of the channel, in its unit.
        order: of the differences; higher ones see less of a motion with few samples in a cycle.
    """
    differences = np.diff(values, order)
    return float(np.median(np.abs(differences)) / (0.6745 * np.sqrt(math.comb(2 * order, order))))


def savitzky_golay_factors(
    half: int, order: int, derivative: int
) -> tuple[Float[np.ndarray, "places coefficients"], Float[np.ndarray, "coefficients samples"]]:
    """Of 2 half + 1 neighbouring samples the least-squares polynomial, in two factors.

    The second one gives its coefficients from the samples, the first one the value at each place in the window from
    the coefficients, or with `derivative` 1 the slope by sample. Their product is not formed: of a window of ten
    thousand samples it would take 800 MB.
    """
    places = np.arange(-half, half + 1) / max(half, 1)
    powers = np.vander(places, order + 1, increasing=True)
    at = powers if derivative == 0 else np.arange(order + 1) * np.pad(powers, ((0, 0), (1, 0)))[:, :-1] / max(half, 1)
    return at, np.linalg.pinv(powers)


def savitzky_golay(values: Samples, window: int, order: int, derivative: int = 0) -> Samples:
    """Value or slope by sample of the least-squares polynomial around each sample, at the ends that of the last window.

    `scipy.signal.savgol_filter` gives the same, and takes half a second to import.
    """
    half = window // 2
    at, fitted = savitzky_golay_factors(half, order, derivative)
    inner = np.correlate(values, at[half] @ fitted, "valid")
    ends = at[:half] @ (fitted @ values[:window]), at[half + 1 :] @ (fitted @ values[-window:])
    return np.concatenate([ends[0], inner, ends[1]])


NEAR_PEAK = 0.98  # of the peak velocity, beyond which samples count as taken at the peak
CENTRAL = 0.1  # share of the stroke range that counts as mid-stroke
STEADY = 0.5  # the same, of strokes at constant velocity, clear of their turns
CONSTANT, MOST = 0.1, 0.7  # of the velocity at mid-stroke, within which most of the samples of such a stroke are

Cycles = Float[np.ndarray, "cycles points"]
Figures = Float[np.ndarray, " cycles"]


def at_peak(stroke: Cycles, directed: Cycles) -> Bool[np.ndarray, "cycles points"]:
    """The samples near the largest velocity of a direction, in which `directed` is positive.

    In strokes at constant velocity those of their central half: what is largest there is noise, and what a velocity
    estimated from the stroke makes of the turns.
    """
    highest = directed.max(axis=1, keepdims=True)
    near = (directed >= NEAR_PEAK * highest) & (highest > 0)
    constant = speed_is_constant(stroke, directed)[:, None]
    return np.where(constant, around_middle(stroke, STEADY) & (directed > 0), near)


def speed_is_constant(stroke: Cycles, directed: Cycles) -> Bool[np.ndarray, " cycles"]:
    """Whether the strokes in a direction have one velocity; a sine has nearly its largest in 0.3 of its time."""
    moving = directed > 0
    level = mean_where(directed, moving & around_middle(stroke, CENTRAL))[:, None]
    near = moving & (np.abs(directed - level) <= CONSTANT * level)
    return near.sum(axis=1) > MOST * moving.sum(axis=1)


def around_middle(stroke: Cycles, share: float) -> Bool[np.ndarray, "cycles points"]:
    """The samples within a share of the stroke range around its middle."""
    highest, lowest = stroke.max(axis=1, keepdims=True), stroke.min(axis=1, keepdims=True)
    return np.abs(stroke - 0.5 * (highest + lowest)) <= 0.5 * share * (highest - lowest)


def mean_where(values: Cycles, where: Bool[np.ndarray, "cycles points"]) -> Figures:
    """Mean of each cycle over some of its samples; NaN where there is none."""
    count = where.sum(axis=1)
    sums = np.where(where, values, 0.0).sum(axis=1)
    return np.divide(sums, count, out=np.full(len(values), np.nan), where=count > 0)


def mean_in_bins(bins: np.ndarray, values: np.ndarray, number: int) -> Float[np.ndarray, " bins"]:
    """Mean of the values in each of so many bins, given the bin of each value; NaN in an empty one."""
    count, sums = np.bincount(bins, minlength=number), np.bincount(bins, values, minlength=number)
    return np.divide(sums, count, out=np.full(number, np.nan), where=count > 0)


def mean_curve(
    x: np.ndarray, values: np.ndarray, low: float, high: float, number: int
) -> tuple[Float[np.ndarray, " bins"], Float[np.ndarray, " bins"]]:
    """Middles of equal bins of a range, and the mean of the values whose x is there; NaN in empty bins."""
    bins = np.minimum(((x - low) / (high - low) * number).astype(int), number - 1)
    return low + (np.arange(number) + 0.5) / number * (high - low), mean_in_bins(bins, values, number)
