"""The least that any passive dampers could do in the half car of paper 002: a search over c(t) ≥ 0 of both axles.

Whatever a passive damper is made of, its force opposes its velocity at each instant: F = c(t) v with some c(t) ≥ 0. The
least value of a peak or an RMS value over all c(t) of the front and the rear damper is therefore one that no law goes
below, with or without hysteresis, as long as it stores no energy.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize


SPRUNG, INERTIA, UNSPRUNG, SPRING, TYRE, AHEAD, BEHIND = 580.0, 1100.0, 40.0, 23.5e3, 190e3, 1.0, 1.5
MASSES = np.array([SPRUNG, INERTIA, UNSPRUNG, UNSPRUNG])
STROKES = np.array([[1.0, AHEAD, -1.0, 0.0], [1.0, -BEHIND, 0.0, -1.0]])  # front and rear, of z, θ and the wheels
STIFFNESS = STROKES.T @ (SPRING * STROKES) + np.diag([0.0, 0.0, TYRE, TYRE])
START, STEP, INTERVAL = 1.0, 1e-3, 2e-3  # of the bump, of the simulation, of constant damping [s]
CHANNELS = ("sprung_acceleration", "z_sprung", "pitch")  # [m/s²], [m], [degree]
PEAKS = np.array([1.76, 0.019, 0.21])  # Table 2, hybrid column
LEVELS = np.array([0.527, 0.0069, 0.0658])  # Table 3, hybrid column
GAMMA = 1.0 - 0.5**0.5  # of the integration
HALFWAY, STIFFEST = 2e3, 5e4  # c [N s/m] at s = 1/2, and the largest, 30 times that of the linear damper


class Ride(NamedTuple):
    """From the start of the bump on: time [s], body [step, channel], velocity and force of the dampers [step, axle]."""

    time: jax.Array
    body: jax.Array
    velocity: jax.Array
    force: jax.Array


def bump(time: jax.Array) -> jax.Array:
    """Equation 5 of the paper [m]."""
    inside = (time >= START) & (time <= START + 0.25)
    return jnp.where(inside, 0.03 * (1.0 - jnp.cos(8.0 * jnp.pi * time)), 0.0)


@partial(jax.jit, static_argnames="end")
def ride(damping: jax.Array, delay: float, end: float) -> Ride:
    """The half car over the bump with `damping` [interval, axle] in N s/m until `end` [s]; the last value stays.

    Two implicit stages a step, (M/γh + γh K) v = M v*/γh − K x* − F + F_road with γ = 1 − 1/√2, stable for any c; the
    two damper forces F = c (stroke velocity) follow from two equations. Accelerations are means over a step: where c(t)
    jumps, they are higher at an instant.
    """
    count, part = round((end - START) / STEP), GAMMA * STEP
    time = jnp.asarray(START + STEP * (np.arange(count)[:, None] + np.array([GAMMA, 1.0])))  # of the stages
    at_rest = jnp.zeros_like(time)
    tyres = TYRE * jnp.stack([at_rest, at_rest, bump(time), bump(time - delay)], axis=-1)
    interval = np.minimum(np.arange(count) // round(INTERVAL / STEP), damping.shape[0] - 1)
    inverse = np.linalg.inv(np.diag(MASSES) / part + part * STIFFNESS)
    compliance = STROKES @ inverse @ STROKES.T

    def stage(position, velocity, rate, tyre):
        load = MASSES / part * velocity - STIFFNESS @ position + tyre
        free = STROKES @ (inverse @ load)
        (a, b), (c, d) = jnp.eye(2) + compliance * rate[None, :]
        stroke = jnp.array([d * free[0] - b * free[1], a * free[1] - c * free[0]]) / (a * d - b * c)
        after = inverse @ (load - STROKES.T @ (rate * stroke))
        return position + part * after, after, stroke

    def step(state, inputs):
        (position, velocity), (rate, tyre) = state, inputs
        _, middle, _ = stage(position, velocity, rate, tyre[0])
        share = (1.0 - GAMMA) / GAMMA
        begun = position + (1.0 - GAMMA) * STEP * middle, velocity + share * (middle - velocity)
        last, after, stroke = stage(*begun, rate, tyre[1])
        body = jnp.array([(after[0] - velocity[0]) / STEP, last[0], jnp.rad2deg(last[1])])
        return (last, after), (body, stroke, rate * stroke)

    _, outputs = jax.lax.scan(step, (jnp.zeros(4), jnp.zeros(4)), (damping[interval], tyres))
    return Ride(time[:, 1], *outputs)


def damping_of(search: jax.Array) -> jax.Array:
    """C = 2000 s/(1 − s) [N s/m] for 0 ≤ s ≤ 0.998: none to locked, in a variable of one size."""
    return HALFWAY * search / (1.0 - search)


def peaks(body: jax.Array) -> jax.Array:
    """Largest positive values of the channels, as multiples of the hybrid column of Table 2."""
    return jnp.max(body, axis=0) / PEAKS


def levels(body: jax.Array) -> jax.Array:
    """RMS values from t = 0 to the end of the ride, as multiples of the hybrid column of Table 3."""
    return jnp.sqrt(jnp.sum(body**2, axis=0) * STEP / (START + STEP * body.shape[0])) / LEVELS


class Bound(NamedTuple):
    """The least maximum that a search finds.

    Attributes:
        values: multiples of the paper's values [channel].
        damping: c(t) of front and rear [interval, axle] in N s/m.
        starts: the maximum to which each start leads.
    """

    values: np.ndarray
    damping: jax.Array
    starts: tuple[float, ...]


def least(
    measure: Callable[[jax.Array], jax.Array],
    channels: Sequence[str],
    delay: float,
    end: float,
    starts: Sequence[float] = (6000.0, 20_000.0),
) -> Bound:
    """The least maximum of `measure` (`peaks` or `levels`) over the `channels`, over all 0 ≤ c(t) ≤ 5e4 of both axles.

    From each constant damping in `starts` [N s/m], quasi-Newton searches within bounds (L-BFGS-B) with the exact
    derivatives of the ride, by reverse differentiation. Maxima are smoothed, log Σ exp(q x)/q with growing q, but not
    in the values returned. Several starts that end at one value speak for the global minimum, they do not prove it.
    """
    count = round((end - START) / INTERVAL)
    chosen = np.array([CHANNELS.index(name) for name in channels])

    def smoothed(search: jax.Array, sharpness: float) -> jax.Array:
        body = ride(damping_of(search.reshape(count, 2)), delay, end).body
        values = (body / PEAKS[None, :] if measure is peaks else measure(body)[None])[:, chosen]
        return jax.scipy.special.logsumexp(sharpness * values) / sharpness

    derivative = jax.jit(jax.value_and_grad(smoothed))

    def evaluate(search: np.ndarray, sharpness: float) -> tuple[float, np.ndarray]:
        value, slope = derivative(search, sharpness)
        return float(value), np.asarray(slope, float)

    found = []
    for start in starts:
        search = np.full(2 * count, start / (start + HALFWAY))
        for sharpness in (40.0, 200.0, 1000.0) if measure is peaks or chosen.size > 1 else (1.0,):
            options, bounds = {"maxiter": 150, "maxcor": 20}, [(0.0, STIFFEST / (STIFFEST + HALFWAY))] * (2 * count)
            search = minimize(evaluate, search, (sharpness,), "L-BFGS-B", jac=True, bounds=bounds, options=options).x
        damping = damping_of(jnp.asarray(search).reshape(count, 2))
        values = np.asarray(measure(ride(damping, delay, end).body))
        found.append((float(values[chosen].max()), values, damping))
    best = min(found, key=lambda entry: entry[0])
    return Bound(best[1], best[2], tuple(entry[0] for entry in found))
