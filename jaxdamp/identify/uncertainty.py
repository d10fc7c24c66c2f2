"""How well the records determine the parameters."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class Uncertainty(NamedTuple):
    """Covariance of the parameters and which of them the data do not determine."""

    covariance: Float[np.ndarray, "free free"]
    undetermined: Float[np.ndarray, " free"]  # share of the weakest directions in each parameter, 0 to 1


def uncertainty(jacobian: Float[np.ndarray, "samples free"], variance: float) -> Uncertainty:
    """Covariance σ² (JᵀJ)⁻¹ from the singular values of J with its columns scaled to one.

    A direction with a singular value below 1e-7 of the largest leaves the force unchanged: its parameters get an
    infinite variance instead of a number made of rounding.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    _, singular, directions = np.linalg.svd(np.linalg.qr(jacobian / scale, mode="r"))
    seen = singular > 1e-7 * singular[0]
    inverse = (directions[seen].T / singular[seen] ** 2) @ directions[seen]
    covariance = variance * inverse / np.outer(scale, scale)
    blind = np.sum(directions[~seen] ** 2, axis=0)
    blind[norms == 0] = 1.0
    lost = blind > 1e-3
    covariance[lost, :] = covariance[:, lost] = 0.0
    covariance[lost, lost] = np.inf
    return Uncertainty(covariance, blind)
