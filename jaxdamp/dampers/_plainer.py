"""Plainer laws to start a fit from, where records do not determine all numbers of a law."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from jaxdamp._types import ScalarLike
from jaxdamp.dampers.base import AbstractDamper, AbstractMemoryless
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.dahl import Dahl
from jaxdamp.dampers.linear import Linear


SAMPLES = 201  # of a curve that a plainer one starts from
LEAST_FRICTION, LEAST_WIDTH = 0.1, 0.01  # of the elastic friction, and of the largest velocity, at a start


def curve_samples(law: AbstractMemoryless, fastest: float) -> tuple[np.ndarray, np.ndarray]:
    """Velocities up to the largest one [m/s] in both directions, and the forces there [N]."""
    velocity = np.linspace(-fastest, fastest, SAMPLES)
    return velocity, np.asarray(_curve(law, velocity))


@eqx.filter_jit
def _curve(
    law: AbstractMemoryless, velocity: Float[Array, " samples"] | Float[np.ndarray, " samples"]
) -> Float[Array, " samples"]:
    """In one program: JAX would compile each operation."""
    return eqx.filter_vmap(law.force_velocity)(velocity)


def sliding(rate: ScalarLike, friction: ScalarLike, width: ScalarLike, elastic: Dahl, fastest: float) -> AbstractDamper:
    """A viscous force beside friction that follows the velocity, and friction that gives before it slides.

    Arguments:
        rate: of the viscous force [N s/m].
        friction: that follows the velocity [N]; at least a tenth of the elastic one.
        width: velocity over which it changes its sign [m/s]; at least a hundredth of the largest velocity.
        elastic: friction that gives.
        fastest: largest velocity [m/s].
    """
    at_once = at_least(friction, LEAST_FRICTION * float(elastic.friction_force))
    width = min(at_least(width, LEAST_WIDTH * fastest), fastest)
    return Linear(at_least(rate, 1.0)) + CoulombFriction(at_once, width) + elastic


def at_least(value: object, least: float) -> float:
    """A number that is not below another one."""
    return max(float(np.asarray(value)), least)
