"""Records of motions that do not repeat, without a virtual dyno in between: stroke, velocity and force by formulas."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp.bench import BenchRun, RandomTest
from jaxdamp.dampers import Besinger, Bilinear, CoulombFriction, Linear


LAWS: dict[str, Any] = {
    "bilinear": Bilinear(2600.0, 1200.0),
    "friction": Linear(2000.0) + CoulombFriction(60.0, 0.01),
    "besinger": Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05),
}
MOTIONS = ("band", "chirp", "road")
RATE, COUNT = 400.0, 4000
_force = jax.jit(lambda law, v: jax.vmap(lambda one: law.force(0.0, one, law.initial_state()))(v))


def motion(kind: str, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], stroke [m] and velocity [m/s]."""
    time, rng = np.arange(COUNT) / RATE, np.random.default_rng(seed)
    if kind == "band":
        test = RandomTest(0.02, 0.6, COUNT / RATE, (0.3, rng.uniform(2.0, 6.0)), seed)
        return time, test.stroke(time), test.velocity(time)
    if kind == "chirp":
        low, high = rng.uniform(0.3, 1.0), rng.uniform(4.0, 12.0)
        growth = np.log(high / low) / time[-1]
        phase = 2 * np.pi * low * np.expm1(growth * time) / growth + rng.uniform(0.0, 6.0)
        size = 0.02 * np.exp(-0.7 * growth * time)
        slope = 2 * np.pi * low * np.exp(growth * time)
        return time, size * np.sin(phase), size * (slope * np.cos(phase) - 0.7 * growth * np.sin(phase))
    frequency = np.arange(3, 250) / time[-1]  # a body at 1.3 Hz and a wheel at 12 Hz over a rough road
    gains = [1.0 / np.abs(1 - (frequency / f) ** 2 + 0.6j * frequency / f) for f in (1.3, 12.0)]
    size = (gains[0] + 0.15 * gains[1]) / frequency * rng.normal(1.0, 0.2, len(frequency))
    angle = 2 * np.pi * frequency * time[:, None] + rng.uniform(0.0, 2 * np.pi, len(frequency))
    stroke, velocity = np.sin(angle) @ size, np.cos(angle) @ (2 * np.pi * frequency * size)
    scale = 0.03 / np.max(np.abs(stroke))
    return time, scale * stroke, scale * velocity


def clean(seed: int) -> BenchRun:
    """A record without artefacts, of any of the laws and motions, with noise."""
    kind, name = MOTIONS[seed % 3], list(LAWS)[seed // 3 % 3]
    rng = np.random.default_rng([seed, 1])
    time, stroke, velocity = motion(kind, seed)
    force = np.asarray(_force(LAWS[name], jnp.asarray(velocity))) + rng.uniform(0.5, 20.0) * rng.standard_normal(COUNT)
    stroke = stroke + 10 ** rng.uniform(-6, -4.7) * rng.standard_normal(COUNT)
    return BenchRun.from_arrays(f"{kind} {name} {seed}", time, stroke, force)
