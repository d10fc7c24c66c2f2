"""The contract of policies of a controller: each check takes a policy and raises an `AssertionError` if it fails."""

from collections.abc import Callable, Collection
from typing import NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks, roads
from jaxdamp._field_types import check_module
from jaxdamp.control import AbstractPolicy, AbstractVehiclePolicy, Controlled, Signals
from jaxdamp.dampers import Linear, Scheduled
from jaxdamp.parameters import parameters
from jaxdamp.simulation import Ride
from jaxdamp.testing import _declared
from jaxdamp.testing._probes import require, require_equal
from jaxdamp.vehicles import QuarterCar, presets


SIZES = (0.3, 1.0, 3.0, 0.03, 0.5, 0.2, 0.1, 5e-3)  # of all signals, in SI units: what a car has on a rough road
RATES = (1.0, 2.3, 1.7, 0.6, 2.9, 1.3, 2.1, 1.9)  # their frequencies, relative to each other
SAMPLES = 48
PERIOD = 5e-3  # s
DAMPERS = ("front_damper", "rear_damper")
Policy: TypeAlias = AbstractPolicy | AbstractVehiclePolicy
Numbers = Float[Array, " numbers"]


class _Flat(NamedTuple):
    """A policy by its numbers."""

    numbers: Numbers  # all floating ones in a row
    build: Callable[[Numbers], Policy]  # the policy with such numbers


def _flat(policy: Policy) -> _Flat:
    own, static = eqx.partition(policy, eqx.is_inexact_array)
    numbers, build = ravel_pytree(own)
    return _Flat(numbers, lambda numbers: eqx.combine(build(numbers), static))


def _signals(samples: int = SAMPLES) -> Signals:
    """Smooth signals over several samples, which begin at rest."""
    t = 0.15 * np.arange(samples)[None, :]
    waves = np.sin(np.array(RATES)[:, None] * t) * np.array(SIZES)[:, None]
    return Signals(*jnp.asarray(waves, float))


def _start(policy: Policy) -> PyTree:
    """What the policy remembers before the first sample."""
    state = policy.initial_state(DAMPERS) if isinstance(policy, AbstractVehiclePolicy) else policy.initial_state()
    return jax.tree.map(jnp.asarray, state)


def _demand(policy: Policy, seen: Signals, state: PyTree) -> tuple[Array, PyTree]:
    """The demanded force [N], of a policy for all dampers their sum where all have the same signals."""
    if isinstance(policy, AbstractVehiclePolicy):
        forces, state = policy(dict.fromkeys(DAMPERS, seen), state)
        require(set(forces) == set(DAMPERS), f"Forces of {', '.join(DAMPERS)} must be demanded, not of {[*forces]}.")
        return jnp.asarray(forces[DAMPERS[0]] + forces[DAMPERS[1]]), state
    force, state = policy(seen, state)
    return jnp.asarray(force), state


def _demands(policy: Policy, signals: Signals) -> Float[Array, " samples"]:
    """The demanded force [N] at each of several samples, one after the other."""

    def step(state: PyTree, seen: Signals) -> tuple[PyTree, Array]:
        force, state = _demand(policy, seen, state)
        return state, force

    policy = policy.sampled(PERIOD)
    return jax.lax.scan(step, _start(policy), signals)[1]


@eqx.filter_jit
def _answers(policy: Policy, signals: Signals) -> tuple[Array, Array, Signals]:
    """Demands, and their derivatives by each number of the policy and by the signals at the same sample."""
    flat = _flat(policy)
    slopes = jax.jacfwd(lambda numbers: _demands(flat.build(numbers), signals))(flat.numbers)
    return _demands(policy, signals), slopes, jax.grad(lambda seen: jnp.sum(_demands(policy, seen)))(signals)


def check_shapes(policy: Policy) -> None:
    """One number is demanded, and the state keeps its structure from sample to sample."""
    sampled = policy.sampled(PERIOD)
    state, seen = _start(sampled), Signals(*map(jnp.asarray, SIZES))
    force, after = eqx.filter_eval_shape(_demand, sampled, seen, state)
    require(jnp.shape(force) == (), f"The demanded force must be one number, but is of shape {jnp.shape(force)}.")
    require(jnp.result_type(force) == jnp.result_type(float), f"The demanded force is {jnp.result_type(force)}.")
    trees = jax.tree.structure(state), jax.tree.structure(after)
    require(trees[0] == trees[1], f"`initial_state` is {trees[0]}, but a sample makes it {trees[1]}.")
    for old, new in zip(jax.tree.leaves(state), jax.tree.leaves(after), strict=True):
        kinds = [(jnp.shape(one), jnp.result_type(one)) for one in (old, new)]
        require(kinds[0] == kinds[1], f"A number of `initial_state` is {kinds[0]}, but a sample makes it {kinds[1]}.")


def check_declared(policy: Policy) -> None:
    """Parameters have units, meanings and enforced domains, and the policy prints as one line; networks have none."""
    if parameters(policy):
        _declared.check_parameters(policy)
    text = repr(policy)
    require(text.startswith(f"{type(policy).__name__}("), f"It must print with its class, not as {text}")


def check_finite(policy: Policy) -> None:
    """Demands and derivatives are finite at rest, for tiny signals and for large ones."""
    for size in (0.0, 1e-12, 1.0, 1e3):
        answers = _answers(policy, Signals(*(size * y for y in _signals())))
        for name, part in zip(("Demands", "Derivatives in numbers", "Derivatives in signals"), answers, strict=True):
            good = all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(part))
            remedy = "Look for a division, a root or a power at zero, or a `where` around an infinite slope."
            require(good, f"{name} are not finite for signals of {size:g} times their usual size. {remedy}")


def check_compiled(policy: Policy) -> None:
    """Compiled and plain calls demand the same forces."""
    sampled, signals = policy.sampled(PERIOD), _signals(6)
    state = _start(sampled)
    expected, plain = np.asarray(_answers(policy, signals)[0]), []
    for number in range(6):
        force, state = _demand(sampled, Signals(*(y[number] for y in signals)), state)
        plain.append(float(force))
    message = "Compiled and plain calls must agree: look for Python's `if` and `float`, and for states kept elsewhere."
    require_equal(plain, expected, message, atol=1e-12 * _largest(expected))


def check_derivatives(policy: Policy) -> None:
    """Forward mode, reverse mode and central differences of the demands agree in numbers and signals."""
    flat, signals = _flat(policy), _signals()
    demands, slopes = map(np.asarray, _answers(policy, signals)[:2])
    numbers, size = np.asarray(flat.numbers), _largest(demands)
    scale = np.where(
        numbers != 0.0, np.abs(numbers), size / np.maximum(np.max(np.abs(slopes), axis=0, initial=0.0), 1e-300)
    )
    way = (
        jnp.asarray(scale * np.cos(np.arange(numbers.size))),
        Signals(*(y * np.cos(k + np.arange(SAMPLES)) for k, y in enumerate(signals))),
    )
    weights = jnp.asarray(np.cos(np.arange(SAMPLES) + 0.5), float)

    @jax.jit
    def derived(point: tuple[Numbers, Signals]) -> tuple[Array, Array, tuple[Numbers, Signals]]:
        def of(point: tuple[Numbers, Signals]) -> Array:
            return _demands(flat.build(point[0]), point[1])

        value, pull = jax.vjp(of, point)
        return value, jax.jvp(of, (point,), (way,))[1], pull(weights)[0]

    at = (flat.numbers, signals)
    along, back = derived(at)[1:]
    along = np.asarray(along)
    backward = sum(float(jnp.vdot(a, b)) for a, b in zip(jax.tree.leaves(back), jax.tree.leaves(way), strict=True))
    message = "Forward and reverse derivatives must agree."
    require_equal(backward, along @ np.asarray(weights), message, rtol=1e-8, atol=1e-9 * size)
    ends = (derived(jax.tree.map(lambda a, b, s=sign: a + s * 1e-5 * b, at, way))[0] for sign in (1.0, -1.0))
    up, down = map(np.asarray, ends)
    message = "Derivatives and differences must agree, sample by sample: demands must be smooth."
    require_equal(along, (up - down) / 2e-5, message, rtol=1e-5, atol=1e-6 * size)


def check_batched(policy: Policy) -> None:
    """A batch over numbers of the policy equals a loop."""
    flat, signals = _flat(policy), _signals()
    rows = np.asarray(flat.numbers) * np.array([1.0, 1.03, 0.96])[:, None]
    together = np.asarray(jax.jit(jax.vmap(lambda row: _demands(flat.build(row), signals)))(jnp.asarray(rows)))
    for row, expected in zip(rows, together, strict=True):
        alone = _answers(flat.build(jnp.asarray(row)), signals)[0]
        require_equal(alone, expected, "A batch must demand as each alone.", atol=1e-12 * _largest(expected))


def check_single_precision(policy: Policy) -> None:
    """In single precision demands are those of double precision to 1e-4 of the largest."""
    expected = np.asarray(_answers(policy, _signals())[0])
    with jax.enable_x64(False):
        single = jax.tree.map(lambda y: jnp.asarray(np.asarray(y)) if eqx.is_array(y) else y, policy)
        demands = eqx.filter_jit(_demands)(single, _signals())
        require(demands.dtype == jnp.float32, f"Demands are {demands.dtype} where all numbers are of single precision.")
    message = "In single precision demands must be the same."
    require_equal(demands, expected, message, atol=1e-4 * _largest(expected))


def check_driven(policy: Policy) -> None:
    """A controlled car drives, with finite metrics and derivatives in the numbers of the policy."""
    damper = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.2)
    together = isinstance(policy, AbstractVehiclePolicy)
    passive = presets.half_car_002(damper) if together else QuarterCar(400.0, 50.0, 20e3, 250e3, damper)
    car = Controlled(passive, policy, period=PERIOD, delay=2e-3)
    bump = roads.cosine_bump(0.05, start=0.2, length=1.6, speed=10.0)
    ride, flat = Ride(car, bump, metrics=["rms_sprung_acceleration"], duration=0.4), _flat(policy)

    def value(numbers: Numbers) -> Array:
        other = eqx.tree_at(lambda ride: ride.vehicle.policy, ride, flat.build(numbers))
        return other()["rms_sprung_acceleration"]

    slope = np.asarray(jax.jit(lambda at: jax.jvp(value, (at,), (at,)))(flat.numbers))
    require(np.all(np.isfinite(slope)) and slope[0] > 0.0, f"In a car RMS acceleration and derivative are {slope}.")


def _largest(demands: np.ndarray) -> float:
    return float(np.max(np.abs(demands))) or 1.0


POLICY_CHECKS: dict[str, Callable[[Policy], None]] = {
    "shapes": check_shapes,
    "declared": check_declared,
    "file": _declared.check_file,
    "finite": check_finite,
    "compiled": check_compiled,
    "derivatives": check_derivatives,
    "batched": check_batched,
    "single precision": check_single_precision,
    "driven": check_driven,
}


def check_policy(policy: Policy, *, leave_out: Collection[str] = ()) -> None:
    """Check that a policy satisfies the contract of policies, so that it works wherever those of the library do.

    The names of the checks are:

    - `"shapes"`: it demands one number, and its state keeps its structure from sample to sample.
    - `"declared"`, `"file"`: parameters have a unit, a meaning and a domain that is enforced; written as JSON and read
      again it is the same.
    - `"finite"`: demands and derivatives are finite at rest and for all signals.
    - `"compiled"`, `"batched"`, `"single precision"`: the same demands compiled, in a batch, and in single precision.
    - `"derivatives"`: forward mode, reverse mode and differences agree in all its numbers and in the signals.
    - `"driven"`: a controlled car drives, with finite derivatives.

    Arguments:
        policy: with realistic parameters; of one damper, or of all together, with a front and a rear one.
        leave_out: names of checks that it cannot satisfy by its nature: `["file"]` for one with a network of equinox,
            `["derivatives"]` for one that switches.

    Raises:
        AssertionError: what is wrong, in a sentence that begins with the class and the name of the check.
        ValueError: something that is not a policy, an unknown name of a check.

    >>> from jaxdamp.control import Skyhook
    >>> check_policy(Skyhook(3000.0), leave_out=set(POLICY_CHECKS) - {"shapes", "declared", "file"})
    """
    check_module("policy", policy, (AbstractPolicy, AbstractVehiclePolicy), "check_policy(policy)")
    for name in leave_out:
        _checks.one_of("leave_out", name, POLICY_CHECKS)
    with jax.enable_x64(True):
        policy = jax.tree.map(lambda y: jnp.asarray(np.asarray(y), float) if eqx.is_inexact_array(y) else y, policy)
        for name, check in POLICY_CHECKS.items():
            if name in leave_out:
                continue
            try:
                check(policy)
            except AssertionError as error:
                raise AssertionError(f"{type(policy).__name__} breaks {name!r}: {error}") from error
