"""The computations of the checks. The compiled functions take the parameters of the law as arguments.

Laws of equal structure are thus compiled once; points and motions are in groups of equal size.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import FreeParameters, parameters
from jaxdamp.rig import march


def require(condition: object, message: str) -> None:
    """Raise an `AssertionError` with the message unless the condition holds."""
    if not condition:
        raise AssertionError(message)


def require_equal(actual: object, expected: object, message: str, *, rtol: float = 0.0, atol: float = 0.0) -> None:
    """Raise an `AssertionError` with the message and the largest difference unless two arrays agree."""
    actual, expected = np.asarray(actual), np.asarray(expected)
    require(actual.shape == expected.shape, f"{message} Their shapes are {actual.shape} and {expected.shape}.")
    excess = np.abs(actual - expected) - rtol * np.abs(expected)
    if actual.size and not np.all(excess <= atol):
        worst = np.unravel_index(int(np.argmax(np.nan_to_num(excess, nan=np.inf))), actual.shape)
        raise AssertionError(f"{message} The largest difference is {actual[worst]!r} against {expected[worst]!r}.")


def require_refusal(
    call: Callable[[], object], words: tuple[str, ...], kinds: tuple[type[Exception], ...], message: str
) -> None:
    """Raise an `AssertionError` with the message unless a call raises one of these errors and names what is wrong."""
    try:
        call()
    except kinds as error:
        text = str(error)
        require(any(word in text for word in words), f"{message} The error does not name it: {text}")
    else:
        raise AssertionError(f"{message} It is accepted.")


LANES = 8
POINTS = 128
SAMPLES = 257


def outputs(law: AbstractDamper, x: Array, v: Array) -> Array:
    """Force with the states of rest, then force and rates after a step of 1 ms from rest to (x, v)."""
    zero, start = jnp.zeros(()), law.initial_state()
    state = law.advance(zero, zero, x, v, start, jnp.asarray(1e-3))
    forces = jnp.stack([law.force(x, v, start), law.force(x, v, state)])
    return jnp.concatenate([forces, law.state_rate(x, v, state)])


@eqx.filter_jit
def _probe(free: FreeParameters, x: Array, v: Array) -> tuple[Array, ...]:
    """The outputs at many (x, v), with their derivatives in the parameters, x and v."""

    def both(values: Array, x: Array, v: Array) -> tuple[Array, Array]:
        results = outputs(free.build(values), x, v)
        return results, results

    def one(x: Array, v: Array) -> tuple[Array, ...]:
        slopes, results = jax.jacfwd(both, argnums=(0, 1, 2), has_aux=True)(free.values, x, v)
        return results, *slopes

    return jax.vmap(one)(x, v)


@eqx.filter_jit
def _batch(free: FreeParameters, values: Array, dt: Array, x: Array, v: Array) -> tuple[Array, Array]:
    """Responses of a batch of parameter vectors on the rig, each with its own motion, and their forward derivatives."""

    def response(values: Array, dt: Array, x: Array, v: Array) -> tuple[Array, Array]:
        force = march(free.build(values), dt, x, v, 1)
        return force, force

    jacobian, force = jax.vmap(jax.jacfwd(response, has_aux=True))(values, dt, x, v)
    return force, jacobian


@eqx.filter_jit
def response_and_gradient(
    free: FreeParameters, values: Array, dt: Array, x: Array, v: Array, weights: Array
) -> tuple[Array, Array]:
    """One response on the rig, and the reverse-mode gradient of its weighted sum."""
    force, pull = jax.vjp(lambda values: march(free.build(values), dt, x, v, 1), values)
    return force, pull(weights)[0]


@eqx.filter_jit
def rates(law: AbstractDamper, x: Array, v: Array, state: Array) -> Array:
    """`law.state_rate`, compiled."""
    return law.state_rate(x, v, state)


@eqx.filter_jit
def predicted_and_advanced(law: AbstractDamper, ends: tuple[Array, ...], state: Array, dt: Array) -> tuple[Array, ...]:
    """`law.predict` and `law.advance`, compiled."""
    x0, v0, x1, v1 = ends
    return law.predict(x0, v0, x1, v1, state, dt), law.advance(x0, v0, x1, v1, state, dt)


def points(free: FreeParameters, x, v) -> list[np.ndarray]:
    """`outputs` and their derivatives in the parameters, x and v, at any number of points."""
    count = max(np.size(x), np.size(v))
    padded = -(-count // POINTS) * POINTS
    x, v = (np.pad(np.broadcast_to(a, (count,)), (0, padded - count)) for a in (x, v))
    starts = range(0, padded, POINTS)
    groups = [_probe(free, jnp.asarray(x[i : i + POINTS]), jnp.asarray(v[i : i + POINTS])) for i in starts]
    return [np.concatenate(group)[:count] for group in zip(*groups, strict=True)]


def responses(free: FreeParameters, values, dt, x, v) -> tuple[np.ndarray, np.ndarray]:
    """Forces on the rig and their derivatives, for any number of lanes; arguments are repeated where they are one."""
    count = max(np.atleast_2d(values).shape[0], np.size(dt), np.atleast_2d(x).shape[0])
    padded = -(-count // LANES) * LANES

    def lanes(a, shape: tuple[int, ...]) -> np.ndarray:
        whole = np.broadcast_to(a, (count, *shape))
        return np.concatenate([whole, np.repeat(whole[-1:], padded - count, axis=0)])

    arguments = [lanes(values, free.values.shape), lanes(dt, ()), lanes(x, (SAMPLES,)), lanes(v, (SAMPLES,))]
    pieces = [_batch(free, *(jnp.asarray(a[i : i + LANES]) for a in arguments)) for i in range(0, padded, LANES)]
    force, jacobian = (np.concatenate(group)[:count] for group in zip(*pieces, strict=True))
    return force, jacobian


def motion() -> tuple[float, np.ndarray, np.ndarray]:
    """Step [s], stroke [m] and velocity [m/s] of a motion that begins at rest and reaches 0.8 m/s both ways."""
    dt = 5e-4
    t = dt * np.arange(SAMPLES)
    x, v = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for size, frequency in ((0.5, 11.3), (0.3, 31.7)):
        w = 2 * np.pi * frequency
        x, v = x + size / w * (1 - np.cos(w * t)), v + size * np.sin(w * t)
    return dt, x, v


def sines() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Steps [s], strokes [m], velocities [m/s] and amplitudes [m] of four cycles each of several sines."""
    amplitude, frequency = np.array(
        [(0.001, 1.0), (0.001, 25.0), (0.005, 10.0), (0.01, 2.0), (0.01, 12.0), (0.03, 5.0), (0.05, 0.5), (0.05, 3.0)]
    ).T
    phase = 2 * np.pi * 4 * np.arange(SAMPLES) / (SAMPLES - 1)
    x, v = amplitude[:, None] * np.sin(phase), (2 * np.pi * frequency * amplitude)[:, None] * np.cos(phase)
    return 4 / frequency / (SAMPLES - 1), x, v, amplitude


def random_motions() -> tuple[float, np.ndarray, np.ndarray]:
    """Step [s], strokes [m] and velocities [m/s] of motions up to 60 Hz and 0.8 m/s that fade in and out."""
    dt, duration = 1e-3, 1e-3 * (SAMPLES - 1)
    t, frequency = dt * np.arange(SAMPLES), np.arange(1, int(60 * duration) + 1) / duration
    window, fade = np.sin(np.pi * t / duration) ** 4, 4 * np.pi / duration * np.cos(np.pi * t / duration)
    fade = fade * np.sin(np.pi * t / duration) ** 3
    w = 2 * np.pi * frequency[:, None]
    phase = np.random.default_rng(5).uniform(0.0, 2 * np.pi, (LANES, frequency.size, 1))
    waves = np.sum(np.sin(w * t + phase) / w, axis=1)
    x, v = window * waves, fade * waves + window * np.sum(np.cos(w * t + phase), axis=1)
    size = 0.8 / np.max(np.abs(v), axis=1, keepdims=True)
    return dt, size * x, size * v


def knees(law: AbstractDamper) -> np.ndarray:
    """Zero and all velocities [m/s] among the numbers of a law and of the laws inside, and divided by motion ratios."""
    places, modules = [0.0], [law]
    ratios = [float(r) for p in parameters(law) if p.path.endswith("ratio") for r in np.ravel(p.value)]
    while modules:
        module = modules.pop()
        if isinstance(module, tuple):
            modules += module
        elif isinstance(module, eqx.Module):
            for name, field in type(module).__dataclass_fields__.items():
                declared = field.metadata.get("parameter") or field.metadata.get("setting") or {}
                value = getattr(module, name)
                if declared.get("unit") == "m/s":
                    places += np.ravel(value).tolist()
                modules.append(value)
    both = np.array([*places, *(-a for a in places)])
    return np.unique(np.concatenate([both, *(both / r for r in ratios)]))
