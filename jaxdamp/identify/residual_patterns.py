"""Patterns that effects leave in the residual of a fit on a bench: of a machine, of its channels, of a damper's law."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.dampers import PiecewiseLinear, SplineTable, Table, laws_inside
from jaxdamp.identify.model import is_memoryless
from jaxdamp.identify.problem import Problem
from jaxdamp.identify.search import SearchEnd
from jaxdamp.identify.traces import signals
from jaxdamp.rig import delayed_samples, lagged_samples


FRICTION_VELOCITY = 0.005  # m/s, width of the sign change of friction
GAPS = (0.01, 0.015, 0.02, 0.03, 0.045, 0.07, 0.1)  # clearances that are tried, relative to the half stroke
KNEES = 12  # of a curve of the velocity
IMITATED = 0.9  # of what a delay changes, which fitted numbers change too where a law imitates one
FEWEST = 8  # samples of a record
SHORT = 50.0  # sampling steps for each time constant below which a filter and a delay are one
OF_LAW = ("curve", "hysteresis")  # effects that no machine has
FREE_CURVES = (PiecewiseLinear, SplineTable, Table)
PLAY = "look for play in the mounts, or put the law into `Play`"
SIGNED = ("offset", "heat", "drift")  # effects of either sign
MEANINGS = {  # what an effect is, with its size, and what to do
    "offset": ("a constant force of {:.3g} N", 'add "gas" or "offset" to the machine (`rig`)'),
    "gas_stiffness": ("a spring of {:.3g} N/m", 'add "gas_stiffness" to the machine (`rig`), or a `Spring` to the law'),
    "mass": ("a moving mass of {:.3g} kg", 'add "mass" to the machine (`rig`)'),
    "friction": ("friction of {:.3g} N", 'add "friction" to the machine (`rig`), or take a law with friction'),
    "heat": ("damping that falls as the oil warms up", 'add "heat" to the machine (`rig`), or cut the records'),
    "drift": (
        "a zero that drifts by {:.3g} N/s",
        "let the bench warm up, and set the load cell to zero before each record",
    ),
    "delay": ("a delay of the force by {:.2g} s", 'add "delay" to the machine (`rig`)'),
    "lag": (
        "a low-pass filter of the force with a time constant of {:.2g} s",
        'add "lag" to the machine (`rig`)',
    ),
}
OR_MEMORY = ", or take a law with hysteresis"  # what else may explain a delay or a filter, to a law without

Values = Float[np.ndarray, " samples"]


class Pattern(NamedTuple):
    """What an effect leaves in the residual, and what it means."""

    name: str  # of the effect
    signals: Float[np.ndarray, "samples numbers"]  # weighted force for a unit of each of its numbers
    signed: bool  # whether its numbers may have either sign
    words: Callable[[np.ndarray], str]  # what it is, with its numbers
    remedy: str  # what to do
    at_rest: np.ndarray | None = (
        None  # force [N] at velocity zero for a unit of each number; None where it says nothing
    )
    of_force: bool = False  # whether its number is relative to the force


class Motion(NamedTuple):
    """One record as it stands in the residuals; the force as predicted, the rise of a measured temperature."""

    time: Values
    stroke: Values
    velocity: Values
    force: Values
    rise: Values | None


class Record(NamedTuple):
    """The samples of a fitted record in the residuals."""

    number: int  # of the record
    at: np.ndarray  # places among the used samples
    weight: Values  # of each sample
    motion: Motion  # of the record there
    cycle: int  # samples in a period; 0 where the record is shorter than two


def records_of(problem: Problem, best: SearchEnd) -> Iterator[Record]:
    """Each fitted record in the residuals."""
    stroke, velocity, force, weight = signals(problem.residuals, "stroke", "velocity", "force", "weight")
    predicted = force + np.divide(best.residual[: weight.size], weight, out=np.zeros_like(force), where=weight > 0)
    first = [run.temperature[0] for run in problem.runs if run.temperature is not None]
    place = np.cumsum(problem.used) - 1
    for i, run in enumerate(problem.runs):
        at = np.flatnonzero((problem.owner == i) & problem.used)
        if at.size < FEWEST or run.of_points:  # points of a table, on no machine, are too few for a pattern
            continue
        step = problem.sample_steps[i]
        time = step * np.arange(at.size)
        rise = None
        if run.temperature is not None:
            end = run.time[-1] - run.time[0]
            rise = np.interp(time + max(end - time[-1], 0.0), run.time - run.time[0], run.temperature) - min(first)
        cycle = round(1.0 / (step * run.frequency)) if run.frequency > 0 else 0
        motion = Motion(time, stroke[at], velocity[at], predicted[at], rise)
        yield Record(i, place[at], weight[at], motion, cycle if at.size >= 2 * cycle else 0)


def filled(text: str) -> Callable[[np.ndarray], str]:
    """The text with the sizes of an effect in it."""
    return lambda sizes: text.format(*sizes)


def column(records: Sequence[Record], change: Callable[[Motion], Values]) -> Float[np.ndarray, "samples 1"]:
    """The weighted change of the force [N] by an effect, over all used samples."""
    values = np.zeros((sum(record.at.size for record in records), 1))
    for _, at, weight, motion, _ in records:
        values[at, 0] = weight * change(motion)
    return values


def proportional(problem: Problem, records: Sequence[Record]) -> list[Pattern]:
    """The effects of a machine that are proportional to their size, the likelier ones first."""
    changes: dict[str, Callable[[Motion], Values]] = {
        "offset": lambda m: np.ones_like(m.time),
        "gas_stiffness": lambda m: m.stroke,
        "mass": lambda m: np.gradient(m.velocity, m.time),
        "friction": lambda m: np.tanh(m.velocity / FRICTION_VELOCITY),
        "heat": _heated,
        "drift": lambda m: m.time,
    }
    patterns = []
    for name, change in changes.items():
        words, remedy = MEANINGS[name]
        patterns.append(Pattern(name, column(records, change), name in SIGNED, filled(words), remedy))
    for gap in GAPS:
        words = f"a clearance of about {1e3 * gap * problem.reach.stroke:.2g} mm (no force after each reversal)"
        lost = column(records, lambda m, gap=gap * problem.reach.stroke: _lost(m, gap))
        patterns.append(Pattern("clearance", lost, False, filled(words), PLAY))
    return [*patterns, *_gains(problem, records), _curve(problem, records)]


def _heated(motion: Motion) -> Values:
    time, _, v, force, rise = motion
    power = 0.5 * (force[1:] * v[1:] + force[:-1] * v[:-1])
    return -force * (np.concatenate([[0.0], np.cumsum(power * np.diff(time))]) if rise is None else rise)


def _lost(motion: Motion, gap: float) -> Values:
    """The force that a clearance takes away, within a distance [m] behind each reversal."""
    x, v = motion.stroke, motion.velocity
    turns = np.flatnonzero(np.signbit(v[1:]) != np.signbit(v[:-1])) + 1
    last = np.searchsorted(turns, np.arange(x.size), side="right") - 1
    since = np.abs(x - x[turns[np.maximum(last, 0)]]) if turns.size else np.full(x.size, np.inf)
    return -motion.force * (np.where(last >= 0, since, np.inf) < gap)


def _gains(problem: Problem, records: Sequence[Record]) -> list[Pattern]:
    """For each of several records a force that is larger or smaller than in all others."""
    patterns = []
    for number, at, weight, motion, _ in records if len(records) > 1 else ():
        values = np.zeros((sum(record.at.size for record in records), 1))
        values[at, 0] = weight * motion.force

        def words(sizes: np.ndarray, name: str = problem.runs[number].name) -> str:
            return f"a gain of {1.0 + float(sizes[0]):.3g} in {name}"

        remedy = "was a range, a unit or a setting changed? Leave the record out, or fit it apart"
        patterns.append(Pattern("gain", values, True, words, remedy, of_force=True))
    return patterns


def _curve(problem: Problem, records: Sequence[Record]) -> Pattern:
    """Another curve of the velocity, by straight lines between knees that each have as many samples."""
    velocity = np.concatenate([record.motion.velocity for record in records])
    knees = np.unique(np.quantile(velocity, np.linspace(0.0, 1.0, KNEES)))
    units = np.eye(knees.size)
    parts = [column(records, lambda m, unit=unit: np.interp(m.velocity, knees, unit)) for unit in units]
    remedy = "take a law with a free curve, such as piecewise_linear or table"
    if any(isinstance(law, FREE_CURVES) for _, law in laws_inside(problem.law)):
        remedy = "give the law's curve more points, or take a law with memory, such as besinger_series_spring"
    words = "the shape of the damper's curve over the velocity"
    at_rest = np.array([float(np.interp(0.0, knees, unit)) for unit in units])
    return Pattern("curve", np.concatenate(parts, axis=1), True, lambda sizes: words, remedy, at_rest)


def hysteresis(problem: Problem, records: Sequence[Record], span: np.ndarray, late: dict[str, float]) -> Pattern:
    """A force that is late by another time in each record and direction, which is memory of a damper.

    A law with a lag imitates a delay of a channel, and leaves such times too; friction with a memory does not. `span`
    is an orthonormal basis of what the fitted numbers change, `late` are delay and lag of the force [s] that were found
    before.
    """
    memoryless = is_memoryless(problem.law)
    delay = column(records, lambda m: np.gradient(m.force, m.time))
    imitates = not (memoryless or any(name.endswith("force_delay") for name in problem.free.names)) and bool(
        np.linalg.norm(span.T @ delay) ** 2 > IMITATED * np.linalg.norm(delay) ** 2
    )
    values = np.zeros((sum(record.at.size for record in records), 2 * len(records)))
    for k, (_, at, weight, motion, _) in enumerate(records):
        force = motion.force + sum(LATE[name](motion, size) for name, size in late.items())
        rate = -weight * np.gradient(force, motion.time)
        values[at, 2 * k], values[at, 2 * k + 1] = rate * (force > 0), rate * (force <= 0)

    def words(sizes: np.ndarray) -> str:
        ends = f"{_late_or_early(1e3 * (sizes + sum(late.values())))} over records and directions"
        if imitates:
            return f"memory of the damper, or a delay of a channel: the force is {ends}, beside the memory of the law"
        if not memoryless:
            return f"memory of the damper beside that of the law: its force is {ends}, by no delay of a channel"
        return f"memory of the damper, whose force is {ends} and so by no delay of a channel"

    remedy = "take a law with memory, such as besinger_series_spring, besinger_lag or series_spring_dahl"
    if not memoryless:
        remedy = 'compare with a law without memory beside a "delay" of the machine (`rig`)' * imitates
    return Pattern("hysteresis", values, True, words, remedy)


def _late_or_early(times: np.ndarray) -> str:
    """How far times [ms] are from zero, in words."""
    low, high = float(times.min()), float(times.max())
    if low >= 0.0:
        return f"{low:.2g} to {high:.2g} ms late"
    return (
        f"{-high:.2g} to {-low:.2g} ms early" if high <= 0.0 else f"between {-low:.2g} ms early and {high:.2g} ms late"
    )


def delayed(motion: Motion, delay: float) -> Values:
    """The force a time later [s], less the force."""
    step = motion.time[1] - motion.time[0]
    return delayed_samples(motion.force, delay / step)[0] - motion.force


def filtered(motion: Motion, lag: float) -> Values:
    """The force behind a first-order lag [s], exact for straight lines between the samples, less the force."""
    force, samples = motion.force, abs(lag) / (motion.time[1] - motion.time[0])
    if samples < 1.0 / SHORT:
        return -lag * np.gradient(force, motion.time)
    settled = lagged_samples(force[:, None], samples)[0][:, 0]  # as if the first force had lasted
    before = samples * (force[1] - force[0])  # the first straight line goes on before the record
    return settled - before * np.exp(-np.arange(force.size) / samples) - force


LATE = {"delay": delayed, "lag": filtered}
"""Changes of the force by effects that are not proportional to their size."""
