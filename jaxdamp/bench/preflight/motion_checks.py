"""Checks of the motion: rest, run-up and run-down, cycles, samples, clock, magnitudes."""

import numpy as np
from jaxtyping import Float

from jaxdamp.bench.analysis import steady_cycles
from jaxdamp.bench.preflight.consistency import exchanged
from jaxdamp.bench.preflight.finding import FEWEST_CYCLES, Examined, Finding


FEWEST_SAMPLES = 30  # a cycle, as the reader recommends
_ALIVE = 0.3  # share of the force's deviation in motion by which it moves when it is not at rest
# What machines and dampers do: beyond it, a unit, the clock or a column is wrong more often than right.
_USUAL = (
    ("sampling rate", "Hz", 5.0, 2e5, "Is time in ms or in minutes?"),
    ("peak velocity", "m/s", 1e-4, 6.0, "Are stroke and force exchanged, is time in ms, or the stroke in m or mm?"),
    ("amplitude", "m", 1e-4, 0.5, "Are stroke and force exchanged, or is the stroke in m or mm?"),
    ("frequency", "Hz", 1e-3, 200.0, "Is time in ms or in minutes?"),
    ("largest force", "N", 1.0, 2e5, "Is the force in kN, or stroke and force exchanged?"),
    ("ratio of force and velocity", "N s/m", 20.0, 1e6, "Is one of the units of time, stroke and force another one?"),
    ("acceleration", "m/s²", 1e-6, 1500.0, "Is time in minutes or in ms, or the stroke in m or mm?"),
)
_POWERS = {  # by which each of them grows with the numbers of a channel
    "time": (-1, -1, 0, -1, 0, 1, -2),
    "stroke": (0, 1, 1, 0, 0, -1, 1),
    "velocity": (0, 1, 1, 0, 0, -1, 1),  # from which the stroke is integrated
    "force": (0, 0, 0, 0, 1, 1, 0),
}
_MISTAKEN = (  # the unit of the numbers, the one they were taken for, and how many times too large they are then
    ("time", "ms", "s", 1e3),
    ("time", "s", "ms", 1e-3),
    ("time", "us", "s", 1e6),
    ("stroke", "mm", "m", 1e3),
    ("stroke", "m", "mm", 1e-3),
    ("stroke", "um", "m", 1e6),
    ("force", "N", "kN", 1e3),
    ("force", "kN", "N", 1e-3),
    ("time", "us", "ms", 1e3),
    ("time", "min", "s", 1 / 60),
    ("time", "s", "min", 60.0),
    ("time", "ms", "min", 6e4),
    ("stroke", "um", "mm", 1e3),
    ("velocity", "mm/s", "m/s", 1e3),
    ("velocity", "m/s", "mm/s", 1e-3),
)
_SECONDS = {"s": 1.0, "min": 60.0}  # units in which no bench counts by one
_SAMPLED = 50.0  # Hz, at which a record in minutes is sampled at the least
_CLEARLY = 2.0  # times beyond what is usual, the factors of all multiplied, from which one unit is said to be wrong
_IMPOSSIBLE = 10.0  # times the usual upper end of these two, from which a unit is wrong
_BOUNDED = ("peak velocity", "amplitude")
_NOTHING = 1e-30  # taken for a magnitude of zero, such as the deviation of a constant force: no quotient overflows


def rest(e: Examined) -> list[Finding]:
    """Rest before and after the motion, during which the force rests too."""
    findings = []
    ends = (("rest before", 0, e.moving.start), ("rest after", e.moving.stop - 1, len(e.run) - 1))
    for name, first, last in ends:
        if last > first and np.std(e.run.force[first : last + 1]) < _ALIVE * np.std(e.run.force[e.moving]):
            seconds = e.run.time[last] - e.run.time[first]
            share = 100 * (last - first) / len(e.run)
            message = f"{seconds:.3g} s of rest {name.split()[1]} the motion, {share:.2g} % of the record"
            remedy = "Laws with memory and means suffer: `process(moving=True)` cuts it off."
            findings += e.finding("warning", name, message, seconds, "s", (first, last), remedy)
    return findings


def run_up(e: Examined) -> list[Finding]:
    """Run-up and run-down of the machine: motion before the first and behind the last steady cycle."""
    steady, count = steady_cycles(e.run), e.run.cycles
    if not steady or len(steady) < 0.5 * count or not e.repeats:
        return []
    findings, period, end = [], 1 / e.run.frequency, len(e.run) - 1
    first, last = e.moving.start, min(e.moving.stop - 1, end)
    ends = (
        ("run-up", first, steady[0].start, first > 0),
        ("run-down", min(steady[-1].stop - 1, end), last, last < end),
    )
    for name, start, stop, beside_rest in ends:
        seconds = e.run.time[stop] - e.run.time[start]
        # A record that begins within the motion has up to a period before its first full cycle.
        if seconds > (0.4 if beside_rest else 1.05) * period:
            message = f"{seconds:.3g} s of {name}, in which the amplitude is not steady"
            remedy = "Means over cycles leave it out; for fits choose cycles: `process(skip_cycles=...)`."
            findings += e.finding("note", name, message, seconds, "s", (start, stop), remedy)
    return findings


def integrated(e: Examined) -> list[Finding]:
    """A stroke that no channel measured."""
    if not e.run.stroke_is_integrated:
        return []
    message = "the stroke was integrated from the velocity: its place in the damper is not known"
    return e.finding("note", "stroke integrated", message, remedy="Laws that depend on the stroke need its channel.")


def few_cycles(e: Examined) -> list[Finding]:
    """Too few full cycles to know the scatter, of a motion that repeats."""
    count = e.run.cycles
    if count >= FEWEST_CYCLES or not e.repeats:
        return []
    message = f"{count} full cycle{'s' * (count != 1)}, so the scatter from cycle to cycle is not known"
    return e.finding("warning", "few cycles", message, count, "", None, f"Record {FEWEST_CYCLES} or more.")


def few_samples(e: Examined) -> list[Finding]:
    """Too few samples in a cycle for velocity and loops."""
    samples = e.samples_per_cycle
    if samples >= FEWEST_SAMPLES:
        return []
    message = f"{samples:.3g} samples a cycle: velocity, loops and peaks are coarse"
    remedy = f"Sample at {FEWEST_SAMPLES * e.run.frequency:.3g} Hz or more."
    return e.finding("warning", "few samples", message, samples, "", None, remedy)


def magnitudes(e: Examined) -> list[Finding]:
    """Numbers that no damper test has; an error where another unit of one channel makes all of them usual."""
    values = _magnitudes(e)
    beyond = _times_beyond(values)
    if np.all(beyond == 1.0):
        return []
    if np.prod(beyond) >= _CLEARLY and not exchanged(e) and (mistake := _mistaken_unit(e, values, beyond)):
        return mistake
    findings = []
    for value, (what, unit, low, high, question) in zip(values, _USUAL, strict=True):
        if not low <= value <= high:
            message = f"unusual: the {what} is {value:.3g} {unit}"
            severity = "error" if what in _BOUNDED and value > _IMPOSSIBLE * high else "warning"
            findings += e.finding(severity, f"unusual {what}", message, value, unit, None, question)
    return findings


def _magnitudes(e: Examined) -> Float[np.ndarray, " magnitudes"]:
    """The numbers of a record in the order of `_USUAL`; a hundredth of the forces at each end may be spikes."""
    run = e.run
    force = np.clip(run.force, *np.quantile(run.force, (0.01, 0.99)))
    speed, largest = float(np.std(run.velocity)), float(np.max(np.abs(force)))
    acceleration = np.sqrt(2.0) * speed**2 / float(np.std(run.stroke))  # exact for a sine
    motion = run.sampling_rate, run.peak_velocity, run.amplitude, run.frequency
    return np.array([*motion, largest, float(np.std(force)) / speed, acceleration])


def _times_beyond(values: Float[np.ndarray, " magnitudes"]) -> Float[np.ndarray, " magnitudes"]:
    """How many times each number is below or above what is usual; 1 within."""
    low, high = (np.array([row[i] for row in _USUAL]) for i in (2, 3))
    return np.maximum(np.maximum(low / np.maximum(values, _NOTHING), values / high), 1.0)


def _mistaken_unit(
    e: Examined, values: Float[np.ndarray, " magnitudes"], beyond: Float[np.ndarray, " magnitudes"]
) -> list[Finding]:
    """The channel whose numbers in another unit make all magnitudes usual, if there is one."""
    for channel, true, taken, factor in _MISTAKEN:
        stated = e.run.units.get(channel, "" if e.run.units else taken)
        of_rate = channel == "time" and not stated
        if stated != taken and not of_rate:
            continue
        corrected = values / factor ** np.array(_POWERS[channel], float)
        if true == "min" and corrected[0] < _SAMPLED:
            continue  # a stroke ten times too large looks alike
        if np.all(_times_beyond(corrected) == 1.0):
            odd = [
                f"{what} {value:.3g} {unit}"
                for value, times, (what, unit, *_) in zip(values, beyond, _USUAL, strict=True)
                if times > 1.0
            ]
            worst = int(np.argmax(beyond))
            size = f"{factor:.0f} times too large" if factor > 1.0 else f"{1 / factor:.0f} times too small"
            message = f"the {channel} looks {size}{'' if of_rate else f', {true} taken for {taken}'}: {', '.join(odd)}"
            unit, remedy = _USUAL[worst][1], _unit_remedy(e, channel, true, of_rate)
            return e.finding("error", f"unit of {channel}", message, values[worst], unit, None, remedy)
    return []


def _unit_remedy(e: Examined, channel: str, true: str, of_rate: bool) -> str:
    """How to read the file again; a time that goes on by one may count the samples instead."""
    if of_rate:
        return "State the rate of the file in Hz, `sampling_rate=...`."
    remedy = f'If it is {true}, read the file with `units={{"{channel}": "{true}"}}`'
    per_unit = e.run.sampling_rate * _SECONDS.get(e.run.units.get("time", ""), 0.0)
    if channel == "time" and abs(per_unit - 1.0) < 1e-9:
        remedy += '; if it counts samples, with `columns={"time": None}` and `sampling_rate=...`'
    return f"{remedy}."


def jitter(e: Examined) -> list[Finding]:
    """A clock whose instants are not those written: the noise of the stroke grows with its velocity."""
    size = e.jitter
    if not size:
        return []
    share = 100 * size * e.run.sampling_rate
    message = f"the clock jitters by {1e6 * size:.3g} µs, {share:.2g} % of a step: the faster the stroke, the noisier"
    remedy = "Take the clock of the hardware, not of the computer."
    return e.finding("warning", "clock jitter", message, size, "s", None, remedy)
