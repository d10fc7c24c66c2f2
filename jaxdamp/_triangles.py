"""Reduction of tall matrices to triangles."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PyTree


RANK_TOLERANCE = 1e-7  # singular value, relative to the largest, below which a direction leaves the force unchanged
RANK_TOLERANCE_SINGLE = 1e-4  # the same in single precision
_ROWS = 512  # of a block: small enough for the cache


_INDEPENDENT = 1e-3  # part of each column, relative to it, that those before leave, where products are precise enough


def triangle(tall: PyTree) -> PyTree:
    """R of the QR decomposition of a matrix with many rows, NumPy's or JAX's, but for the signs of its rows.

    By the products of the columns, two to fifteen times as fast, where these are far from depending on each other, so
    that R is precise to 1e-9 of the length of each column; else block by block.
    """
    xp: Any = jnp if isinstance(tall, jax.Array) else np
    rows, columns = tall.shape
    if not columns:
        return tall[:0]
    by_products = None if isinstance(tall, jax.Array) else _by_products(tall)
    if by_products is not None:
        return by_products
    if rows > 4 * _ROWS and columns < _ROWS // 4:
        padded = xp.concatenate([tall, xp.zeros((-rows % _ROWS, columns), tall.dtype)])
        tall = xp.reshape(xp.linalg.qr(xp.reshape(padded, (-1, _ROWS, columns)), mode="r"), (-1, columns))
    return xp.linalg.qr(tall, mode="r")


def _by_products(tall: Float[np.ndarray, "rows columns"]) -> Float[np.ndarray, "columns columns"] | None:
    """The triangle by Cholesky; None where the rounding of the products would be seen."""
    if tall.dtype != np.float64 or len(tall) < 2 * tall.shape[1]:
        return None
    products = tall.T @ tall
    norms = np.sqrt(np.diagonal(products))
    lengths = np.where(norms > 0.0, norms, 1.0)
    unit = products / lengths / lengths[:, None]
    np.fill_diagonal(unit, 1.0)  # columns of zeros, as of knots that a record does not reach, are zeros of R too
    try:
        unit = np.linalg.cholesky(unit)
    except np.linalg.LinAlgError:
        return None
    return unit.T * norms if np.diagonal(unit).min() > _INDEPENDENT else None


def rows_of_products(
    products: Float[np.ndarray, "lanes columns columns"],
) -> Float[np.ndarray, "lanes columns columns"]:
    """Rows A with these products of columns AᵀA: triangles, or by eigenvectors where some columns depend on others."""
    norms = np.sqrt(np.maximum(np.diagonal(products, axis1=1, axis2=2), 0.0))
    scale = np.where(norms > 0, norms, 1.0)[:, None, :]
    finite = np.all(np.isfinite(products), axis=(1, 2))[:, None, None]
    unit = np.where(finite, products / (scale * scale.transpose(0, 2, 1)), np.eye(scale.shape[2]))
    try:
        rows = np.linalg.cholesky(unit).transpose(0, 2, 1)
    except np.linalg.LinAlgError:
        squares, directions = np.linalg.eigh(unit)
        rows = np.sqrt(np.maximum(squares, 0.0))[:, :, None] * directions.transpose(0, 2, 1)
    return np.where(finite, rows * scale, np.nan)


def determined(
    scaled: Float[np.ndarray, "rows free"],
) -> tuple[Float[np.ndarray, " rank"], Float[np.ndarray, "rank free"]]:
    """Singular values and directions in which a matrix with columns of length one or zero is not blind."""
    _, singular, directions = np.linalg.svd(triangle(scaled))
    blind = RANK_TOLERANCE if scaled.dtype == np.float64 else RANK_TOLERANCE_SINGLE
    seen = singular > blind * np.max(singular, initial=0.0)
    return singular[seen], directions[: singular.size][seen]


def unit_columns(tall: Float[np.ndarray, "rows free"]) -> tuple[Float[np.ndarray, "rows free"], np.ndarray]:
    """The matrix with columns of length one, and the lengths it had; a column of zeros stays, with length one."""
    norms = np.linalg.norm(tall, axis=0)
    scale = np.where(norms > 0, norms, 1.0)
    return tall / scale, scale


def orthonormal(tall: Float[np.ndarray, "rows free"]) -> Float[np.ndarray, "rows rank"]:
    """Orthonormal columns that span those of a matrix."""
    scaled, _ = unit_columns(tall)
    singular, directions = determined(scaled)
    return scaled @ (directions.T / singular)
