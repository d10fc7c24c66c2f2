"""Stroke from a measured velocity, for benches that have no stroke channel."""

import numpy as np

from jaxdamp.bench.motion import Samples, cycle_instants


def integrate_velocity(time: Samples, velocity: Samples, where: str) -> tuple[Samples, Samples, str]:
    """Stroke and velocity without drift, and a sentence that says what was done.

    A constant error of the velocity makes the stroke drift. It is the slope of the straight line through the means of
    the stroke over the full cycles, and is taken off the velocity. Zero stroke is the middle of the motion.

    Arguments:
        time: instants [s], uniform.
        velocity: as measured [m/s].
        where: the file, for messages.

    Returns:
        Stroke [m], velocity [m/s], and the sentence.

    Raises:
        ValueError: a velocity without a full cycle, from which drift cannot be told.
    """
    from scipy.interpolate import CubicSpline  # takes a second to import, and few records need it

    instants = cycle_instants(time, velocity) if np.ptp(velocity) > 0 else time[:1]
    if len(instants) < 2:
        raise ValueError(
            f"{where}: the velocity has no full cycle, so that drift cannot be told from motion when it is integrated. "
            "Record a cycle or more, or a stroke channel."
        )
    curve = CubicSpline(time, velocity)
    lengths, wander = np.diff(instants), ""
    if len(lengths) > 1:
        means, middles = np.diff(curve.antiderivative(2)(instants)) / lengths, instants[:-1] + 0.5 * lengths
        offset, start = np.polyfit(middles - time[0], means, 1)
        off = means - start - offset * (middles - time[0])
        wander = f", and wanders by {1e3 * np.std(off):.2g} mm from cycle to cycle" if len(off) > 2 else ""
    else:
        offset = np.diff(curve.antiderivative()(instants))[0] / lengths[0]
    stroke = curve.antiderivative()(time) - offset * (time - time[0])
    steady = stroke[(time >= instants[0]) & (time <= instants[-1])]
    note = (
        f"stroke integrated from the velocity, less a constant {offset:.3g} m/s against drift; its zero is the middle "
        f"of the motion, not a place in the damper{wander}"
    )
    return stroke - 0.5 * (steady.max() + steady.min()), velocity - offset, note
