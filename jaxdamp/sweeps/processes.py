"""One sweep over the devices of one or of several processes: arrays go out to all of them and come back to each."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import NamedSharding


def several() -> bool:
    """Whether `jax.distributed` has joined processes."""
    return jax.process_count() > 1


def is_first() -> bool:
    """Whether this process writes files and shows progress."""
    return jax.process_index() == 0


def put(array: Any, sharding: NamedSharding) -> jax.Array:
    """An array, the same in every process, onto the devices."""
    if several() and not jnp.issubdtype(array.dtype, jax.dtypes.prng_key):
        array = np.asarray(array)
        return jax.make_array_from_callback(array.shape, sharding, lambda part: array[part])
    return jax.device_put(array, sharding)


def fetch(array: jax.Array) -> np.ndarray:
    """The whole array, in every process."""
    if several():
        from jax.experimental import multihost_utils

        return np.asarray(multihost_utils.process_allgather(array, tiled=True))
    return np.asarray(array)


def largest(*numbers: float | bool) -> np.ndarray:
    """The largest of what the processes say, for each number."""
    mine = np.asarray(numbers, np.float32)
    if several():
        from jax.experimental import multihost_utils

        return np.max(np.asarray(multihost_utils.process_allgather(mine)), axis=0)
    return mine


def of_first(tree: Any) -> Any:
    """What the first process says."""
    if several():
        from jax.experimental import multihost_utils

        return jax.tree.map(np.array, multihost_utils.broadcast_one_to_all(tree))
    return tree


def text_of_first(text: str) -> str:
    """What the first process says, as a text."""
    if not several():
        return text
    size = int(largest(len(text.encode()))[0])  # arrays that are sent must be equally long everywhere
    padded = np.frombuffer(text.encode().ljust(size), np.uint8)
    return np.asarray(of_first(padded)).tobytes().decode().rstrip()
