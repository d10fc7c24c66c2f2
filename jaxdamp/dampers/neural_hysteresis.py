"""Hysteresis learnt by a small neural network, passive for any weights."""

from typing import final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from jaxdamp import _checks
from jaxdamp._limits import at_least
from jaxdamp._random import normal
from jaxdamp._types import Number, Scalar, ScalarLike, State, Vector
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.parameters import parameter, positive, setting, weight


_ROUNDING = 0.01  # of the velocity scale, over which |v| is rounded at zero


def relaxed_forces(forces: State, rates: State, stiffness: State, v: ScalarLike, dt: ScalarLike) -> State:
    """Z [N] after a time dt [s] of ż = k v − ρ z at constant rates ρ [1/s] and velocity v [m/s], exactly."""
    decay = rates * dt
    tiny = jnp.finfo(decay.dtype).tiny
    return jnp.exp(-decay) * forces + stiffness * v * dt * (-jnp.expm1(-decay) / at_least(decay, tiny))


@final
class NeuralHysteresis(AbstractDamper):
    """F = Σ zᵢ, żᵢ = kᵢ v − ρᵢ(v, z) zᵢ: springs that relax at rates ρᵢ ≥ 0 given by a neural network.

    Each of the n elements is a spring kᵢ in series with an element that yields: with travel, like friction, and with
    time, like a dashpot. The network gives the rates:

        ρᵢ = (kᵢ/F₀) (αᵢ |v| + βᵢ v₀),   (α, β) = softplus(W₂ tanh(W₁ [v/v₀, z/F₀] + b₁) + b₂).

    A constant β is a Maxwell element, a constant α is Dahl friction; functions of v and z give other loops. **Passive
    by construction**: the springs store E = Σ zᵢ²/2kᵢ and Ė = F v − Σ ρᵢ zᵢ²/kᵢ, so the law can return only stored
    energy, for any weights and also far outside the data. v₀ and F₀ scale the inputs of the network. |v| is rounded
    within 0.01 v₀.

    States: zᵢ [N]. The step is exact for constant rates and of second order otherwise; as ρᵢ ≥ 0 it is bounded and
    stable for any step. Fit it with `identify.train` (gradient descent with early stopping) or, while it has up to
    about a hundred parameters, with `identify.fit`. The weights and their standard errors have no physical meaning.

    >>> law = NeuralHysteresis.random(jax.random.key(0), elements=2, width=4, velocity_scale=0.3, force_scale=900.0)
    >>> law.initial_state().shape, law.hidden_weights.shape
    ((2,), (4, 3))
    """

    stiffness: Vector = parameter("N/m", "kᵢ, stiffness of each element", positive, adjustable=False)
    hidden_weights: Float[Array, "width inputs"] = parameter(
        "", "W₁, from v and z to the hidden layer", weight, adjustable=False
    )
    hidden_biases: Vector = parameter("", "b₁, of the hidden layer", weight, adjustable=False)
    output_weights: Float[Array, "outputs width"] = parameter(
        "", "W₂, from the hidden layer to α and β", weight, adjustable=False
    )
    output_biases: Vector = parameter("", "b₂, of α and β", weight, adjustable=False)
    velocity_scale: Number = setting("m/s", "v₀, velocity scale of the network", positive)
    force_scale: Number = setting("N", "F₀, force scale of the network", positive)

    def __check_init__(self) -> None:
        n, width = self.stiffness.size, self.hidden_biases.size
        shapes = {"stiffness": (n,), "hidden_weights": (width, n + 1), "hidden_biases": (width,)}
        shapes |= {"output_weights": (2 * n, width), "output_biases": (2 * n,)}
        for name, shape in shapes.items():
            actual = getattr(self, name).shape
            if actual != shape or 0 in shape:
                must = f"be of shape {shape} for {n} elements and {width} hidden units"
                _checks.refuse(name, must, f"of shape {actual}", "`NeuralHysteresis.random` makes a network that fits.")

    def traits(self) -> Traits:
        """The force is the sum of the states."""
        return Traits(has_feed_through=False, stroke_dependent_at_rest=False)

    def relaxation(self, v: ScalarLike, forces: State) -> State:
        """ρᵢ [1/s], the relaxation rates of the elements, never negative."""
        inputs = jnp.concatenate([jnp.asarray(v / self.velocity_scale)[None], forces / self.force_scale])
        hidden = jnp.tanh(self.hidden_weights @ inputs + self.hidden_biases)
        with_travel, with_time = jnp.split(jax.nn.softplus(self.output_weights @ hidden + self.output_biases), 2)
        width = _ROUNDING * self.velocity_scale
        speed = jnp.sqrt(v * v + width * width) - width
        return self.stiffness / self.force_scale * (with_travel * speed + with_time * self.velocity_scale)

    def initial_state(self) -> State:
        """No force in any element."""
        return jnp.zeros_like(self.stiffness)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        del x, v
        return jnp.sum(jnp.stack(own_states(self, state, self.stiffness.size)))

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates [N/s] of the elements' forces."""
        del x
        forces = jnp.stack(own_states(self, state, self.stiffness.size))
        return self.stiffness * v - self.relaxation(v, forces) * forces

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two exponential steps: to the midpoint with the initial rates, then the whole with those of the midpoint."""
        del x0, x1
        forces = jnp.stack(own_states(self, state, self.stiffness.size))
        mean = 0.5 * (v0 + v1)
        middle = relaxed_forces(forces, self.relaxation(v0, forces), self.stiffness, 0.75 * v0 + 0.25 * v1, 0.5 * dt)
        return relaxed_forces(forces, self.relaxation(mean, middle), self.stiffness, mean, dt)

    @classmethod
    def random(
        cls,
        key: PRNGKeyArray,
        *,
        elements: int = 2,
        width: int = 6,
        velocity_scale: ScalarLike,
        force_scale: ScalarLike,
        stiffness: ScalarLike | None = None,
    ) -> "NeuralHysteresis":
        """A start for training with random weights from a key, such as `jax.random.key(0)`.

        Arguments:
            key: the same key gives the same weights.
            elements: n, number of parallel springs.
            width: number of hidden units.
            velocity_scale: v₀ [m/s], about the RMS velocity of the records.
            force_scale: F₀ [N], about their RMS force.
            stiffness: k₁ [N/m]; if left out, F₀/(3 ms v₀). Each further stiffness is a third of the previous one.
        """
        for name, count in (("elements", elements), ("width", width)):
            if count < 1:
                _checks.refuse(name, "be 1 or more", count)
        first = force_scale / (3e-3 * velocity_scale) if stiffness is None else stiffness
        hidden, output = jax.random.split(key)
        return cls(
            jnp.asarray(first) * (1.0 / 3.0) ** jnp.arange(float(elements)),
            normal(hidden, (width, elements + 1)),
            jnp.zeros(width),
            0.3 * normal(output, (2 * elements, width)),
            jnp.zeros(2 * elements),
            velocity_scale,
            force_scale,
        )
