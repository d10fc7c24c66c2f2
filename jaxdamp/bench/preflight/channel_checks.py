"""Checks of each channel: clipping, rounding, mains ripple."""

import numpy as np

from jaxdamp.bench.motion import Samples
from jaxdamp.bench.preflight.finding import Examined, Finding, step
from jaxdamp.bench.preflight.gaps import runs_of
from jaxdamp.bench.preflight.mains import MAINS
from jaxdamp.bench.preflight.sample_checks import STUCK, UNITS


LEAST_LOST = 5e-3  # of the range: less is a machine that turns slowly, or rounding
COARSE = 1000  # levels over the range, below which rounding is seen in loops


def clipping(e: Examined) -> list[Finding]:
    """Flat tops: the largest or smallest value again and again, reached with a slope that would have gone on."""
    found = []
    for name, values in e.channels.items():
        for side, extreme in (("largest", values.max()), ("smallest", values.min())):
            flat = [(a, b) for a, b in runs_of(values == extreme) if b > a + 1]
            flat = [
                pair
                for pair in flat
                if _goes_on(values, *pair, e.noise[name]) and pair[1] - pair[0] <= STUCK * e.samples_per_cycle
            ]
            count = sum(b - a + 1 for a, b in flat)
            if count >= 4:
                share = 100 * count / len(values)
                message = f"the {name} is clipped at {extreme:.4g} {UNITS[name]} ({share:.2g} % of the samples)"
                place = (e.moving.start + flat[0][0], e.moving.start + flat[-1][1])
                remedy = f"Its {side} values are lost: take a larger range of the channel and measure again."
                found += e.finding("error", f"{name} clipped", message, extreme, UNITS[name], place, remedy)
    return found


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
    found = []
    for name, values in e.channels.items():
        size = step(values)
        levels = np.ptp(values) / size if size > 0 else np.inf
        if levels < COARSE:
            message = f"the {name} comes in steps of {size:.3g} {UNITS[name]}, {levels:.0f} of them over its range"
            remedy = "Take a smaller range or more bits, and write more digits."
            found += e.finding("note", f"{name} quantised", message, size, UNITS[name], None, remedy)
    return found


def ripple(e: Examined) -> list[Finding]:
    """Lines at the mains frequency and its harmonics that stand out from the motion beside them, and from the noise."""
    found = []
    for name in e.channels:
        for mains in MAINS:
            lines = e.mains[name].get(mains, [])
            if lines:
                size = float(np.linalg.norm([size for _, size in lines]))
                where = ", ".join(f"{at:.4g} Hz" for at, _ in lines)
                said = f"line{'s' * (len(lines) > 1)} at {where}"
                message = f"{mains:.0f} Hz ripple of {size:.3g} {UNITS[name]} in the {name} ({said})"
                remedy = f"Mend the earthing, or filter: `process(low_pass={mains / 2:g})` if the motion allows it."
                found += e.finding("warning", f"{name} ripple", message, size, UNITS[name], None, remedy)
    return found
