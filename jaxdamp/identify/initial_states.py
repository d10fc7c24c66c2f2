"""The states of a law at the start of a record: at rest, after a warm-up cycle, periodic, or estimated."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias, final
from weakref import WeakKeyDictionary

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, PyTree

from jaxdamp._root import ImplicitDerivatives
from jaxdamp._types import Scalar, State
from jaxdamp.bench import BenchRun, moving_part
from jaxdamp.dampers import AbstractDamper


INITIAL_STATES = ("warm_up", "rest", "periodic", "estimated")
REST_WINDOW = 1.0  # s, of rest before the motion whose force tells the states of a record that is predicted
SHARE_OF_REST = 0.5  # of it at most
LEAST_CYCLES = 1.25  # of a periodic record, so that a part of it can be compared with the next cycle
ALIKE = 0.1  # difference of the stroke from that one cycle later, relative to its RMS, of a periodic record
DOUBLINGS = 20  # of the number of cycles that an extrapolation covers
MOST_ROUNDS = 30  # of the search for the periodic solution
SETTLED = 1e-9  # change of the states over a cycle, relative to their largest values, of the periodic solution
DRIFT = 1e-4  # such a change of what should be the periodic solution, from which it is refused

_moving: WeakKeyDictionary[BenchRun, slice] = WeakKeyDictionary()  # records do not change


class Cycle(NamedTuple):
    """A cycle of the motion, whose last instant is one period after its first one."""

    dt: Float[Array, "*runs"]  # s
    stroke: Float[Array, "*runs points"]  # m
    velocity: Float[Array, "*runs points"]  # m/s
    periodic: Bool[Array, "*runs"]  # whether the record begins in the periodic solution, or else at rest


def moving_samples(run: BenchRun) -> slice:
    """The samples between rest before and rest after the motion."""
    if run not in _moving:
        _moving[run] = slice(0, len(run)) if run.of_points else moving_part(run)
    return _moving[run]


def rest_window(run: BenchRun) -> int:
    """Samples at the beginning of rest before the motion, whose mean force tells the states of the law there."""
    return int(min(REST_WINDOW * run.sampling_rate, SHARE_OF_REST * moving_samples(run).start))


def is_periodic(run: BenchRun) -> bool:
    """Whether the stroke of a whole record repeats from cycle to cycle."""
    cycle = round(run.sampling_rate / run.frequency)
    if len(run) < LEAST_CYCLES * cycle:
        return False
    change = run.stroke[cycle:] - run.stroke[:-cycle]
    return float(np.sqrt(np.mean(change**2))) < ALIKE * float(np.std(run.stroke))


def start_of(run: BenchRun, initial_state: str) -> str:
    """How a record starts: "rest" also if the record begins at rest, "periodic" only if it is periodic."""
    if initial_state == "estimated":
        return initial_state
    if initial_state == "rest" or moving_samples(run).start > 0:
        return "rest"
    return "periodic" if initial_state == "periodic" and is_periodic(run) else "warm_up"


def starts_in_words(runs: Sequence[BenchRun], initial_state: str) -> str:
    """Which records start otherwise than after a warm-up cycle; empty if none does."""
    if initial_state == "warm_up":
        return ""
    starts = [start_of(run, initial_state) for run in runs]
    words = {
        "rest": "from rest",
        "periodic": "in the periodic solution",
        "warm_up": "after a warm-up cycle",
        "estimated": "with states estimated from their force",
    }
    if len(set(starts)) == 1:
        return f"all records start {words[starts[0]]}"
    names = {kind: [run.name for run, start in zip(runs, starts, strict=True) if start == kind] for kind in words}
    return "; ".join(f"start {words[kind]}: {', '.join(some)}" for kind, some in names.items() if some)


def repeated_motion(run: BenchRun, channels: Sequence[np.ndarray], step: float) -> Callable[[np.ndarray], np.ndarray]:
    """The first cycle of a periodic record, repeated for ever: periodic cubic splines.

    Arguments:
        run: the record.
        channels: stroke and velocity of the record at equal steps.
        step: [s] from one to the next.

    Returns:
        A function from instants [s] after the first of these samples to the channels.
    """
    from scipy.interpolate import CubicSpline  # few fits need it

    period = 1.0 / run.frequency
    count = int(period / step - 0.3) + 1  # samples of the cycle, the last one not too near to its end
    nodes = np.append(np.arange(count) * step, period)
    spline = CubicSpline(nodes, [np.append(values[:count], values[0]) for values in channels], 1, "periodic")
    return lambda times: np.asarray(spline(times))


_Setting: TypeAlias = tuple[AbstractDamper, Cycle]


def _a_cycle_later(state: State, setting: _Setting) -> tuple[State, State]:
    """The states after a cycle, and their largest values on the way."""
    law, cycle = setting

    def step(now: tuple[State, State], ends: tuple[Array, ...]) -> tuple[tuple[State, State], None]:
        x0, v0, x1, v1 = ends
        state = law.advance(x0, v0, x1, v1, now[0], cycle.dt)
        return (state, jnp.maximum(now[1], jnp.abs(state))), None

    ends = (cycle.stroke[:-1], cycle.velocity[:-1], cycle.stroke[1:], cycle.velocity[1:])
    return jax.lax.scan(step, (state, jnp.abs(state)), ends)[0]


def _linearised(state: State, setting: _Setting) -> tuple[State, Float[Array, "state state"], Scalar]:
    """P(s), J and the relative change."""

    def both(state: State) -> tuple[State, tuple[State, State]]:
        later, largest = _a_cycle_later(state, setting)
        return later, (later, largest)

    slopes, (later, largest) = jax.jacfwd(both, has_aux=True)(state)
    scale = jnp.where(largest > 0, largest, 1.0)
    return later, slopes, jnp.max(jnp.abs(later - state) / scale)


class _Before(NamedTuple):
    """What the search for the periodic solution remembers of the states before."""

    otherwise: State  # a cycle after them, if the present ones are further from the periodic solution
    error: Scalar


@final
class _Extrapolation(optx.AbstractFixedPointSolver):
    """From P(s) − s over 2²⁰ cycles; by single cycles where that leads away."""

    atol: float = SETTLED
    rtol: float = 0.0
    norm: Callable[[PyTree], Array] = eqx.field(static=True, default=optx.max_norm)

    def init(
        self, fn: Callable, y: State, args: PyTree, options: dict, f_struct: PyTree, aux_struct: PyTree, tags: frozenset
    ) -> _Before:
        """Nothing is known of the first states."""
        return _Before(y, jnp.full((), jnp.inf, y.dtype))

    def step(
        self, fn: Callable, y: State, args: PyTree, options: dict, state: _Before, tags: frozenset
    ) -> tuple[State, _Before, None]:
        """One extrapolation, or a cycle after the states before if these were better."""
        later, slopes, error = _linearised(y, args)
        worse = ~(error < state.error)
        ahead = y + _sums_of_powers(slopes)[0] @ (later - y)
        ahead = jnp.where(jnp.all(jnp.isfinite(ahead)), ahead, later)
        before = _Before(jnp.where(worse, state.otherwise, later), jnp.where(worse, jnp.inf, error))
        return jnp.where(worse, state.otherwise, ahead), before, None

    def terminate(
        self, fn: Callable, y: State, args: PyTree, options: dict, state: _Before, tags: frozenset
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Where a cycle changes nothing, or cannot be computed."""
        return ~(state.error > self.atol), optx.RESULTS.successful

    def postprocess(
        self,
        fn: Callable,
        y: State,
        aux: PyTree,
        args: PyTree,
        options: dict,
        state: _Before,
        tags: frozenset,
        result: optx.RESULTS,
    ) -> tuple[State, PyTree, dict[str, object]]:
        """As it is."""
        return y, aux, {}


def periodic_state(law: AbstractDamper, cycle: Cycle) -> tuple[State, Scalar]:
    """The states to which a law settles in a motion that repeats a cycle, after infinitely many cycles from rest.

    With the states s, the map P over one cycle and J = ∂P/∂s, the search extrapolates from P(s) − s over 2²⁰ cycles,
    Σ Jᵏ (P(s) − s), which is Newton's method for P(s) = s where states are forgotten, and leaves alone what a law
    conserves. Where that leads away, it goes on by single cycles. The derivatives are those of the implicit function
    theorem, in the same sum: 1 − J, which `optimistix.ImplicitAdjoint` would invert, is singular for such a law.

    Returns:
        The states at the first instant of the cycle, and their change over a cycle relative to their largest values.
    """
    setting, begin = (jax.lax.stop_gradient(law), cycle), law.initial_state()
    first = jax.lax.stop_gradient(begin)
    start = _a_cycle_later(first, setting)[0]
    solution = optx.fixed_point(
        lambda state, setting: _a_cycle_later(state, setting)[0],
        _Extrapolation(),
        start,
        setting,
        max_steps=MOST_ROUNDS,
        adjoint=ImplicitDerivatives(),
        throw=False,
    )
    state = jax.lax.stop_gradient(solution.value)
    _, slopes, error = jax.lax.stop_gradient(_linearised(state, setting))
    sums, last = _sums_of_powers(slopes)
    return state + sums @ (_a_cycle_later(state, (law, cycle))[0] - state) + last @ (begin - first), error


def _sums_of_powers(slopes: Float[Array, "state state"]) -> tuple[Float[Array, "state state"], ...]:
    """Σ Jᵏ over 2²⁰ cycles, and the last power."""
    sums, power = jnp.eye(len(slopes), dtype=slopes.dtype), slopes
    for _ in range(DOUBLINGS):
        sums, power = sums + power @ sums, power @ power
    return sums, power
