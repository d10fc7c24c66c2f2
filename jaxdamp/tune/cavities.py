"""Where a cavity opens in a tube at constant velocity, and the force that it then has."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp.dampers import MonoTube, TwinTube
from jaxdamp.parameters import with_values
from jaxdamp.rig import quasi_static


ENDLESS = 1e10  # m³, of gas that no cavity compresses
STEP, STEPS = 1e-3, 200  # s, in which the oil settles where a cavity opens


def with_cavities(
    law: MonoTube | TwinTube, velocities: np.ndarray, forces: np.ndarray, allowed: float
) -> tuple[np.ndarray, np.ndarray]:
    """Forces with those of cavities that have just opened where these differ by more than is allowed, and where.

    There is no settled force with a cavity: it grows, and compresses the gas, by a share that depends on the stroke.

    Arguments:
        law: the damper.
        velocities: constant ones [m/s].
        forces: at these velocities without cavities, then others [N].
        allowed: difference [N].
    """
    cavities = np.zeros(forces.shape, bool)
    count = velocities.size
    if not count or np.all(settled := quasi_static(law, velocities).settled):
        return forces, cavities
    opened = forces.copy()
    opened[:count] = np.where(settled, forces[:count], _opened(law, jnp.asarray(velocities)))
    cavities = np.abs(opened - forces) > allowed
    return np.where(cavities, opened, forces), cavities


@eqx.filter_jit
def _opened(law: MonoTube | TwinTube, velocities: Array) -> Array:
    """Forces [N] at constant velocities in the middle of the stroke, with the gas at its charge."""
    still = with_values(law, {"gas.volume": jnp.full_like(law.gas.volume, ENDLESS)})

    def force(v: Array) -> Array:
        zero = jnp.zeros_like(v)

        def step(_: int, state: Array) -> Array:
            return still.implicit_stage(zero, v, state, STEP)

        return still.force(zero, v, jax.lax.fori_loop(0, STEPS, step, still.initial_state()))

    return jax.vmap(force)(velocities)
