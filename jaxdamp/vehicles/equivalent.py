"""Equivalent spring and dashpot of the laws for a sinusoidal stroke (describing function)."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp._types import Scalar
from jaxdamp.vehicles.ports import Ports, States


POINTS = 256  # in a cycle
CYCLES = 8  # the last one is evaluated; laws with states settle before


def equivalent_slopes(
    ports: Ports, centre: Float[Array, " ports"], amplitude: Float[Array, "..."], frequency: Scalar
) -> tuple[Float[Array, " ports"], Float[Array, " ports"]]:
    """First harmonic of each force for x = centre + X sin ωt: F ≈ k (x − centre) + c v.

    k = (2/X) mean(F sin ωt) [N/m], c = (2/(Xω)) mean(F cos ωt) [N s/m] over the last of eight cycles of 256 points. c
    dissipates the same energy as the law, k is its part in phase with the stroke. Zeros without elements.

    Arguments:
        ports: the laws at the ports.
        centre: mean deflection [m], shape (ports,).
        amplitude: X [m], one for all or one for each port.
        frequency: ω/2π [Hz].
    """
    x_max = jnp.broadcast_to(jnp.abs(amplitude), centre.shape)
    rate = 2.0 * jnp.pi * frequency
    phase = 2.0 * jnp.pi * jnp.arange(CYCLES * POINTS + 1.0, dtype=centre.dtype) / POINTS
    sine, cosine = jnp.sin(phase), jnp.cos(phase)
    x = centre[None, :] + sine[:, None] * x_max[None, :]
    v = cosine[:, None] * (rate * x_max)[None, :]

    def step(states: States, ends: tuple[Array, ...]) -> tuple[States, Array]:
        x0, v0, x1, v1 = ends
        states = ports.advance(x0, v0, x1, v1, states, 1.0 / (frequency * POINTS))
        return states, ports.force(x1, v1, states)

    _, forces = jax.lax.scan(step, ports.initial(), (x[:-1], v[:-1], x[1:], v[1:]))
    last, of_cycle = forces[-POINTS:], slice(-POINTS, None)
    stiffness = 2.0 * jnp.mean(last * sine[of_cycle, None], axis=0) / x_max
    return stiffness, 2.0 * jnp.mean(last * cosine[of_cycle, None], axis=0) / (rate * x_max)
