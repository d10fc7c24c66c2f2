"""How well the records determine the parameters."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxdamp.identify._tall import triangle


BLIND = 1e-7  # singular value, relative to the largest, below which a direction leaves the force unchanged
BLIND_SINGLE = 1e-4  # the same in single precision


class Uncertainty(NamedTuple):
    """What noise does to the parameters."""

    covariance: Float[np.ndarray, "free free"]
    beyond: Float[np.ndarray, " free"]  # step to the minimum without any bounds, in standard errors


def _inverse(factor: Float[np.ndarray, "rows free"]) -> tuple[np.ndarray, np.ndarray]:
    """(RᵀR)⁻¹ for a matrix R with columns of length one or zero, and which parameters blind directions touch."""
    _, singular, directions = np.linalg.svd(factor)
    blind = BLIND if factor.dtype == np.float64 else BLIND_SINGLE
    directions = directions[: singular.size]
    seen = singular > blind * singular[0]
    inverse = (directions[seen].T / singular[seen] ** 2) @ directions[seen]
    return inverse, np.sum(directions[seen] ** 2, axis=0) < 1.0 - 1e-3


def uncertainty(
    jacobian: Float[np.ndarray, "samples free"],
    residual: Float[np.ndarray, " samples"],
    noise: Float[np.ndarray, " samples"],
    held: np.ndarray,
) -> Uncertainty:
    """Covariance at a minimum, (JᵀJ)⁻¹ Jᵀ diag(σ²) J (JᵀJ)⁻¹.

    A direction with a singular value below `BLIND` of the largest leaves the force unchanged: its parameters get an
    infinite variance instead of a number made of rounding.

    Arguments:
        jacobian: derivatives of the weighted residual by the parameters.
        residual: the weighted residual.
        noise: standard deviation σ of each weighted sample. Where the weights are one over the true standard deviation
            it is one, and the covariance (JᵀJ)⁻¹; elsewhere the covariance counts both.
        held: which parameters lie on an edge of their range. The others are counted as if those were frozen; the
            variance of those is what it would be without the edge.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    scaled = jacobian / scale
    factor = triangle(scaled)
    noisy = scaled * noise[:, None]
    spread = noisy.T @ noisy

    def covariance(some: np.ndarray) -> Float[np.ndarray, "some some"]:
        inverse, lost = _inverse(factor[:, some])
        found = inverse @ spread[np.ix_(some, some)] @ inverse
        found[lost, :] = found[:, lost] = 0.0
        found[lost, lost] = np.inf
        return found

    whole = covariance(np.ones_like(held))
    errors = np.sqrt(np.diag(whole))
    step = -_inverse(factor)[0] @ (scaled.T @ residual)
    if held.any():
        whole = np.diag(np.diag(whole))
        if not held.all():
            whole[np.ix_(~held, ~held)] = covariance(~held)
    beyond = np.divide(step, errors, out=np.zeros_like(step), where=errors > 0)
    return Uncertainty(whole / np.outer(scale, scale), beyond)
