"""Processing of records: steps with names, in one fixed order, always from the raw record.

A processed record knows its raw one and its steps. Every further step is added to these, and all are done anew from the
raw record in the order of the fields of `Steps`: so it does not matter in which order they were asked for.
"""

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp.bench.motion import moving_span


if TYPE_CHECKING:
    from jaxdamp.bench.evaluation.separation import GasAndFriction
    from jaxdamp.bench.runs import BenchRun


ORDER = 4  # of the Butterworth filter, which is run forwards and backwards
CHANNELS = ("stroke", "velocity", "force")
BESIDE = ("temperature", "command_channel")  # channels that a record may have beside these


@final
@dataclass(frozen=True)
class Steps:
    """What is done to a raw record, in this order.

    Arguments:
        delay: by which the force channel lags behind the stroke channel [s]; the force is read so much later.
        low_pass: cut-off frequency [Hz] of a zero-phase filter on stroke, velocity, force and a command that varies
            alike; half is left there.
        between: start and end of the part that is kept [s].
        moving: cut off the rest before and after the motion.
        skip_cycles: number of full cycles left out at the beginning.
        last_cycles: number of full cycles kept, the last ones.
        without: gas force and friction to be subtracted from the force.
        mean_cycle: the mean over the full cycles in place of all.
    """

    delay: float | int | None = None
    low_pass: float | int | None = None
    between: tuple[float | int, float | int] | None = None
    moving: bool = False
    skip_cycles: int | None = None
    last_cycles: int | None = None
    without: "GasAndFriction | None" = None
    mean_cycle: bool = False

    def __post_init__(self) -> None:
        if self.delay is not None:
            _checks.finite("delay", self.delay)
        if self.low_pass is not None:
            _checks.positive("low_pass", self.low_pass)
        for argument, least in (("skip_cycles", 0), ("last_cycles", 1)):
            if getattr(self, argument) is not None and getattr(self, argument) < least:
                _checks.refuse(argument, f"be {least} or more", getattr(self, argument))

    def and_then(self, more: "Steps") -> "Steps":
        """Both, where they agree: windows are intersected, of two numbers of last cycles the smaller one is taken.

        Raises:
            ValueError: a window is asked for when cycles are chosen already, or cycles to be left out after the last
                ones were chosen, because then it would be another choice; or one step with two values.
        """
        if more.between is not None and (self.skip_cycles, self.last_cycles) != (None, None):
            remedy = "Cut in time first, or begin with `run.raw`: cycles are counted in the part that is kept."
            _checks.refuse("between", "be given before cycles are chosen", more.between, remedy)
        if more.skip_cycles and self.last_cycles is not None:
            both = f"`process(skip_cycles={more.skip_cycles}, last_cycles={self.last_cycles})`"
            remedy = f"Begin with `run.raw` and give both in one call, {both}; or choose fewer last cycles."
            _checks.refuse("skip_cycles", "be given before or with `last_cycles`", more.skip_cycles, remedy)
        merged: dict[str, object] = {}
        for field in fields(self):
            old, new = getattr(self, field.name), getattr(more, field.name)
            if old in (None, False) or new in (None, False):
                merged[field.name] = old if new in (None, False) else new
            elif field.name == "between":
                merged["between"] = (max(old[0], new[0]), min(old[1], new[1]))
            elif field.name == "last_cycles":
                merged["last_cycles"] = min(old, new)
            elif field.name == "skip_cycles":
                merged["skip_cycles"] = old + new
            elif old is new or (field.name != "without" and old == new):
                merged[field.name] = old
            else:
                remedy = "Begin with `run.raw`."
                _checks.refuse(field.name, "be given once", f"{new} after {old}", remedy)
        return replace(self, **merged)


class Origin(NamedTuple):
    """Where a processed record comes from: the raw record, the part of it that the steps begin with, the steps."""

    raw: "BenchRun"
    base: "BenchRun"
    steps: Steps


def processed(raw: "BenchRun", steps: Steps) -> "BenchRun":
    """A record of the raw one, with all steps done and named in its notes."""
    for name in ("delay", "low_pass", "between"):
        if raw.of_points and (given := getattr(steps, name)) is not None:
            remedy = "The points of a force-velocity table have no time: leave it out."
            _checks.refuse(name, "be asked for of records over time", f"{given} for {raw.name!r}", remedy)
    run = replace(raw)
    if steps.delay is not None:
        run = _align(run, float(steps.delay))
    if steps.low_pass is not None:
        run = _low_pass(run, float(steps.low_pass))
    if steps.between is not None:
        run = cut_between(run, *steps.between)
    if steps.moving:
        run = _cut_rest(run)
    if steps.skip_cycles is not None or steps.last_cycles is not None:
        run = choose_cycles(run, steps.skip_cycles or 0, steps.last_cycles)
    if steps.without is not None:
        run = _subtract(run, steps.without)
    return _mean_cycle(run) if steps.mean_cycle else run


@of_known_numbers
def low_pass_gain(frequency: float, cutoff: float, sampling_rate: float) -> float:
    """What the zero-phase filter leaves of a sine: 1 / (1 + (tan(π f / f_s) / tan(π f_c / f_s))^8), all in Hz.

    Arguments:
        frequency: of the sine [Hz].
        cutoff: of the filter [Hz].
        sampling_rate: of the record [Hz].

    >>> [round(low_pass_gain(f, 50.0, 2000.0), 4) for f in (15.0, 50.0, 60.0)]
    [0.9999, 0.5, 0.1876]
    """
    warped = np.tan(np.pi * frequency / sampling_rate) / np.tan(np.pi * cutoff / sampling_rate)
    return float(1.0 / (1.0 + warped ** (2 * ORDER)))


def _noted(run: "BenchRun", note: str, **changes: object) -> "BenchRun":
    return replace(run, **changes, notes=(*run.notes, note))


def _cut(run: "BenchRun", part: np.ndarray | slice, note: str) -> "BenchRun":
    """The samples of a part, in which a command that varies besides may be held."""
    names = [name for name in ("time", *CHANNELS, *BESIDE) if getattr(run, name) is not None]
    cut = _noted(run, note, **{name: getattr(run, name)[part] for name in names})
    command = cut.command_channel
    return cut if command is None or np.ptp(command) > 0.0 else cut.held_at(command[0])


def _align(run: "BenchRun", delay: float) -> "BenchRun":
    """The force of a time later by the delay, by cubics; the end of the record for which there is none is cut off."""
    from scipy.interpolate import CubicSpline

    there = (run.time + delay >= run.time[0]) & (run.time + delay <= run.time[-1])
    if there.sum() < 0.5 * len(run):
        _checks.refuse("delay", f"be shorter than half the record, {run.duration:.4g} s", delay)
    force = CubicSpline(run.time, run.force)(run.time + delay)
    note = f"force channel read {1e3 * delay:.4g} ms later, to make up for its delay"
    return _cut(replace(run, force=force), there, note)


def _low_pass(run: "BenchRun", cutoff: float) -> "BenchRun":
    """Stroke, velocity, force and a command through a Butterworth filter, forwards and backwards."""
    from scipy.signal import butter, sosfiltfilt

    if not cutoff < 0.45 * run.sampling_rate:
        must = f"be less than 0.45 times the sampling rate of {run.name!r}, {0.45 * run.sampling_rate:.4g} Hz"
        _checks.refuse("low_pass", must, cutoff)
    # Each pass leaves the root of a half at its own cut-off, so that both leave a half there.
    sections = butter(ORDER, cutoff, fs=run.sampling_rate, output="sos")
    pad = min(len(run) - 1, 3 * int(np.ceil(run.sampling_rate / cutoff)))
    names = [*CHANNELS, *["command_channel"] * (run.command_channel is not None)]
    filtered = {name: sosfiltfilt(sections, getattr(run, name), padlen=pad) for name in names}
    tones = [k * run.frequency for k in (1, 3) if 2 * k * run.frequency < run.sampling_rate]
    gains = [100 * low_pass_gain(tone, cutoff, run.sampling_rate) for tone in tones]
    left = ", ".join(f"{gain:.3g} % at {tone:.3g} Hz" for gain, tone in zip(gains, tones, strict=True))
    peak = 100 * (1 - np.ptp(filtered["force"]) / np.ptp(run.force))
    note = f"stroke, velocity and force filtered at {cutoff:g} Hz with zero phase: it leaves {left}, and takes "
    return _noted(run, f"{note}{peak:.2g} % off the range of the force", **filtered)


def cut_between(run: "BenchRun", start: float | int, stop: float | int) -> "BenchRun":
    """The part with start ≤ time < stop [s]."""
    part = (run.time >= start) & (run.time < stop)
    if not np.any(part):
        remedy = f"It runs from {run.time[0]:.6g} to {run.time[-1]:.6g} s."
        _checks.refuse("start", "leave some of the record", f"{start} with stop {stop}", remedy)
    return _cut(run, part, f"cut to {run.time[part][0]:g} … {run.time[part][-1]:g} s")


def _cut_rest(run: "BenchRun") -> "BenchRun":
    first, last = moving_span(run.time, run.stroke, run.frequency)
    before, after = run.time[first] - run.time[0], run.time[-1] - run.time[last]
    if not before and not after:
        return run
    note = f"rest cut off: {before:.3g} s before and {after:.3g} s after the motion"
    return _cut(run, slice(first, last + 1), note)


def choose_cycles(run: "BenchRun", skip: int, last: int | None) -> "BenchRun":
    """Full cycles of the record, half a sample before the passages of mid-stroke."""
    count = run.cycles
    most = count - skip
    if skip and most < 1:
        _checks.refuse("skip_cycles", f"be less than the number of full cycles of {run.name!r}, {count}", skip)
    if last is not None and not 1 <= last <= most:
        must = f"be between 1 and the number of full cycles, {most}"
        _checks.refuse("last_cycles", must, f"{last} for {run.name!r}")
    instants, half = run.cycle_instants, 0.5 / run.sampling_rate
    first = count - last if last is not None else skip
    start, stop = instants[first] - half, instants[-1] - half
    part = (run.time >= start) & (run.time < stop)
    note = f"cut to {run.time[part][0]:g} … {run.time[part][-1]:g} s, cycles {first + 1} to {count} of {count}"
    return _cut(run, part, note)


def _subtract(run: "BenchRun", forces: "GasAndFriction") -> "BenchRun":
    """Without gas force and friction; friction grows in proportion below the velocities it was measured at."""
    friction = forces.friction * np.clip(run.velocity / forces.velocities[0], -1.0, 1.0)
    force = run.force - forces.static_force(run.stroke) - friction
    gas = f"gas force {forces.gas_force:.4g} N with {forces.gas_rate:.4g} N/m"
    note = f"{gas} and friction {forces.friction:.4g} N subtracted, as measured on {forces.record}"
    return _noted(run, note, force=force)


def _mean_cycle(run: "BenchRun") -> "BenchRun":
    from jaxdamp.bench.analysis import fold_cycles

    if run.command_channel is not None:
        remedy = "Leave `mean_cycle` out, or cut the part in which the command is held."
        must = "be asked for where all cycles are alike"
        _checks.refuse("mean_cycle", must, f"{run.name!r}, whose command varies", remedy)
    cycles = fold_cycles(run)
    count, period = len(cycles.periods), float(cycles.periods.mean())
    points = cycles.force.shape[1]
    time = np.arange(points) * (period / points)
    channels = {name: getattr(cycles, name).mean(axis=0) for name in CHANNELS}
    warm = None
    if run.temperature is not None:
        during = (run.time >= cycles.starts[0]) & (run.time < cycles.starts[-1] + cycles.periods[-1])
        warm = np.full(len(time), float(np.mean(run.temperature[during])))
    scatter = f"{np.sqrt(np.mean(np.var(cycles.force, axis=0, ddof=1))):.3g} N" if count > 1 else "unknown"
    note = f"mean cycle over {count} cycles; scatter of the force from cycle to cycle {scatter} (RMS)"
    note += "" if warm is None else f", at their mean temperature, {warm[0] - 273.15:.3g} °C"
    return _noted(run, note, time=time, **channels, temperature=warm)
