"""Equations of motion written by hand: rows, laws and loads in NumPy, integrated by SciPy.

Nothing here comes from the package: what a link stretches by is a row of numbers over the coordinates, and the force of
a law is its formula.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy.integrate
import scipy.optimize


GRAVITY = 9.80665


class Law(NamedTuple):
    """Force at stroke, velocity and state; rate of the state, of a law that has one."""

    force: Callable
    rate: Callable | None = None


class Link(NamedTuple):
    """A spring, a dashpot and laws over a row of the coordinates; with a track, it stands on the road."""

    row: np.ndarray
    stiffness: float
    damping: float = 0.0
    laws: Sequence[Law] = ()
    track: int | None = None
    load: float | None = None  # static load of a tyre that can lift


def contact(travel, width):
    share = min(max(travel / width, 0.0), 1.0)
    return share * (travel - 0.5 * width * share), share


def bilinear(rebound, compression, width=0.02):
    mean, half = 0.5 * (rebound + compression), 0.5 * (rebound - compression)
    return Law(lambda x, v, s: mean * v + half * (np.sqrt(v * v + width * width) - width))


def power_law(width, rebound, up, compression, down):
    def force(x, v, s):
        level, exponent = (rebound, up) if v >= 0 else (compression, down)
        return level * v * (v * v + width * width) ** (0.5 * (exponent - 1.0))

    return Law(force)


def lag(law, time):
    return Law(lambda x, v, s: s, lambda x, v, s: (law.force(x, v, 0.0) - s) / time)


def maxwell(rate, stiffness):
    return Law(lambda x, v, s: s, lambda x, v, s: stiffness * (v - s / rate))


def bouc_wen(viscous, level, travel, shape=0.75):
    """With n = 2."""
    rate = lambda x, v, z: (v - shape * abs(v) * z * abs(z) - (1 - shape) * v * z * z) / travel  # noqa: E731
    return Law(lambda x, v, z: viscous * v + level * z, rate)


def friction(level, width):
    return Law(lambda x, v, s: level * np.tanh(v / width))


def cubic(quadratic, third):
    return Law(lambda x, v, s: quadratic * x**2 + third * x**3)


def gas(pressure, volume, area):
    return Law(lambda x, v, s: -(pressure * (volume / (volume + area * x)) ** 1.3 - 101_325.0) * area)


def lever(law, ratio):
    return Law(lambda x, v, s: ratio * law.force(ratio * x, ratio * v, s))


def stop(gap, stiffness, damping):
    """At both ends, its onset rounded over 1 mm."""

    def push(outward, speed):
        d, share = contact(outward - gap, 1e-3)
        return max(stiffness * d + damping * share * speed, 0.0)

    return Law(lambda x, v, s: push(x, v) - push(-x, -v))


class Newton(NamedTuple):
    """Masses and links; `rigid` are the motions that strain no link between bodies."""

    mass: np.ndarray
    links: Sequence[Link]
    heights: np.ndarray  # 1 for coordinates that weight acts on
    rigid: Sequence[np.ndarray] = ()

    @property
    def stateful(self) -> list[Law]:
        return [law for link in self.links for law in link.laws if law.rate is not None]

    def field(self, road):
        n = len(self.mass)

        def rates(t, y):
            q, v, states = y[:n], y[n : 2 * n], iter(y[2 * n :])
            z, slope = road(t)
            push, changes = np.zeros(n), []
            for link in self.links:
                x, rate = link.row @ q, link.row @ v
                if link.track is not None:
                    x, rate = x - z[link.track], rate - slope[link.track]
                force = link.stiffness * x + link.damping * rate
                if link.load is not None:
                    width = 0.01 * link.load
                    force = link.load - width * np.logaddexp(0.0, (link.load - force) / width)
                for law in link.laws:
                    state = next(states) if law.rate else 0.0
                    force += law.force(x, rate, state)
                    if law.rate:
                        changes.append(law.rate(x, rate, state))
                push -= link.row * force
            return np.concatenate([v, push / self.mass, changes])

        return rates

    def rest(self):
        """Where everything balances on level ground."""
        n, none = len(self.mass), np.zeros(len(self.links))
        field, still = self.field(lambda t: (none, none)), np.zeros(n + len(self.stateful))
        found = scipy.optimize.root(
            lambda q: field(0.0, np.concatenate([q, still]))[n : 2 * n] * self.mass, np.zeros(n), tol=1e-13
        )
        return np.concatenate([found.x, still])

    def motion(self, road, time):
        """(q, q̇) at the times, from rest."""
        solved = scipy.integrate.solve_ivp(
            self.field(road), (time[0], time[-1]), self.rest(), "DOP853", time, rtol=1e-10, atol=1e-12, max_step=5e-3
        )
        assert solved.success
        return solved.y[: 2 * len(self.mass)].T
