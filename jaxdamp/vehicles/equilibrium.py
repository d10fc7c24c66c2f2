"""Where a vehicle comes to rest on the road, with every nonlinear spring."""

from typing import Any, NoReturn

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._matrices import solve
from jaxdamp._sharded import varying_as
from jaxdamp.dampers import coverage
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.port_form import PortForm
from jaxdamp.vehicles.ports import Ports
from jaxdamp.vehicles.system import System


STEPS = 50
SHARES = 0.5 ** np.arange(8.0)  # of a Newton step


def rest_position(system: System, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    """The coordinates of the static equilibrium: K q + Pᵀ f(P q − S z_r, 0) = K_r z_r.

    The laws are in their initial states. If no law depends on its stroke at rest, this is one linear system; otherwise
    it is solved by Newton's method with step control. Derivatives are exact (implicit function theorem). NaN if no
    equilibrium is found.

    Arguments:
        system: the vehicle.
        road: heights under the wheels [m, up], shape (wheels,).
    """
    form, ports = system.form, Ports(system.laws)
    if not any(law.traits().stroke_dependent_at_rest for law in system.laws):
        still = jnp.zeros(len(system.laws))
        forces = ports.force(still, still, ports.initial())
        return solve(form.stiffness, form.road_stiffness @ road - form.ports.T @ forces)
    arrays, rest = eqx.partition((form, ports, road), eqx.is_array)
    position = _newton(*eqx.combine(jax.lax.stop_gradient(arrays), rest))
    for _ in range(2):  # differentiable Newton steps: one gives exact first derivatives, two exact second ones
        residual, slope = _residual_force(form, ports, road, position)
        position = position - solve(slope, residual)
    return position


def _residual_force(form: PortForm, ports: Ports, road: Array, q: Float[Array, " q"]) -> tuple[Array, Array]:
    """The unbalanced forces at a position [N], and their derivatives with respect to it [N/m]."""
    deflection = form.at_ports(q, road)
    slopes, _ = ports.stiffness_and_damping(deflection)
    forces = ports.force(deflection, jnp.zeros_like(deflection), ports.initial())
    residual = form.stiffness @ q + form.ports.T @ forces - form.road_stiffness @ road
    return residual, form.stiffness + (form.ports.T * slopes[None, :]) @ form.ports


def _newton(form: PortForm, ports: Ports, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    scale = jnp.max(jnp.diag(form.stiffness))  # N/m, converts residual forces to lengths
    tolerance = 1e-8 if scale.dtype == jnp.float32 else 1e-14

    def step(now: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        q, _, count = now
        residual, slope = _residual_force(form, ports, road, q)
        tries = q[None] - SHARES[:, None] * solve(slope, residual)[None]
        sizes = jnp.linalg.norm(jax.vmap(lambda q: _residual_force(form, ports, road, q)[0])(tries), axis=1)
        best = jnp.nanargmin(sizes)
        return tries[best], sizes[best] / scale, count + 1

    start = jnp.zeros_like(form.mass[0]), jnp.full_like(scale, jnp.inf), jnp.zeros((), int)
    start = varying_as(start, *eqx.filter((form, ports, road), eqx.is_array))
    position, size, _ = jax.lax.while_loop(lambda now: (now[1] > tolerance) & (now[2] < STEPS), step, start)
    return jnp.where(size < 1e3 * tolerance, position, jnp.nan)


@eqx.filter_jit
def _rest(vehicle: AbstractVehicle, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    return rest_position(vehicle.system(), road)


def static_equilibrium(vehicle: AbstractVehicle, road: Any = None) -> dict[str, Array]:
    """The static equilibrium: coordinates [m, rad] by name.

    Coordinates are measured from the equilibrium of the linear springs on level ground, without forces of laws. A gas
    spring, or a bump stop in contact, raises the body from there. Differentiable in every parameter.

    Arguments:
        vehicle: any vehicle.
        road: heights under the wheels [m], shape (wheels,); level ground if left out.

    Raises:
        ValueError: a number of heights other than that of wheels; no equilibrium found.

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
    position = _rest(vehicle, heights)
    values = _checks.concrete(position)
    if values is not None and not np.all(np.isfinite(values)):
        refuse_restless(vehicle)
    return dict(zip(vehicle.coordinates, position, strict=True))


def refuse_restless(vehicle: AbstractVehicle) -> NoReturn:
    """Refuse a vehicle for which no static equilibrium was found.

    Arguments:
        vehicle: the vehicle.
    """
    remedy = "Check for springs that are much too soft, or for a law whose force decreases with extension."
    remedy = " ".join([*filter(None, map(coverage, vehicle.elements())), remedy])
    actual = f"a {type(vehicle).__name__} for which none was found"
    _checks.refuse("vehicle", "have a static equilibrium", actual, remedy)
