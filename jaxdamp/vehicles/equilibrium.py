"""Where a vehicle comes to rest on the road, with every nonlinear spring."""

from typing import Any, NoReturn

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.dampers import coverage
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.port_form import PortForm
from jaxdamp.vehicles.ports import Ports
from jaxdamp.vehicles.system import System


STEPS = 50
SHARES = 0.5 ** np.arange(8.0)  # of a Newton step


def rest_position(system: System, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    """The coordinates at which springs and laws balance: K q + Pᵀ f(P q − S z_r, 0) = K_r z_r.

    The laws are in their initial states. One linear system where no law depends on its stroke; else Newton steps, each
    shortened as far as helps. Derivatives are those of the implicit function theorem. NaN without an equilibrium.
    """
    form, ports = system.form, Ports(system.laws)
    if not any(law.traits().stroke_dependent_at_rest for law in system.laws):
        still = jnp.zeros(len(system.laws))
        forces = ports.force(still, still, ports.initial())
        return jnp.linalg.solve(form.stiffness, form.road_stiffness @ road - form.ports.T @ forces)
    arrays, rest = eqx.partition((form, ports, road), eqx.is_array)
    found = _newton(*eqx.combine(jax.lax.stop_gradient(arrays), rest))
    for _ in range(2):  # derivatives pass through these: one step has the first of them right, two the next as well
        left, slope = _unbalanced(form, ports, road, found)
        found = found - jnp.linalg.solve(slope, left)
    return found


def _unbalanced(form: PortForm, ports: Ports, road: Array, q: Float[Array, " q"]) -> tuple[Array, Array]:
    """Forces that are left at a position [N], and how they grow with it [N/m]."""
    deflection = form.at_ports(q, road)
    slopes, _ = ports.stiffness_and_damping(deflection)
    forces = ports.force(deflection, jnp.zeros_like(deflection), ports.initial())
    left = form.stiffness @ q + form.ports.T @ forces - form.road_stiffness @ road
    return left, form.stiffness + (form.ports.T * slopes[None, :]) @ form.ports


def _newton(form: PortForm, ports: Ports, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    scale = jnp.max(jnp.diag(form.stiffness))  # N/m, makes a length of what is left
    tight = 1e-8 if scale.dtype == jnp.float32 else 1e-14

    def step(now: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        q, _, count = now
        left, slope = _unbalanced(form, ports, road, q)
        tries = q[None] - SHARES[:, None] * jnp.linalg.solve(slope, left)[None]
        sizes = jnp.linalg.norm(jax.vmap(lambda q: _unbalanced(form, ports, road, q)[0])(tries), axis=1)
        best = jnp.nanargmin(sizes)
        return tries[best], sizes[best] / scale, count + 1

    start = jnp.zeros_like(form.mass[0]), jnp.full_like(scale, jnp.inf), jnp.zeros((), int)
    found, size, _ = jax.lax.while_loop(lambda now: (now[1] > tight) & (now[2] < STEPS), step, start)
    return jnp.where(size < 1e3 * tight, found, jnp.nan)


@eqx.filter_jit
def _rest(vehicle: AbstractVehicle, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    return rest_position(vehicle.system(), road)


def static_equilibrium(vehicle: AbstractVehicle, road: Any = None) -> dict[str, Array]:
    """Where the vehicle comes to rest: its coordinates [m, rad] by name.

    Coordinates are zero where the linear springs carry the weight on level ground and every law is without force; a gas
    spring lifts the body from there, a bump stop in contact too. Differentiable in every parameter.

    Arguments:
        vehicle: any vehicle.
        road: heights under the wheels [m], shape (wheels,); level ground if left out.

    Raises:
        ValueError: another number of heights than wheels, no equilibrium found.

    >>> from jaxdamp.dampers import GasSpring, Linear
    >>> from jaxdamp.vehicles import QuarterCar
    >>> car = QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0), extra_spring=GasSpring(2e6, 6e-5, 1e-4))
    >>> round(1e3 * float(static_equilibrium(car)["z_sprung"]), 2)  # mm
    9.3
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), "static_equilibrium(vehicle)")
    wheels = len(vehicle.wheel_names)
    heights = jnp.zeros(wheels) if road is None else jnp.asarray(road, dtype=float)
    if heights.shape != (wheels,):
        _checks.refuse("road", f"hold a height for each of {wheels} wheel(s)", f"of shape {heights.shape}")
    found = _rest(vehicle, heights)
    values = _checks.concrete(found)
    if values is not None and not np.all(np.isfinite(values)):
        refuse_restless(vehicle)
    return dict(zip(vehicle.coordinates, found, strict=True))


def refuse_restless(vehicle: AbstractVehicle) -> NoReturn:
    """Refuse a vehicle for which no static equilibrium was found."""
    remedy = "Look for springs that are far too soft, or a law whose force falls as it is stretched."
    remedy = " ".join([*filter(None, map(coverage, vehicle.elements())), remedy])
    _checks.refuse("vehicle", "have an equilibrium", f"a {type(vehicle).__name__} without one that was found", remedy)
