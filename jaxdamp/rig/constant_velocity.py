"""The force of a law at constant velocity: the curve without hysteresis."""

import functools
from collections.abc import Hashable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._traced import of_known_numbers
from jaxdamp.dampers import AbstractDamper, Heated, MonoTube, TwinTube, coverage, laws_inside
from jaxdamp.parameters import as_float, with_values
from jaxdamp.rig.law_numbers import is_number, numbers_of
from jaxdamp.rig.printed import numbers_on_rig, printed_law
from jaxdamp.rig.strokes import refuse_strokes


class QuasiStatic(NamedTuple):
    """Forces of a law at constant velocity, and where it has none.

    Attributes:
        velocity: the velocities asked for [m/s], shape (points,).
        force: settled force [N], NaN where the law does not settle, has a cavity or no finite force, shape (points,).
        settled: which points have a force, shape (points,).
        note: how many points have none, where and why, in words; empty if all have one.
        states: states of the law at the end, NaN where it does not settle, shape (points, states): a start for
            `respond` of a record in motion.
    """

    velocity: Float[Array, " points"]
    force: Float[Array, " points"]
    settled: Bool[np.ndarray, " points"]
    note: str
    states: Float[Array, "points states"]


MOST_REMEMBERED = 64  # curves
LONGEST_HOLD = 64  # s at constant velocity
# s and J/K, in which a law neither cools nor warms; finite, so that the levels of a command without a share add nothing
LONG, HEAVY = 1e15, 1e30
STEADY = 1e-4  # change of a force while the time held doubles, relative to the scale of the forces: settled
MOST_SPANS = 2  # of velocities without a force that are named
NO_CAVITY = -1e30  # Pa, below the pressure of any oil
STILL = {"float64": 1e-9, "float32": 1e-3}  # the same, at which no longer hold can improve the curve


@of_known_numbers
def quasi_static(
    law: AbstractDamper, velocities: Float[Array, " points"] | np.ndarray, *, stroke: float = 0.0
) -> QuasiStatic:
    """Force [N] of a law at constant velocity, its states settled: the curve without hysteresis.

    Each velocity is held at one stroke for 1, 2, 4 ... up to 64 s, until no force changes any more; a memoryless law
    answers at once. A point is settled if its force changed, over the last doubling of the time, by no more than 1e-4
    of itself or of the largest settled force. A `Heated` law keeps its `initial_rise`. Friction that acts through a
    bristle needs longer the slower it moves, a law that drifts never settles, and with a cavity in the oil, which
    grows as the damper moves on, the force depends on the stroke: such points are left without a force, and the note
    says so.

    Arguments:
        law: the damper law.
        velocities: velocities [m/s], shape (points,).
        stroke: at which they are held [m].

    Returns:
        The forces, NaN at points without one, with a flag for each point and a note in words.

    Raises:
        ValueError: velocities that are not finite numbers in one dimension; a stroke outside the limits of the law.

    >>> from jaxdamp.dampers import Linear, SeriesSpring
    >>> quasi_static(SeriesSpring(Linear(2000.0), stiffness=1e6), np.array([-0.5, 0.0, 0.5])).force
    Array([-1000.,     0.,  1000.], dtype=float64)
    """
    check_module("law", law, (AbstractDamper,), "quasi_static(law, velocities)")
    velocities = as_float(velocities)
    if velocities.ndim != 1 or velocities.size == 0:
        _checks.refuse("velocities", "be one or more in one dimension", f"of shape {velocities.shape}")
    _checks.finite("velocities", velocities)
    stroke = _checks.plain_number("stroke", stroke)
    refuse_strokes(law, "stroke", stroke, stroke)
    law = as_warm_as_it_begins(law)
    numbers = numbers_of(law)
    kinds = sorted({str(leaf.dtype) for leaf in jax.tree.leaves(law) if is_number(leaf)})
    key = numbers.key, numbers.flat.tobytes(), np.asarray(velocities).tobytes(), stroke, *kinds, coverage(law)
    return _settled(_Keyed(key, law, velocities, stroke))


def as_warm_as_it_begins(law: AbstractDamper) -> AbstractDamper:
    """The law whose `Heated` parts keep the rise that they begin with, since at a constant power they never settle.

    Arguments:
        law: the damper law.
    """
    heated = [prefix for prefix, part in laws_inside(law) if isinstance(part, Heated)]
    still = {"heat_capacity": np.asarray(HEAVY), "cooling_time": np.asarray(LONG)}
    return with_values(law, {f"{prefix}{name}": value for prefix in heated for name, value in still.items()})


class _Keyed:
    """What is remembered by a key, and with what it is computed."""

    def __init__(self, key: Hashable, law: AbstractDamper, velocities: Array, stroke: float) -> None:
        self.key, self.content = key, (law, velocities, stroke)

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Keyed) and self.key == other.key


@functools.lru_cache(maxsize=MOST_REMEMBERED)
def _settled(question: _Keyed) -> QuasiStatic:
    """The curve, which a table, a picture and a page ask for one after the other."""
    law, velocities, stroke = question.content
    states = _at_rest(law, velocities.size)
    states, force = _hold(law, stroke, velocities, states, jnp.asarray(0))
    if states.size == 0:
        settled = np.isfinite(force)
        note = _gaps(law, np.asarray(velocities), np.asarray(force), settled, np.zeros_like(settled))
        return QuasiStatic(velocities, force, settled, note, states)
    seconds, change = 0, np.full(velocities.shape, np.inf)
    while seconds < LONGEST_HOLD:
        longer = max(2 * seconds, 1)
        before, (states, force) = force, _hold(law, stroke, velocities, states, jnp.asarray(1000 * (longer - seconds)))
        seconds, change = longer, np.abs(np.asarray(force) - np.asarray(before))
        if np.all(change <= STILL[str(force.dtype)] * np.max(np.abs(force))):
            break
    size = np.abs(np.asarray(force))
    limit = STEADY if force.dtype == jnp.float64 else STILL["float32"]
    alone = change <= limit * size
    settled = np.isfinite(size) & (alone | (change <= limit * np.max(size, where=alone, initial=0.0)))
    cavities = settled & _differs_by_cavities(law, stroke, velocities, seconds, np.asarray(force), limit)
    settled &= ~cavities
    note = _gaps(law, np.asarray(velocities), np.asarray(force), settled, cavities)
    states = on_device(np.where(settled[:, None], states, np.nan))
    return QuasiStatic(velocities, on_device(np.where(settled, force, np.nan)), settled, note, states)


def _at_rest(law: AbstractDamper, count: int) -> Array:
    """The states of so many dampers at rest."""
    begin = np.asarray(law.initial_state())
    return on_device(np.broadcast_to(begin, (count, begin.size)).copy())


def _differs_by_cavities(
    law: AbstractDamper, stroke: float, velocities: Array, seconds: int, force: np.ndarray, limit: float
) -> np.ndarray:
    """Where a force held so long is not that of the law without cavities.

    A cavity that is held at one stroke grows until it has compressed the gas: no stroke is as long.
    """
    tubes = [(path, part) for path, part in laws_inside(law) if isinstance(part, MonoTube | TwinTube)]
    if not tubes:
        return np.zeros(force.shape, bool)
    never = {
        f"{prefix}cavitation_pressure": jnp.full_like(part.cavitation_pressure, NO_CAVITY) for prefix, part in tubes
    }
    held = jnp.asarray(1000 * seconds)
    oil = np.asarray(_hold(with_values(law, never), stroke, velocities, _at_rest(law, velocities.size), held)[1])
    return np.abs(force - oil) > limit * np.abs(oil)


def _gaps(
    law: AbstractDamper, velocity: np.ndarray, force: np.ndarray, settled: np.ndarray, cavities: np.ndarray
) -> str:
    """Where a law has no settled force, and why."""
    finite = np.isfinite(force)
    reasons = (
        (~finite, f"the law gives no finite force. {coverage(law)}".strip()),
        (cavities, "a cavity opens in the oil and grows, so that the force depends on the stroke (`jaxdamp.respond`)."),
        (finite & ~settled & ~cavities, f"the force still changes after {LONGEST_HOLD} s of constant velocity."),
    )
    notes = []
    for at, why in reasons:
        if at.any():
            where = f"{np.count_nonzero(at)} of {at.size} velocities, {_spans(velocity, at)} m/s"
            notes.append(f"No force at {where}: {why}")
    return " ".join(notes)


def _spans(velocity: np.ndarray, at: np.ndarray) -> str:
    """Where points lie, in words: each row of neighbours, or all in one span where there are more than two."""
    order = np.argsort(velocity)
    ends = np.flatnonzero(np.diff(at[order], prepend=False, append=False)).reshape(-1, 2) - [0, 1]
    rows = velocity[order][ends if len(ends) <= MOST_SPANS else ends[[0, -1], [0, 1]][None]]
    words = ((f"{lower:.3g}", f"{upper:.3g}") for lower, upper in rows)
    return " and ".join(f"at {lower}" if lower == upper else f"from {lower} to {upper}" for lower, upper in words)


def _hold(law: AbstractDamper, stroke: float, velocities: Array, states: Array, count: Array) -> tuple[Array, Array]:
    """States and forces after so many more milliseconds at constant velocities."""
    if states.size:
        numbers = numbers_on_rig(law)
        printed = printed_law(numbers, None)
        if printed is not None:
            s = np.array(states, np.float64)
            force = printed.hold(numbers.flat, stroke, np.ascontiguousarray(velocities, np.float64), int(count), s)
            return on_device(s.astype(states.dtype)), on_device(force.astype(velocities.dtype))
    return _held_by_xla(law, on_device(np.asarray(stroke, velocities.dtype)), velocities, states, count)


def on_device(array: np.ndarray) -> Array:
    """With a type stated, an array is copied; without one JAX compiles a program for that."""
    return jnp.asarray(array, array.dtype)


@compiled_for_loops
def _held_by_xla(
    law: AbstractDamper, x: Array, velocities: Array, states: Array, count: Int[Array, ""]
) -> tuple[Array, Array]:
    """States and forces after so many more milliseconds at constant velocities."""
    dt = jnp.asarray(1e-3, velocities.dtype)

    def one(v: Array, start: Array) -> tuple[Array, Array]:
        state = jax.lax.fori_loop(0, count, lambda _, state: law.advance(x, v, x, v, state, dt), start)
        return state, law.force(x, v, state)

    return jax.vmap(one)(velocities, states)
