"""What the metrics share: checks of signals, a safe root, the exact response of small linear systems."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike, DTypeLike
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork
from jaxdamp._matrices import phi_functions
from jaxdamp._types import Scalar, ScalarLike, Signal, SignalLike


def as_signal(argument: str, signal: SignalLike, *, least: int = 1) -> Signal:
    """The signal as a JAX array of floats, refused unless it has one axis and `least` samples."""
    refuse_fork()
    array = jnp.asarray(signal)
    if not jnp.issubdtype(array.dtype, jnp.inexact):
        array = array.astype(float)
    if jnp.issubdtype(array.dtype, jnp.complexfloating):
        _checks.refuse(argument, "be real", f"of type {array.dtype}", "Pass its real part, or its magnitude.")
    if array.ndim != 1:
        remedy = "Pass one channel at a time, or batch with jax.vmap."
        _checks.refuse(argument, "have one axis, time", f"of shape {array.shape}", remedy)
    if array.size < least:
        _checks.refuse(argument, f"hold at least {least} sample{'s' * (least > 1)}", f"of length {array.size}")
    return array


def as_numbers(*values: ArrayLike) -> list[Array]:
    """Numbers, lists or arrays of them as floats of one type, the one that JAX finds for all."""
    refuse_fork()
    dtype = jnp.result_type(*jax.tree.leaves(values) or [float])
    dtype = dtype if jnp.issubdtype(dtype, jnp.floating) else jnp.result_type(float)
    return [jnp.asarray(value, dtype) for value in values]


def same_length(first: str, one: Signal, second: str, other: Signal) -> None:
    """Refuse two signals of different length."""
    if one.shape != other.shape:
        remedy = "Cut or resample them to the same time base."
        _checks.refuse(second, f"be as long as `{first}` ({one.size} samples)", f"of length {other.size}", remedy)


def check_interval(dt: ScalarLike | int) -> None:
    """Refuse a sampling interval that is not one number, positive and finite."""
    if np.ndim(dt):
        remedy = "Samples must be evenly spaced: resample the record, and give their distance in s."
        _checks.refuse("dt", "be one number", f"of shape {np.shape(dt)}", remedy)
    _checks.positive("dt", dt, "It is the sampling interval in s.")


def check_increasing(frequency: Float[Array, " lines"]) -> None:
    """Refuse known frequencies that do not increase."""
    concrete = _checks.concrete(frequency)
    if concrete is not None and not (concrete[1:] > concrete[:-1]).all():
        _checks.refuse(
            "frequency", "increase", f"{concrete[0]:g} to {concrete[-1]:g} Hz in another order", "Sort the lines."
        )


class StateSpace(NamedTuple):
    """A linear system with one input and one output: x' = A x + B u, y = C x + D u; time in seconds.

    Attributes:
        state_matrix: A [1/s], shape (n, n).
        input_vector: B, shape (n,).
        output_vector: C, shape (n,).
        feed_through: D.
    """

    state_matrix: Float[Array, "n n"] | Float[np.ndarray, "n n"]
    input_vector: Float[Array, " n"] | Float[np.ndarray, " n"]
    output_vector: Float[Array, " n"] | Float[np.ndarray, " n"]
    feed_through: ScalarLike


_LAG = StateSpace(-np.ones((1, 1)), np.ones(1), np.ones(1), 0.0)


def respond_as_lag(signal: Signal, dt: ScalarLike, time_constant: ScalarLike, start: Scalar | None = None) -> Signal:
    """The solution of tau y' = u - y at every sample, from `start` (zero), exact as `respond_exactly`."""
    return respond_exactly(_LAG, signal, quotient(dt, time_constant, signal.dtype), start)


def quotient(above: ScalarLike, below: ScalarLike, dtype: DTypeLike) -> ScalarLike:
    """The quotient of two numbers, known if both are."""
    one, other = _checks.concrete(above), _checks.concrete(below)
    if one is not None and other is not None:
        return float(one) / float(other)
    return jnp.asarray(above, dtype) / jnp.asarray(below, dtype)


def respond_exactly(system: StateSpace, signal: Signal, dt: ScalarLike, start: Scalar | None = None) -> Signal:
    """The output at every sample, exact for an input that runs straight from sample to sample (first-order hold).

    The system is a constant (NumPy); it starts at rest, or with every state at `start`. One exponential of the
    augmented matrix gives x₁ = Φ x₀ + H₀ u₀ + H₁ (u₁ − u₀); it is taken by SciPy in double precision where `dt` is
    known and by JAX where it is traced. Rises (Φ − 1) x₀ + … are added with what rounding took off the last sum, so
    that single precision does not drift where a time constant is a million samples long.
    """
    n = system.input_vector.size
    growth, shift = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2))
    growth[:n, :n], growth[:n, n], shift[n, n + 1] = system.state_matrix, system.input_vector, 1.0
    concrete = _checks.concrete(dt)
    if concrete is None:
        step = jnp.asarray(dt, signal.dtype)
        growth = jnp.asarray(growth, signal.dtype) * step + jnp.asarray(shift, signal.dtype)
        rise = growth @ phi_functions(growth)[1]
    else:
        from scipy.linalg import expm

        rise = jnp.asarray(expm(growth * float(concrete) + shift) - np.eye(n + 2), signal.dtype)
    output = jnp.asarray(system.output_vector, signal.dtype)
    initial = np.zeros(n, signal.dtype) if start is None else jnp.full(n, start, signal.dtype)
    return _run(rise, output, jnp.asarray(system.feed_through, signal.dtype), signal, initial)


@jax.jit
def _run(
    rise: Float[Array, "n2 n2"], output: Float[Array, " n"], feed_through: Scalar, signal: Signal,
    start: Float[Array, " n"],
) -> Signal:  # fmt: skip
    n = output.size
    grown, held, ramp = rise[:n, :n], rise[:n, n], rise[:n, n + 1]
    drive = signal[:-1, None] * held[None, :] + jnp.diff(signal)[:, None] * ramp[None, :]

    def step(now: tuple[Array, Array], push: Array) -> tuple[tuple[Array, Array], Array]:
        before, lost = now
        added = grown @ before + push - lost
        state = before + added
        return (state, (state - before) - added), state

    _, states = jax.lax.scan(step, (start, jnp.zeros_like(start)), drive)
    return jnp.concatenate([start[None, :], states]) @ output + feed_through * signal
