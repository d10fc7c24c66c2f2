"""A vehicle over one period of a sine under its wheels, and the sweep from one frequency to the next."""

from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from jaxdamp._periodic import Shot, shoot, steady_state, with_derivatives
from jaxdamp._sharded import varying_as
from jaxdamp._types import Scalar, State
from jaxdamp._vectors import MemoryLayout
from jaxdamp.simulation.equations import Equations, RoadInput, StepState, settled
from jaxdamp.simulation.exponential import ExponentialStepper
from jaxdamp.vehicles import System


class Cycle(NamedTuple):
    """The samples of a period in SI units."""

    channels: Float[Array, "samples channels"]
    motion: Float[Array, "samples n"]
    force: Float[Array, "samples ports"]  # of the elements [N]
    road: Float[Array, "samples wheels"]  # heights [m]
    road_rate: Float[Array, "samples wheels"]  # [m/s]


@final
class Excitation(eqx.Module):
    """A vehicle on z_w = A sin(2πf (t − τ_w)), a period in so many steps.

    Attributes:
        system: the vehicle.
        frequency: f [Hz].
        amplitude: A [m].
        delays: τ of each wheel [s].
        samples: instants of a period.
        substeps: steps from one instant to the next.
    """

    system: System
    frequency: Scalar
    amplitude: Scalar
    delays: Float[Array, " wheels"]
    samples: int = eqx.field(static=True)
    substeps: int = eqx.field(static=True)

    def stepper(self) -> ExponentialStepper:
        """The steps of `simulate`."""
        steps = self.samples * self.substeps
        return ExponentialStepper(Equations(self.system, MemoryLayout.ARRAY), 1.0 / (self.frequency * steps))

    def road(self, turns: Scalar) -> tuple[Float[Array, " wheels"], Float[Array, " wheels"]]:
        """Heights [m] and rates [m/s] after so many periods."""
        phase = 2.0 * np.pi * (turns - self.frequency * self.delays)
        rate = 2.0 * np.pi * self.frequency * self.amplitude
        return self.amplitude * jnp.sin(phase), rate * jnp.cos(phase)

    def start(self, rest: Float[Array, " n"]) -> State:
        """The vehicle at rest."""
        stepper = self.stepper()
        now = stepper.start(rest, RoadInput(*self.road(jnp.zeros(()))))
        return ravel_pytree(_carried(now))[0]


def _carried(now: StepState) -> PyTree:
    """What an instant hands to the next: all but the forces, which follow from it."""
    return now.motion, now.states, now.memory


def _over_period(excitation: Excitation, state: State) -> tuple[StepState, StepState]:
    """The vehicle at the end, and at all samples before it."""
    stepper, substeps = excitation.stepper(), excitation.substeps
    count = excitation.samples * substeps
    like = stepper.start(
        jnp.zeros(excitation.system.motion.motion.shape[1]), RoadInput(*excitation.road(jnp.zeros(())))
    )
    motion, states, memory = ravel_pytree(_carried(like))[1](state)
    heights, rates = jax.vmap(excitation.road)(jnp.arange(count + 1.0) / count)
    # A sine through straight pieces has a smaller first harmonic; their aliases are at `count` times the frequency.
    heights = heights / np.sinc(1.0 / count) ** 2
    now = stepper.equations.at(motion, states, RoadInput(heights[0], rates[0]), memory)

    def step(now: StepState, ends: tuple[Array, ...]) -> tuple[StepState, None]:
        z0, v0, z1, v1 = ends
        return stepper(now, RoadInput(z0, v0), RoadInput(z1, v1)), None

    def sample(now: StepState, ends: tuple[Array, ...]) -> tuple[StepState, StepState]:
        after = jax.lax.scan(step, now, ends)[0] if substeps > 1 else step(now, tuple(end[0] for end in ends))[0]
        return after, now

    ends = tuple(
        values.reshape(excitation.samples, substeps, -1)
        for values in (heights[:-1], rates[:-1], heights[1:], rates[1:])
    )
    now = varying_as(now, excitation, ends)
    return jax.lax.scan(sample, now, ends)


def period(state: State, excitation: Excitation) -> tuple[State, State]:
    """What the vehicle carries a period later, and the scale of each entry.

    Positions have one scale, velocities another, and each state of a law its own; what the steps remember has none.
    """
    last, instants = _over_period(excitation, state)
    motion, states, memory = jax.tree.map(lambda values: jnp.max(jnp.abs(values), axis=0), _carried(instants))
    half = motion.shape[0] // 2
    sizes = [jnp.broadcast_to(jnp.max(part), part.shape) for part in (motion[:half], motion[half:])]
    scale = jnp.concatenate(sizes), states, jax.tree.map(jnp.zeros_like, memory)
    return ravel_pytree(_carried(last))[0], ravel_pytree(scale)[0]


def cycle(excitation: Excitation, state: State) -> Cycle:
    """The period that begins in this state."""
    _, instants = _over_period(excitation, state)
    heights, rates = jax.vmap(excitation.road)(jnp.arange(float(excitation.samples)) / excitation.samples)
    channels = jax.vmap(excitation.system.outputs)(instants.motion, instants.force, heights, rates)
    return Cycle(channels, instants.motion, instants.force, heights, rates)


def sweep(
    vehicle: Excitation, frequency: Float[Array, " frequencies"], amplitude: Float[Array, " frequencies"]
) -> tuple[Cycle, Shot]:
    """The steady cycles at frequencies one after the other, each searched from the motion at the one before.

    Arguments:
        vehicle: the vehicle; its frequency and amplitude are replaced.
        frequency: [Hz], in the order of the sweep.
        amplitude: [m], at each frequency.
    """
    fixed = jax.lax.stop_gradient(vehicle)
    rest = jax.lax.stop_gradient(settled(fixed.system, jnp.zeros(vehicle.delays.shape)))

    def at(excitation: Excitation, frequency: Scalar, amplitude: Scalar) -> Excitation:
        return eqx.tree_at(lambda e: (e.frequency, e.amplitude), excitation, (frequency, amplitude))

    def step(state: State, point: tuple[Scalar, Scalar]) -> tuple[State, State]:
        here = at(fixed, *point)
        state = jnp.where(jnp.all(jnp.isfinite(state)), state, here.start(rest))
        steady = steady_state(period, state, here)
        return steady, steady

    points = jax.lax.stop_gradient((frequency, amplitude))
    begin = at(fixed, points[0][0], points[1][0]).start(rest)
    _, states = jax.lax.scan(step, varying_as(begin, fixed, points), points)

    def steady(state: State, frequency: Scalar, amplitude: Scalar) -> tuple[Cycle, Shot]:
        here = at(vehicle, frequency, amplitude)
        shot = shoot(period, state, jax.lax.stop_gradient(here))
        return cycle(here, with_derivatives(period, state, here)), jax.lax.stop_gradient(shot)

    return jax.vmap(steady)(states, frequency, amplitude)
