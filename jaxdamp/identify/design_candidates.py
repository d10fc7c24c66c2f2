"""The runs that a design of experiments chooses from: what a test machine can do, and tests over its range."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple, NoReturn, final

import numpy as np

from jaxdamp import _checks
from jaxdamp.bench import CommandStep, Excitation, MultiSineTest, RandomTest, SineTest, TriangleTest
from jaxdamp.parameters import listed


SPREAD = (1.0, 2.3, 5.3)  # frequencies of a multi-sine, relative to the lowest
OCTAVES = 3.0  # width of the band of a random test
FEWEST_CYCLES = 3  # of a run, however slow
LEAST_STROKE = 1e-4  # m, that a machine moves well
ROUNDING = 1e-3  # relative excess of a motion over a limit that counts as none: `extent` is as exact


@final
@dataclasses.dataclass(frozen=True)
class MachineLimits:
    """What a test machine can do, and what a damper bears.

    Arguments:
        stroke: largest |x| [m], zero to peak.
        velocity: largest |v| [m/s].
        force: largest |F| [N] of the law on its machine.
        power: largest mean power ⟨F v⟩ [W] that a run may turn into heat.
        frequencies: lowest and highest frequency [Hz].

    Raises:
        ValueError: a limit that is not positive; frequencies that do not increase.
    """

    stroke: float | int
    velocity: float | int
    force: float | int = np.inf
    power: float | int = np.inf
    frequencies: tuple[float | int, float | int] = (0.5, 15.0)

    def __post_init__(self) -> None:
        for name in ("stroke", "velocity", "frequencies"):
            _checks.positive(name, np.asarray(getattr(self, name), float))
        for name in ("force", "power"):
            if not getattr(self, name) > 0:
                _checks.refuse(name, "be positive", getattr(self, name))
        if not self.frequencies[0] < self.frequencies[1]:
            _checks.refuse("frequencies", "increase", self.frequencies)


def extent(test: Excitation) -> tuple[float, float]:
    """Largest stroke [mm] and velocity [m/s] of a record.

    Arguments:
        test: the excitation.
    """
    time = np.arange(0.0, test.duration, 0.01 / test.highest_frequency)
    return 1e3 * float(np.max(np.abs(test.stroke(time)))), float(np.max(np.abs(test.velocity(time))))


def beyond(test: Excitation, limits: MachineLimits | None, force: float = 0.0, power: float = 0.0) -> str:
    """The name of a test, and in what it is beyond the limits; empty if it is within them.

    Arguments:
        test: the excitation.
        limits: of the machine; without them nothing is beyond.
        force: largest |F| [N] in it, if it is known.
        power: mean F v [W] in it, if it is known.
    """
    if limits is None:
        return ""
    (stroke, velocity), (low, high) = extent(test), _band(test)
    more, less = 1.0 + ROUNDING, 1.0 - ROUNDING
    over = [f"{stroke:.4g} mm"] * (stroke > 1e3 * limits.stroke * more)
    over += [f"{velocity:.4g} m/s"] * (velocity > limits.velocity * more)
    over += [f"{high:.4g} Hz"] * (high > limits.frequencies[1] * more)
    over += [f"{low:.4g} Hz"] * (low < limits.frequencies[0] * less)
    over += [f"{force:.4g} N"] * (not force <= limits.force) + [f"{power:.4g} W"] * (not power <= limits.power)
    return f"{test.name} ({', '.join(over)})" if over else ""


def _band(test: Excitation) -> tuple[float | int, float | int]:
    """Lowest and highest frequency [Hz]; of a triangle that of its cycles, of a test of one's own the highest twice."""
    if isinstance(test, CommandStep):
        return _band(test.test)
    if isinstance(test, SineTest | TriangleTest):
        return test.frequency, test.frequency
    if isinstance(test, MultiSineTest):
        return min(test.frequencies), max(test.frequencies)
    return test.band if isinstance(test, RandomTest) else (test.highest_frequency, test.highest_frequency)


class Point(NamedTuple):
    """Where a candidate lies in the plane of the limits."""

    waveform: str
    stroke: float  # m, zero to peak
    frequency: float  # Hz, the lowest


WAVEFORMS = ("sine", "triangle", "random", "multisine")


def excitation_at(point: Point, limits: MachineLimits, duration: float) -> Excitation | None:
    """The test at a point; `None` if it is outside the limits."""
    waveform, stroke, frequency = point
    low, high = limits.frequencies
    cycles = max(int(duration * frequency), FEWEST_CYCLES)
    name = f"{waveform}_{1e3 * stroke:.3g}mm_{frequency:.3g}Hz"
    widest = {"sine": 1.0, "triangle": 1.0, "random": 2.0**OCTAVES, "multisine": SPREAD[-1]}[waveform]
    if not (LEAST_STROKE <= stroke <= limits.stroke and low <= frequency and frequency * widest <= high):
        return None
    if waveform == "random":
        band = (frequency, frequency * widest)
        return RandomTest(stroke, limits.velocity, cycles / frequency, band, warm_up=1.0 / frequency, name=name)
    if waveform == "multisine":
        lines = tuple(frequency * factor for factor in SPREAD)
        return MultiSineTest(stroke, limits.velocity, lines, cycles / frequency, warm_up=1.0 / frequency, name=name)
    test = (SineTest if waveform == "sine" else TriangleTest)(stroke, frequency, cycles, name=name)
    return test if test.peak_velocity <= limits.velocity * (1.0 + 1e-9) else None


def grid(
    limits: MachineLimits, waveforms: Sequence[str], duration: float, strokes: int, frequencies: int
) -> dict[Point, Excitation]:
    """Tests over the range of a machine: strokes and frequencies in equal ratios, and on the limit of velocity."""
    for waveform in waveforms:
        _checks.one_of("waveforms", waveform, WAVEFORMS)
    rates = np.geomspace(*limits.frequencies, frequencies)
    slowest = limits.velocity / (2 * np.pi * limits.frequencies[1])
    sizes = np.geomspace(max(min(limits.stroke / 10, slowest), LEAST_STROKE), limits.stroke, strokes)
    points = [
        Point(waveform, float(stroke), float(rate))
        for waveform in waveforms
        for rate in rates
        for stroke in dict.fromkeys([*sizes, min(limits.velocity / (2 * np.pi * rate), limits.stroke)])
    ]
    return _within(points, limits, duration)


def near(points: Sequence[Point], ratio: float, limits: MachineLimits, duration: float) -> dict[Point, Excitation]:
    """Tests around some points: strokes and frequencies a ratio larger and smaller, moved inside the limits."""
    factors = (1.0 / ratio, 1.0, ratio)
    around = [
        point._replace(
            stroke=min(point.stroke * a, limits.stroke),
            frequency=float(np.clip(point.frequency * b, *limits.frequencies)),
        )
        for point in dict.fromkeys(points)
        for a in factors
        for b in factors
    ]
    return _within(around, limits, duration)


def _within(points: Sequence[Point], limits: MachineLimits, duration: float) -> dict[Point, Excitation]:
    tests = {point: excitation_at(point, limits, duration) for point in points}
    return {point: test for point, test in tests.items() if test is not None}


def refuse_all(left_out: Sequence[str]) -> NoReturn:
    """Refuse limits within which there is no test."""
    value = "no candidate within them" + f": {listed(left_out)}" * bool(left_out)
    _checks.refuse("limits", "leave tests to choose from", value, "Allow more, or give slower and shorter `tests`.")
