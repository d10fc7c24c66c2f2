"""Errors and standard errors of many dampers that were fitted side by side."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp.identify.dependence import Dependence
from jaxdamp.identify.lanes import Fitted, noise_level
from jaxdamp.parameters import Coordinates


BLIND = 1e-12  # eigenvalue of JᵀJ, relative to the largest, below which a direction changes no force


@eqx.filter_jit
def physical(coordinates: Coordinates, y: Float[Array, "lanes free"]) -> tuple[Array, Array]:
    """Physical values and their derivatives by the coordinates."""
    return jax.vmap(coordinates.to_physical)(y), jax.vmap(jax.jacfwd(coordinates.to_physical))(y)


def judged(fitted: Fitted, depends: Dependence | None, counts: Sequence[int]) -> dict[str, Any]:
    """Errors of each damper and of each of its records, drift, and standard errors of its numbers."""
    lanes, (count, free) = fitted.lanes, fitted.end.y.shape
    percent, rmse, drift, noise = (np.zeros(count) for _ in range(4))
    first, by_record = np.cumsum([0, *counts]), tuple(np.zeros(n) for n in counts)
    free_numbers, levels = free if depends is None else depends.size / count, lanes.levels()
    for i, records in enumerate(lanes.missed(fitted.end.y)):
        errors = [record.residual / record.weight for record in records]
        drift[i] = max(record.drift for record in records)
        together, measured = np.concatenate(errors), np.concatenate([record.force for record in records])
        rmse[i] = np.sqrt(np.mean(together**2))
        spread = np.linalg.norm(measured - measured.mean())
        percent[i] = 100.0 * (1.0 - np.linalg.norm(together) / spread) if spread > 0 else -np.inf
        for record, error in zip(records, errors, strict=True):
            by_record[i][record.number - first[i]] = np.sqrt(np.mean(error**2))
        noise[i] = (fitted.factor[i] * noise_level([r.residual for r in records], free_numbers) / levels[i]) ** 2
    errors_of_numbers = _standard_errors(fitted, depends, noise)
    named = {"standard_errors": errors_of_numbers, "fit_percent": percent, "rmse": rmse, "record_rmse": by_record}
    return named | {"drift": drift}


def _standard_errors(
    fitted: Fitted, depends: Dependence | None, noise: Float[np.ndarray, " dampers"]
) -> Float[np.ndarray, "dampers free"]:
    """Standard errors of the numbers of each damper, from the variance of the noise relative to its level."""
    y, products = fitted.end.y, fitted.end.aux
    slopes = np.asarray(physical(fitted.lanes.coordinates, jnp.asarray(y))[1], np.float64)
    inverse = [_inverse(of_damper[:-1, :-1]) for of_damper in (products if depends is None else products[:1])]
    errors, free = np.zeros(y.shape), y.shape[1]
    for i in range(len(y)):
        columns, rows = (np.arange(free), np.eye(free)) if depends is None else depends.rows(i)
        variances, lost = inverse[i if depends is None else 0]
        variance = noise[i] if depends is None else float(np.mean(noise))
        to_values = slopes[i] @ rows
        covariance = variance * to_values @ variances[np.ix_(columns, columns)] @ to_values.T
        undetermined = np.any(lost[columns] & (to_values != 0), axis=1)
        errors[i] = np.where(undetermined, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    return errors


def _inverse(products: Float[np.ndarray, "free free"]) -> tuple[np.ndarray, np.ndarray]:
    """(JᵀJ)⁻¹ without the directions that change no force, and the numbers that take part in those."""
    norms = np.sqrt(np.diag(products))
    scale = np.where(norms > 0, norms, 1.0)
    squares, directions = np.linalg.eigh(products / np.outer(scale, scale))
    seen = squares > BLIND * squares[-1]
    inverse = (directions[:, seen] / squares[seen]) @ directions[:, seen].T
    return inverse / np.outer(scale, scale), np.sum(directions[:, seen] ** 2, axis=1) < 1.0 - 1e-3
