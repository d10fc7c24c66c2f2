"""Where a vehicle comes to rest on the road, with every nonlinear spring."""

from collections.abc import Callable, Sequence
from typing import NoReturn, TypeAlias, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._matrices import solve
from jaxdamp._quickly import compiled_quickly
from jaxdamp._root import ImplicitDerivatives
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar
from jaxdamp.dampers import coverage
from jaxdamp.vehicles.base import AbstractVehicle
from jaxdamp.vehicles.port_form import PortForm, Ports
from jaxdamp.vehicles.system import System


STEPS = 50
SHARES = 0.5 ** np.arange(8.0)  # of a Newton step


def rest_position(system: System, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    """The coordinates of the static equilibrium: K q + Pᵀ f(P q − S z_r, 0) = K_r z_r.

    The laws are in their states at rest. If no law depends on its stroke at rest, this is one linear system; otherwise
    it is solved by Newton's method with step control. Derivatives are exact (implicit function theorem). NaN if no
    equilibrium is found.

    Arguments:
        system: the vehicle.
        road: heights under the wheels [m, up], shape (wheels,).
    """
    form, ports = system.form, Ports(system.laws)
    if not any(law.traits().stroke_dependent_at_rest for law in system.laws):
        still = jnp.zeros(len(system.laws))
        forces = ports.force(still, still, ports.at_rest(still))
        return solve(form.stiffness, form.road_stiffness @ road - form.ports.T @ forces)
    scale = jnp.max(jnp.diag(form.stiffness))  # N/m, converts residual forces to lengths
    solver = _SharedNewton(atol=1e-8 if scale.dtype == jnp.float32 else 1e-14)
    setting = form, ports, road, jax.lax.stop_gradient(scale)
    start = varying_as(jnp.zeros_like(form.mass[0]), *eqx.filter(setting, eqx.is_array))
    solution = optx.root_find(
        _unbalanced, solver, start, setting, max_steps=STEPS, adjoint=ImplicitDerivatives(), throw=False
    )
    return jnp.where(solution.state < 1e3 * solver.atol, solution.value, jnp.nan)


def _residual_force(form: PortForm, ports: Ports, road: Array, q: Float[Array, " q"]) -> tuple[Array, Array]:
    """The unbalanced forces at a position [N], and their derivatives with respect to it [N/m]."""
    deflection = form.at_ports(q, road)
    slopes, _ = ports.stiffness_and_damping(deflection)
    forces = ports.force(deflection, jnp.zeros_like(deflection), ports.at_rest(deflection))
    residual = form.stiffness @ q + form.ports.T @ forces - form.road_stiffness @ road
    return residual, form.stiffness + (form.ports.T * slopes[None, :]) @ form.ports


_Setting: TypeAlias = tuple[PortForm, Ports, Array, Scalar]  # and the stiffness that converts forces to lengths


def _unbalanced(q: Float[Array, " q"], setting: _Setting) -> Array:
    """The unbalanced forces at a position, as lengths [m]."""
    form, ports, road, scale = setting
    return _residual_force(form, ports, road, q)[0] / scale


@final
class _SharedNewton(optx.AbstractRootFinder):
    """Newton's method, of whose step that share is taken which leaves the least; its state is what is left [m]."""

    atol: float
    rtol: float = 0.0
    norm: Callable[[PyTree], Array] = eqx.field(static=True, default=optx.max_norm)

    def init(
        self, fn: object, y: Array, args: PyTree, options: object, f_struct: object, aux_struct: object, tags: object
    ) -> Array:
        """Nothing is known of the first position."""
        return jnp.full_like(args[3], jnp.inf)

    def step(
        self, fn: object, y: Array, args: PyTree, options: object, state: Array, tags: object
    ) -> tuple[Array, Array, None]:
        """The best of some shares."""
        form, ports, road, scale = args
        residual, slope = _residual_force(form, ports, road, y)
        tries = y[None] - SHARES[:, None] * solve(slope, residual)[None]
        sizes = jnp.linalg.norm(jax.vmap(lambda q: _residual_force(form, ports, road, q)[0])(tries), axis=1)
        best = jnp.nanargmin(sizes)
        return tries[best], sizes[best] / scale, None

    def terminate(
        self, fn: object, y: object, args: object, options: object, state: Array, tags: object
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Where rounding errors are left."""
        return state <= self.atol, optx.RESULTS.successful

    def postprocess(
        self,
        fn: object,
        y: object,
        aux: object,
        args: object,
        options: object,
        state: object,
        tags: object,
        result: object,
    ) -> tuple[object, object, dict[str, object]]:
        """As it is."""
        return y, aux, {}


@compiled_quickly
def _rest(vehicle: AbstractVehicle, road: Float[Array, " wheels"]) -> Float[Array, " q"]:
    return rest_position(vehicle.system(), road)


def static_equilibrium(vehicle: AbstractVehicle, road: ArrayLike | Sequence[float] | None = None) -> dict[str, Array]:
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
