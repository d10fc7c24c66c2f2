"""Checks of each channel: values that repeat, spikes, jumps, clipping, rounding, mains ripple."""

import numpy as np

from jaxdamp.bench.motion import Samples
from jaxdamp.bench.preflight.finding import SHARE, Examined, Finding, runs_of, step
from jaxdamp.bench.spectrum import MAINS


UNITS = {"stroke": "m", "force": "N"}
STUCK = 0.75  # of a period; a clipped half wave is shorter
_LONG = 0.1  # of a period, from which a gap is an error
_FEW = 4  # samples: so short a gap is none, in however short a period
_EDGE = 9.0  # times the median of the third differences: six of their standard deviations
_WIDEST = 5  # samples of a spike
_RETURNS = 0.4  # of its height, within which a spike comes back
_ABOVE_OTHERS = 2.5  # times the edges that the damper makes in every cycle
_LEAST_JUMP = 0.02  # of the range of a channel
_STAYS = 0.5  # of a jump
_TURNING = 0.05  # of the peak velocity, below which friction turns
WHITE = 1.2  # ratio of the scatter of a channel to that of neighbours, up to which it is white noise
LEAST_VARIATION = 0.01  # of its level, up to which a command is held
_SQUARES = 0.05  # of the sum of squares of a channel, from which its spikes decide a fit


def repeated(e: Examined) -> list[Finding]:
    """A channel that repeats one value where it should move: stuck, held or dropped to zero."""
    findings = []
    for name in UNITS:
        stretches = _stuck(e, name)
        if stretches:
            first, last = max(stretches, key=lambda pair: pair[1] - pair[0])
            findings += _stuck_finding(e, name, first, last)
            continue
        values = getattr(e.run, name)
        gaps = e.gaps[name]
        zero = values[gaps[:, 0]] == 0.0
        for kind, part in (("dropout", gaps[zero]), ("held", gaps[~zero])):
            if len(part):
                findings += _gap_finding(e, name, kind, part)
    return findings


def held_command(e: Examined) -> list[Finding]:
    """A channel of the command that shows no more than noise about one value."""
    values = e.run.command_channel
    if values is None:
        return []
    level, scatter = float(values.mean()), float(values.std())
    noise = float(np.std(np.diff(values))) / np.sqrt(2.0)
    if scatter > max(WHITE * noise, LEAST_VARIATION * abs(level)):
        return []
    message = f"the command varies by no more than noise, {level:.3g} ± {scatter:.1g} {e.run.command_unit}"
    remedy = f"State it as held, `run.held_at({level:.3g})`, so that the record is fitted at one setting."
    return e.finding("warning", "command held", message, scatter, e.run.command_unit, None, remedy)


def _stuck(e: Examined, name: str) -> list[tuple[int, int]]:
    values, moves = getattr(e.run, name), getattr(e.run, "force" if name == "stroke" else "stroke")
    still = [(a, b + 1) for a, b in runs_of(np.diff(values) == 0.0) if b + 1 - a > STUCK * e.samples_per_cycle]
    return [(a, b) for a, b in still if np.ptp(moves[a : b + 1]) > 0.3 * np.ptp(moves)]


def _stuck_finding(e: Examined, name: str, first: int, last: int) -> list[Finding]:
    value, other = getattr(e.run, name)[first], "force" if name == "stroke" else "stroke"
    seconds = e.run.time[last] - e.run.time[first]
    message = f"the {name} stays at {value:.4g} {UNITS[name]} for {seconds:.3g} s while the {other} moves"
    remedy = f"Cut the record there (`process(between=...)`), or measure again: is the {name} channel connected?"
    return e.finding("error", f"{name} stuck", message, e.run.time[first], "s", (first, last), remedy)


def _gap_finding(e: Examined, name: str, kind: str, gaps: np.ndarray) -> list[Finding]:
    counts = gaps[:, 1] - gaps[:, 0] + 1
    longest = int(counts.max())
    severity = "error" if longest > max(_LONG * e.samples_per_cycle, _FEW) else "warning"
    times = f"{len(counts)} times, at most " if len(counts) > 1 else ""
    verb = "drops to zero" if kind == "dropout" else "repeats its value"
    seconds = longest / e.run.sampling_rate
    message = f"the {name} {verb} {times}for {longest} samples ({seconds:.3g} s) and then goes on elsewhere"
    remedy = "Samples were lost: cut the record there (`process(between=...)`), or look for a loose plug and repeat it."
    place = (int(gaps[0, 0]), int(gaps[-1, 1]))
    return e.finding(severity, f"{name} {kind}", message, seconds, "s", place, remedy)


def edges(e: Examined) -> list[Finding]:
    """Sudden changes: spikes of up to five samples, and jumps of the level that stay.

    What changes suddenly in every cycle, as friction does where the motion turns, is the damper's.
    """
    findings = []
    for name, values in e.channels.items():
        third = _third_differences(values)
        size = np.abs(third)
        if not np.any(size > 0.0):
            continue
        least = max(_EDGE * float(np.median(size[size > 0.0])), 1e-6 * float(np.ptp(np.quantile(values, (0.01, 0.99)))))
        slope = float(np.quantile(np.abs(np.diff(values)), 0.95)) * e.run.sampling_rate
        least = max(least, 2.0 * _EDGE * e.jitter * slope)
        at = np.flatnonzero(size > least)
        if not len(at):
            continue
        step = np.diff(values)
        first, last, height = _spikes(values, step, at, least, min(_WIDEST, e.samples_per_cycle / 6))
        if len(first):
            findings += _spike_finding(e, name, values, first, last, height)
        taken = np.zeros(len(values), bool)
        for a, b in [*zip(first, last, strict=True), *(e.gaps[name] - e.moving.start)]:
            taken[max(a - 3, 0) : b + 4] = True
        findings += _jump_finding(e, name, at[~taken[at]], third, least)
    return findings


def _third_differences(values: Samples) -> Samples:
    """The change from each sample to the next, less the mean of the changes before and behind it."""
    step = np.diff(values)
    third = np.zeros_like(step)
    third[1:-1] = step[1:-1] - 0.5 * (step[:-2] + step[2:])
    return third


def _spikes(
    values: Samples, step: Samples, at: np.ndarray, least: float, widest: float
) -> tuple[np.ndarray, np.ndarray, Samples]:
    """First and last sample of each spike, and its height above what is before and behind it."""
    spikes: list[tuple[int, int, float]] = []
    free = 0
    for i in at.tolist():
        a = i + 1  # the first sample of the spike
        if a < max(free, 2) or abs(step[i]) < 0.5 * least:
            continue
        for width in range(1, int(widest) + 1):
            b = a + width  # the first sample behind it
            if b + 1 >= len(values):
                break
            inside = values[a:b] - np.linspace(values[a - 1], values[b], width + 2)[1:-1]
            height = float(np.median(inside))
            alike = np.all(inside * np.sign(height) > 0.3 * abs(height)) and abs(step[b - 1]) > 0.5 * abs(height)
            if alike and abs(height) > 0.5 * least and abs(values[b] - values[a - 1]) < _RETURNS * abs(height):
                spikes.append((a, b - 1, height))
                free = b + 1
                break
    if not spikes:
        return np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    first, last, height = zip(*spikes, strict=True)
    return np.array(first), np.array(last), np.array(height)


def _spike_finding(
    e: Examined, name: str, values: Samples, first: np.ndarray, last: np.ndarray, height: Samples
) -> list[Finding]:
    size, noise = float(np.median(np.abs(height))), max(e.noise[name], 1e-9 * float(np.ptp(values)))
    counts = last - first + 1
    number = f"{len(first)} spike{'s' * (len(first) > 1)}"
    width = f" of up to {counts.max()} samples" if counts.max() > 1 else ""
    message = f"{number}{width} in the {name}, about {size:.3g} {UNITS[name]}, {size / noise:.2g} times its noise"
    squares = float(np.sum(counts * height**2))
    deviation = float(np.median(np.abs(values - np.median(values)))) / 0.6745
    decides = squares > _SQUARES * len(values) * deviation**2
    remedy = "Look for a loose plug or a dropped sample; fits weigh spikes by their square" + (
        ", and these outweigh the record: cut it there, or measure again." if decides else "."
    )
    place = (e.moving.start + int(first[0]), e.moving.start + int(last[-1]))
    return e.finding("error" if decides else "warning", f"{name} spikes", message, size, UNITS[name], place, remedy)


def _jump_finding(e: Examined, name: str, at: np.ndarray, third: Samples, least: float) -> list[Finding]:
    """Edges that stand out from those that the damper makes in every cycle."""
    cycles, velocity = e.run.cycles, np.abs(e.run.velocity[e.moving])
    turning = np.minimum(velocity[at], velocity[at + 1]) < _TURNING * float(np.quantile(velocity, 0.99))
    turning |= np.diff(np.sign(e.run.velocity[e.moving]), prepend=0.0)[
        np.minimum(at[:, None] + np.arange(-2, 4), len(velocity) - 1)
    ].any(axis=1)
    at = at[~turning]
    if cycles < 3 or not len(at):
        return []
    least = max(least, _LEAST_JUMP * float(np.ptp(np.quantile(e.channels[name], (0.01, 0.99)))))
    size = np.abs(third[at])
    top = size[
        (size >= np.abs(third[np.maximum(at - 1, 0)])) & (size >= np.abs(third[np.minimum(at + 1, len(third) - 1)]))
    ]
    most = max(2, int(SHARE * cycles))  # so many jumps at most are none of the damper's
    if len(top) > most:
        least = max(least, _ABOVE_OTHERS * float(np.sort(top)[-most - 1]))
    at = at[size > least]
    i = int(at[np.argmax(np.abs(third[at]))]) if len(at) else 0
    jump = float(third[i])
    if not len(at) or (name == "force" and not _stays(e, i, jump)):
        return []
    message = f"the {name} jumps by {jump:+.3g} {UNITS[name]} from one sample to the next"
    remedy = "Was a plug touched, a range switched or an offset set? Use one side of it: `process(between=...)`."
    place = (e.moving.start + i, e.moving.start + i + 1)
    return e.finding("warning", f"{name} jump", message, jump, UNITS[name], place, remedy)


def _stays(e: Examined, i: int, jump: float) -> bool:
    """Whether the force above its mean curve has another level over the period behind a sample than before it."""
    period = int(e.samples_per_cycle)
    before, behind = e.above_curve[max(i + 1 - period, 0) : i + 1], e.above_curve[i + 1 : i + 1 + period]
    return bool((np.mean(behind) - np.mean(before)) / jump > _STAYS)


LEAST_LOST = 5e-3  # of the range: less is a machine that turns slowly, or rounding
COARSE = 1000  # levels over the range, below which rounding is seen in loops


def clipping(e: Examined) -> list[Finding]:
    """Flat tops: the largest or smallest value again and again, reached with a slope that would have gone on."""
    findings = []
    for name, values in e.channels.items():
        for side, extreme in (("largest", values.max()), ("smallest", values.min())):
            flat = [(a, b) for a, b in runs_of(values == extreme) if 1 < b - a <= STUCK * e.samples_per_cycle]
            flat = [pair for pair in flat if _goes_on(values, *pair, e.noise[name])]
            count = sum(b - a + 1 for a, b in flat)
            if count >= 4:
                share = 100 * count / len(values)
                message = f"the {name} is clipped at {extreme:.4g} {UNITS[name]} ({share:.2g} % of the samples)"
                place = (e.moving.start + flat[0][0], e.moving.start + flat[-1][1])
                remedy = f"Its {side} values are lost: take a larger range of the channel and measure again."
                findings += e.finding("error", f"{name} clipped", message, extreme, UNITS[name], place, remedy)
    return findings


def _goes_on(values: Samples, first: int, last: int, noise: float) -> bool:
    """Whether the slope into a flat stretch would have led well beyond it, unlike at a rounded peak."""
    length = last - first + 1
    before = values[max(first - max(length // 2, 2), 0) : first]
    if len(before) < 2:
        return False
    slope = abs(values[first] - before[0]) / len(before)
    if abs(values[first] - values[max(first - 3, 0)]) / 3.0 < 0.05 * slope:
        return False  # it bends into the flat stretch smoothly, as a friction without noise does
    return bool(slope * length / 2 > max(6.0 * step(values), 3.0 * noise, LEAST_LOST * np.ptp(values)))


def quantisation(e: Examined) -> list[Finding]:
    """A channel with so few levels that its steps are seen."""
    findings = []
    for name, values in e.channels.items():
        size = step(values)
        levels = np.ptp(values) / size if size > 0 else np.inf
        if levels < COARSE:
            message = f"the {name} comes in steps of {size:.3g} {UNITS[name]}, {levels:.0f} of them over its range"
            remedy = "Take a smaller range or more bits, and write more digits."
            findings += e.finding("note", f"{name} quantised", message, size, UNITS[name], None, remedy)
    return findings


def ripple(e: Examined) -> list[Finding]:
    """Lines at the mains frequency and its harmonics that stand out from the motion beside them, and from the noise."""
    findings = []
    for name in e.channels:
        for mains in MAINS:
            lines = e.mains[name].get(mains, [])
            if lines:
                size = float(np.linalg.norm([size for _, size in lines]))
                where = ", ".join(f"{at:.4g} Hz" for at, _ in lines)
                said = f"line{'s' * (len(lines) > 1)} at {where}"
                message = f"{mains:.0f} Hz ripple of {size:.3g} {UNITS[name]} in the {name} ({said})"
                remedy = f"Mend the earthing, or filter: `process(low_pass={mains / 2:g})` if the motion allows it."
                findings += e.finding("warning", f"{name} ripple", message, size, UNITS[name], None, remedy)
    return findings
