"""Laws in single precision."""

import jax
import numpy as np

from jaxdamp import respond


def single_precision_error(make):
    """Largest difference between the forces in single and in double precision, relative to the peak."""
    t = 1e-3 * np.arange(300)
    x, v = 0.01 * (1 - np.cos(40.0 * t)), 0.4 * np.sin(40.0 * t)
    double = np.asarray(respond(make(), t, x, v))
    with jax.enable_x64(False):
        single = respond(make(), *(a.astype(np.float32) for a in (t, x, v)))
        assert single.dtype == np.float32
    return np.max(np.abs(np.asarray(single, dtype=float) - double)) / np.max(np.abs(double))
