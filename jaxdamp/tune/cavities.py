"""Where a cavity opens in a tube at constant velocity, the force that it then has, and the pressure that it lacks."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdamp._types import VectorLike
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


def lacking(law: MonoTube | TwinTube, velocities: VectorLike) -> Array:
    """What the oil lacks of the pressure of a cavity on the area of its chamber, above the piston, then below it [N].

    At constant velocities in the middle of the stroke: p_r − p_c = F_piston/A, and p_g − p_c = F_base/A_r.

    Arguments:
        law: the damper.
        velocities: constant ones [m/s].
    """
    v, piston, rod_area, charge = jnp.asarray(velocities), law.piston, law.gas.rod_area, law.gas.pressure
    below = jnp.full_like(v, charge)  # of the mono-tube, which the gas keeps from a cavity
    if isinstance(law, TwinTube):
        below = charge - jax.vmap(law.base_on_rod.force_velocity)(v) / rod_area
    above = below + jax.vmap(piston.force_velocity)(v) / piston.area
    rows = ((piston.area, above), (piston.area + rod_area, below))
    return jnp.concatenate([area * jnp.maximum(law.cavitation_pressure - pressure, 0.0) for area, pressure in rows])


@eqx.filter_jit
def _opened(law: MonoTube | TwinTube, velocities: Array) -> Array:
    """Forces [N] at constant velocities in the middle of the stroke, with the gas at its charge."""
    still = with_values(law, {"gas.volume": jnp.full_like(law.gas.volume, ENDLESS)})

    def force(v: Array) -> Array:
        zero = jnp.zeros_like(v)

        def step(_: Array, state: Array) -> Array:
            return still.implicit_stage(zero, v, state, STEP)

        return still.force(zero, v, jax.lax.fori_loop(0, STEPS, step, still.initial_state()))

    return jax.vmap(force)(velocities)
