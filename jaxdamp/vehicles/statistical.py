"""Statistical (equivalent) linearisation: the linear laws nearest to those of a vehicle in its random motion.

On a road whose rate is Gaussian white noise, deflection x, rate v and states s of each law are taken as normally
distributed, and force and state rates y(x, v, s) are replaced by ȳ + J (z − z̄), z = (v, x, s), with the least mean
square error: ȳ = E[y], J = E[y (z − z̄)ᵀ] P⁻¹. For a law of the velocity alone J = E[v F]/σ². Means and covariance P are
those of the vehicle with these linear laws, a fixed point.

Sources: Roberts and Spanos, Random Vibration and Statistical Linearization (1990); for hysteresis Wen, Journal of
Applied Mechanics 47 (1980).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float, PyTree

from jaxdamp._limits import at_least, within
from jaxdamp._matrices import solve
from jaxdamp._traced import depends
from jaxdamp._types import Scalar, State
from jaxdamp.dampers import AbstractDamper
from jaxdamp.vehicles.equilibrium import rest_position
from jaxdamp.vehicles.gaussian import channel_covariance, gaussian_points
from jaxdamp.vehicles.port_form import Ports
from jaxdamp.vehicles.system import LinearLaws, System, motions_of, with_linear_laws


BODY, WHEEL = 1.5, 10.0  # Hz, of a vehicle, to start the search from
MOST_STEPS = 60
LONGEST_STEP = 0.5  # of the search, in logarithms of standard deviations
_SMALLEST = 1e-6  # of the first standard deviation
_STRAIGHT = 1.0 - 1e-6  # largest correlation
_NARROWEST = 1e-6  # squared: least share of a variance that the variables before it do not explain


class Spread(NamedTuple):
    """Distribution of the variables of each law of one kind in which it is not linear.

    Attributes:
        log_deviation: logarithm of the standard deviations, shape (laws, variables).
        tilt: artanh of the correlation of each variable with those before it, shape (laws, pairs).
        mean: arsinh of its multiple of the first standard deviation, as it can be a hundred times as large (the heat of
            a damper), shape (laws, variables).
    """

    log_deviation: Float[Array, "laws variables"]
    tilt: Float[Array, "laws pairs"]
    mean: Float[Array, "laws variables"]


class _Kind(NamedTuple):
    """Laws that differ in their numbers only."""

    law: AbstractDamper  # stacked if there are several
    curved: tuple[int, ...]  # the variables among (v, x, s) in which they are not linear
    motions: np.ndarray  # of each law, the places of (v, x, s) among all motions
    answers: np.ndarray  # of each law, the places of (f, ṡ) among all answers
    scale: Float[Array, "laws variables"]  # first standard deviations


def statistical_laws(
    system: System,
    velocity_psd: Scalar,
    delays: Float[Array, " wheels"],
    on_road: Sequence[bool],
    lifts: Sequence[bool],
) -> tuple[LinearLaws, Scalar]:
    """The linear laws, and whether they were found: one, or zero.

    Differentiable: derivatives are those of the fixed point (implicit function theorem), first and second.

    Arguments:
        system: the vehicle.
        velocity_psd: of the road, two-sided [(m/s)²/Hz].
        delays: of each wheel behind the first [s].
        on_road: whether each port is between a wheel and the road, where the rate contains the white noise.
        lifts: whether it is the lift-off of a tyre: linear in its rate.
    """
    arrays, static = eqx.partition((system, velocity_psd, delays), eqx.is_array)
    parts = [_side_by_side(law) for law in system.laws]
    owners = tuple(port for port, laws in enumerate(parts) for _ in laws)
    laws = [law for of_port in parts for law in of_port]
    curved = [_curved(law, port, on_road[port], lifts[port]) for law, port in zip(laws, owners, strict=True)]

    def settings(arrays: PyTree) -> tuple[System, list[_Kind], Scalar, Array]:
        system, psd, delays = eqx.combine(arrays, static)
        return system, _kinds([law for law in system.laws for law in _side_by_side(law)], curved, psd), psd, delays

    kinds = settings(arrays)[1]
    begun = _first(system, kinds, owners)
    if not any(kind.curved for kind in kinds):
        return _nearest(kinds, begun, owners), jnp.ones(())
    start, unravel = jax.flatten_util.ravel_pytree(begun)

    def again(y: Array, arrays: object) -> Array:
        """The distributions of the vehicle with the laws nearest to given ones."""
        system, kinds, psd, delays = settings(arrays)
        spreads = _distributions(system, kinds, _nearest(kinds, unravel(y), owners), psd, delays)
        return jax.flatten_util.ravel_pytree(spreads)[0]

    solution, converged = _fixed_point(again, jax.lax.stop_gradient(start), arrays)
    return _nearest(kinds, unravel(solution), owners), converged


def _curved(law: AbstractDamper, port: int, on_road: bool, lifts: bool) -> tuple[int, ...]:
    """Numbers of the variables in which a law is curved; not the rate of a tyre that contains the white noise."""
    curved = nonlinear_variables(law)
    if not on_road or curved[:1] != (0,):
        return curved
    if not lifts:
        raise NoiseAtLaw(port)
    return curved[1:]


class NoiseAtLaw(Exception):
    """A law that is not linear in a rate that contains white noise, at this port."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        self.port = port


def nonlinear_variables(law: AbstractDamper) -> tuple[int, ...]:
    """The variables among (v, x, s…), by number, in which force and state rates are not linear with constant slopes.

    Arguments:
        law: the damper law.
    """
    count = 2 + law.initial_state().size
    still = [jnp.zeros(()) for _ in range(count)]

    def slope(number: int) -> PyTree:
        def along(values: list[Scalar]) -> Array:
            def one(value: Scalar) -> Array:
                return _answers(law, [*values[:number], value, *values[number + 1 :]])

            return jax.jvp(one, (values[number],), (jnp.ones_like(values[number]),))[1]

        return along

    return tuple(number for number in range(count) if depends(slope(number), still))


def _answers(law: AbstractDamper, values: Sequence[Scalar]) -> Float[Array, " answers"]:
    """(f, ṡ) at (v, x, s)."""
    v, x, *states = values
    state = jnp.stack(states) if states else jnp.zeros(0)
    return jnp.concatenate([jnp.reshape(law.force(x, v, state), 1), law.state_rate(x, v, state)])


def _side_by_side(law: AbstractDamper) -> tuple[AbstractDamper, ...]:
    """The terms of a sum: the linear law nearest to a sum is the sum of those nearest to its terms."""
    terms = law.side_by_side()
    together = sum(term.initial_state().size for term in terms)
    return terms if together == law.initial_state().size else (law,)


def _kinds(laws: Sequence[AbstractDamper], curved: Sequence[tuple[int, ...]], psd: Scalar) -> list[_Kind]:
    ports, kinds, begun = Ports(laws), [], 0
    fast = jnp.sqrt(psd * 2.0 * jnp.pi * WHEEL)
    for law, members in zip(ports.laws, ports.members, strict=True):
        count = laws[members[0]].initial_state().size
        inner = begun + np.arange(len(members) * count).reshape(len(members), count)
        begun += inner.size
        members_column = np.array(members)[:, None]
        motions = np.concatenate([len(laws) + members_column, members_column, 2 * len(laws) + inner], axis=1)
        answers = np.concatenate([members_column, len(laws) + inner], axis=1)
        scale = _scales(law, len(members), curved[members[0]], fast)
        kinds.append(_Kind(law, curved[members[0]], motions, answers, scale))
    return kinds


def _each(function: Callable[..., PyTree], law: AbstractDamper, count: int, *rows: PyTree) -> PyTree:
    """The function of each law, with its row of each array."""
    if count == 1:
        return jax.tree.map(lambda leaf: leaf[None], function(law, *jax.tree.map(lambda leaf: leaf[0], rows)))
    arrays, static = eqx.partition(law, eqx.is_array)
    return jax.vmap(lambda arrays, *rows: function(eqx.combine(arrays, static), *rows))(arrays, *rows)


def _scales(law: AbstractDamper, count: int, curved: tuple[int, ...], fast: Scalar) -> Float[Array, "laws variables"]:
    """Typical size of each variable: that of a state after a stroke at constant velocity."""

    def of_one(law: AbstractDamper, fast: Scalar) -> Array:
        duration = 1.0 / (2.0 * jnp.pi * BODY)
        state = law.initial_state()
        if state.size and max(curved, default=0) > 1:
            dt = duration / 64

            def move(i: Array, state: State) -> State:
                return law.advance(i * dt * fast, fast, (i + 1) * dt * fast, fast, state, dt)

            moved = jnp.abs(jax.lax.fori_loop(0, 64, move, state) - state)
            state = jnp.where(jnp.isfinite(moved), moved, 0.0)
        sizes = jnp.concatenate([jnp.stack([fast, fast * duration]), 0.7 * state])
        return jax.lax.stop_gradient(at_least(sizes[np.array(curved, dtype=int)], 1e-9))

    return _each(of_one, law, count, jnp.broadcast_to(fast, (count,)))


def _first(system: System, kinds: Sequence[_Kind], owners: Sequence[int]) -> list[Spread]:
    """Where the search begins: with the vehicle at rest and no correlations."""
    at_rest = rest_position(system, jnp.zeros(system.form.road_stiffness.shape[1]))
    at_rest = jnp.where(jnp.isfinite(at_rest), at_rest, 0.0)
    states = sum(kind.answers.shape[1] - 1 for kind in kinds for _ in kind.answers)
    place = jnp.concatenate([at_rest, jnp.zeros(at_rest.size + states)])
    means = motions_of(system, owners, states).state @ place
    pairs = [len(kind.curved) * (len(kind.curved) - 1) // 2 for kind in kinds]
    return [
        Spread(jnp.log(kind.scale), jnp.zeros((len(kind.scale), count)), jnp.arcsinh(means[_chosen(kind)] / kind.scale))
        for kind, count in zip(kinds, pairs, strict=True)
    ]


def _chosen(kind: _Kind) -> np.ndarray:
    return kind.motions[:, np.array(kind.curved, dtype=int)]


def _nearest(kinds: Sequence[_Kind], spreads: Sequence[Spread], owners: tuple[int, ...]) -> LinearLaws:
    """The linear laws with the least mean square error for these distributions."""
    answers = sum(kind.answers.size for kind in kinds)
    constant, slopes = jnp.zeros(answers), jnp.zeros((answers, answers + len(owners)))
    for kind, spread in zip(kinds, spreads, strict=True):

        def of_one(
            law: AbstractDamper, spread: Spread, scale: Array, curved: tuple[int, ...] = kind.curved
        ) -> tuple[Array, Array]:
            return _nearest_of_one(law, curved, spread, scale)

        constants, own_slopes = _each(of_one, kind.law, len(kind.answers), spread, kind.scale)
        rows, columns = (
            np.eye(answers, dtype=constants.dtype)[kind.answers],
            np.eye(slopes.shape[1], dtype=constants.dtype)[kind.motions],
        )
        constant += jnp.tensordot(constants, rows, 2)
        slopes += jnp.tensordot(jnp.swapaxes(own_slopes @ columns, 1, 2), rows, ((0, 2), (0, 1))).T
    return LinearLaws(constant, slopes, owners)


def _nearest_of_one(
    law: AbstractDamper, curved: tuple[int, ...], spread: Spread, scale: Float[Array, " variables"]
) -> tuple[Array, Array]:
    """Constant and slopes by (v, x, s) of one law: E[y tᵀ] L⁻¹ for z = z̄ + L t with uncorrelated t of variance one."""
    count, places = 2 + law.initial_state().size, np.array(curved, dtype=int)
    mean = jnp.sinh(spread.mean) * scale
    placing = np.eye(count, dtype=mean.dtype)[:, places]

    def at(curved_values: Array) -> Array:
        return jnp.asarray(placing) @ curved_values

    def answers(values: Array) -> Array:
        return _answers(law, list(values))

    slopes = jax.jacfwd(answers)(at(mean))  # in the other variables they are the same everywhere
    if not curved:
        return answers(at(mean)), slopes
    points, weights = (jnp.asarray(part, mean.dtype) for part in gaussian_points(len(curved)))
    lower = jnp.exp(spread.log_deviation)[:, None] * _triangle(jnp.tanh(spread.tilt), len(curved))
    values = jax.vmap(lambda t: answers(at(mean + lower @ t)))(points)
    average = weights @ values
    secant = ((values - average[None]) * weights[:, None]).T @ points
    own = solve(lower.T, secant.T).T
    return average - own @ mean, jnp.where(placing.any(axis=1), own @ placing.T, slopes)


def _triangle(correlation: Float[Array, " pairs"], size: int) -> Float[Array, "size size"]:
    """The lower triangle L with L Lᵀ = the matrix of these correlations, or the nearest that is regular."""
    rows: list[list[Array]] = []
    pairs = iter(range(correlation.size))
    for i in range(size):
        row: list[Array] = []
        for j in range(i):
            projected = sum((row[k] * rows[j][k] for k in range(j)), jnp.zeros_like(correlation[0]))
            row.append((correlation[next(pairs)] - projected) / rows[j][j])
        left = 1.0 - sum((value * value for value in row), jnp.zeros(()))
        rows.append([*row, jnp.sqrt(at_least(left, _NARROWEST))])
    none = jnp.zeros(())
    return jnp.stack([jnp.stack([*row, *[none] * (size - len(row))]) for row in rows])


def _distributions(
    system: System, kinds: Sequence[_Kind], laws: LinearLaws, psd: Scalar, delays: Float[Array, " wheels"]
) -> list[Spread]:
    """How the variables of each kind are distributed in the vehicle with linear laws."""
    linear = with_linear_laws(system, laws)
    moved = motions_of(system, laws.ports, laws.constant.size - len(laws.ports))
    settled = -solve(linear.a, jnp.concatenate([linear.b, linear.constant[:, None]], axis=1))
    settled, rest = settled[:, :-1], settled[:, -1]
    static = moved.state @ settled + moved.road
    covariance = psd * channel_covariance(linear.a, moved.state, linear.e - settled, static, delays)[0]
    means, spreads = moved.state @ rest, []
    for kind in kinds:
        chosen, size = _chosen(kind), len(kind.curved)
        covariances = covariance[chosen[:, :, None], chosen[:, None, :]]
        variance = jnp.diagonal(covariances, axis1=1, axis2=2) + (_SMALLEST * kind.scale) ** 2
        log_deviation = 0.5 * jnp.log(at_least(variance, (_SMALLEST * kind.scale) ** 2))
        deviation = jnp.exp(log_deviation)
        row, column = np.tril_indices(size, -1)
        correlation = covariances[:, row, column] / (deviation[:, row] * deviation[:, column])
        tilt = jnp.arctanh(within(correlation, -_STRAIGHT, _STRAIGHT))
        spreads.append(Spread(log_deviation, tilt, jnp.arcsinh(means[chosen] / kind.scale)))
    return spreads


def _fixed_point(function: Callable[[Array, PyTree], Array], start: Array, arguments: object) -> tuple[Array, Scalar]:
    """The solution of y = function(y, arguments) by Newton's method with limited steps, and whether it was found.

    Derivatives by the arguments follow from the implicit function theorem, of any order and in both modes.
    """
    differentiable, static = eqx.partition(arguments, eqx.is_inexact_array)

    def slope(y: Array, differentiable: object) -> tuple[Array, Array]:
        """1 − ∂function/∂y, and what is missing."""

        def at(y: Array) -> tuple[Array, Array]:
            value = function(y, eqx.combine(differentiable, static))
            return value, value

        slopes, value = jax.jacfwd(at, has_aux=True)(y)
        return jnp.eye(y.size, dtype=y.dtype) - slopes, value - y

    def step(y: Array, differentiable: object) -> Array:
        return y + within(solve(*slope(y, differentiable)), -LONGEST_STEP, LONGEST_STEP)

    @jax.custom_jvp
    def solution(start: Array, differentiable: object) -> tuple[Array, Scalar]:
        accuracy = 1e-4 if start.dtype == jnp.float32 else 1e-9
        solver = optx.FixedPointIteration(rtol=accuracy, atol=accuracy)
        result = optx.fixed_point(step, solver, start, differentiable, max_steps=MOST_STEPS, throw=False)
        return result.value, jnp.where(result.result == optx.RESULTS.successful, 1.0, 0.0).astype(start.dtype)

    def rule(
        primals: tuple[object, ...], tangents: tuple[object, ...]
    ) -> tuple[tuple[Array, Scalar], tuple[Array, Scalar]]:
        y, converged = solution(*primals)
        (_, now), (_, moved) = primals, tangents
        _, change = jax.jvp(lambda d: function(y, eqx.combine(d, static)), (now,), (moved,))
        return (y, converged), (solve(slope(y, now)[0], change), jnp.zeros_like(converged))

    solution.defjvp(rule)
    return solution(start, differentiable)
