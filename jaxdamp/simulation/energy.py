"""Where the energy of a run has gone."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import jax.numpy as jnp
from jaxtyping import Array

from jaxdamp._quickly import compiled_for_loops
from jaxdamp._types import Scalar


if TYPE_CHECKING:
    from jaxdamp.simulation.response import Response


def _middle(values: Array) -> Array:
    """Mean over each step."""
    return 0.5 * (values[1:] + values[:-1])


def _same(values: Array) -> Array:
    return values


def _road_rates(response: "Response") -> tuple[Array, Callable[[Array], Array], Callable[[Array], Array]]:
    """Rates of the road [m/s]; what has forces where these are, and what the mean of products over each step.

    Over a step of the run the road is straight: its slope there, and the mean of the forces. Over several steps between
    saved instants it is not: its rate at these.
    """
    if response.every > 1:
        return response.road_rate, _same, _middle
    return jnp.diff(response.road, axis=0) / response.dt, _middle, _same


@compiled_for_loops
def energy_balance(response: "Response") -> dict[str, Scalar]:
    """Where the energy that the road put in has gone [J].

    `road_work` = `stored` (in masses and linear springs, at the end less at the start) + `absorbed` (by the laws;
    springs among them give it back later, dampers do not: `absorbed_by` takes them apart) + `dashpots` (linear
    ones, as in the tyre), up to `error`, which falls with the square of the step. All integrals by the trapezoid
    rule over the saved instants: with `every` above 1, estimates from samples of the powers. Heights count from
    static equilibrium, so that weight and static loads do no work.

    Arguments:
        response: the run, or a part of it.
    """
    form, n = response.system.form, len(response.system.layout.coordinates)
    q, rate, road, dt = response.motion[:, :n], response.motion[:, n:], response.road, response.dt
    slope, there, mean = _road_rates(response)

    def stored(i: int) -> Scalar:
        spring = 0.5 * form.stiffness @ q[i] - form.road_stiffness @ road[i]
        ground = 0.5 * road[i] @ form.ground_stiffness @ road[i]
        return 0.5 * rate[i] @ form.mass @ rate[i] + q[i] @ spring + ground

    push = road @ form.ground_stiffness - q @ form.road_stiffness
    if form.port_road is not None:
        push = push - response.port_force @ form.port_road
    towed = there(rate) @ form.road_damping
    rolled = slope @ form.ground_damping
    road_work = jnp.sum(mean((there(push) + rolled - towed) * slope)) * dt
    dashpots = _middle(jnp.sum((rate @ form.damping) * rate, axis=1))
    dashed = jnp.sum(dashpots + jnp.sum(mean((rolled - 2.0 * towed) * slope), axis=1)) * dt
    absorbed = sum(absorbed_by(response).values(), jnp.zeros(()))
    change = stored(-1) - stored(0)
    parts = {"road_work": road_work, "stored": change, "absorbed": absorbed, "dashpots": dashed}
    return parts | {"error": road_work - change - absorbed - dashed}


@compiled_for_loops
def absorbed_by(response: "Response") -> dict[str, Scalar]:
    """Energy that each element has taken in [J], ∫ F ė dt, by its name.

    Where an element is several dampers that act together, it is that of all; force and power channels are of one.

    Arguments:
        response: the run, or a part of it.
    """
    form, n = response.system.form, len(response.system.layout.coordinates)
    moved = _middle(response.port_force * (response.motion[:, n:] @ form.ports.T))
    if form.port_road is not None:
        slope, there, mean = _road_rates(response)
        moved = moved - mean(there(response.port_force) * (slope @ form.port_road.T))
    taken = jnp.sum(moved, axis=0) * response.dt
    return dict(zip(response.system.layout.ports, taken, strict=True))
