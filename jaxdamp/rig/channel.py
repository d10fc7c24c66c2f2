"""A channel that answers late: a delay of any part of a sample, a first-order lag."""

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp._limits import within
from jaxdamp._types import Scalar, Signal
from jaxdamp.rig.marching import hermite, slopes


def delayed(values: Signal, samples: Scalar) -> Signal:
    """A signal later by a number of samples, not necessarily whole; its first and last values stand beyond its ends."""
    last = values.size - 1
    places = within(jnp.arange(values.size, dtype=values.dtype) - samples, 0.0, float(last))
    before = jnp.clip(jax.lax.stop_gradient(places).astype(int), 0, last - 1)
    rises = slopes(values, jnp.ones((), values.dtype))
    ends = (values[before], rises[before], values[before + 1], rises[before + 1])
    return hermite(ends, places - before.astype(places.dtype))


def lagged(values: Signal, samples: Scalar) -> Signal:
    """Y of τ y' + y = signal, from a settled start, exact for straight lines between samples.

    Arguments:
        values: the signal.
        samples: τ in samples; zero gives the signal itself.
    """
    there = samples > 1e-3  # below, exp(−1/samples) is no number beside 1
    safe = jnp.where(there, samples, 1.0)
    decay = jnp.where(there, jnp.exp(-1.0 / safe), 0.0)
    mean = samples * (1.0 - decay)
    weights = (mean - decay, 1.0 - mean)

    def step(y: Array, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        return decay * y + weights[0] * ends[0] + weights[1] * ends[1], y  # the one before, as in `march`

    last, before = jax.lax.scan(step, values[0], (values[:-1], values[1:]))
    return jnp.append(before, last)
