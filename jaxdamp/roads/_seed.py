"""Seeds."""

import jax
import jax.numpy as jnp
from jaxtyping import Array


def random_key(seed: int | Array) -> Array:
    """A JAX random key from a whole number; keys, also those of the old kind (two unsigned numbers), pass unchanged."""
    if isinstance(seed, jax.Array) and (jnp.issubdtype(seed.dtype, jax.dtypes.prng_key) or seed.shape == (2,)):
        return seed
    return jax.random.key(seed)
