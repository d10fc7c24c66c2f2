"""How well the records determine the parameters."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp._triangles import determined, triangle, unit_columns
from jaxdamp.identify.noise import Noise


TAKES_PART = 0.1  # force of a parameter in a direction, relative to the largest, above which it belongs to it


class Uncertainty(NamedTuple):
    """The uncertainty of the parameters due to noise."""

    covariance: Float[np.ndarray, "free free"]
    unconstrained_step: Float[np.ndarray, " free"]  # step to the minimum without any bounds, in standard errors


def uncertainty(
    jacobian: Float[np.ndarray, "samples free"], residual: Float[np.ndarray, " samples"], noise: Noise
) -> Uncertainty:
    """Covariance at a minimum, (JᵀJ)⁻¹ Jᵀ Σ J (JᵀJ)⁻¹ with the covariance Σ of the noise, without edges of parameters.

    A parameter at an edge of its range thus counts as unknown in the errors of the others; if it were taken as fixed,
    their errors would be too small. A direction with a singular value below `RANK_TOLERANCE` of the largest does not
    change the force: its parameters get an infinite variance instead of a result of rounding errors.

    Arguments:
        jacobian: derivatives of the weighted residual by the parameters.
        residual: the weighted residual.
        noise: of the weighted residual.
    """
    scaled, scale = unit_columns(jacobian)
    singular, directions = determined(scaled)
    inverse = (directions.T / singular**2) @ directions
    lost = np.sum(directions**2, axis=0) < 1.0 - 1e-3
    whole = inverse @ noise.covariance_of(scaled) @ inverse
    whole[lost, :] = whole[:, lost] = 0.0
    whole[lost, lost] = np.inf
    errors = np.sqrt(np.diag(whole))
    step = -inverse @ (scaled.T @ residual)
    steps = np.divide(step, errors, out=np.zeros_like(step), where=errors > 0)
    return Uncertainty(whole / np.outer(scale, scale), steps)


def weak_directions(
    jacobian: Float[np.ndarray, "samples free"],
    noise: float,
    large: Float[np.ndarray, " free"],
    weak: float,
) -> list[Float[np.ndarray, " free"]]:
    """Directions in which parameters change the force separately, but hardly if changed together.

    Arguments:
        jacobian: derivatives of the weighted residual by the parameters.
        noise: standard deviation of a weighted sample.
        large: a large change of each parameter.
        weak: standard error along a direction, relative to `large`, above which it counts as undetermined.

    Returns:
        For each direction, changes relative to `large`; zero for parameters with little force in this direction.
    """
    reduced = triangle(jacobian * large)
    _, singular, directions = np.linalg.svd(reduced)
    singular = np.concatenate([singular, np.zeros(len(directions) - singular.size)])
    undetermined = directions[singular * weak < noise]
    forces = np.abs(undetermined) * np.linalg.norm(reduced, axis=0)
    pairs = zip(undetermined, forces, strict=True)
    return [np.where(force > TAKES_PART * force.max(), row, 0.0) for row, force in pairs]
