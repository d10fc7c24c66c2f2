"""A vehicle whose laws are replaced by linear ones."""

from collections.abc import Sequence
from typing import NamedTuple, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp.vehicles.system import System


@final
class LinearLaws(eqx.Module):
    """(f, ṡ) = constant + slopes (x, v, s): forces and rates of the states, from deflections, rates and states.

    Attributes:
        constant: shape (laws + states,).
        slopes: shape (laws + states, 2 laws + states).
        ports: the port of each law; several laws may share one.
    """

    constant: Float[Array, " answers"]
    slopes: Float[Array, "answers motions"]
    ports: tuple[int, ...] = eqx.field(static=True)

    @property
    def count(self) -> int:
        """Number of laws."""
        return len(self.ports)


class StateSpaceOfVehicle(NamedTuple):
    """ẋ = A x + B z_r + E ż_r + a, channels C x + D z_r + F ż_r; x = (q, q̇, states of the laws)."""

    a: Float[Array, "n n"]
    b: Float[Array, "n wheels"]
    e: Float[Array, "n wheels"]
    c: Float[Array, "channels n"]
    d: Float[Array, "channels wheels"]
    f: Float[Array, "channels wheels"]
    constant: Float[Array, " n"]


class Motions(NamedTuple):
    """(x, v, s) of the laws = Z x + D z_r + F ż_r."""

    state: Float[Array, "motions n"]
    road: Float[Array, "motions wheels"]
    road_rate: Float[Array, "motions wheels"]


def motions_of(system: System, ports: Sequence[int], states: int) -> Motions:
    """Deflection, rate and states of laws at these ports."""
    form, chosen = system.form, np.array(ports, dtype=int)
    rows, wheels = form.ports[chosen], form.road_stiffness.shape[1]
    on_road = jnp.zeros((len(ports), wheels)) if form.port_road is None else form.port_road[chosen]
    n, none = rows.shape[1], jnp.zeros_like(rows)
    state = jnp.concatenate([jnp.concatenate([rows, none], axis=1), jnp.concatenate([none, rows], axis=1)])
    inner = jnp.concatenate([jnp.zeros((states, 2 * n)), jnp.eye(states)], axis=1)
    state = jnp.concatenate([jnp.concatenate([state, jnp.zeros((2 * len(ports), states))], axis=1), inner])
    quiet, nothing = jnp.zeros_like(on_road), jnp.zeros((states, wheels))
    return Motions(state, jnp.concatenate([-on_road, quiet, nothing]), jnp.concatenate([quiet, -on_road, nothing]))


def with_linear_laws(system: System, laws: LinearLaws) -> StateSpaceOfVehicle:
    """The equations of the vehicle with these laws in place of its own."""
    count, states = laws.count, laws.constant.size - laws.count
    moved = motions_of(system, laws.ports, states)
    of_state, of_road, of_rate = (laws.slopes @ part for part in moved)
    chosen = np.array(laws.ports, dtype=int)
    push, feel = system.motion.force[:, chosen], system.outputs.force[:, chosen]

    def rates(answers: Array) -> Array:
        return jnp.concatenate([push @ answers[:count], answers[count:]])

    wide = ((0, states), (0, states))
    return StateSpaceOfVehicle(
        jnp.pad(system.motion.motion, wide) + rates(of_state),
        jnp.pad(system.motion.road, (*wide[:1], (0, 0))) + rates(of_road),
        jnp.pad(system.motion.road_rate, (*wide[:1], (0, 0))) + rates(of_rate),
        jnp.pad(system.outputs.motion, ((0, 0), (0, states))) + feel @ of_state[:count],
        system.outputs.road + feel @ of_road[:count],
        system.outputs.road_rate + feel @ of_rate[:count],
        rates(laws.constant),
    )
