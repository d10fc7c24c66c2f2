"""Sines on the rig, and what is read from their last cycle."""

import numpy as np

from jaxdamp import respond


def last_cycle(law, frequency, amplitude, *, cycles=4, samples=2000, substeps=1):
    """Stroke, velocity and force over the last of several cycles of a sine."""
    w = 2 * np.pi * frequency
    t = np.arange(cycles * samples + 1) / (samples * frequency)
    x, v = amplitude * np.sin(w * t), amplitude * w * np.cos(w * t)
    force = np.asarray(respond(law, t, x, v, substeps=substeps))
    return x[-samples:], v[-samples:], force[-samples:]


def work(frequency, v, force):
    """∮ F v dt [J] of one cycle."""
    return np.mean(force * v) / frequency


def force_at_zero_velocity(v, force):
    """|F| [N] at the two places where the velocity changes sign: first from rebound, then from compression."""
    place = np.nonzero(np.sign(v) != np.sign(np.roll(v, -1)))[0]
    after = (place + 1) % v.size
    share = v[place] / (v[place] - v[after])
    crossing = force[place] + share * (force[after] - force[place])
    return np.abs(crossing[np.argsort(v[place] < 0)])
