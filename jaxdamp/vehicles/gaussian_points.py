"""Points and weights for means over normally distributed variables."""

import functools

import numpy as np
from jaxtyping import Float


_REACH = 7.0  # standard deviations
_ON_EACH_SIDE, _WITH_OTHERS = 20, 12  # points of the first variable
_HERMITE = {1: 16, 2: 12}  # points of each further variable, by the number of these
_MANY = 256  # points of the further variables where a grid would be too large


@functools.cache
def gaussian_points(variables: int) -> tuple[Float[np.ndarray, "points variables"], Float[np.ndarray, " points"]]:
    """Points t and weights w with E[f] ≈ Σ w f(t) for independent standard normal variables.

    The first variable may have a kink or a steep slope at zero, as friction has in the velocity: Gauss-Legendre points
    on each side of zero, graded as u², so that E|t| has an error of 1e-6, also where the jump is spread over a
    thousandth of a standard deviation. One or two further variables have Gauss-Hermite points, more of them a Sobol
    sequence with its mirror image. Means, variances and correlations are exact.

    Arguments:
        variables: number of variables.
    """
    if variables == 0:
        return np.zeros((1, 0)), np.ones(1)
    first, weights = _one_with_kink(_ON_EACH_SIDE if variables == 1 else _WITH_OTHERS)
    if variables == 1:
        return first[:, None], weights
    others, their_weights = _others(variables - 1)
    points = np.concatenate([np.repeat(first, len(others))[:, None], np.tile(others, (len(first), 1))], axis=1)
    return points, np.outer(weights, their_weights).ravel()


def _one_with_kink(count: int) -> tuple[np.ndarray, np.ndarray]:
    u, share = np.polynomial.legendre.leggauss(count)
    u, share = 0.5 * (u + 1.0), 0.5 * share
    t = _REACH * u**2
    weights = share * u * np.exp(-0.5 * t**2)
    weights = 0.5 * weights / weights.sum()
    t /= np.sqrt(2.0 * np.sum(weights * t**2))
    return np.concatenate([-t[::-1], t]), np.concatenate([weights[::-1], weights])


def _others(variables: int) -> tuple[np.ndarray, np.ndarray]:
    if variables in _HERMITE:
        t, weights = np.polynomial.hermite_e.hermegauss(_HERMITE[variables])
        grid = np.stack(np.meshgrid(*[t] * variables, indexing="ij"), axis=-1).reshape(-1, variables)
        product = functools.reduce(np.multiply.outer, [weights] * variables).ravel()
        return grid, product / product.sum()
    import scipy.special
    import scipy.stats

    half = scipy.special.ndtri(scipy.stats.qmc.Sobol(variables, rng=0).random(_MANY // 2))
    points = np.concatenate([half, -half])
    spread = np.linalg.cholesky(points.T @ points / len(points))
    return np.linalg.solve(spread, points.T).T, np.full(len(points), 1.0 / len(points))
