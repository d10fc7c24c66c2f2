"""The conditions between parameters of all laws in a tree, for searches that must satisfy them."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp.dampers.base import laws_inside


def margins(tree: Any) -> Float[Array, " conditions"]:
    """The margin of each condition of all laws in a law, a vehicle or another module; negative if violated.

    Every margin is in the unit of the parameter that the condition limits.

    Arguments:
        tree: the module.
    """
    each = [getattr(law, c.parameter) - c.least for _, law in laws_inside(tree) for c in law.conditions()]
    return jnp.concatenate([jnp.ravel(margin) for margin in each]) if each else jnp.zeros(0)


def keeps_conditions(tree: Any) -> bool:
    """Whether all laws in a law, a vehicle or another module satisfy their conditions; nothing is compiled.

    Arguments:
        tree: the module.
    """
    plain = [jax.tree.map(np.asarray, law) for _, law in laws_inside(tree) if law.has_conditions()]
    return all(np.all(getattr(law, c.parameter) > c.least) for law in plain for c in law.conditions())
