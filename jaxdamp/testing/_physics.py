"""Checks of the forces, states and derivatives of a law, alone and under a prescribed motion."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp.dampers import AbstractDamper
from jaxdamp.parameters import free_parameters
from jaxdamp.rig import march
from jaxdamp.testing._probes import (
    SAMPLES,
    knees,
    motion,
    outputs,
    points,
    predicted_and_advanced,
    random_motions,
    rates,
    require,
    require_equal,
    response_and_gradient,
    responses,
    sines,
)


def check_finite(law: AbstractDamper) -> None:
    """Value, slope and derivative in each parameter are finite at rest, at knees, beside them and far away."""
    at, far = knees(law), np.logspace(-12, 3, 46)
    v = np.concatenate([at, np.nextafter(at, np.inf), np.nextafter(at, -np.inf), at + 1e-9, at - 1e-9, far, -far])
    for x in (0.0, 0.05):
        names = ("The force is", "Derivatives in parameters are", "Slopes over x are", "Slopes over v are")
        for name, array in zip(names, points(free_parameters(law), x, v), strict=True):
            bad = v[~np.isfinite(array).reshape(v.size, -1).all(axis=1)]
            remedy = "Look for `sign`, a root or power at zero, or a `where` around an infinite slope."
            require(bad.size == 0, f"{name} not finite at v = {bad[:5]} m/s, x = {x} m. {remedy}")


def check_rest(law: AbstractDamper) -> None:
    """No force at rest, and the law stays at rest."""
    free = free_parameters(law)
    at_rest = points(free, 0.0, 0.0)[0]
    require(np.all(np.abs(at_rest) <= 1e-9), f"Forces and rates at rest must be zero, but are {at_rest}.")
    force, _ = responses(free, free.values, 1e-3, np.zeros(SAMPLES), np.zeros(SAMPLES))
    require(np.all(np.abs(force) <= 1e-9), f"The law must stay at rest, but the force becomes {force[0, -1]} N.")


def check_continuous(law: AbstractDamper) -> None:
    """No jump over v or x: however small an interval, the force over it changes in proportion.

    Every interval of a dense grid is halved again and again, keeping the half over which the force changes more.
    """
    small = np.logspace(-6, -1, 40)
    along_v = np.unique(np.concatenate([np.linspace(-3.0, 3.0, 240), knees(law), small, -small]))
    along_x = np.linspace(-0.1, 0.1, 61)
    free = free_parameters(law)
    low, high = (np.concatenate([along_v[part], along_x[part]]) for part in (slice(-1), slice(1, None)))
    is_v = np.arange(low.size) < along_v.size - 1

    def force(place: np.ndarray) -> np.ndarray:
        return points(free, np.where(is_v, 0.0, place), np.where(is_v, place, 0.3))[0][:, :2]

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
    place = f"{'v' if is_v[worst] else 'x'} = {low[worst]:g}"
    require(jump[worst] <= 1e-6 * scale, f"The force jumps by {jump[worst]:g} N at {place}: gradients miss jumps.")


def check_passive(law: AbstractDamper) -> None:
    """Neither a steady sine nor a random motion from rest to rest gains energy from the law."""
    free = free_parameters(law)
    dt, x, v, amplitude = sines()
    force, _ = responses(free, free.values, dt, x, v)
    last = slice(-(SAMPLES - 1) // 4, None)
    work = np.sum((force * v)[:, last], axis=1) * dt
    least = -1e-9 * np.max(np.abs(force), axis=1) * amplitude
    require(np.all(work >= least), f"Sines gain energy from the law: work per cycle {work} J.")
    dt, x, v = random_motions()
    force, _ = responses(free, free.values, dt, x, v)
    power = force * v
    # where a law only stores, the sum over instants is zero to the order of the step
    allowed = 2e-3 * np.sum(np.abs(power), axis=1) * dt
    work = np.sum(power, axis=1) * dt
    message = f"Random motions gain energy from the law: work {work} J, of which {allowed} J may be errors of the step."
    require(np.all(work >= -allowed), message)


def check_compiled(law: AbstractDamper) -> None:
    """Compiled and plain calls agree, and so do their derivatives in the parameters, forward and reverse."""
    free, x, v = free_parameters(law), jnp.asarray(0.003), jnp.asarray(-0.21)
    values, slopes = (a[0] for a in points(free, x, v)[:2])

    def plain(numbers: Array) -> Array:
        return outputs(free.build(numbers), x, v)

    largest = [np.max(np.abs(part), initial=0.0) or 1.0 for part in (values[:2], values[2:])]  # of forces and of rates
    size = np.repeat(largest, [2, values.size - 2])
    message = "Compiled and plain calls must agree: look for Python's `if` and `float` on numbers of the law."
    require_equal(plain(free.values) / size, values / size, message, atol=1e-12)
    # One direction shows each entry: plain derivatives run one operation at a time, which takes long for all of them.
    own = np.asarray(free.values)
    relative, along = slopes / size[:, None], own * np.cos(np.arange(own.size))
    weights = np.cos(np.arange(size.size) + 0.5)
    _, forward = jax.jvp(plain, (free.values,), (jnp.asarray(along),))
    _, pull = jax.vjp(plain, free.values)
    traced = {
        "forward": (forward / size, relative @ along),
        "reverse": (pull(jnp.asarray(weights / size))[0] * own, weights @ relative * own),
    }
    for mode, (plainly, compiled) in traced.items():
        message = f"Plain derivatives in {mode} mode must be those of a compiled batch."
        require_equal(plainly, compiled, message, rtol=1e-9, atol=1e-9)


def check_batched(law: AbstractDamper) -> None:
    """A batch over parameters equals a loop."""
    free, (dt, x, v) = free_parameters(law), motion()
    values = np.asarray(free.values) * np.array([1.0, 1.03, 0.96])[:, None]
    force, _ = responses(free, values, dt, x, v)
    signals = (jnp.asarray(dt), jnp.asarray(x, float), jnp.asarray(v, float), jnp.ones(SAMPLES))
    for row, expected in zip(values, force, strict=True):
        single, _ = response_and_gradient(free, jnp.asarray(row, float), *signals)
        atol = 1e-9 * np.max(np.abs(expected))
        require_equal(single, expected, "A batch of laws must respond as each alone.", rtol=1e-9, atol=atol)


def check_derivatives(law: AbstractDamper) -> None:
    """Forward mode, reverse mode and central differences of the response agree in every parameter."""
    free, (dt, x, v) = free_parameters(law), motion()
    values, weights = np.asarray(free.values), np.cos(np.arange(SAMPLES))
    force, jacobian = (a[0] for a in responses(free, values, dt, x, v))
    signals = (jnp.asarray(dt), *(jnp.asarray(a, float) for a in (x, v, weights)))
    _, reverse = response_and_gradient(free, free.values, *signals)
    size = np.max(np.abs(force))
    effect = np.maximum(np.max(np.abs(jacobian), axis=0), 1e-300)
    scale = np.where(values != 0.0, np.abs(values), size / effect)
    names = f"in the parameters {[p.path for p in free.chosen]}, for changes by their own size"
    message = f"Forward and reverse mode must agree {names}."
    require_equal(reverse * scale, weights @ jacobian * scale, message, rtol=1e-8, atol=1e-8 * size)
    steps = np.diag(1e-5 * scale)
    moved, _ = responses(free, np.concatenate([values + steps, values - steps]), dt, x, v)
    up, down = np.split(moved, 2)
    message = f"Derivatives and differences must agree {names}, one column each."
    require_equal(jacobian * scale, (up - down).T / 2e-5, message, rtol=1e-4, atol=2e-6 * size)


def check_step(law: AbstractDamper) -> None:
    """The law's own step converges with second order to its rates integrated by an independent solver.

    In the states of `state_at_rest`, in which vehicles start, nothing moves.
    """
    if law.initial_state().size == 0:
        return
    _check_states_at_rest(law)
    from scipy.integrate import solve_ivp

    free, frequency, peak = free_parameters(law), 9.0, 0.4
    w = 2 * np.pi * frequency
    dt = np.array([5e-4, 2.5e-4, 1.25e-4])
    t = dt[:, None] * np.arange(SAMPLES)
    x, v = peak / w * (1 - np.cos(w * t)), peak * np.sin(w * t)
    force, _ = responses(free, free.values, dt, x, v)
    common = [force[i, : 64 * 2**i + 1 : 2**i] for i in range(3)]

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        now = jnp.asarray(peak / w * (1 - np.cos(w * t))), jnp.asarray(peak * np.sin(w * t))
        return np.asarray(rates(law, *now, jnp.asarray(state)))

    start, t = np.asarray(law.initial_state()), t[0, :65]
    exact = solve_ivp(rate, (0.0, t[-1]), start, "LSODA", t, rtol=1e-10, atol=1e-13)
    require(exact.success, f"`state_rate` cannot be integrated: {exact.message}")
    places = zip(x[0, :65], v[0, :65], exact.y.T, strict=True)
    expected = np.array([law.force(jnp.asarray(a), jnp.asarray(b), jnp.asarray(s)) for a, b, s in places])
    errors = [np.max(np.abs(c - expected)) / np.max(np.abs(common[2])) for c in common]
    errors_text = f"has errors {errors} of the peak force in steps of 0.5, 0.25 and 0.125 ms of `state_rate`"
    remedy = "States faster than the step need an exact or implicit `advance`."
    require(errors[0] < 0.02, f"`advance` {errors_text}. {remedy}")
    require(errors[2] < max(errors[0] / 8, 1e-7), f"`advance` {errors_text}, which decrease too slowly. {remedy}")


def _check_states_at_rest(law: AbstractDamper) -> None:
    """The states of a damper that is held at a stroke stay as they are, beside their rates in motion."""
    held, still, moving = (jnp.asarray(number, float) for number in (0.003, 0.0, 0.3))
    state = law.state_at_rest(held)
    drift, rate = (np.abs(rates(law, held, v, state)) for v in (still, moving))
    message = f"Held at x = 3 mm the states of `state_at_rest` change with rates of {drift}"
    require(np.all(drift <= 1e-6 * (rate + np.max(rate))), f"{message}, in motion of {rate}: define the method.")


def check_prediction(law: AbstractDamper) -> None:
    """Over a short step `predict` gives what `advance` does, to a hundredth of the change."""
    start = law.initial_state()
    if start.size == 0:
        return
    _, state = predicted_and_advanced(law, tuple(map(jnp.asarray, (0.0, 0.2, 2e-4, 0.2))), start, jnp.asarray(1e-3))
    ends = tuple(map(jnp.asarray, (2e-4, 0.2, 2.02e-4, 0.202)))
    predicted, advanced = predicted_and_advanced(law, ends, state, jnp.asarray(1e-5))
    atol = 0.01 * float(np.max(np.abs(advanced - state)))
    require_equal(predicted, advanced, "`predict` must give about what `advance` does.", atol=max(atol, 1e-15))


def check_single_precision(law: AbstractDamper) -> None:
    """In single precision the response is that of double precision to 3e-5 of the peak force."""
    dt, x, v = motion()
    free = free_parameters(law)
    force = responses(free, free.values, dt, x, v)[0][0]
    with jax.enable_x64(False):
        half = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf), jnp.float32), law)
        dt, x, v = (jnp.asarray(a, jnp.float32) for a in (dt, x, v))
        single = march(half, dt, x, v, 1)
    require(single.dtype == jnp.float32, f"A law in single precision must give such forces, not {single.dtype}.")
    message = "In single precision the response must be that of double precision to 3e-5 of the peak force."
    require_equal(np.asarray(single, dtype=float), force, message, atol=3e-5 * np.max(np.abs(force)))
