"""How well the records determine the parameters."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.identify._tall import triangle


RANK_TOLERANCE = 1e-7  # singular value, relative to the largest, below which a direction leaves the force unchanged
RANK_TOLERANCE_SINGLE = 1e-4  # the same in single precision
TAKES_PART = 0.1  # of the largest force in a direction, from which a parameter belongs to it


class Uncertainty(NamedTuple):
    """What noise does to the parameters."""

    covariance: Float[np.ndarray, "free free"]
    unconstrained_step: Float[np.ndarray, " free"]  # step to the minimum without any bounds, in standard errors


def _inverse(factor: Float[np.ndarray, "rows free"]) -> tuple[np.ndarray, np.ndarray]:
    """(RᵀR)⁻¹ for a matrix R with columns of length one or zero, and which parameters blind directions touch."""
    _, singular, directions = np.linalg.svd(factor)
    blind = RANK_TOLERANCE if factor.dtype == np.float64 else RANK_TOLERANCE_SINGLE
    directions = directions[: singular.size]
    seen = singular > blind * singular[0]
    inverse = (directions[seen].T / singular[seen] ** 2) @ directions[seen]
    return inverse, np.sum(directions[seen] ** 2, axis=0) < 1.0 - 1e-3


def uncertainty(
    jacobian: Float[np.ndarray, "samples free"],
    residual: Float[np.ndarray, " samples"],
    noise: Float[np.ndarray, " samples"],
) -> Uncertainty:
    """Covariance at a minimum, (JᵀJ)⁻¹ Jᵀ diag(σ²) J (JᵀJ)⁻¹, as if no parameter had an edge.

    So a parameter on an edge of its range counts as unknown in the errors of its partners: frozen there, it would lend
    them a certainty that the records do not give. A direction with a singular value below `RANK_TOLERANCE` of the
    largest leaves the force unchanged: its parameters get an infinite variance instead of a number made of rounding.

    Arguments:
        jacobian: derivatives of the weighted residual by the parameters.
        residual: the weighted residual.
        noise: standard deviation σ of each weighted sample. Where the weights are one over the true standard deviation
            it is one, and the covariance (JᵀJ)⁻¹; elsewhere the covariance counts both.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    scaled = jacobian / scale
    inverse, lost = _inverse(triangle(scaled))
    noisy = scaled * noise[:, None]
    whole = inverse @ (noisy.T @ noisy) @ inverse
    whole[lost, :] = whole[:, lost] = 0.0
    whole[lost, lost] = np.inf
    errors = np.sqrt(np.diag(whole))
    step = -inverse @ (scaled.T @ residual)
    steps = np.divide(step, errors, out=np.zeros_like(step), where=errors > 0)
    return Uncertainty(whole / np.outer(scale, scale), steps)


def weak_directions(
    jacobian: Float[np.ndarray, "samples free"],
    noise: float,
    yardstick: Float[np.ndarray, " free"],
    weak: float,
) -> list[Float[np.ndarray, " free"]]:
    """Directions in which parameters change the force, each by itself, but hardly together.

    Arguments:
        jacobian: derivatives of the weighted residual by the parameters.
        noise: standard deviation of a weighted sample.
        yardstick: a large change of each parameter.
        weak: standard error along a direction, in yardsticks, above which it counts as undetermined.

    Returns:
        For each direction, changes in yardsticks; zero for parameters whose force has no part in it.
    """
    reduced = triangle(jacobian * yardstick)
    _, singular, directions = np.linalg.svd(reduced)
    singular = np.concatenate([singular, np.zeros(len(directions) - singular.size)])
    found = directions[singular * weak < noise]
    forces = np.abs(found) * np.linalg.norm(reduced, axis=0)
    return [np.where(force > TAKES_PART * force.max(), row, 0.0) for row, force in zip(found, forces, strict=True)]
