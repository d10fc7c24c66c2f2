"""The hybrid of paper 002: a piecewise-linear law with a learnt hysteresis."""

from typing import final

import jax
import numpy as np
from jaxtyping import PRNGKeyArray

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._types import Scalar, ScalarLike, State
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.neural_hysteresis import NeuralHysteresis
from jaxdamp.dampers.piecewise_linear import PiecewiseLinear
from jaxdamp.parameters import replace


@final
class Hybrid(AbstractDamper):
    """F = F_pwl(v) + F_nn(v, z): a piecewise-linear backbone and a parallel neural hysteresis (paper 002).

    The backbone is the mean force at a velocity, the network describes the loop around it. Paper 002 does not specify
    its network; here it is a `NeuralHysteresis`, and the backbone must be monotone, so the law is **passive by
    construction** for any parameters: F_pwl v ≥ 0, and the network returns only energy that it stored.

    `Hybrid.guess(velocity, force, key=...)` gives a start; train it with `identify.train` and add a `Spring` if the
    records contain an offset or a stiffness. States: those of the network. Valid in the range of velocities, forces and
    frequencies of its records; outside, it is still passive but not accurate.

    Attributes:
        hysteresis: the network.

    >>> v = np.linspace(-0.5, 0.5, 200)
    >>> law = Hybrid.guess(v, 1500.0 * np.tanh(4.0 * v), key=jax.random.key(1))
    >>> law.initial_state().size, bool(law.backbone.force_velocity(0.5) > 0)
    (2, True)
    """

    backbone: PiecewiseLinear
    hysteresis: NeuralHysteresis

    def __check_init__(self) -> None:
        check_field_types(self)
        if not self.backbone.monotone:
            remedy = "Make it with `monotone=True`, or add the two laws: `backbone + hysteresis`."
            _checks.refuse("backbone", "be monotone, so that the hybrid is passive", self.backbone, remedy)

    def initial_state(self) -> State:
        """The states of the network."""
        return self.hysteresis.initial_state()

    def state_at_rest(self, x: ScalarLike) -> State:
        """The states of the network at rest."""
        return self.hysteresis.state_at_rest(x)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        return self.backbone.force_velocity(v) + self.hysteresis.force(x, v, state)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the network's states."""
        return self.hysteresis.state_rate(x, v, state)

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step of the network."""
        return self.hysteresis.advance(x0, v0, x1, v1, state, dt)

    @classmethod
    def guess(
        cls,
        velocity: np.ndarray,
        force: np.ndarray,
        *,
        key: PRNGKeyArray | None = None,
        elements: int = 2,
        width: int = 6,
    ) -> "Hybrid":
        """A start for training: half the force in the backbone, random weights from the key (0 if left out)."""
        velocity, force = np.asarray(velocity), np.asarray(force)
        backbone = PiecewiseLinear.guess(velocity, force)
        hysteresis = NeuralHysteresis.random(
            jax.random.key(0) if key is None else key,
            elements=elements,
            width=width,
            velocity_scale=max(float(np.sqrt(np.mean(velocity**2))), 1e-6),
            force_scale=max(float(np.sqrt(np.mean(force**2))), 1e-3),
        )
        return cls(replace(backbone, {"slopes": 0.5 * backbone.slopes}), hysteresis)
