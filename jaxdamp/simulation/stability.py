"""How many steps between two instants the steepest law of a vehicle needs."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._types import Scalar, Signal
from jaxdamp.dampers import AbstractDamper, Sum
from jaxdamp.vehicles import AbstractVehicle
from jaxdamp.vehicles.ports import is_smooth


LARGEST = 0.5  # of the share below; the corrected step is stable up to 1
MOST = 64
_VELOCITIES = np.concatenate([-np.geomspace(3.0, 1e-4, 14), [0.0], np.geomspace(1e-4, 3.0, 14)])  # m/s


def substeps_needed(vehicle: AbstractVehicle, dt: float) -> int:
    """Steps of the exponential engine between instants dt [s] apart.

    A force that grows by c [N s/m] with the velocity and acts on a mass m takes back the share c dt/(2m) of an error of
    the predicted velocity in one step; here m is what the port feels, 1/m = P M⁻¹ Pᵀ. The steepest slope over a step
    counts of every law without states, such as that of friction at standstill, and twice of a law whose states are
    extrapolated, such as a lag much shorter than the step. Other laws with states bring stable steps of their own.
    Where parameters are traced their slopes are not known, and one step is taken.

    Raises:
        ValueError: more than 64 would be needed.
    """
    slopes = [_steepest(law, dt) for law in vehicle.elements()]
    if not any(slopes):
        return 1
    form = vehicle.port_form()
    mass, ports = _checks.concrete(form.mass), _checks.concrete(form.ports)
    if mass is None or ports is None:
        return 1
    felt = np.diag(ports @ np.linalg.solve(mass, ports.T))
    shares = 0.5 * dt * np.array(slopes) * felt
    count = max(1, math.ceil(float(shares.max()) / LARGEST))
    if count > MOST:
        name = vehicle.frame().element_names[int(shares.argmax())]
        remedy = (
            f"Pass `dt={_rounded_down(dt * MOST / count):g}` or less, widen the velocity over which its force changes "
            "sign, or take an implicit solver, `method=diffrax.Kvaerno5()`."
        )
        must = f"have a slope that {MOST} steps in {dt:g} s can follow"
        _checks.refuse(name, must, f"{max(slopes):.3g} N s/m steep at some velocity", remedy)
    return count


def _rounded_down(value: float) -> float:
    """To one digit."""
    unit = 10.0 ** math.floor(math.log10(value))
    return math.floor(value / unit) * unit


def _steepest(law: AbstractDamper, dt: float) -> float:
    """Largest slope of the force after a step by the velocity at its end [N s/m]; zero where it is not known."""
    terms = law.terms if isinstance(law, Sum) else (law,)
    total = 0.0
    for term in terms:
        size, foreseen = term.initial_state().size, is_smooth(term)
        known = all(_checks.concrete(leaf) is not None for leaf in jax.tree.leaves(eqx.filter(term, eqx.is_array)))
        if known and (foreseen or not size):
            slopes = _checks.concrete(_slopes(term, jnp.asarray(_VELOCITIES), jnp.asarray(dt, dtype=float)))
            largest = 0.0 if slopes is None else float(np.max(np.nan_to_num(slopes), initial=0.0))
            total += 2.0 * largest if foreseen else largest
    return total


@eqx.filter_jit
def _slopes(law: AbstractDamper, velocity: Signal, dt: Scalar) -> Float[Array, " time"]:
    def force(end: Scalar, v: Scalar) -> Any:
        still = jnp.zeros_like(v)
        return law.force(still, end, law.advance(still, v, still, end, law.initial_state(), dt))

    return jax.vmap(jax.grad(force))(velocity, velocity)
