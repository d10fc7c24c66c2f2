"""The contract of damper laws: each check takes a law and fails with an `AssertionError` if it breaks its part.

The checks share a few compiled functions whose arguments are the law's numbers, so that laws of one structure are
compiled once.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pint
import pytest
from scipy.integrate import solve_ivp

from jaxdamp.dampers import AbstractDamper
from jaxdamp.export import from_json, to_json
from jaxdamp.parameters import FreeParameters, free_parameters, get, parameters, replace
from jaxdamp.rig import march


LANES = 8
POINTS = 128
SAMPLES = 257
UNITS = pint.UnitRegistry()


# ---- what is compiled, once for each structure of law


def _outputs(law: AbstractDamper, x: jax.Array, v: jax.Array) -> jax.Array:
    """Force with the states of rest, then force and rates after a step of 1 ms from rest to (x, v)."""
    zero, start = jnp.zeros(()), law.initial_state()
    state = law.advance(zero, zero, x, v, start, jnp.asarray(1e-3))
    forces = jnp.stack([law.force(x, v, start), law.force(x, v, state)])
    return jnp.concatenate([forces, law.state_rate(x, v, state)])


@eqx.filter_jit
def _probe(free: FreeParameters, x: jax.Array, v: jax.Array) -> tuple[jax.Array, ...]:
    """The outputs at many (x, v), with their derivatives in the parameters, x and v."""

    def outputs(values: jax.Array, x: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array]:
        found = _outputs(free.build(values), x, v)
        return found, found

    def one(x: jax.Array, v: jax.Array) -> tuple[jax.Array, ...]:
        slopes, found = jax.jacfwd(outputs, argnums=(0, 1, 2), has_aux=True)(free.values, x, v)
        return found, *slopes

    return jax.vmap(one)(x, v)


@eqx.filter_jit
def _batch(free: FreeParameters, values: jax.Array, dt: jax.Array, x: jax.Array, v: jax.Array) -> tuple:
    """Responses of a batch of parameter vectors on the rig, each with its own motion, and their forward derivatives."""

    def response(values: jax.Array, dt: jax.Array, x: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array]:
        force = march(free.build(values), dt, x, v, 1)
        return force, force

    jacobian, force = jax.vmap(jax.jacfwd(response, has_aux=True))(values, dt, x, v)
    return force, jacobian


@eqx.filter_jit
def _single(
    free: FreeParameters, values: jax.Array, dt: jax.Array, x: jax.Array, v: jax.Array, weights: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """One response, and the reverse-mode gradient of its weighted sum."""
    force, pull = jax.vjp(lambda values: march(free.build(values), dt, x, v, 1), values)
    return force, pull(weights)[0]


@eqx.filter_jit
def _rate(law: AbstractDamper, x: jax.Array, v: jax.Array, state: jax.Array) -> jax.Array:
    return law.state_rate(x, v, state)


def _points(free: FreeParameters, x, v) -> list[np.ndarray]:
    """`_probe` for any number of points, in groups of one size."""
    count = max(np.size(x), np.size(v))
    padded = -(-count // POINTS) * POINTS
    x, v = (np.pad(np.broadcast_to(a, (count,)), (0, padded - count)) for a in (x, v))
    groups = [_probe(free, *(jnp.asarray(a[i : i + POINTS]) for a in (x, v))) for i in range(0, padded, POINTS)]
    return [np.concatenate(parts)[:count] for parts in zip(*groups, strict=True)]


def _responses(free: FreeParameters, values, dt, x, v) -> tuple[np.ndarray, np.ndarray]:
    """`_batch` for any number of lanes, in batches of one size; arguments are repeated where they are the same."""
    count = max(np.atleast_2d(values).shape[0], np.size(dt), np.atleast_2d(x).shape[0])
    padded = -(-count // LANES) * LANES

    def lanes(a, shape: tuple[int, ...]) -> np.ndarray:
        whole = np.broadcast_to(a, (count, *shape))
        return np.concatenate([whole, np.repeat(whole[-1:], padded - count, axis=0)])

    arguments = [lanes(values, free.values.shape), lanes(dt, ()), lanes(x, (SAMPLES,)), lanes(v, (SAMPLES,))]
    pieces = [_batch(free, *(jnp.asarray(a[i : i + LANES]) for a in arguments)) for i in range(0, padded, LANES)]
    force, jacobian = (np.concatenate(parts)[:count] for parts in zip(*pieces, strict=True))
    return force, jacobian


def _motion() -> tuple[float, np.ndarray, np.ndarray]:
    """A motion that begins at rest and reaches 0.8 m/s both ways."""
    dt = 5e-4
    t = dt * np.arange(SAMPLES)
    x, v = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for size, frequency in ((0.5, 11.3), (0.3, 31.7)):
        w = 2 * np.pi * frequency
        x, v = x + size / w * (1 - np.cos(w * t)), v + size * np.sin(w * t)
    return dt, x, v


def _random_motions() -> tuple[float, np.ndarray, np.ndarray]:
    """Motions with all frequencies up to 60 Hz, up to 0.8 m/s, that fade in and out."""
    dt, duration = 1e-3, 1e-3 * (SAMPLES - 1)
    t, frequency = dt * np.arange(SAMPLES), np.arange(1, int(60 * duration) + 1) / duration
    window, fade = np.sin(np.pi * t / duration) ** 4, 4 * np.pi / duration * np.cos(np.pi * t / duration)
    fade = fade * np.sin(np.pi * t / duration) ** 3
    w = 2 * np.pi * frequency[:, None]
    phase = np.random.default_rng(5).uniform(0.0, 2 * np.pi, (LANES, frequency.size, 1))
    sines = np.sum(np.sin(w * t + phase) / w, axis=1)
    x, v = window * sines, fade * sines + window * np.sum(np.cos(w * t + phase), axis=1)
    size = 0.8 / np.max(np.abs(v), axis=1, keepdims=True)
    return dt, size * x, size * v


def _knees(law: AbstractDamper) -> np.ndarray:
    """Zero and all velocities among the numbers of a law and of the laws inside, there and divided by motion ratios."""
    found, leaves = [0.0], [law]
    ratios = [float(p.value) for p in parameters(law) if p.path.endswith("ratio")]
    while leaves:
        module = leaves.pop()
        if isinstance(module, tuple):
            leaves += module
        elif isinstance(module, eqx.Module):
            for name, field in type(module).__dataclass_fields__.items():
                declared = field.metadata.get("parameter") or field.metadata.get("setting") or {}
                value = getattr(module, name)
                if declared.get("unit") == "m/s":
                    found += np.ravel(value).tolist()
                leaves.append(value)
    knees = np.array(found)
    return np.unique(np.concatenate([knees, -knees, *(knees / r for r in ratios), *(-knees / r for r in ratios)]))


# ---- the checks


def check_finite(law: AbstractDamper) -> None:
    """Value, slope and derivative in each parameter are finite at rest, at knees, beside them and far away."""
    knees = _knees(law)
    near = [knees, np.nextafter(knees, np.inf), np.nextafter(knees, -np.inf), knees + 1e-9, knees - 1e-9]
    far = np.logspace(-12, 3, 46)
    v = np.concatenate([*near, far, -far])
    for x in (0.0, 0.05):
        names = ("values", "derivatives in parameters", "derivatives in x", "derivatives in v")
        for name, array in zip(names, _points(free_parameters(law), x, v), strict=True):
            bad = v[~np.isfinite(array).reshape(v.size, -1).all(axis=1)]
            assert bad.size == 0, f"{name} are not finite at v = {bad[:5]} m/s, x = {x} m"


def check_passive(law: AbstractDamper) -> None:
    """Neither a steady sine nor a random motion from rest to rest takes energy out of the law."""
    amplitude, frequency = np.array(
        [(0.001, 1.0), (0.001, 25.0), (0.005, 10.0), (0.01, 2.0), (0.01, 12.0), (0.03, 5.0), (0.05, 0.5), (0.05, 3.0)]
    ).T
    dt = 4 / frequency / (SAMPLES - 1)
    phase = 2 * np.pi * 4 * np.arange(SAMPLES) / (SAMPLES - 1)
    x = amplitude[:, None] * np.sin(phase)
    v = (2 * np.pi * frequency * amplitude)[:, None] * np.cos(phase)
    free = free_parameters(law)
    force, _ = _responses(free, free.values, dt, x, v)
    last = slice(-(SAMPLES - 1) // 4, None)
    work = np.sum((force * v)[:, last], axis=1) * dt
    scale = np.max(np.abs(force), axis=1) * amplitude
    assert np.all(work >= -1e-9 * scale), f"work per cycle {work} J"
    dt, x, v = _random_motions()
    force, _ = _responses(free, free.values, dt, x, v)
    power = force * v
    # where a law only stores, the sum over instants is zero to the order of the step
    allowed = 2e-3 * np.sum(np.abs(power), axis=1) * dt
    work = np.sum(power, axis=1) * dt
    assert np.all(work >= -allowed), f"work {work} J of random motions, of which {allowed} J may be the step's"


def check_continuous(law: AbstractDamper) -> None:
    """No jump over v or x: however small an interval, the force over it changes in proportion.

    Every interval of a dense grid is halved again and again, keeping the half over which the force changes more.
    """
    fine = np.concatenate([np.linspace(-3.0, 3.0, 240), _knees(law), np.logspace(-6, -1, 40), -np.logspace(-6, -1, 40)])
    along_v, along_x = np.unique(fine), np.linspace(-0.1, 0.1, 61)
    free = free_parameters(law)
    low = np.concatenate([along_v[:-1], along_x[:-1]])
    high = np.concatenate([along_v[1:], along_x[1:]])
    is_v = np.arange(low.size) < along_v.size - 1

    def force(place: np.ndarray) -> np.ndarray:
        return _points(free, np.where(is_v, 0.0, place), np.where(is_v, place, 0.3))[0][:, :2]

    at_low, at_high = force(low), force(high)
    scale = np.max(np.abs(at_low))
    for _ in range(42):
        middle = 0.5 * (low + high)
        here = force(middle)
        first = np.max(np.abs(here - at_low), axis=1) > np.max(np.abs(at_high - here), axis=1)
        low, at_low = np.where(first, low, middle), np.where(first[:, None], at_low, here)
        high, at_high = np.where(first, middle, high), np.where(first[:, None], here, at_high)
    jump = np.max(np.abs(at_high - at_low), axis=1)
    worst = int(np.argmax(jump))
    assert jump[worst] <= 1e-6 * scale, f"jump of {jump[worst]} N at {'v' if is_v[worst] else 'x'} = {low[worst]}"


def check_rest(law: AbstractDamper) -> None:
    """No force at rest, and rest lasts."""
    state = law.initial_state()
    found = _points(free_parameters(law), 0.0, 0.0)[0]
    assert np.all(np.abs(found) <= 1e-9), f"forces and rates at rest {found}"
    free = free_parameters(law)
    force, _ = _responses(free, free.values, 1e-3, np.zeros(SAMPLES), np.zeros(SAMPLES))
    assert np.all(np.abs(force) <= 1e-9), f"force {force[0, -1]} N after a rest, states {state}"


def check_compiled(law: AbstractDamper) -> None:
    """Compiled and plain calls agree."""
    x, v = jnp.asarray(0.003), jnp.asarray(-0.21)
    compiled = _points(free_parameters(law), x, v)[0][0]
    np.testing.assert_allclose(_outputs(law, x, v), compiled, rtol=1e-9, atol=1e-9)


def check_batched(law: AbstractDamper) -> None:
    """A batch over parameters equals a loop."""
    free, (dt, x, v) = free_parameters(law), _motion()
    values = np.asarray(free.values) * np.array([1.0, 1.03, 0.96])[:, None]
    force, _ = _responses(free, values, dt, x, v)
    for row, expected in zip(values, force, strict=True):
        single, _ = _single(free, jnp.asarray(row), jnp.asarray(dt), jnp.asarray(x), jnp.asarray(v), jnp.ones(SAMPLES))
        np.testing.assert_allclose(single, expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))


def check_derivatives(law: AbstractDamper) -> None:
    """Forward mode, reverse mode and central differences of the response agree in every parameter."""
    free, (dt, x, v) = free_parameters(law), _motion()
    values = np.asarray(free.values)
    weights = np.cos(np.arange(SAMPLES))
    force, jacobian = (a[0] for a in _responses(free, values, dt, x, v))
    _, reverse = _single(free, free.values, jnp.asarray(dt), jnp.asarray(x), jnp.asarray(v), jnp.asarray(weights))
    size = np.max(np.abs(force))
    effect = np.maximum(np.max(np.abs(jacobian), axis=0), 1e-300)
    scale = np.where(values != 0.0, np.abs(values), size / effect)
    expected = weights @ jacobian * scale
    np.testing.assert_allclose(reverse * scale, expected, rtol=1e-8, atol=1e-8 * size)
    steps = np.diag(1e-5 * scale)
    moved, _ = _responses(free, np.concatenate([values + steps, values - steps]), dt, x, v)
    up, down = np.split(moved, 2)
    difference = (up - down).T / 2e-5
    np.testing.assert_allclose(jacobian * scale, difference, rtol=1e-4, atol=2e-6 * size)


def check_advance(law: AbstractDamper) -> None:
    """The law's own step converges with second order to its rates integrated by an independent solver."""
    if law.initial_state().size == 0:
        return
    free, frequency, peak = free_parameters(law), 9.0, 0.4
    w = 2 * np.pi * frequency
    dt = np.array([5e-4, 2.5e-4, 1.25e-4])
    t = dt[:, None] * np.arange(SAMPLES)
    x, v = peak / w * (1 - np.cos(w * t)), peak * np.sin(w * t)
    force, _ = _responses(free, free.values, dt, x, v)
    common = [force[i, : 64 * 2**i + 1 : 2**i] for i in range(3)]

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        now = jnp.asarray(peak / w * (1 - np.cos(w * t))), jnp.asarray(peak * np.sin(w * t))
        return np.asarray(_rate(law, *now, jnp.asarray(state)))

    start, t = np.asarray(law.initial_state()), t[0, :65]
    size = np.max(np.abs(common[2]))
    exact = solve_ivp(rate, (0.0, t[-1]), start, "LSODA", t, rtol=1e-10, atol=1e-13)
    assert exact.success, exact.message
    places = zip(x[0, :65], v[0, :65], exact.y.T, strict=True)
    expected = np.array([law.force(jnp.asarray(a), jnp.asarray(b), jnp.asarray(s)) for a, b, s in places])
    errors = [np.max(np.abs(c - expected)) / size for c in common]
    assert errors[0] < 0.02, f"errors {errors} at 0.5 ms and halves"
    assert errors[2] < max(errors[0] / 8, 1e-7), f"errors {errors} at 0.5 ms and halves fall too slowly"


def check_shapes(law: AbstractDamper) -> None:
    """Shapes and types of all methods."""
    zero = jnp.zeros(())
    state = eqx.filter_eval_shape(law.initial_state)
    force = eqx.filter_eval_shape(law.force, zero, zero, state)
    rate = eqx.filter_eval_shape(law.state_rate, zero, zero, state)
    after = eqx.filter_eval_shape(law.advance, zero, zero, zero, zero, state, zero)
    assert state.ndim == 1
    assert force.shape == ()
    assert rate.shape == after.shape == state.shape
    assert {a.dtype for a in (state, force, rate, after)} == {jnp.dtype("float64")}


def check_refusals(law: AbstractDamper) -> None:
    """Several velocities at once and states of the wrong length are refused by name."""
    state, zero, dt = law.initial_state(), jnp.zeros(()), jnp.asarray(1e-3)
    refusal = (ValueError, TypeError, jaxtyping.TypeCheckError)
    for method in (law.force, law.state_rate):
        with pytest.raises(refusal, match=r"`v`|'v'"):
            method(zero, jnp.zeros(3), state)
    wrong = [jnp.zeros(size) for size in (state.size - 1, state.size + 1) if size >= 0]
    for states in wrong:
        with pytest.raises(refusal, match=r"`state`|'state'"):
            law.state_rate(zero, zero, states)
        with pytest.raises(refusal, match=r"`state`|'state'"):
            law.advance(zero, zero, zero, zero, states, dt)


def check_parameter_table(law: AbstractDamper) -> None:
    """Each parameter has a unit that can be read, a meaning and a domain that is enforced."""
    table = parameters(law)
    assert table, "a law without parameters"
    for p in table:
        assert p.meaning.strip() and "\n" not in p.meaning, p.path
        UNITS.parse_units(p.unit)
        assert np.all(np.isfinite(p.value)) and p.domain.contains(np.asarray(p.value)), p.path
        if p.value.size == 0:
            continue
        parent, _, name = p.path.rpartition(".")
        owner = type(get(law, parent)).__name__
        with pytest.raises(ValueError, match=rf"`{owner}\.{name}` must be finite.*nan"):
            replace(law, {p.path: p.value.at[...].set(jnp.nan)})
        if p.domain.lower == 0.0:
            with pytest.raises(ValueError, match=rf"`{owner}\.{name}` must be .*-"):
                replace(law, {p.path: -1.0 - p.value})


def check_repr(law: AbstractDamper) -> None:
    """The law prints as one line with its class and its numbers."""
    text = repr(law)
    assert text.startswith(f"{type(law).__name__}(") and "\n" not in text
    for p in parameters(law):
        assert f"{p.path.rpartition('.')[2]}={np.asarray(p.value).tolist()!r}" in text, (p.path, text)


def check_round_trip(law: AbstractDamper) -> None:
    """Written and read again, the law is the same bit for bit."""
    text = to_json(law)
    again = from_json(text)
    assert jax.tree.structure(again) == jax.tree.structure(law)
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(law), strict=True):
        assert a.dtype == b.dtype and np.asarray(a).tobytes() == np.asarray(b).tobytes()
    assert to_json(again) == text


def check_single_precision(law: AbstractDamper) -> None:
    """In single precision the response is that of double precision to 3e-5 of the peak force."""
    dt, x, v = _motion()
    free = free_parameters(law)
    force = _responses(free, free.values, dt, x, v)[0][0]
    with jax.enable_x64(False):
        half = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf), jnp.float32), law)
        dt, x, v = (jnp.asarray(a, jnp.float32) for a in (dt, x, v))
        single = march(half, dt, x, v, 1)
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(np.asarray(single, dtype=float), force, atol=3e-5 * np.max(np.abs(force)))


CHECKS = {name: check for name, check in globals().items() if name.startswith("check_")}
